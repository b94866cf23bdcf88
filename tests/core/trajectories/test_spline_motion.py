"""Smooth motion through poses: derivatives, rests and ends."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import SplineMotion

H = 1e-5


def tumbling(times_s):
    turns = np.column_stack((0.8 * np.sin(times_s), 0.4 * np.cos(1.3 * times_s), 0.3 * times_s))
    poses = np.tile(np.eye(4), (len(times_s), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("ZYX", turns).as_matrix()
    poses[:, :3, 3] = np.column_stack((times_s, np.sin(times_s), 0.2 * np.cos(2.0 * times_s)))
    return Trajectory(times_s, poses)


def straight(times_s, ways_m):
    return Trajectory.on_ground(times_s, np.column_stack((ways_m, 0.0 * ways_m)), 0.0 * times_s)


def test_rates_are_central_differences_of_the_poses():
    motion = SplineMotion(tumbling(np.linspace(0.0, 4.0, 41)))
    times = np.linspace(0.01, 3.99, 400)
    before, now, after = (motion.at(times + shift) for shift in (-H, 0.0, H))
    moved = (after.world_from_base - before.world_from_base)[:, :3, 3] / (2.0 * H)
    np.testing.assert_allclose(now.velocity_mps, moved, atol=1e-8)
    faster = (after.velocity_mps - before.velocity_mps) / (2.0 * H)
    np.testing.assert_allclose(now.acceleration_mps2, faster, atol=1e-4)
    rotations = (state.world_from_base[:, :3, :3] for state in (before, after))
    change = np.swapaxes(next(rotations), 1, 2) @ next(rotations)
    rates = Rotation.from_matrix(change).as_rotvec() / (2.0 * H)
    np.testing.assert_allclose(now.angular_rate_radps, rates, atol=1e-8)


def test_it_is_near_the_motion_that_the_poses_are_of():
    fine = tumbling(np.linspace(0.0, 4.0, 4001))
    found = SplineMotion(tumbling(np.linspace(0.0, 4.0, 81))).at(fine.times_s).world_from_base
    # 20 poses a second of a body that turns at up to 1 rad/s
    np.testing.assert_allclose(found, fine.world_from_base, atol=3e-5)


@pytest.mark.parametrize("speed_mps", [0.0, 0.7])
def test_the_ends_have_the_velocity_of_even_acceleration(speed_mps):
    times = np.array([0.0, 0.1, 0.3, 0.35, 0.5])
    motion = SplineMotion(straight(times, speed_mps * times + 0.25 * times**2))
    states = motion.at(np.array([0.0, 0.5]))
    expected = [speed_mps, speed_mps + 0.25]
    np.testing.assert_allclose(states.velocity_mps[:, 0], expected, atol=1e-12)
    np.testing.assert_allclose(states.acceleration_mps2[:, 0], 0.5, atol=1e-9)


def test_the_velocity_at_an_end_never_points_back_and_is_none_from_rest():
    motion = SplineMotion(straight(np.arange(3.0), np.array([0.0, 0.1, 3.0])))
    assert not motion.at(np.zeros(1)).velocity_mps.any()
    motion = SplineMotion(straight(np.arange(4.0), np.arange(4.0)), from_rest=True)
    assert not motion.at(np.array([0.0, 3.0])).velocity_mps.any()


def test_a_step_without_motion_is_rest():
    ways_m = np.array([0.0, 1.0, 2.0, 2.0, 2.0, 3.0, 4.0])
    motion = SplineMotion(straight(np.arange(7.0), ways_m))
    states = motion.at(np.linspace(2.0, 4.0, 21))
    np.testing.assert_allclose(states.world_from_base[:, 0, 3], 2.0, rtol=1e-15)
    assert not states.velocity_mps.any()


def test_a_turn_on_the_spot_stays_on_it():
    times = np.arange(7.0)
    places = np.array([[0, 0], [1, 0], [2, 0], [2, 0], [2, 0], [2, 1], [2, 2]], dtype=float)
    trajectory = Trajectory.on_ground(times, places, np.radians([0, 0, 0, 45, 90, 90, 90]))
    states = SplineMotion(trajectory).at(np.linspace(2.0, 4.0, 21))
    np.testing.assert_allclose(states.world_from_base[:, :2, 3], [[2.0, 0.0]] * 21, atol=1e-15)
    before = SplineMotion(trajectory).at(np.linspace(0.0, 2.0, 21))
    assert not before.angular_rate_radps.any()


def test_it_rests_before_and_after_as_one_pose_does():
    for count in (3, 1):
        motion = SplineMotion(straight(np.arange(float(count)), np.arange(float(count))))
        states = motion.at(np.array([-1.0, 9.0]))
        assert states.world_from_base[:, 0, 3].tolist() == [0.0, count - 1.0]
        assert not states.velocity_mps.any()
