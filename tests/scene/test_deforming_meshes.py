"""Skins and morph targets of files: NumPy's own formula, eight joints, and what is wrong."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from omnisim.core.errors import SceneError
from omnisim.scene import load_scene
from tests.animated_gltf import WORLD_FROM_FILE, Animated
from tests.scene.world_corners import points_of
from tests.skinned_figure import JOINTS, Figure

RANDOM = np.random.default_rng(11)
VERTICES = RANDOM.normal(size=(6, 3)).astype("<f4")
NORMALS = RANDOM.normal(size=(6, 3)).astype("<f4")
OFFSETS = RANDOM.normal(size=(5, 6, 3)).astype("<f4")
NORMAL_OFFSETS = RANDOM.normal(size=(5, 6, 3)).astype("<f4")
KEYS_S = [0.0, 1.0, 3.0]
WEIGHTS = RANDOM.normal(size=(3, 5)).astype("<f4")
WEIGHTS[:, 3] = 0.0  # a target that never counts
PLACES = RANDOM.normal(size=(9, 3))
BINDS = np.tile(np.eye(4), (9, 1, 1)) + 0.2 * RANDOM.normal(size=(9, 4, 4))
BINDS[:, 3] = (0, 0, 0, 1)
TURNS = RANDOM.normal(size=(3, 4))
TURNS[TURNS[:, 3] < 0] *= -1.0
TURNS /= np.linalg.norm(TURNS, axis=1, keepdims=True)
JOINT_OF = np.stack([RANDOM.permutation(9)[:8] for _ in range(6)])
SHARES = RANDOM.random((6, 8)) + 0.1
SHARES /= SHARES.sum(axis=1, keepdims=True)
ALMOST = 2e-6  # float32 of coordinates up to 10


def _write(folder, skinned=True, morphed=True, weights=None, sets=2, **animation):
    """Nine joints in a row below one that turns; two triangles."""
    gltf = Animated()
    accessors = {
        "POSITION": gltf.accessor(VERTICES, "VEC3"), "NORMAL": gltf.accessor(NORMALS, "VEC3")
    }  # fmt: skip
    primitive = {"attributes": accessors}
    if skinned:
        for number in range(sets):
            some = slice(4 * number, 4 * number + 4)
            accessors[f"JOINTS_{number}"] = gltf.accessor(JOINT_OF[:, some].astype("u1"), "VEC4")
            values = (SHARES if weights is None else weights)[:, some].astype("<f4")
            accessors[f"WEIGHTS_{number}"] = gltf.accessor(values, "VEC4")
        binds = animation.pop("binds", BINDS).swapaxes(1, 2).reshape(-1, 16).astype("<f4")
        gltf.tree["skins"] = [
            {"joints": list(range(1, 10)), "inverseBindMatrices": gltf.accessor(binds, "MAT4")}
        ]
    if morphed:
        primitive["targets"] = [
            {"POSITION": gltf.accessor(offset, "VEC3"), "NORMAL": gltf.accessor(two, "VEC3")}
            for offset, two in zip(OFFSETS, NORMAL_OFFSETS, strict=True)
        ]
    gltf.tree["meshes"].append({"primitives": [primitive], "weights": [0.5, 0, 0, 0, 0.25]})
    node = {"mesh": 0, "name": "blob", "translation": [3, 1, 2]}
    gltf.node(**node, **({"skin": 0} if skinned else {}))
    for number in range(9):
        gltf.node(name=f"joint {number}", translation=PLACES[number].tolist())
    gltf.node(name="above", children=[1, 2, 3, 4, 5])
    gltf.tree["scenes"][0]["nodes"] = [0, 6, 7, 8, 9, 10]
    channels = []
    if animation.pop("turns", True):
        channels.append((10, "rotation", KEYS_S, TURNS, "LINEAR"))
    gltf.animate("move", *channels)
    if morphed and animation.pop("moves_weights", True):
        entry = gltf.tree["animations"][0]
        entry["samplers"].append(
            {
                "input": gltf.accessor(np.array(KEYS_S, "<f4"), "SCALAR"),
                "output": gltf.accessor(animation.pop("weight_values", WEIGHTS).ravel(), "SCALAR"),
            }
        )
        target = {"sampler": len(entry["samplers"]) - 1, "target": {"node": 0, "path": "weights"}}
        entry["channels"].append(target)
    if not gltf.tree["animations"][0]["channels"]:
        gltf.tree["animations"] = []
    return gltf.write(folder / "a.glb")


def _expected(time_s, skinned, morphed, weights=WEIGHTS, turns=TURNS):
    """Positions and unit normals (6, 3) in the world, by glTF's formulas."""
    positions, normals = VERTICES.astype(float), NORMALS.astype(float)
    if morphed:
        now = [np.interp(time_s, KEYS_S, weights[:, k]) for k in range(5)]
        positions = positions + np.tensordot(now, OFFSETS.astype(float), 1)
        normals = normals + np.tensordot(now, NORMAL_OFFSETS.astype(float), 1)
    above = np.eye(4)
    above[:3, :3] = Slerp(KEYS_S, Rotation.from_quat(turns))(time_s).as_matrix()
    moved, turned = [], []
    for vertex in range(6):
        matrix = np.eye(4)
        matrix[:3, 3] = [3, 1, 2]
        if skinned:
            matrix = np.zeros((4, 4))
            for joint, share in zip(JOINT_OF[vertex], SHARES[vertex], strict=True):
                node = np.eye(4)
                node[:3, 3] = PLACES[joint]
                parent = above if joint < 5 else np.eye(4)
                matrix += share * parent @ node @ BINDS[joint].astype("<f4").astype(float)
        matrix = WORLD_FROM_FILE @ matrix
        linear = matrix[:3, :3]
        moved.append(linear @ positions[vertex] + matrix[:3, 3])
        normal = np.linalg.inv(linear).T @ normals[vertex]
        turned.append(normal / np.linalg.norm(normal))
    return np.array(moved), np.array(turned)


@pytest.mark.parametrize(
    ("skinned", "morphed"), [(True, False), (False, True), (True, True)],
    ids=["skin", "morph", "both"],
)  # fmt: skip
def test_vertices_are_by_the_formulas(skinned, morphed, tmp_path):
    scene = load_scene(_write(tmp_path, skinned, morphed))
    assert scene.notices == ()
    (instance,) = scene.instances
    deformation = scene.meshes[instance.mesh].deformation
    assert deformation.targets is None or len(deformation.targets.positions) == 4
    matrix = instance.world_from_mesh
    for time_s in (0.0, 0.4, 2.5):
        expected, normals = _expected(time_s, skinned, morphed)
        positions = deformation.positions_at(time_s) @ matrix[:3, :3].T + matrix[:3, 3]
        np.testing.assert_allclose(positions, expected, atol=ALMOST)
        again = deformation.positions_at(time_s + 3.0)
        np.testing.assert_allclose(again, deformation.positions_at(time_s), atol=1e-9)
        found = deformation.normals_at(time_s) @ matrix[:3, :3].T
        agrees = np.abs(np.einsum("nc,nc->n", found, normals))
        np.testing.assert_allclose(agrees, 1.0, atol=1e-6)
        center, radius = deformation.sphere_at(time_s)
        local = deformation.positions_at(time_s) - center
        assert np.linalg.norm(local, axis=1).max() <= radius * (1 + 1e-9)
    mesh = scene.meshes[instance.mesh]
    np.testing.assert_allclose(mesh.positions, deformation.positions_at(0.0), atol=ALMOST)


def test_what_rests_is_placed_once(tmp_path):
    scene = load_scene(_write(tmp_path, turns=False, moves_weights=False))
    assert not scene.deforms
    at_rest = np.array([[0.5, 0.0, 0.0, 0.0, 0.25]] * 3), np.array([[0.0, 0.0, 0.0, 1.0]] * 3)
    expected, _ = _expected(0.0, True, True, *at_rest)
    np.testing.assert_allclose(points_of(scene), expected, atol=ALMOST)


def test_weights_of_another_sum_are_divided(tmp_path):
    weights = SHARES.copy()
    weights[0] *= 3.0
    weights[1] = 0.0
    scene = load_scene(_write(tmp_path, weights=weights))
    assert scene.notices == (
        "a.glb: weights of joints do not add up to 1: they are normalized (2 vertices)",
    )
    deformation = scene.meshes[scene.instances[0].mesh].deformation
    np.testing.assert_allclose(deformation.shares.sum(axis=1), 1.0, rtol=1e-6)
    assert np.isfinite(deformation.positions_at(0.5)).all()


def test_singular_binds_are_noticed(tmp_path):
    binds = BINDS.copy()
    binds[2, :3, :3] = 0.0
    scene = load_scene(_write(tmp_path, binds=binds))
    assert scene.notices == (
        "a.glb: inverse bind matrices are singular: meshes are flattened (1 joint)",
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"weights": np.full((6, 8), np.nan)}, "attributes: expected finite WEIGHTS"),
        ({"binds": np.full_like(BINDS, np.inf)}, r"mesh 'mesh 0'.*expected finite numbers"),
        ({"weight_values": WEIGHTS[:, :4]}, r"samplers\[1\].output: .* 15 finite SCALAR"),
        (
            {"weight_values": np.full_like(WEIGHTS, np.inf)},
            r"samplers\[1\].output: .* 15 finite SCALAR",
        ),
        ({"weight_values": WEIGHTS * np.float32([[1], [1], [1e30]])}, "in its animation"),
    ],
)
def test_damaged_values_are_refused(options, words, tmp_path):
    with pytest.raises(SceneError, match=words):
        load_scene(_write(tmp_path, **options))


def test_joints_out_of_range_are_refused(tmp_path):
    figure = Figure()
    figure.joints = figure.joints + len(JOINTS)
    with pytest.raises(SceneError, match=r"attributes: expected JOINTS below 13"):
        load_scene(figure.write(tmp_path / "a.glb"))


def test_an_object_plays_the_animation_that_it_names(tmp_path):
    Figure().write(tmp_path / "walker.glb")
    (tmp_path / "scene.toml").write_text(
        'extends = "courtyard"\n[[objects]]\nname = "passer-by"\nfile = "walker.glb"\n'
        'animation = "walk"\norbit = { center_m = [0, 0, 0], radius_m = 2.0, period_s = 9.0 }\n'
        '[[objects]]\nname = "standing"\nfile = "walker.glb"\n'
    )
    walking, standing = load_scene(tmp_path / "scene.toml").objects
    assert walking.shape.deforms
    assert not standing.shape.deforms
    text = (tmp_path / "scene.toml").read_text().replace('"walk"', '"swim"')
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(SceneError, match="animation = 'swim': unknown"):
        load_scene(tmp_path / "scene.toml")


def test_nodes_together_are_nodes_one_by_one(tmp_path):
    scene = load_scene(Figure().write(tmp_path / "a.glb"))
    (deformation,) = [mesh.deformation for mesh in scene.meshes if mesh.deformation is not None]
    skeleton = deformation.skeleton
    for time_s in (0.0, 0.123, 0.9999, 17.3):
        alone = np.stack([node.transform_at(time_s) for node in skeleton.nodes])
        expected = alone @ skeleton.node_from_bind
        np.testing.assert_allclose(skeleton.matrices_at(time_s), expected, atol=1e-12)


def test_nodes_of_an_object_deform_it(tmp_path):
    """Animated nodes in a file of an object: its meshes move, and it stays one object."""
    gltf = Animated()
    gltf.node(name="base", mesh=gltf.triangle())
    gltf.child(0, name="lid", mesh=gltf.triangle())
    moves = [[0, 0, 0], [0, 2, 0]]
    gltf.animate("open", (1, "translation", [0, 1], moves, "LINEAR"))
    gltf.write(tmp_path / "bin.glb")
    text = (
        'extends = "courtyard"\n[[objects]]\nname = "bin"\nfile = "bin.glb"\nanimation = "open"\n'
    )
    (tmp_path / "scene.toml").write_text(text)
    (made,) = load_scene(tmp_path / "scene.toml").objects
    low, high = made.shape.boxes_at(0.5)["lid"].corners_m[:, 2][[0, -1]]
    assert made.shape.objects == ()
    assert (low, high) == pytest.approx((1.0, 2.0))
    assert made.shape.boxes_at(0.5)["base"] is made.shape.instance_boxes["base"]
