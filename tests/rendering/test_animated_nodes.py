"""Animated nodes in images: place, flow and rolling shutter follow the keyframes, by SciPy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from omnisim import OmniCamera, Stage, load_scene
from omnisim.cameras import EquirectangularCamera, pixel_grid
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.camera.degradations import Degradation, Shutter
from tests.animated_gltf import WORLD_FROM_FILE, Animated

TURNS = Rotation.from_euler("yxz", [[0, 0, 0], [50, 10, 5], [80, -20, 30]], degrees=True)
TIMES_S = np.array([0.0, 1.0, 2.0])
PLACES = np.array([[0.0, 0.2, 0.0], [0.6, 0.4, -0.4], [0.3, 0.0, 0.5]])
NOW_S, AFTER_S = 0.8, 0.85
HERE, THERE = pose((-1.6, 0.3, 0.3), yaw_deg=8.0), pose((-1.57, 0.32, 0.3), yaw_deg=9.0)
LENS = EquirectangularCamera(360, 180)
CORNERS = np.array([[x, y, z] for x in (-0.4, 0.4) for y in (-0.3, 0.3) for z in (-0.2, 0.2)])
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
IDEAL = Degradation()
BACKENDS = pytest.mark.parametrize("backend", ["cube", "rays"])


def _open(folder, backend, degradation=IDEAL):
    """A stage of a box that an animation moves, before a wall, and a renderer."""
    if backend == "rays":
        pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    gltf = Animated()
    faces = [CORNERS[np.array([[a, b, c], [a, c, d]])] for a, b, c, d in QUADS]
    gltf.node(name="crate", mesh=gltf.triangle(positions=np.concatenate(faces).reshape(-1, 3)))
    gltf.node(name="wall", mesh=gltf.triangle(positions=[[3, -9, 9], [3, -9, -9], [3, 18, 0]]))
    gltf.animate(
        "tumble",
        (0, "translation", TIMES_S, PLACES, "LINEAR"),
        (0, "rotation", TIMES_S, TURNS.as_quat(), "LINEAR"),
    )
    scene = load_scene(gltf.write(folder / "a.glb"))
    stage = Stage(scene, backend=backend)
    return stage, stage.open(_camera(degradation))


def _camera(degradation):
    return OmniCamera(LENS, polygons=None, supersampling=1, degradation=degradation)


def _world_from_crate(time_s):
    matrix = np.eye(4)
    matrix[:3, :3] = Slerp(TIMES_S, TURNS)(time_s).as_matrix()
    matrix[:3, 3] = [np.interp(time_s, TIMES_S, PLACES[:, axis]) for axis in range(3)]
    return WORLD_FROM_FILE @ matrix


@BACKENDS
@pytest.mark.usefixtures("needs_opengl")
def test_flow_follows_the_keyframes(backend, tmp_path):
    stage, renderer = _open(tmp_path, backend)
    with stage, renderer:
        now, after = (
            WorldState({renderer.vehicle: base}, time_s)
            for base, time_s in ((HERE, NOW_S), (THERE, AFTER_S))
        )
        also = ("flow", "position", "instance", "occluded", "scene_flow")
        found = renderer.render(now, also=also, next_state=after).channels
    on_crate = found["instance"] == found["instance"].max()
    assert on_crate.sum() > 300
    points_m = found["position"][on_crate]
    matrix = np.linalg.inv(_world_from_crate(NOW_S))
    in_crate = points_m @ matrix[:3, :3].T + matrix[:3, 3]
    # on one of its faces, where SciPy has it at the time
    distances_m = np.min(np.abs(np.abs(in_crate) - CORNERS.max(axis=0)), axis=1)
    assert distances_m.max() < 2e-6
    matrix = _world_from_crate(AFTER_S)
    moved_m = in_crate @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(found["scene_flow"][on_crate], moved_m - points_m, atol=2e-6)
    local_m = (moved_m - THERE[:3, 3]) @ THERE[:3, :3] @ LENS.rig_from_optical
    expected = LENS.pixel_from_ray(local_m).positions_px
    expected -= pixel_grid(LENS.width_px, LENS.height_px)[on_crate]
    assert np.abs(found["flow"][on_crate] - expected).max() < 1e-3  # range and flow are float32
    np.testing.assert_array_equal(found["scene_flow"][found["instance"] == 1], 0.0)


@BACKENDS
@pytest.mark.usefixtures("needs_opengl")
def test_a_image_is_of_its_time_and_repeats(backend, tmp_path):
    stage, renderer = _open(tmp_path, backend)
    with stage, renderer:
        first, later, again = (
            renderer.render(WorldState({renderer.vehicle: HERE}, time_s)).rgb
            for time_s in (0.5, 1.5, 4.5)
        )
    assert (first != later).any(axis=-1).mean() > 0.005
    np.testing.assert_array_equal(first, again)


@BACKENDS
@pytest.mark.usefixtures("needs_opengl")
def test_a_image_of_a_rolling_shutter_has_rows_of_their_times(backend, tmp_path):
    """Camera at rest: each row is that of the image at the middle of its sub-frame."""
    shutter = Shutter(readout_s=0.6, sub_frames=6)
    stage, renderer = _open(tmp_path, backend, Degradation(shutter=shutter))
    instant = stage.open(_camera(IDEAL))
    with stage, renderer, instant:

        def state_at(time_s):
            return WorldState({renderer.vehicle: HERE}, time_s)

        rolled = renderer.render(state_at(NOW_S), motion=state_at).rgb.astype(int)
        times_s = NOW_S + (np.arange(6) + 0.5) * 0.1 - 0.3
        instants = [instant.render(state_at(float(time_s))).rgb.astype(int) for time_s in times_s]
    for number, expected in enumerate(instants):
        rows = slice(30 * number + 2, 30 * number + 28)  # away from the next sub-frame's
        np.testing.assert_allclose(rolled[rows], expected[rows], atol=1)
    assert np.abs(rolled - instants[0]).max() > 20
