"""Objects that move while an image is exposed, against averages and what their speed says."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import PerspectiveCamera
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.core.world import WorldState
from omnisim.rendering.camera.degradations import Degradation, Shutter
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.rendering.twist import Twist
from omnisim.scene.model import DynamicObject, Material, Mesh
from omnisim.scene.motion.object_motion import Along, Orbit, Shuttle
from tests.scenes import room, scene_of

pytestmark = pytest.mark.usefixtures("needs_opengl")
FOCAL_PX, SIZE_PX = 60.0, (48, 32)
LENS = PerspectiveCamera(*SIZE_PX, FOCAL_PX, (23.5, 15.5))


def _camera(shutter=None):
    # fine enough for an edge: 4 samples to a side of a pixel, 4 samples in each texel
    return OmniCamera(
        LENS, polygons=None, supersampling=4, samples=4, degradation=Degradation(shutter=shutter)
    )


def _curtain():
    """White, in the plane x = 0 of its frame, from y = 0 to the right."""
    corners = np.array([[0, 0, -20], [0, -40, -20], [0, -40, 20], [0, 0, 20]], dtype=np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    return scene_of([Mesh("curtain", corners, triangles, 0)], [Material(double_sided=True)])


def _edges_px(linear):
    """Column of the edge in each row: black left of it, white right."""
    return SIZE_PX[0] - 0.5 - linear[..., 0].sum(axis=1)


@pytest.mark.parametrize("exposure_s", [None, 0.01])
def test_rolling_shutter_slants_an_object_that_passes(exposure_s):
    """A curtain 4 m ahead that slides to the right, seen by a camera at rest: to 0.1 px."""
    speed_mps, readout_s = 5.0, 0.05
    sensor = _camera(Shutter(exposure_s=exposure_s, readout_s=readout_s))

    def motion(time_s):
        return WorldState(
            {"body": np.eye(4), "curtain": pose((4.0, -speed_mps * (time_s - 10.0), 0.0))}, time_s
        )

    with (
        Stage(scene_of([], []), dynamic_objects={"curtain": _curtain()}) as stage,
        stage.open(sensor, unlit=True) as renderer,
    ):
        frame = renderer.render(motion(10.0), linear=True, motion=motion)
    rows = np.arange(SIZE_PX[1])
    middle_s = (rows / (SIZE_PX[1] - 1) - 0.5) * readout_s
    expected = 23.5 + FOCAL_PX * speed_mps * middle_s / 4.0
    seen = _edges_px(frame.linear)
    assert np.abs(seen - expected).max() <= 0.1
    assert seen[-1] - seen[0] > 3.3
    assert frame.metadata["degradation"]["sub_frames"] > 5


def _psnr_db(ours, theirs):
    mask = np.isfinite(ours).all(axis=-1)
    return -10.0 * np.log10(np.mean((ours[mask] - theirs[mask]) ** 2))


def test_blur_of_a_ball_and_a_turning_robot_is_the_mean_of_its_instants():
    """Against 64 images at evenly spaced instants: at least 40 dB."""
    exposure_s = 0.3
    ball = scene_of([_octahedron(0.25)], [Material(base_color=(0, 0, 0, 1))])
    orbit = Orbit((2.0, 0.0, 0.0), 0.4, 4.0)
    world = scene_of([room()])
    world = dataclasses.replace(world, objects=(DynamicObject("ball", ball, orbit),))
    turn = Twist(angular_radps=(0.0, 0.0, 0.5)).through(pose((-0.5, 0.2, 0.0)))

    def motion(time_s):
        return WorldState({"body": turn(time_s - 3.0), "ball": orbit.pose_at(time_s)}, time_s)

    with Stage(world) as stage:
        with stage.open(_camera(Shutter(exposure_s=exposure_s)), unlit=True) as renderer:
            ours = renderer.render(motion(3.0), linear=True, motion=motion)
            # the scene moves its own objects where a motion is of poses alone
            by_pose = renderer.render(
                WorldState({"body": turn(0.0)}, 3.0),
                linear=True,
                motion=lambda time_s: turn(time_s - 3.0),
            )
        with stage.open(_camera(), unlit=True) as still:
            times_s = 3.0 + ((np.arange(64) + 0.5) / 64 - 0.5) * exposure_s
            mean = np.mean([still.render(motion(t), linear=True).linear for t in times_s], axis=0)
            sharp = still.render(motion(3.0), linear=True).linear
    np.testing.assert_array_equal(by_pose.linear, ours.linear)
    assert _psnr_db(ours.linear, mean) >= 40.0
    assert _psnr_db(sharp, mean) < 35.0  # there is blur to speak of


def _octahedron(radius_m):
    corners = radius_m * np.vstack((np.eye(3), -np.eye(3))).astype(np.float32)
    triangles = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5],
                 [0, 4, 5]]  # fmt: skip
    return Mesh("ball", corners, np.array(triangles, dtype=np.uint32), 0)


def test_a_pose_stands_for_the_time_0():
    """And a state's time moves the scene's objects."""
    shape = scene_of([_octahedron(0.3)], [Material(base_color=(1, 1, 1, 1))])
    shuttle = Shuttle((2.0, -0.5, 0.0), (2.0, 0.5, 0.0), 4.0)
    world = scene_of([room()])
    world = dataclasses.replace(world, objects=(DynamicObject("ball", shape, shuttle),))
    still = Along(Trajectory(np.zeros(1), shuttle.pose_at(1.0)[None]))
    stopped = dataclasses.replace(world, objects=(DynamicObject("ball", shape, still),))
    with open_sensor(world, _camera(), unlit=True) as moving:
        at_start = moving.render(np.eye(4)).rgba
        later = moving.render(WorldState({"body": np.eye(4)}, 1.0)).rgba
        there = WorldState({"body": np.eye(4), "ball": shuttle.pose_at(1.0)})
        np.testing.assert_array_equal(moving.render(there).rgba, later)
    with open_sensor(stopped, _camera(), unlit=True) as renderer:
        np.testing.assert_array_equal(renderer.render(np.eye(4)).rgba, later)
    assert np.any(at_start != later)
