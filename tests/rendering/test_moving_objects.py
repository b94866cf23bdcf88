"""Objects that move while an image is exposed, against averages and what their speed says."""

import dataclasses

import numpy as np
import pytest
import trimesh

from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.core.world import WorldState
from omnisim.rendering.camera.degradations import Shutter
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.rendering.twist import Twist
from omnisim.scene.model import DynamicObject, Material, Mesh
from omnisim.scene.motion.object_motion import Along, Orbit, Shuttle
from omnisim.validation.image_differences import psnr_db
from tests.rendering.test_degraded_renderer import (
    FOCAL_PX,
    curtain,
    edges_px,
    looking_ahead,
    middles_s,
)
from tests.scenes import room, scene_of

pytestmark = pytest.mark.usefixtures("needs_opengl")


@pytest.mark.parametrize("exposure_s", [None, 0.01])
def test_rolling_shutter_slants_an_object_that_passes(exposure_s):
    """A curtain 4 m ahead that slides to the right, seen by a camera at rest: to 0.1 px."""
    speed_mps, readout_s = 5.0, 0.05
    sensor = looking_ahead(Shutter(exposure_s=exposure_s, readout_s=readout_s))

    def motion(time_s):
        return WorldState(
            {"body": np.eye(4), "curtain": pose((4.0, -speed_mps * (time_s - 10.0), 0.0))}, time_s
        )

    with (
        Stage(scene_of([], []), dynamic_objects={"curtain": curtain()}) as stage,
        stage.open(sensor, unlit=True) as renderer,
    ):
        frame = renderer.render(motion(10.0), linear=True, motion=motion)
    expected = 23.5 + FOCAL_PX * speed_mps * middles_s(readout_s) / 4.0
    seen = edges_px(frame.linear)
    assert np.abs(seen - expected).max() <= 0.1
    assert seen[-1] - seen[0] > 3.3
    assert frame.metadata["degradation"]["sub_frames"] > 5


def test_blur_of_a_ball_and_a_turning_robot_is_the_mean_of_its_instants():
    """Against 48 images at evenly spaced instants: at least 40 dB."""
    exposure_s = 0.3
    ball = scene_of([_ball(0.25)], [Material(base_color=(0, 0, 0, 1))])
    orbit = Orbit((2.0, 0.0, 0.0), 0.4, 4.0)
    world = scene_of([room()])
    world = dataclasses.replace(world, objects=(DynamicObject("ball", ball, orbit),))
    turn = Twist(angular_radps=(0.0, 0.0, 0.5)).through(pose((-0.5, 0.2, 0.0)))

    def motion(time_s):
        return WorldState({"body": turn(time_s - 3.0), "ball": orbit.pose_at(time_s)}, time_s)

    with Stage(world) as stage:
        with stage.open(looking_ahead(Shutter(exposure_s=exposure_s)), unlit=True) as renderer:
            ours = renderer.render(motion(3.0), linear=True, motion=motion)
            # the scene moves its own objects where a motion is of poses alone
            by_pose = renderer.render(
                WorldState({"body": turn(0.0)}, 3.0),
                linear=True,
                motion=lambda time_s: turn(time_s - 3.0),
            )
        with stage.open(looking_ahead(), unlit=True) as still:
            times_s = 3.0 + ((np.arange(48) + 0.5) / 48 - 0.5) * exposure_s
            mean = np.mean([still.render(motion(t), linear=True).linear for t in times_s], axis=0)
            sharp = still.render(motion(3.0), linear=True).linear
    np.testing.assert_array_equal(by_pose.linear, ours.linear)
    everywhere = np.ones(mean.shape[:2], dtype=bool)
    assert psnr_db(ours.linear, mean, everywhere) >= 40.0
    assert psnr_db(sharp, mean, everywhere) < 35.0  # there is blur to speak of


def _ball(radius_m):
    ball = trimesh.creation.icosphere(subdivisions=0, radius=radius_m)
    return Mesh("ball", ball.vertices.astype(np.float32), ball.faces.astype(np.uint32), 0)


def test_a_pose_stands_for_the_time_0():
    """And a state's time moves the scene's objects."""
    shape = scene_of([_ball(0.3)], [Material(base_color=(1, 1, 1, 1))])
    shuttle = Shuttle((2.0, -0.5, 0.0), (2.0, 0.5, 0.0), 4.0)
    world = scene_of([room()])
    world = dataclasses.replace(world, objects=(DynamicObject("ball", shape, shuttle),))
    still = Along(Trajectory(np.zeros(1), shuttle.pose_at(1.0)[None]))
    stopped = dataclasses.replace(world, objects=(DynamicObject("ball", shape, still),))
    with open_sensor(world, looking_ahead(), unlit=True) as moving:
        at_start = moving.render(np.eye(4)).rgba
        later = moving.render(WorldState({"body": np.eye(4)}, 1.0)).rgba
        there = WorldState({"body": np.eye(4), "ball": shuttle.pose_at(1.0)})
        np.testing.assert_array_equal(moving.render(there).rgba, later)
    with open_sensor(stopped, looking_ahead(), unlit=True) as renderer:
        np.testing.assert_array_equal(renderer.render(np.eye(4)).rgba, later)
    assert np.any(at_start != later)
