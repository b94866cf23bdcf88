"""Robots in the soccer field as a Gymnasium vector environment: wheel speeds in, images out.

Each robot is alone in a field of its own, with the paper's camera; all fields are one stage, and
all observations one batch. A robot is rewarded for each meter that it comes closer to the blue
goal.

    python examples/soccer_env.py        # 100 random steps of 16 robots
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray

import omnisim
from omnisim.core.poses import pose_from_rotation

WHEEL_RADIUS_M, TRACK_M = 0.11, 0.42  # of the robot, see scenes/p2at/robot.toml
MAX_WHEEL_SPEED_RADPS = 1.2 / WHEEL_RADIUS_M
STEP_S = 0.1
GOAL_M, REACHED_M = np.array([2.7, 0.0]), 0.6
HALF_FIELD_M = np.array([2.7, 1.8])


class SoccerEnv(VectorEnv):
    """Robots that learn to drive to the blue goal.

    Observations are images (n, size, size, 3) uint8, actions the speeds (n, 2) of the left and
    the right wheels in rad/s. An episode ends at the goal, and is truncated outside of the field
    and after `max_steps`; the step after resets it.

    Args:
        num_envs: number of robots.
        size_px: side of the square images.
        max_steps: of an episode, 0.1 s each.
        copy: return new observations; else all steps fill one array, which is quicker.
        render_mode: "rgb_array": `render` returns the last images.
        device: number of the GPU, as `omnisim info` lists them.
    """

    metadata = {  # noqa: RUF012  # Gymnasium's own name and type
        "render_modes": ["rgb_array"],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 16,
        size_px: int = 84,
        max_steps: int = 200,
        copy: bool = True,
        render_mode: str | None = None,
        device: int | None = None,
    ):
        self.num_envs, self.render_mode = num_envs, render_mode
        self._max_steps, self._copy = max_steps, copy
        robot = omnisim.Vehicle.load("p2at")
        mounted = robot.camera("omnicam")
        camera = mounted.sensor.resized(size_px).with_quality("fast")
        self._stage = omnisim.Stage("soccer", robot.body, device=device)
        self._renderer = self._stage.open(camera, hidden=mounted.hides)
        limit = np.full(2, MAX_WHEEL_SPEED_RADPS, np.float32)
        self.single_action_space = gymnasium.spaces.Box(-limit, limit)
        self.single_observation_space = gymnasium.spaces.Box(
            0, 255, (size_px, size_px, 3), np.uint8
        )
        batch = gymnasium.vector.utils.batch_space
        self.action_space = batch(self.single_action_space, num_envs)
        self.observation_space = batch(self.single_observation_space, num_envs)
        self._images = np.empty(self.observation_space.shape, np.uint8)
        self._position_m = np.zeros((num_envs, 2))
        self._yaw_rad = np.zeros(num_envs)
        self._steps = np.zeros(num_envs, np.int64)
        self._is_done = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        """Place all robots anew."""
        super().reset(seed=seed)
        self._place(np.ones(self.num_envs, np.bool_))
        return self._observe(), self._infos()

    def step(self, actions: NDArray[np.floating]) -> tuple[
        NDArray[np.uint8], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]
    ]:  # fmt: skip
        """Drive for 0.1 s; robots whose episode has ended are placed anew instead."""
        starts = self._is_done.copy()
        before_m = self._distances_m()
        self._drive(np.where(starts[:, None], 0.0, actions))
        self._steps += 1
        self._place(starts)
        rewards = np.where(starts, 0.0, before_m - self._distances_m())
        terminations = self._distances_m() < REACHED_M
        is_outside = (np.abs(self._position_m) > HALF_FIELD_M).any(axis=1)
        truncations = ~terminations & (is_outside | (self._steps >= self._max_steps))
        self._is_done = terminations | truncations
        return self._observe(), rewards, terminations, truncations, self._infos()

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Last images, one of each robot."""
        return tuple(self._images.copy()) if self.render_mode == "rgb_array" else None

    def close_extras(self, **_: Any) -> None:
        """Free the GPU's memory."""
        self._renderer.close()
        self._stage.close()

    def _place(self, chosen: NDArray[np.bool_]) -> None:
        """Place some robots (n,) at random in the other half of the field."""
        count = int(chosen.sum())
        low_m, high_m = (-HALF_FIELD_M[0] + 0.4, -HALF_FIELD_M[1] + 0.4), (0.0, 1.4)
        self._position_m[chosen] = self.np_random.uniform(low_m, high_m, (count, 2))
        self._yaw_rad[chosen] = self.np_random.uniform(-np.pi, np.pi, count)
        self._steps[chosen] = 0
        self._is_done[chosen] = False

    def _drive(self, wheels_radps: NDArray[np.floating]) -> None:
        """Move along arcs: the exact solution for constant speeds of the wheels."""
        limit = MAX_WHEEL_SPEED_RADPS
        left, right = np.clip(wheels_radps, -limit, limit).T * WHEEL_RADIUS_M * STEP_S
        turn_rad, distance_m = (right - left) / TRACK_M, 0.5 * (left + right)
        chord_m = distance_m * np.sinc(0.5 * turn_rad / np.pi)
        heading_rad = self._yaw_rad + 0.5 * turn_rad
        self._position_m += chord_m[:, None] * np.stack(
            (np.cos(heading_rad), np.sin(heading_rad)), axis=1
        )
        self._yaw_rad += turn_rad

    def _observe(self) -> NDArray[np.uint8]:
        cos, sin = np.cos(self._yaw_rad), np.sin(self._yaw_rad)
        rotations = np.zeros((self.num_envs, 3, 3))
        rotations[:, 0, 0], rotations[:, 0, 1] = cos, -sin
        rotations[:, 1, 0], rotations[:, 1, 1] = sin, cos
        rotations[:, 2, 2] = 1.0
        positions_m = np.pad(self._position_m, ((0, 0), (0, 1)))
        poses = pose_from_rotation(rotations, positions_m)
        self._renderer.render_batch(poses, out=self._images)
        return self._images.copy() if self._copy else self._images

    def _distances_m(self) -> NDArray[np.float64]:
        return np.linalg.norm(self._position_m - GOAL_M, axis=1)

    def _infos(self) -> dict[str, Any]:
        """Distance to the goal, in Gymnasium's form: values, and a mask of those that have one."""
        has_one = np.ones(self.num_envs, np.bool_)
        return {"distance_m": self._distances_m(), "_distance_m": has_one}


def main() -> None:
    """Take random steps, and print what came of them."""
    envs = SoccerEnv()
    envs.action_space.seed(0)
    envs.reset(seed=0)
    total, episodes = 0.0, 0
    for _ in range(100):
        _, rewards, terminations, truncations, _ = envs.step(envs.action_space.sample())
        total += float(rewards.sum())
        episodes += int((terminations | truncations).sum())
    print(f"{envs.num_envs} robots, 100 steps: {total:.2f} m closer, {episodes} episodes ended")
    envs.close()


if __name__ == "__main__":
    main()
