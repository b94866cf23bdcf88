"""Errors of trajectories against evo's, and in cases with a known answer."""

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose, pose_from_rotation
from omnisim.core.trajectories import Trajectory
from omnisim.evaluation.trajectory_errors import (
    align,
    lost_intervals,
    over_seeds,
    trajectory_errors,
)
from tests.evaluation.evo_oracle import check_errors


def drive(count=200, seed=0):
    """Trajectory of a winding drive in three dimensions."""
    random = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, count)
    positions = np.stack(
        (8.0 * np.sin(4.0 * share), 5.0 * np.cos(7.0 * share), 0.5 * np.sin(9.0 * share)), axis=1
    )
    poses = [
        pose(position, roll_deg=4.0 * random.normal(), pitch_deg=3.0, yaw_deg=400.0 * one)
        for position, one in zip(positions, share, strict=True)
    ]
    return Trajectory(np.round(np.linspace(0.0, 20.0, count), 6), np.stack(poses))


def disturbed(truth, scale=1.0, noise_m=0.02, seed=1):
    """Estimate of a drive in a world of its own."""
    random = np.random.default_rng(seed)
    world = pose((3.0, -2.0, 1.0), roll_deg=10.0, pitch_deg=-20.0, yaw_deg=130.0)
    poses = []
    for one in truth.world_from_base:
        moved = world @ one
        moved[:3, 3] = scale * moved[:3, 3] + noise_m * random.normal(size=3)
        roll_deg, pitch_deg, yaw_deg = 0.5 * random.normal(size=3)
        turn = pose(roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)
        moved[:3, :3] = moved[:3, :3] @ turn[:3, :3]
        poses.append(moved)
    return Trajectory(truth.times_s[::2], np.stack(poses)[::2])


@pytest.mark.slow
def test_errors_are_those_of_evo(tmp_path):
    cases = {
        f"{kind}-{scale:g}": (disturbed(drive(), scale), drive(), kind)
        for kind in ("none", "se3", "sim3")
        for scale in (1.0, 0.3)
    }
    check_errors(tmp_path, cases)


def test_a_rigidly_moved_estimate_has_no_errors():
    truth = drive()
    world = pose((3.0, -2.0, 1.0), roll_deg=10.0, pitch_deg=-20.0, yaw_deg=130.0)
    estimate = Trajectory(truth.times_s, world @ truth.world_from_base)
    errors = trajectory_errors(estimate, truth, "se3")
    assert errors.ate_m < 1e-12
    assert errors.drift < 1e-12
    assert errors.scale == pytest.approx(1.0, abs=1e-12)
    assert errors.yaw_deg < 1e-6
    assert errors.lost == 0.0
    assert errors.gravity_deg > 10.0  # the estimate's world is tilted


def test_drift_is_the_share_of_the_way():
    """Wheels that report 3 % too much, along a straight line."""
    times = np.linspace(0.0, 10.0, 101)
    still = np.broadcast_to(np.eye(3), (101, 3, 3))
    ways = np.column_stack((times, np.zeros((101, 2))))
    truth = Trajectory(times, pose_from_rotation(still, ways))
    estimate = Trajectory(times, pose_from_rotation(still, 1.03 * ways))
    errors = trajectory_errors(estimate, truth, "none")
    assert errors.drift == pytest.approx(0.03, rel=1e-9)
    assert errors.path_length_m == pytest.approx(10.0)
    assert errors.scale == 1.0  # positions on a line: no alignment


def test_turns_are_aligned_by_their_first_poses():
    """A turn on the spot has no positions to align by."""
    times = np.linspace(0.0, 1.0, 11)
    poses = np.stack([pose((1.0, 2.0, 0.0), yaw_deg=9.0 * step) for step in range(11)])
    world = pose((5.0, 0.0, 0.0), yaw_deg=70.0)
    errors = trajectory_errors(Trajectory(times, world @ poses), Trajectory(times, poses), "se3")
    assert errors.ate_m < 1e-12
    assert errors.yaw_deg < 1e-6
    assert np.isnan(errors.drift)


def test_gaps_and_ends_are_lost():
    times = np.delete(0.1 * np.arange(101), slice(30, 60))
    lost = lost_intervals(times, 0.0, 12.0)
    np.testing.assert_allclose(lost, [(2.9, 6.0), (10.0, 12.0)])
    assert lost_intervals(np.delete(0.1 * np.arange(101), 50), 0.0, 10.0) == []  # a single image
    assert lost_intervals(np.array([]), 1.0, 2.0) == [(1.0, 2.0)]
    truth = drive()
    gap = np.delete(np.arange(200), slice(60, 120))
    for part, share in ((gap, 0.3), (slice(50, 150), 0.5)):
        estimate = Trajectory(truth.times_s[part], truth.world_from_base[part])
        assert trajectory_errors(estimate, truth, "se3").lost == pytest.approx(share, abs=0.01)


def test_means_have_their_confidence():
    """Quantile of Student's t with two degrees of freedom, from a table: 4.303."""
    found = over_seeds([1.0, 2.0, np.nan, 3.0])
    assert (found.mean, found.seeds) == (2.0, 3)
    assert found.half_width == pytest.approx(4.303 / np.sqrt(3.0), rel=1e-4)
    assert np.isnan(over_seeds([5.0]).half_width)
    assert np.isnan(over_seeds([]).mean)


def test_poses_without_a_true_state_are_refused():
    truth = drive()
    late = Trajectory(truth.times_s[:-1] + 0.04, truth.world_from_base[:-1])
    with pytest.raises(TrajectoryError, match="0 of 199 poses have a true state"):
        trajectory_errors(late, truth, "se3")


def test_a_similarity_is_found_again():
    truth = drive().world_from_base
    moved = truth.copy()
    turn = pose((0, 0, 0), yaw_deg=40.0, pitch_deg=15.0)[:3, :3]
    moved[:, :3, 3] = (truth[:, :3, 3] @ turn.T + (1.0, 2.0, 3.0)) * 2.5
    moved[:, :3, :3] = turn @ truth[:, :3, :3]
    found = align(moved, truth, "sim3")
    assert found.scale == pytest.approx(0.4, rel=1e-12)
    assert np.abs(found.apply(moved) - truth).max() < 1e-12
