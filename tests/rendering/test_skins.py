"""A skinned, walking figure in images: place, normals and flow follow NumPy's skinning."""

import dataclasses

import numpy as np
import pytest

from omnisim import (
    LaserScanner,
    OmniCamera,
    Stage,
    load_scene,
    open_sensor,
)
from omnisim.cameras import EquirectangularCamera, pixel_grid
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.camera.degradations import Degradation, Shutter
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from tests.cameras.optics.examples import SYSTEMS
from tests.skinned_figure import Figure

LENS = EquirectangularCamera(480, 240)
HERE, THERE = pose((-0.7, -1.1, 1.0), yaw_deg=8.0), pose((-0.68, -1.08, 1.0), yaw_deg=9.0)
NOW_S, AFTER_S, BEFORE_S = 0.37, 0.42, 0.31
BACKENDS = pytest.mark.parametrize("backend", ["cube", "rays"])
FIGURE = Figure()
pytestmark = pytest.mark.usefixtures("needs_opengl")


def _camera(**options):
    return OmniCamera(LENS, polygons=None, supersampling=1, **options)


def _open(folder, backend, **options):
    if backend == "rays":
        pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    stage = Stage(load_scene(FIGURE.write(folder / "a.glb", **options)), backend=backend)
    return stage, stage.open(_camera())


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


@BACKENDS
def test_flow_follows_the_skin(backend, tmp_path):
    """Both ways, far within 0.02 px in the mean; points, to a few micrometers."""
    stage, renderer = _open(tmp_path, backend)
    with stage, renderer:
        states = [
            WorldState({renderer.vehicle: base}, time_s)
            for base, time_s in ((HERE, NOW_S), (THERE, AFTER_S), (THERE, BEFORE_S))
        ]
        also = ("position", "instance", "normals", "flow", "flow_backward", "scene_flow")
        also += ("scene_flow_camera",)
        found = renderer.render(
            states[0], also=also, next_state=states[1], previous_state=states[2]
        ).channels
        labels = renderer.render(HERE, also=also[:2]).labels
    names = {label.id: label.name for label in labels.instances}
    on_figure = np.vectorize(names.get)(found["instance"]) == "walker"
    assert on_figure.sum() > 600
    points_m = found["position"][on_figure]
    now_m = FIGURE.vertices_m(NOW_S)
    triangles, weights, away_m = _nearest(points_m, now_m)
    assert away_m.max() < 5e-6
    corners = FIGURE.triangles[triangles]
    pixels = pixel_grid(LENS.width_px, LENS.height_px)[on_figure]
    for name, time_s in (("flow", AFTER_S), ("flow_backward", BEFORE_S)):
        then_m = np.einsum("nk,nkc->nc", weights, FIGURE.vertices_m(time_s)[corners])
        error_px = np.linalg.norm(
            found[name][on_figure] - (_pixels(then_m, THERE) - pixels), axis=1
        )
        assert np.linalg.norm(found[name][on_figure], axis=1).max() > 3.0
        assert error_px.mean() < 1e-4
        assert error_px.max() < 1e-3
    then_m = np.einsum("nk,nkc->nc", weights, FIGURE.vertices_m(AFTER_S)[corners])
    np.testing.assert_allclose(found["scene_flow"][on_figure], then_m - points_m, atol=1e-5)
    optical = (THERE[:3, :3] @ LENS.rig_from_optical, HERE[:3, :3] @ LENS.rig_from_optical)
    relative_m = (then_m - THERE[:3, 3]) @ optical[0] - (points_m - HERE[:3, 3]) @ optical[1]
    np.testing.assert_allclose(found["scene_flow_camera"][on_figure], relative_m, atol=1e-5)
    on_wall = np.vectorize(names.get)(found["instance"]) == "wall"
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


@BACKENDS
def test_a_image_is_of_its_time_and_repeats(backend, tmp_path):
    stage, renderer = _open(tmp_path, backend)
    with stage, renderer:
        first, later, again = (
            renderer.render(WorldState({renderer.vehicle: HERE}, time_s)).rgb
            for time_s in (0.25, 0.625, 2.25)
        )
    assert (first != later).any(axis=-1).mean() > 0.005
    np.testing.assert_array_equal(first, again)


@pytest.mark.slow
def test_back_ends_agree_on_images_and_occlusion(tmp_path):
    found = []
    for backend in ("cube", "rays"):
        stage, renderer = _open(tmp_path, backend)
        with stage, renderer:
            states = [
                WorldState({renderer.vehicle: base}, time_s)
                for base, time_s in ((HERE, NOW_S), (THERE, AFTER_S))
            ]
            frame = renderer.render(states[0], also=("occluded", "instance"), next_state=states[1])
            channels = frame.channels
            found.append((frame.rgb.astype(int), channels["occluded"], channels["instance"]))
    for channel in (1, 2):
        assert (found[0][channel] != found[1][channel]).mean() < 1e-3
    assert (found[0][1] == 1).sum() > 100  # behind the figure
    inside = found[0][2] == found[1][2]
    assert np.abs(found[0][0] - found[1][0])[inside].mean() < 0.5


@pytest.mark.slow
def test_batches_are_the_single_images(tmp_path):
    stage, renderer = _open(tmp_path, "cube")
    with stage, renderer:
        states = [WorldState({renderer.vehicle: HERE}, time_s) for time_s in (0.1, 0.45, 0.45, 0.8)]
        following = [*states[1:], states[0]]
        also = ("range", "normals", "instance", "flow", "occluded")
        batch = renderer.render_batch(states, channels=("rgb", *also), next_states=following)
        for number, (state, after) in enumerate(zip(states, following, strict=True)):
            frame = renderer.render(state, also=also, next_state=after)
            np.testing.assert_array_equal(batch["rgb"][number], frame.rgb)
            for name in also:
                np.testing.assert_array_equal(batch[name][number], frame.channels[name])
    assert len({one.tobytes() for one in batch["rgb"]}) == 3


@pytest.mark.slow
def test_shadows_follow_the_figure(tmp_path):
    """A lamp far behind the figure, that shadows of it on the wall: by maps, and by rays."""
    FIGURE.write(tmp_path / "a.glb")
    lamp = 'kind = "directional"\ndirection = [1.0, 0.3, -0.1]\nintensity = 3.0\n'
    text = f'file = "a.glb"\n[light]\nambient = [0.1, 0.1, 0.1]\n[[lamps]]\n{lamp}'
    (tmp_path / "scene.toml").write_text(text)
    scene = load_scene(tmp_path / "scene.toml")
    images = {}
    for backend in ("cube", "rays"):
        with open_sensor(scene, _camera(), backend=backend) as renderer:
            for time_s in (0.1, 0.9):
                state = WorldState({renderer.vehicle: HERE}, time_s)
                frame = renderer.render(state, also=("instance",))
                images[backend, time_s] = frame.rgb.astype(int)
    for time_s in (0.1, 0.9):
        mapped, traced = (images[backend, time_s] for backend in ("cube", "rays"))
        # edges differ, which the virtual cameras and the maps filter
        assert (np.abs(mapped - traced).max(axis=-1) > 20).mean() < 6e-3
    dark, expected = (images[backend, 0.9].sum(axis=-1) < 120 for backend in ("cube", "rays"))
    assert expected.sum() > 150  # the shadow, which has left where it was
    assert (dark & expected).sum() > 0.6 * (dark | expected).sum()  # its edges are a third of it
    before = images["cube", 0.1].sum(axis=-1) < 120
    assert (before & expected).sum() < 0.1 * expected.sum()


def test_a_laser_scanner_sees_the_shins_where_they_are(tmp_path):
    """Against NumPy's skin, cut by the plane of the scan."""
    scene = load_scene(FIGURE.write(tmp_path / "a.glb"))
    scanner = dataclasses.replace(
        LaserScanner().without_errors(), range_min_m=0.0, range_max_m=np.inf
    )
    at = pose((0.2, -1.0, 0.3))
    time_s = 0.6
    with open_sensor(scene, scanner) as renderer:
        still = renderer.scan(WorldState({renderer.vehicle: at}, 0.0))
        scan = renderer.scan(WorldState({renderer.vehicle: at}, time_s))
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


def test_boxes_hold_the_figure_as_it_is(tmp_path):
    stage, renderer = _open(tmp_path, "cube")
    with stage, renderer:
        for time_s in (0.0, 0.7):
            state = WorldState({renderer.vehicle: HERE}, time_s)
            frame = renderer.render(state, boxes_3d=True)
            (box,) = [one for one in frame.boxes_3d if one.label.name == "walker"]
            vertices_m = FIGURE.vertices_m(time_s)
            low, high = vertices_m.min(axis=0), vertices_m.max(axis=0)
            np.testing.assert_allclose(box.full.corners_m.min(axis=0), low, atol=1e-5)
            np.testing.assert_allclose(box.full.corners_m.max(axis=0), high, atol=1e-5)


@pytest.mark.slow
def test_a_rolling_shutter_has_rows_of_their_times(tmp_path):
    """A camera at rest: sub-frames are chosen by how far joints move."""
    shutter = Shutter(readout_s=0.3)
    stage, renderer = _open(tmp_path, "cube")
    rolling = stage.open(_camera(degradation=Degradation(shutter=shutter)))
    with stage, renderer, rolling:

        def state_at(time_s):
            return WorldState({renderer.vehicle: HERE}, time_s)

        frame = rolling.render(state_at(0.5), motion=state_at)
        count = frame.metadata["degradation"]["sub_frames"]
        assert count > 4
        times_s = 0.5 + ((np.arange(count) + 0.5) / count - 0.5) * 0.3
        rows = np.linspace(0, LENS.height_px, count + 1).astype(int)
        for time_s, first, last in list(zip(times_s, rows[:-1], rows[1:], strict=True))[::4]:
            instant = renderer.render(state_at(float(time_s))).rgb.astype(int)
            middle = (first + last) // 2
            np.testing.assert_allclose(frame.rgb[middle].astype(int), instant[middle], atol=2)


@pytest.mark.slow
@pytest.mark.parametrize(("backend", "bound_m"), [("cube", 3e-4), ("rays", 1e-6)])
def test_a_lidar_meets_the_figure_where_it_is_at_each_firing(backend, bound_m, tmp_path):
    """In the middle of each slice by the virtual cameras, which is 1 cm at most; else exactly."""
    if backend == "rays":
        pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    scene = load_scene(FIGURE.write(tmp_path / "a.glb"))
    lidar = SpinningLidar.vlp16().without_errors()
    at = pose((-0.2, -0.9, 0.9))
    with open_sensor(scene, lidar, backend=backend) as renderer:

        def state_at(time_s):
            return WorldState({renderer.vehicle: at}, time_s)

        cloud = renderer.scan(state_at, 0.6)
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


@pytest.mark.slow
def test_flow_through_optics_without_a_viewpoint(tmp_path):
    """A ball as a mirror, beside which the figure walks: by its virtual cameras and by rays."""
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    scene = load_scene(FIGURE.write(tmp_path / "a.glb"))
    model = SYSTEMS["sphere"].scaled(0.4)
    found = []
    for backend in ("cube", "rays"):
        with open_sensor(scene, OmniCamera(model, supersampling=1), backend=backend) as renderer:
            base = pose((0.6, -0.9, 0.9), yaw_deg=20.0)
            now, after = (WorldState({renderer.vehicle: base}, time_s) for time_s in (0.4, 0.45))
            also = ("instance", "flow", "occluded", "scene_flow")
            found.append(renderer.render(now, also=also, next_state=after).channels)
    same = (found[0]["instance"] == found[1]["instance"]) & (found[0]["instance"] > 0)
    moves = same & (np.linalg.norm(found[1]["scene_flow"], axis=-1) > 0.0)
    assert moves.sum() > 300
    for name, bound in (("flow", 0.02), ("scene_flow", 2e-4)):
        error = np.linalg.norm(found[0][name] - found[1][name], axis=-1)[moves]
        assert np.nanmean(error) < bound
        assert np.isfinite(error).mean() > 0.95
    assert (found[0]["occluded"] != found[1]["occluded"])[moves].mean() < 0.02


def test_edits_of_the_scene_keep_the_figure_walking(tmp_path):
    stage, renderer = _open(tmp_path, "cube")
    with stage, renderer:
        state = WorldState({renderer.vehicle: HERE}, 0.6)
        before = renderer.render(state, also=("range", "instance"))
        green = stage.scene.recolored("walker", (0, 1, 0))
        stage.scene = stage.scene.added("box", green, pose((9, 9, 0)))
        stage.scene = stage.scene.removed("box")
        again = renderer.render(state, also=("range", "instance"))
        np.testing.assert_array_equal(again.channels["range"], before.channels["range"])
        shifted = pose((0.0, 0.3, 0.0))
        stage.scene = stage.scene.moved("walker", shifted)
        moved = renderer.render(state, also=("position", "instance"))
        stage.scene = stage.scene.removed("walker")
        gone = renderer.render(state)
    name_of = {label.id: label.name for label in moved.labels.instances}
    on_figure = np.vectorize(name_of.get)(moved.channels["instance"]) == "walker"
    points_m = moved.channels["position"][on_figure] - (0.0, 0.3, 0.0)
    assert _nearest(points_m, FIGURE.vertices_m(0.6))[2].max() < 5e-6
    assert np.abs(gone.rgb.astype(int) - before.rgb).max() > 20
