"""Animations of glTF: nodes against SciPy's interpolation, what moves, and what is wrong."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from omnisim.core.errors import SceneError
from omnisim.core.poses import is_pose
from omnisim.scene import load_scene
from omnisim.scene.model import Scene
from tests.animated_gltf import WORLD_FROM_FILE, Animated
from tests.scene.world_corners import points_of

TIMES_S = np.array([0.5, 1.0, 2.5, 4.0], "<f4")
CORNERS = np.array([[0.2, 0, 0], [1, 0.1, 0], [0, 1, 0.4]], "<f4")
RANDOM = np.random.default_rng(7)
PLACES = RANDOM.normal(size=(4, 3)).astype("<f4")
QUATERNIONS = RANDOM.normal(size=(4, 4)).astype("<f4")
QUATERNIONS /= np.linalg.norm(QUATERNIONS, axis=1, keepdims=True)
QUATERNIONS[1:3] *= -1.0  # slerp takes the shorter way
TANGENTS = RANDOM.normal(scale=0.3, size=(2, 4, 4)).astype("<f4")


def _spline_values(values, tangents):
    """In-tangents, values and out-tangents of each time, one after the other."""
    width = values.shape[1]
    return np.stack((tangents[0, :, :width], values, tangents[1, :, :width]), 1).reshape(-1, width)


def _hermite(values, tangents, time_s):
    """SciPy's spline, piece by piece, as tangents on both sides of a time differ."""
    time_s = float(np.clip(time_s, TIMES_S[0], TIMES_S[-1]))
    last = min(int(np.searchsorted(TIMES_S, time_s, side="right")) - 1, 2)
    width = values.shape[1]
    slopes = np.stack((tangents[1, last, :width], tangents[0, last + 1, :width]))
    spline = CubicHermiteSpline(
        TIMES_S[last : last + 2].astype(float), values[last : last + 2].astype(float), slopes
    )
    return spline(time_s)


def _expected(interpolation, time_s):
    """Translation (3,) and rotation (3, 3) in the file, independent of ours."""
    time_s = time_s % 4.0
    inside_s = float(np.clip(time_s, TIMES_S[0], TIMES_S[-1]))
    if interpolation == "STEP":
        last = int(np.searchsorted(TIMES_S, inside_s, side="right")) - 1
        return PLACES[last].astype(float), Rotation.from_quat(QUATERNIONS[last]).as_matrix()
    if interpolation == "LINEAR":
        place = [np.interp(inside_s, TIMES_S, PLACES[:, axis]) for axis in range(3)]
        turns = Slerp(TIMES_S.astype(float), Rotation.from_quat(QUATERNIONS))
        return np.array(place), turns(inside_s).as_matrix()
    turn = Rotation.from_quat(_hermite(QUATERNIONS, TANGENTS, time_s))
    return _hermite(PLACES, TANGENTS, time_s), turn.as_matrix()


def _corners_m(scene, time_s):
    """Corners (n, 3) of all dynamic objects in the world."""
    corners_m = []
    for moving in scene.objects:
        pose = moving.motion.pose_at(time_s)
        assert is_pose(pose)
        for number in range(len(moving.shape.instances)):
            corners_m.append(points_of(moving.shape, number) @ pose[:3, :3].T + pose[:3, 3])
    return np.concatenate(corners_m)


@pytest.mark.parametrize("interpolation", ["STEP", "LINEAR", "CUBICSPLINE"])
@pytest.mark.parametrize("mirrored", [1.0, -1.0], ids=["plain", "mirrored"])
def test_nodes_move_as_scipy_interpolates(interpolation, mirrored, tmp_path):
    """An arm: a parent at rest with a scale, an animated node, and a child with a mesh."""
    gltf = Animated()
    gltf.node(translation=[5, 0, 1], rotation=[0, 0.6, 0, 0.8], scale=[mirrored * 2, 2, 2])
    arm = gltf.child(0, name="arm")
    gltf.child(
        arm, name="hand", mesh=gltf.triangle(positions=CORNERS), translation=[0, 1, 0],
        scale=[1, 3, 1],
    )  # fmt: skip
    is_spline = interpolation == "CUBICSPLINE"
    places, turns = (
        _spline_values(values, TANGENTS) if is_spline else values
        for values in (PLACES, QUATERNIONS)
    )
    gltf.animate(
        "wave",
        (arm, "translation", TIMES_S, places, interpolation),
        (arm, "rotation", TIMES_S, turns, interpolation),
    )
    scene = load_scene(gltf.write(tmp_path / "a.glb"))
    assert scene.notices == ()
    assert [moving.name for moving in scene.objects] == ["arm"]
    assert scene.objects[0].shape.instance_names == ("hand",)
    base = np.eye(4)
    base[:3, :3] = Rotation.from_quat([0, 0.6, 0, 0.8]).as_matrix() @ np.diag([mirrored * 2, 2, 2])
    base[:3, 3] = 5, 0, 1
    for time_s in (-1.3, 0.0, 0.2, 0.5, 0.7, 1.0, 1.9, 2.5, 3.2, 3.999, 4.0, 4.9, 103.1):
        local = np.eye(4)
        local[:3, 3], local[:3, :3] = _expected(interpolation, time_s)
        hand = CORNERS.astype(float) * (1, 3, 1) + (0, 1, 0)
        matrix = WORLD_FROM_FILE @ base @ local
        expected = hand @ matrix[:3, :3].T + matrix[:3, 3]
        # a float32 holds the mesh's corners
        np.testing.assert_allclose(_corners_m(scene, time_s), expected, atol=3e-6)


def _turntable():
    """A floor at rest, a table that turns, and a cup that slides on it."""
    gltf = Animated()
    corner = gltf.triangle(positions=CORNERS)
    gltf.node(name="floor", mesh=corner, translation=[0, -1, 0])
    gltf.node(name="table", mesh=corner)
    gltf.child(1, name="cup", mesh=corner, translation=[0, 0.5, 0])
    turn = [[0, 0, 0, 1], [0, np.sqrt(0.5), 0, np.sqrt(0.5)]]
    gltf.animate(
        "turn",
        (1, "rotation", [0, 2], turn, "LINEAR"),
        (2, "translation", [0, 1], [[0, 0.5, 0], [1, 0.5, 0]], "LINEAR"),
        (0, "translation", [0, 1], [[0, -1, 0]] * 2, "LINEAR"),  # as exporters write what rests
    )
    gltf.animate("slide", (2, "translation", [0, 1], [[0, 0.5, 0], [1, 0.5, 0]], "LINEAR"))
    return gltf


def test_only_what_moves_is_a_dynamic_object(tmp_path):
    scene = load_scene(_turntable().write(tmp_path / "a.glb"))
    assert scene.instance_names == ("floor",)
    assert [moving.name for moving in scene.objects] == ["table", "cup"]
    assert len(scene.meshes) == 1
    cup = next(moving for moving in scene.objects if moving.name == "cup")
    # the table has turned by 45°, and the cup is at its end since 1 s: each channel ends by itself
    place = cup.motion.pose_at(1.0)[:3, 3]
    np.testing.assert_allclose(place, [np.sqrt(0.5), np.sqrt(0.5), 0.5], atol=1e-6)
    assert scene.notices == ("a.glb: animations are not played (1 animation)",)


def _named(folder, name):
    (folder / "scene.toml").write_text(f'file = "a.glb"\nanimation = "{name}"\n')
    return load_scene(folder)


def test_a_toml_chooses_the_animation(tmp_path):
    _turntable().write(tmp_path / "a.glb")
    slide = _named(tmp_path, "slide")
    assert [moving.name for moving in slide.objects] == ["cup"]
    assert slide.notices == ()
    rest = _named(tmp_path, "none")
    assert rest.objects == ()
    assert rest.notices == ("a.glb: animations are not played (2 animations)",)
    assert set(rest.instance_names) == {"floor", "table", "cup"}
    assert load_scene(tmp_path, animation="none").objects == ()
    assert len(load_scene(tmp_path, animation="turn").objects) == 2
    with pytest.raises(SceneError, match=r"a.glb: animation = 'slid': unknown; did you mean 'slid"):
        _named(tmp_path, "slid")
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SceneError, match=r"a.obj: animation = 'turn': expected a glTF file"):
        load_scene(tmp_path / "a.obj", animation="turn")


def test_parts_and_shapes_of_objects_rest(tmp_path):
    path = _turntable().write(tmp_path / "a.glb")
    rest, moving = load_scene(path, animation="none"), load_scene(path)
    (tmp_path / "floor.glb").write_bytes(path.read_bytes())
    (tmp_path / "scene.toml").write_text(
        'file = "floor.glb"\nanimation = "none"\n[[objects]]\nname = "toy"\nfile = "a.glb"\n'
    )
    (toy,) = load_scene(tmp_path).objects
    assert toy.shape.triangle_count == rest.triangle_count == 3
    empty = Scene.from_arrays("ground", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    added = empty.added("toy", moving)
    assert added.triangle_count == 4
    np.testing.assert_allclose(added.bounds_m("toy"), rest.bounds_m(), atol=1e-6)


def test_a_scene_where_everything_moves_has_bounds_and_exposure(tmp_path):
    gltf = Animated()
    gltf.node(name="body", mesh=gltf.triangle(positions=CORNERS))
    gltf.animate("go", (0, "translation", [0, 1], [[3, 0, 0], [4, 0, 0]], "LINEAR"))
    scene = load_scene(gltf.write(tmp_path / "a.glb"))
    assert scene.instances == ()
    # the name of a vehicle's body is taken
    assert [moving.name for moving in scene.objects] == ["body_1"]
    expected = WORLD_FROM_FILE[:3, :3] @ (CORNERS + [3, 0, 0]).T
    low, high = expected.min(axis=1), expected.max(axis=1)
    np.testing.assert_allclose(scene.bounds_m(), [low, high], atol=1e-6)
    assert scene.at_start().objects == ()
    (tmp_path / "scene.toml").write_text(
        'file = "a.glb"\n[[lamps]]\nkind = "directional"\ndirection = [0, 1, 0]\nintensity = 10\n'
    )
    assert load_scene(tmp_path).lighting.exposure > 0.0


def test_nodes_that_change_their_shape_deform(tmp_path):
    """Scale and shear, below a parent with a scale: no object, but a mesh that deforms."""
    gltf = Animated()
    gltf.node(scale=[1, 3, 1])
    turning = gltf.child(0, mesh=gltf.triangle(positions=CORNERS))
    growing = gltf.child(0, mesh=gltf.triangle(positions=CORNERS), scale=[2, 2, 2])
    turns = Rotation.from_euler("z", [[0], [90]], degrees=True)
    sizes = np.array([[1, 1, 1], [5, 3, 0]])
    gltf.animate(
        "shear",
        (turning, "rotation", [0, 2], turns.as_quat(), "LINEAR"),
        (growing, "scale", [0, 2], sizes, "LINEAR"),
    )
    scene = load_scene(gltf.write(tmp_path / "a.glb"))
    assert scene.notices == ()
    assert scene.objects == ()
    for time_s in (0.0, 0.7, 1.9, 2.7):
        share = time_s % 2.0 / 2.0
        turned = Slerp([0, 1], turns)(share).as_matrix()
        grown = np.diag(sizes[0] + share * (sizes[1] - sizes[0]))
        expected = [np.diag([1, 3, 1]) @ linear for linear in (grown, turned)]
        for instance, linear in zip(scene.instances, expected, strict=True):
            matrix = instance.world_from_mesh
            positions = scene.meshes[instance.mesh].deformation.positions_at(time_s)
            world_m = positions @ matrix[:3, :3].T + matrix[:3, 3]
            file_m = CORNERS.astype(float) @ linear.T
            np.testing.assert_allclose(world_m, file_m @ WORLD_FROM_FILE[:3, :3].T, atol=1e-6)


@pytest.mark.parametrize(
    ("times_s", "values", "interpolation", "words"),
    [
        ([1, 0], [[0, 0, 0]] * 2, "LINEAR", "input: expected an accessor of times that increase"),
        ([0, np.nan], [[0, 0, 0]] * 2, "LINEAR", "input: expected an accessor of finite times"),
        ([0, 1], [[0, 0, 0]], "LINEAR", "output: expected an accessor of 2 finite VEC3"),
        ([0, 1], [[0, 0, 0]] * 2, "CUBICSPLINE", "output: expected an accessor of 6 finite VEC3"),
        ([0, 1], [[0, 0, np.inf]] * 2, "LINEAR", "output: expected an accessor of 2 finite VEC3"),
        ([0, 1], [[0, 0]] * 2, "LINEAR", "output: expected an accessor of 2 finite VEC3"),
        ([0, 1], [[0, 0, 0]] * 2, "BEZIER", "interpolation: expected one of STEP, LINEAR, CUBIC"),
    ],
)
def test_damaged_animations_are_refused(times_s, values, interpolation, words, tmp_path):
    gltf = Animated()
    gltf.node(mesh=gltf.triangle())
    gltf.animate("bad", (0, "translation", times_s, values, interpolation))
    path = gltf.write(tmp_path / "a.glb")
    with pytest.raises(SceneError, match=r"animations\[0\].samplers\[0\]." + words):
        load_scene(path)
    assert load_scene(path, animation="none").triangle_count == 1
