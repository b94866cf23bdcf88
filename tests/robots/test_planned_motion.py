"""Motion of a plan in closed form: its derivatives, its limits, and the plan's own poses."""

import math

import numpy as np
import pytest

from omnisim.robots import load_robot
from omnisim.robots.motion_profile import plan_in_steps, plan_with_period

POINTS = [(0.0, 0.0), (5.0, 0.0), (5.0, 3.3), (0.1, 0.0), (0.1, 0.4)]
LIMITS = load_robot("p2at").kinematics
PLANS = {
    "steps": plan_in_steps(POINTS, LIMITS, 0.35, 0.2),
    "period": plan_with_period(POINTS, LIMITS, 0.1, start_yaw_rad=1.0),
}


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_it_goes_through_the_plans_poses(plan):
    poses = plan.motion.at(plan.trajectory.times_s).world_from_base
    np.testing.assert_allclose(poses, plan.trajectory.world_from_base, atol=1e-13)
    assert plan.motion.end_s == pytest.approx(plan.trajectory.times_s[-1], abs=1e-9)


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_rates_are_central_differences_and_keep_to_the_limits(plan):
    motion, h = plan.motion, 1e-6
    times = np.linspace(0.0, motion.end_s, 20_001)
    before, now, after = (motion.at(times + shift) for shift in (-h, 0.0, h))
    moved = (after.world_from_base - before.world_from_base)[:, :3, 3] / (2.0 * h)
    # across a jump of the acceleration they differ by a quarter of it times the difference's step
    np.testing.assert_allclose(now.velocity_mps, moved, atol=0.5 * h * LIMITS.max_acceleration_mps2)
    yaws = np.arctan2(*(now.world_from_base[:, 1, 0], now.world_from_base[:, 0, 0]))
    turned = np.gradient(np.unwrap(yaws), times)
    off = np.abs(turned - now.angular_rate_radps[:, 2])
    assert off.max() <= LIMITS.max_turn_acceleration_radps2 * (times[1] - times[0])
    speeds = np.linalg.norm(now.velocity_mps, axis=1)
    assert speeds.max() <= LIMITS.max_speed_mps * (1.0 + 1e-12)
    # speed changes by the acceleration at most, from any time to any other
    assert np.abs(np.diff(speeds)).max() <= LIMITS.max_acceleration_mps2 * times[1] * (1.0 + 1e-9)
    accelerations = np.linalg.norm(now.acceleration_mps2, axis=1)
    assert accelerations.max() <= LIMITS.max_acceleration_mps2 * (1.0 + 1e-12)
    rates = np.abs(now.angular_rate_radps[:, 2])
    assert rates.max() <= LIMITS.max_turn_rate_radps * (1.0 + 1e-12)


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_it_begins_and_ends_at_rest(plan):
    states = plan.motion.at(np.array([-1.0, 0.0, plan.motion.end_s, plan.motion.end_s + 1.0]))
    assert np.abs(states.velocity_mps).max() < 1e-12
    assert np.abs(states.angular_rate_radps).max() < 1e-12
    assert math.isclose(states.world_from_base[-1, 1, 3], 0.4)
