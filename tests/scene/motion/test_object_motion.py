"""Motions of dynamic objects, against what they are defined by: their velocity and rolling."""

import numpy as np
import pytest

from omnisim.core.poses import is_pose
from omnisim.core.trajectories import Trajectory
from omnisim.scene.motion.object_motion import Along, Orbit, Rest, Rolling, Shuttle

SQUARE = Trajectory.on_ground(
    [0.0, 1.0, 3.0, 4.0, 6.0], [[0, 0], [1, 0], [1, 1.5], [-0.5, 1.5], [0, 0]], np.zeros(5)
)
MOTIONS = {
    "rest": Rest((1.0, 2.0, 3.0), 30.0),
    "path": Along(SQUARE),
    "again": Along(SQUARE, repeats=True),
    "orbit": Orbit((0.5, -1.0, 0.2), 1.5, 7.0, 20.0),
    "clockwise": Orbit((0.5, -1.0, 0.2), 1.5, -3.0),
    "shuttle": Shuttle((0.0, 1.0, 0.1), (2.0, -1.0, 0.1), 5.0),
}
TIMES_S = [0.37, 1.9, 2.5, 5.1, 8.3]


@pytest.mark.parametrize("name", MOTIONS)
def test_poses_are_poses(name):
    assert all(is_pose(MOTIONS[name].pose_at(time_s)) for time_s in (-3.0, 0.0, *TIMES_S, 1e4))


@pytest.mark.parametrize("name", ["path", "again", "orbit", "clockwise", "shuttle"])
@pytest.mark.parametrize("time_s", TIMES_S)
def test_a_rolling_ball_does_not_slip(name, time_s):
    """The point of the ball on the ground is at rest: v + ω × (−r z) = 0, by differences."""
    radius_m, step_s = 0.11, 1e-5
    ball = Rolling(MOTIONS[name], radius_m)
    before, after = ball.pose_at(time_s - step_s), ball.pose_at(time_s + step_s)
    velocity = (after[:3, 3] - before[:3, 3]) / (2.0 * step_s)
    turned = after[:3, :3] @ before[:3, :3].T
    rates = np.array(
        [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
    ) / (4.0 * step_s)
    contact = velocity + np.cross(rates, [0.0, 0.0, -radius_m])
    np.testing.assert_allclose(contact, 0.0, atol=1e-6)
    assert abs(rates[2]) < 1e-6  # it does not spin
    np.testing.assert_array_equal(ball.pose_at(time_s)[:3, 3], MOTIONS[name].pose_at(time_s)[:3, 3])


@pytest.mark.parametrize("name", ["orbit", "clockwise", "shuttle"])
@pytest.mark.parametrize("time_s", [0.37, 1.9, 5.1])
def test_objects_face_along_their_way(name, time_s):
    motion = MOTIONS[name]
    ahead = motion.pose_at(time_s + 1e-6)[:3, 3] - motion.pose_at(time_s - 1e-6)[:3, 3]
    np.testing.assert_allclose(
        motion.pose_at(time_s)[:3, 0], ahead / np.linalg.norm(ahead), atol=1e-6
    )


def test_repeats_go_on_where_they_began():
    ball = Rolling(MOTIONS["again"], 0.2)
    np.testing.assert_allclose(ball.pose_at(6.0)[:3, 3], ball.pose_at(0.0)[:3, 3], atol=1e-12)
    np.testing.assert_allclose(
        ball.pose_at(6.0 - 1e-9)[:3, :3], ball.pose_at(6.0 + 1e-9)[:3, :3], atol=1e-6
    )
    still = MOTIONS["path"]
    np.testing.assert_array_equal(still.pose_at(60.0), still.pose_at(6.0))


def test_ends_of_a_shuttle_and_a_turn():
    shuttle, orbit = MOTIONS["shuttle"], MOTIONS["orbit"]
    np.testing.assert_allclose(shuttle.pose_at(2.5)[:3, 3], (2.0, -1.0, 0.1), atol=1e-12)
    np.testing.assert_allclose(shuttle.pose_at(5.0)[:3, 3], (0.0, 1.0, 0.1), atol=1e-12)
    np.testing.assert_allclose(orbit.pose_at(7.0), orbit.pose_at(0.0), atol=1e-12)
