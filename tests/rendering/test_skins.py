"""Animated nodes and a skinned, walking figure in images: by SciPy's keyframes, NumPy's skin."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from omnisim import LaserScanner, OmniCamera, Stage, load_scene, open_sensor
from omnisim.cameras import EquirectangularCamera, pixel_grid
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.camera.degradations import Degradation, Shutter
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from tests.animated_gltf import WORLD_FROM_FILE, Animated
from tests.rendering.frames import BACKENDS, assert_batch_is_frames, each_backend, opened
from tests.skinned_figure import Figure

LENS = EquirectangularCamera(384, 192)
CAMERA = OmniCamera(LENS, polygons=None, supersampling=1)
HERE, THERE = pose((-0.7, -1.1, 1.0), yaw_deg=8.0), pose((-0.68, -1.08, 1.0), yaw_deg=9.0)
NOW_S, AFTER_S, BEFORE_S = 0.37, 0.42, 0.31
FIGURE = Figure()
# The box that an animation moves.
TURNS = Rotation.from_euler("yxz", [[0, 0, 0], [50, 10, 5], [80, -20, 30]], degrees=True)
TIMES_S = np.array([0.0, 1.0, 2.0])
PLACES = np.array([[0.0, 0.2, 0.0], [0.6, 0.4, -0.4], [0.3, 0.0, 0.5]])
BEFORE_IT = pose((-1.6, 0.3, 0.3), yaw_deg=8.0), pose((-1.57, 0.32, 0.3), yaw_deg=9.0)
CORNERS = np.array([[x, y, z] for x in (-0.4, 0.4) for y in (-0.3, 0.3) for z in (-0.2, 0.2)])
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.fixture(scope="module")
def walker(tmp_path_factory):
    """The figure before a wall."""
    return load_scene(FIGURE.write(tmp_path_factory.mktemp("figure") / "a.glb"))


@pytest.fixture(scope="module")
def crate(tmp_path_factory):
    """A box that tumbles before a wall."""
    gltf = Animated()
    faces = [CORNERS[np.array([[a, b, c], [a, c, d]])] for a, b, c, d in QUADS]
    gltf.node(name="crate", mesh=gltf.triangle(positions=np.concatenate(faces).reshape(-1, 3)))
    gltf.node(name="wall", mesh=gltf.triangle(positions=[[3, -9, 9], [3, -9, -9], [3, 18, 0]]))
    gltf.animate(
        "tumble",
        (0, "translation", TIMES_S, PLACES, "LINEAR"),
        (0, "rotation", TIMES_S, TURNS.as_quat(), "LINEAR"),
    )
    return load_scene(gltf.write(tmp_path_factory.mktemp("crate") / "a.glb"))


def _at(base, time_s):
    return WorldState({"body": base}, float(time_s))


def _world_from_crate(time_s):
    matrix = np.eye(4)
    matrix[:3, :3] = Slerp(TIMES_S, TURNS)(time_s).as_matrix()
    matrix[:3, 3] = [np.interp(time_s, TIMES_S, PLACES[:, axis]) for axis in range(3)]
    return WORLD_FROM_FILE @ matrix


def _nearest(points_m, vertices_m):
    """Triangle (n,), weights (n, 3) of its corners and distance (n,) of points (n, 3)."""
    corners = vertices_m[FIGURE.triangles]
    a, first, second = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(first, second)
    squared = np.einsum("nc,nc->n", across, across)
    inside = points_m[:, None] - a
    second_weight = np.einsum("ptc,tc->pt", np.cross(inside, second), across) / squared
    third_weight = np.einsum("ptc,tc->pt", np.cross(first, inside), across) / squared
    weights = np.stack((1 - second_weight - third_weight, second_weight, third_weight), axis=-1)
    away_m = np.abs(np.einsum("ptc,tc->pt", inside, across)) / np.sqrt(squared)
    away_m += 0.05 * np.maximum(-weights.min(axis=-1), 0.0)
    found = away_m.argmin(axis=1)
    rows = np.arange(len(points_m))
    return found, weights[rows, found], away_m[rows, found]


def _pixels(points_m, base):
    local_m = (points_m - base[:3, 3]) @ base[:3, :3] @ LENS.rig_from_optical
    return LENS.pixel_from_ray(local_m).positions_px


def _on(frame, name):
    """Mask of the pixels of an instance."""
    ids = [label.id for label in frame.labels.instances if label.name == name]
    return np.isin(frame.channels["instance"], ids)


@each_backend
def test_flow_follows_the_keyframes(backend, crate):
    now_s, after_s = 0.8, 0.85
    here, there = BEFORE_IT
    also = ("flow", "position", "instance", "occluded", "scene_flow")
    with opened(crate, CAMERA, backend) as renderer:
        frame = renderer.render(_at(here, now_s), also=also, next_state=_at(there, after_s))
    found, on_crate = frame.channels, _on(frame, "crate")
    assert on_crate.sum() > 300
    points_m = found["position"][on_crate]
    matrix = np.linalg.inv(_world_from_crate(now_s))
    in_crate = points_m @ matrix[:3, :3].T + matrix[:3, 3]
    # on one of its faces, where SciPy has it at the time
    distances_m = np.min(np.abs(np.abs(in_crate) - CORNERS.max(axis=0)), axis=1)
    assert distances_m.max() < 2e-6
    matrix = _world_from_crate(after_s)
    moved_m = in_crate @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(found["scene_flow"][on_crate], moved_m - points_m, atol=2e-6)
    expected = _pixels(moved_m, there) - pixel_grid(LENS.width_px, LENS.height_px)[on_crate]
    assert np.abs(found["flow"][on_crate] - expected).max() < 1e-3  # range and flow are float32
    np.testing.assert_array_equal(found["scene_flow"][_on(frame, "wall")], 0.0)


@each_backend
def test_an_image_of_a_rolling_shutter_has_rows_of_their_times(backend, crate):
    """Camera at rest: each row is that of the image at the middle of its sub-frame."""
    shutter = Shutter(readout_s=0.6, sub_frames=6)
    here = BEFORE_IT[0]
    ideal = dataclasses.replace(CAMERA, model=EquirectangularCamera(360, 180))
    rolling = dataclasses.replace(ideal, degradation=Degradation(shutter=shutter))

    def motion(time_s):
        return _at(here, time_s)

    with Stage(crate, backend=backend) as stage:
        with stage.open(rolling) as renderer:
            rolled = renderer.render(motion(0.8), motion=motion).rgb.astype(int)
        with stage.open(ideal) as renderer:
            times_s = 0.8 + (np.arange(6) + 0.5) * 0.1 - 0.3
            instants = [renderer.render(motion(time_s)).rgb.astype(int) for time_s in times_s]
    for number, expected in enumerate(instants):
        rows = slice(30 * number + 2, 30 * number + 28)  # away from the next sub-frame's
        np.testing.assert_allclose(rolled[rows], expected[rows], atol=1)
    assert np.abs(rolled - instants[0]).max() > 20


@each_backend
def test_flow_follows_the_skin(backend, walker):
    """Both ways, far within 0.02 px in the mean; points, to a few micrometers."""
    also = ("position", "instance", "normals", "flow", "flow_backward", "scene_flow")
    also += ("scene_flow_camera",)
    with opened(walker, CAMERA, backend) as renderer:
        frame = renderer.render(
            _at(HERE, NOW_S), also=also, next_state=_at(THERE, AFTER_S),
            previous_state=_at(THERE, BEFORE_S),
        )  # fmt: skip
    found, on_figure = frame.channels, _on(frame, "walker")
    assert on_figure.sum() > 400
    points_m = found["position"][on_figure]
    triangles, weights, away_m = _nearest(points_m, FIGURE.vertices_m(NOW_S))
    assert away_m.max() < 5e-6
    corners = FIGURE.triangles[triangles]
    pixels = pixel_grid(LENS.width_px, LENS.height_px)[on_figure]
    for name, time_s in (("flow_backward", BEFORE_S), ("flow", AFTER_S)):
        then_m = np.einsum("nk,nkc->nc", weights, FIGURE.vertices_m(time_s)[corners])
        expected = _pixels(then_m, THERE) - pixels
        error_px = np.linalg.norm(found[name][on_figure] - expected, axis=1)
        assert np.linalg.norm(found[name][on_figure], axis=1).max() > 3.0
        assert error_px.mean() < 1e-4
        assert error_px.max() < 1e-3
    np.testing.assert_allclose(found["scene_flow"][on_figure], then_m - points_m, atol=1e-5)
    optical = (THERE[:3, :3] @ LENS.rig_from_optical, HERE[:3, :3] @ LENS.rig_from_optical)
    relative_m = (then_m - THERE[:3, 3]) @ optical[0] - (points_m - HERE[:3, 3]) @ optical[1]
    np.testing.assert_allclose(found["scene_flow_camera"][on_figure], relative_m, atol=1e-5)
    on_wall = _on(frame, "wall")
    assert on_wall.any()
    np.testing.assert_array_equal(found["scene_flow"][on_wall], 0.0)
    # normals of rigid bones turn with them: by the mean rotation of the joints, within its shear
    blended = FIGURE.blended(NOW_S)[:, :3, :3]
    normals = np.einsum("nab,nb->na", np.linalg.inv(blended).swapaxes(1, 2), FIGURE.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.einsum("nk,nkc->nc", weights, normals[corners])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    agrees = np.abs(np.einsum("nc,nc->n", normals, found["normals"][on_figure]))
    assert np.degrees(np.arccos(np.clip(agrees, -1.0, 1.0))).max() < 0.1


@each_backend
def test_an_image_is_of_its_time_and_repeats(backend, walker):
    with opened(walker, CAMERA.resized(160), backend) as renderer:
        first, later, again = (
            renderer.render(_at(HERE, time_s)).rgb for time_s in (0.25, 0.625, 2.25)
        )
    assert (first != later).any(axis=-1).mean() > 0.005
    np.testing.assert_array_equal(first, again)
    # sub-frames are chosen by how far joints move
    rolling = dataclasses.replace(CAMERA, degradation=Degradation(shutter=Shutter(readout_s=0.3)))
    with opened(walker, rolling.resized(60), backend) as renderer:
        frame = renderer.render(_at(HERE, 0.5), motion=lambda time_s: _at(HERE, time_s))
    assert frame.metadata["degradation"]["sub_frames"] > 2


@pytest.mark.slow
def test_batches_are_the_single_images(walker):
    states = [_at(HERE, time_s) for time_s in (0.1, 0.45, 0.45, 0.8)]
    with open_sensor(walker, CAMERA) as renderer:
        batch = assert_batch_is_frames(renderer, states, ("rgb", "range", "normals", "instance"))
    assert len({one.tobytes() for one in batch["rgb"]}) == 3


@pytest.mark.slow
def test_shadows_follow_the_figure(tmp_path):
    """A lamp far behind the figure, that shadows of it on the wall: by maps, and by rays."""
    FIGURE.write(tmp_path / "a.glb")
    lamp = 'kind = "directional"\ndirection = [1.0, 0.3, -0.1]\nintensity = 3.0\n'
    text = f'file = "a.glb"\n[light]\nambient = [0.1, 0.1, 0.1]\n[[lamps]]\n{lamp}'
    (tmp_path / "scene.toml").write_text(text)
    scene, images = load_scene(tmp_path / "scene.toml"), {}
    for backend in BACKENDS:
        with opened(scene, CAMERA.resized(240), backend) as renderer:
            for time_s in (0.1, 0.9):
                images[backend, time_s] = renderer.render(_at(HERE, time_s)).rgb.astype(int)
    for time_s in (0.1, 0.9):
        mapped, traced = (images[backend, time_s] for backend in BACKENDS)
        # edges differ, which the virtual cameras and the maps filter
        assert (np.abs(mapped - traced).max(axis=-1) > 20).mean() < 6e-3
    dark, expected = (images[backend, 0.9].sum(axis=-1) < 120 for backend in BACKENDS)
    assert expected.sum() > 150  # the shadow, which has left where it was
    assert (dark & expected).sum() > 0.6 * (dark | expected).sum()  # its edges are a third of it
    before = images["cube", 0.1].sum(axis=-1) < 120
    assert (before & expected).sum() < 0.1 * expected.sum()


def test_a_laser_scanner_sees_the_shins_where_they_are(walker):
    """Against NumPy's skin, cut by the plane of the scan."""
    scanner = dataclasses.replace(
        LaserScanner().without_errors(), range_min_m=0.0, range_max_m=np.inf
    )
    at, time_s = pose((0.2, -1.0, 0.3)), 0.6
    with open_sensor(walker, scanner) as renderer:
        still, scan = (renderer.scan(_at(at, time_s)) for time_s in (0.0, 0.6))
    corners_m = FIGURE.vertices_m(time_s)[FIGURE.triangles] - scan.world_from_scanner[:3, 3]
    beams = np.stack((np.cos(scan.angles_rad), np.sin(scan.angles_rad)), axis=-1)
    expected_m = np.full(len(beams), np.inf)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        a, b, c = corners_m[:, start], corners_m[:, end], corners_m[:, 3 - start - end]
        # corner b is alone on its side of the plane
        alone = ((a[:, 2] < 0) == (c[:, 2] < 0)) & ((a[:, 2] < 0) != (b[:, 2] < 0))
        height = b[alone, 2:]
        one, two = (
            b[alone] + (height / (height - other[alone, 2:])) * (other[alone] - b[alone])
            for other in (a, c)
        )
        for p, q in zip(one[:, :2], two[:, :2], strict=True):
            along = q - p
            across = beams[:, 0] * along[1] - beams[:, 1] * along[0]
            with np.errstate(all="ignore"):
                range_m = (p[0] * along[1] - p[1] * along[0]) / across
                share = (p[0] * beams[:, 1] - p[1] * beams[:, 0]) / across
            hit = (range_m > 0) & (share >= 0) & (share <= 1)
            expected_m[hit] = np.minimum(expected_m[hit], range_m[hit])
    seen = np.flatnonzero(np.isfinite(expected_m))
    assert len(seen) > 5
    np.testing.assert_allclose(scan.ranges_m[seen], expected_m[seen], atol=1e-5)
    assert not np.array_equal(scan.ranges_m, still.ranges_m)


@pytest.mark.slow
@pytest.mark.parametrize(("backend", "bound_m"), [("cube", 3e-4), ("rays", 1e-6)])
def test_a_lidar_meets_the_figure_where_it_is_at_each_firing(backend, bound_m, walker):
    """In the middle of each slice by the virtual cameras, which is 1 cm at most; else exactly."""
    lidar, at = SpinningLidar.vlp16().without_errors(), pose((-0.2, -0.9, 0.9))
    with opened(walker, lidar, backend) as renderer:
        cloud = renderer.scan(lambda time_s: _at(at, time_s), 0.6)
    points = cloud.points[cloud.points["instance"] == cloud.points["instance"].max()]
    points = points[np.hypot(points["x"], points["y"]) < 2.5]
    points = points[:: len(points) // 80]
    assert len(points) > 60
    local_m = np.stack([points[axis] for axis in "xyz"], axis=-1).astype(float)
    points_m = local_m @ at[:3, :3].T + cloud.world_from_lidar[:3, 3]
    away_m = np.array(
        [
            _nearest(point_m[None], FIGURE.vertices_m(0.6 - lidar.period_s + float(after_s)))[2][0]
            for point_m, after_s in zip(points_m, points["time"], strict=True)
        ]
    )
    assert np.median(away_m) < bound_m
    assert away_m.max() < 0.005


def test_boxes_and_edits_follow_the_figure(walker):
    also = ("range", "position", "instance")
    with Stage(walker) as stage, stage.open(CAMERA) as renderer:
        state = _at(HERE, 0.6)
        before = renderer.render(state, also=also, boxes_3d=True)
        (box,) = [one for one in before.boxes_3d if one.label.name == "walker"]
        vertices_m = FIGURE.vertices_m(0.6)
        bounds_m = vertices_m.min(axis=0), vertices_m.max(axis=0)
        corners_m = box.full.corners_m
        found_m = corners_m.min(axis=0), corners_m.max(axis=0)
        np.testing.assert_allclose(found_m, bounds_m, atol=1e-5)
        green = stage.scene.recolored("walker", (0, 1, 0))
        stage.scene = stage.scene.added("box", green, pose((9, 9, 0)))
        stage.scene = stage.scene.removed("box")
        again = renderer.render(state, also=also)
        np.testing.assert_array_equal(again.channels["range"], before.channels["range"])
        stage.scene = stage.scene.moved("walker", pose((0.0, 0.3, 0.0)))
        moved = renderer.render(state, also=also)
        stage.scene = stage.scene.removed("walker")
        gone = renderer.render(state)
    points_m = moved.channels["position"][_on(moved, "walker")] - (0.0, 0.3, 0.0)
    assert _nearest(points_m, FIGURE.vertices_m(0.6))[2].max() < 5e-6
    assert np.abs(gone.rgb.astype(int) - before.rgb).max() > 20
