"""The example of a Gymnasium vector environment, by Gymnasium's own rules."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="gymnasium is not installed")
pytestmark = pytest.mark.usefixtures("needs_opengl")

PATH = Path(__file__).resolve().parents[2] / "examples" / "soccer_env.py"
SPEC = importlib.util.spec_from_file_location("soccer_env", PATH)
soccer_env = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(soccer_env)
ROBOTS = 3


@pytest.fixture(scope="module")
def shared():
    envs = soccer_env.SoccerEnv(ROBOTS, size_px=48, max_steps=5, render_mode="rgb_array")
    yield envs
    envs.close()


@pytest.fixture
def envs(shared):
    shared.reset(seed=1)
    return shared


def test_spaces_have_what_comes(envs):
    images, infos = envs.reset(seed=7)
    assert images in envs.observation_space
    assert infos["distance_m"].shape == infos["_distance_m"].shape == (ROBOTS,)
    actions = envs.action_space.sample()
    images, rewards, terminations, truncations, _ = envs.step(actions)
    assert images in envs.observation_space
    assert images[0] in envs.single_observation_space
    assert rewards.shape == terminations.shape == truncations.shape == (ROBOTS,)
    assert rewards.dtype == np.float64
    assert terminations.dtype == truncations.dtype == np.bool_


def test_a_seed_repeats_everything(envs):
    def episode():
        images, _ = envs.reset(seed=3)
        envs.action_space.seed(3)
        steps = [envs.step(envs.action_space.sample()) for _ in range(8)]
        return [images, *(part for step in steps for part in step[:4])]

    first, second = episode(), episode()
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(envs.reset(seed=4)[0], first[0])


def test_observations_are_single_frames_and_stay(envs):
    images, _ = envs.reset(seed=5)
    kept = images.copy()
    envs.step(envs.action_space.sample())
    np.testing.assert_array_equal(images, kept)
    assert len(envs.render()) == ROBOTS
    assert len({image.tobytes() for image in images}) == ROBOTS


def test_wheels_drive_ahead_and_turn(envs):
    before, yaw = envs._position_m.copy(), envs._yaw_rad.copy()
    speed = soccer_env.MAX_WHEEL_SPEED_RADPS
    ahead, turn, arc = (speed, speed), (-speed, speed), (0.0, speed)
    for _ in range(2):
        envs.step(np.array([ahead, turn, arc], np.float32))
    moved = envs._position_m - before
    distance_m = 2 * 1.2 * soccer_env.STEP_S
    np.testing.assert_allclose(
        moved[0], distance_m * np.array([np.cos(yaw[0]), np.sin(yaw[0])]), atol=1e-6
    )
    np.testing.assert_allclose(moved[1], 0.0, atol=1e-9)
    np.testing.assert_allclose(
        envs._yaw_rad - yaw, np.array([0.0, 2.0, 1.0]) * distance_m / soccer_env.TRACK_M, rtol=1e-6
    )
    # about the left wheels: the base keeps its distance to them
    center = before[2] + 0.5 * soccer_env.TRACK_M * np.array([-np.sin(yaw[2]), np.cos(yaw[2])])
    np.testing.assert_allclose(
        np.linalg.norm(envs._position_m[2] - center), 0.5 * soccer_env.TRACK_M, rtol=1e-6
    )


def test_rewards_are_meters_closer_to_the_goal(envs):
    _, infos = envs.reset(seed=2)
    _, rewards, _, _, after = envs.step(envs.action_space.sample())
    np.testing.assert_allclose(rewards, infos["distance_m"] - after["distance_m"])


def test_an_ended_episode_begins_anew_with_the_next_step(envs):
    still = np.zeros((ROBOTS, 2), np.float32)
    envs._position_m[0] = soccer_env.GOAL_M - (0.3, 0.0)
    envs._position_m[1] = (0.0, 1.9)
    _, _, terminations, truncations, _ = envs.step(still)
    assert terminations.tolist() == [True, False, False]
    assert truncations.tolist() == [False, True, False]
    _, rewards, terminations, truncations, _ = envs.step(still + 1.0)
    assert not terminations.any()
    assert not truncations.any()
    assert rewards[0] == rewards[1] == 0.0 != rewards[2]
    assert (envs._steps == [0, 0, 2]).all()
    for _ in range(3):
        _, _, _, truncations, _ = envs.step(still)
    assert truncations.tolist() == [False, False, True]  # after `max_steps`


def test_one_array_can_be_filled_in_every_step():
    envs = soccer_env.SoccerEnv(1, size_px=32, copy=False)
    first, _ = envs.reset(seed=0)
    second, *_ = envs.step(envs.action_space.sample())
    assert second is first
    envs.close()
