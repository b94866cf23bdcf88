"""Trajectory of the robot's base: poses and times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats, Indices
from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import (
    MAX_M,
    interpolate_pose,
    is_pose,
    pose_from_rotation,
    rotation_from_yaw,
    yaw_from_rotation,
)
from omnisim.core.short_repr import counted, short_repr

MAX_S = 1e12  # about 30 000 years: a larger timestamp is in another unit


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses in temporal order. The arrays are read-only copies.

    Raises:
        TrajectoryError: shapes do not match, there is no pose, a value is not finite, times do not
            increase, or a pose scales or mirrors; names the first such pose.
    """

    times_s: Floats  # (n,) times, n ≥ 1, strictly increasing
    world_from_base: Floats  # (n, 4, 4) poses

    def __post_init__(self) -> None:
        times = np.array(self.times_s, dtype=np.float64)
        poses = np.array(self.world_from_base, dtype=np.float64)
        if times.ndim != 1 or poses.shape != (len(times), 4, 4):
            raise TrajectoryError(
                f"trajectory: expected times (n,) and poses (n, 4, 4), got {times.shape} and "
                f"{poses.shape}"
            )
        if not len(times):
            raise TrajectoryError("trajectory: no pose: expected at least one")
        finite = np.abs(times) < MAX_S
        if not np.all(finite):
            k = np.argmin(finite)
            raise TrajectoryError(f"trajectory: time {k} is {times[k]:g} s: expected a finite time")
        later = np.diff(times) > 0.0
        if not np.all(later):
            k = np.argmin(later)
            raise TrajectoryError(
                f"trajectory: time {k + 1}, {times[k + 1]:.9g} s, is not after "
                f"time {k}, {times[k]:.9g} s: expected times that increase"
            )
        check_poses(poses)
        for name, values in (("times_s", times), ("world_from_base", poses)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @classmethod
    def on_ground(
        cls, times_s: ArrayLike, positions_m: ArrayLike, yaw_rad: ArrayLike
    ) -> Trajectory:
        """Build a level trajectory at z = 0.

        Args:
            times_s: (n,) times.
            positions_m: (n, 2), x and y in the world.
            yaw_rad: (n,) headings.

        Raises:
            TrajectoryError: for the same reasons as the constructor.
        """
        return cls(np.asarray(times_s, dtype=np.float64), poses_on_ground(positions_m, yaw_rad))

    def __repr__(self) -> str:
        poses = counted(len(self), "pose")
        return short_repr(self, poses, f"{self.path_length_m:.4g} m", f"{self.duration_s:.4g} s")

    def __len__(self) -> int:
        return len(self.times_s)

    @property
    def positions_m(self) -> Floats:
        """Positions (n, 3) of the base in the world."""
        return self.world_from_base[:, :3, 3]

    @property
    def yaw_rad(self) -> Floats:
        """Headings (n,) on the ground, within ±π; `np.unwrap` makes them continuous."""
        return yaw_from_rotation(self.world_from_base)

    def pose_at(self, time_s: float) -> Floats:
        """Interpolate the pose (4, 4) at a time; constant before the first and after the last one.

        For straight legs and turns on the spot, linear interpolation is the true path.
        """
        times, poses = self.times_s, self.world_from_base
        step = int(np.searchsorted(times, time_s, side="right")) - 1
        if not 0 <= step < len(times) - 1:
            return np.array(poses[0 if step < 0 else -1])
        share = float((time_s - times[step]) / (times[step + 1] - times[step]))
        if share == 0.0:
            return np.array(poses[step])
        return interpolate_pose(poses[step], poses[step + 1], share)

    @property
    def step_lengths_m(self) -> Floats:
        """Straight distances (n − 1,) between successive poses."""
        return step_lengths_m(self.world_from_base)

    @property
    def path_length_m(self) -> float:
        """Sum of the step lengths."""
        return float(np.sum(self.step_lengths_m))

    @property
    def duration_s(self) -> float:
        """Time from the first pose to the last."""
        return float(self.times_s[-1] - self.times_s[0])

    def jumps(self, limit_m: float, max_speed_mps: float | None = None) -> Indices:
        """Indices k (jumps,) of steps, from pose k to k + 1, that are too long or too fast."""
        lengths = self.step_lengths_m
        far = lengths > limit_m
        if max_speed_mps is not None:
            far |= lengths > max_speed_mps * np.diff(self.times_s)
        return np.flatnonzero(far)


def check_continuous(
    trajectory: Trajectory,
    limit_m: float,
    source: str,
    max_speed_mps: float | None = None,
    lines: ArrayLike | None = None,
) -> None:
    """Reject a trajectory with steps that are too long, or too fast on average.

    The limit of the length may be infinite; None: any speed. `source` names the trajectory in
    messages, and `lines` (n,) are those of its poses in the file, if there is one.

    Raises:
        TrajectoryError: the trajectory jumps; names the first jump, its size and the limit.
    """
    jumps = trajectory.jumps(limit_m, max_speed_mps)
    if not len(jumps):
        return
    k = int(jumps[0])
    length_m = float(trajectory.step_lengths_m[k])
    duration_s = float(trajectory.times_s[k + 1] - trajectory.times_s[k])
    where = f"{source}: " if lines is None else f"{source}:{np.asarray(lines)[k + 1]}: "
    allowed = f"{limit_m:g} m" if length_m > limit_m else f"{max_speed_mps:g} m/s"
    raise TrajectoryError(
        f"{where}step {k} → {k + 1}: {length_m:g} m in {duration_s:g} s: expected at most {allowed}"
    )


def poses_on_ground(positions_m: ArrayLike, yaw_rad: ArrayLike) -> Floats:
    """Level poses (n, 4, 4) world_from_base at z = 0, from positions (n, 2) and headings (n,).

    Raises:
        TrajectoryError: the shapes do not match, or a heading is not finite.
    """
    positions = np.asarray(positions_m, dtype=np.float64)
    yaw = np.asarray(yaw_rad, dtype=np.float64)
    if yaw.ndim != 1 or positions.shape != (len(yaw), 2):
        raise TrajectoryError(
            f"trajectory: expected positions (n, 2) and headings (n,), got {positions.shape} and "
            f"{yaw.shape}"
        )
    if not np.all(np.abs(yaw) < MAX_M):  # also rejects NaN
        raise TrajectoryError("trajectory: expected headings that are finite numbers in radians")
    level = np.column_stack((positions, np.zeros(len(yaw))))
    return pose_from_rotation(rotation_from_yaw(yaw), level)


def step_lengths_m(world_from_base: Floats) -> Floats:
    """Straight distances (n − 1,) between the origins of successive poses (n, 4, 4)."""
    steps = np.diff(world_from_base[:, :3, 3], axis=0)
    return np.linalg.norm(steps, axis=-1)


def check_poses(poses: Floats) -> None:
    """Reject poses (n, 4, 4) that are not rotations and translations.

    Raises:
        TrajectoryError: a pose is invalid; names the first.
    """
    finite = np.all(np.abs(poses) < MAX_M, axis=(1, 2))  # also rejects NaN
    if not np.all(finite):
        raise TrajectoryError(f"trajectory: pose {np.argmin(finite)}: expected finite numbers")
    proper = is_pose(poses)
    if not np.all(proper):
        raise TrajectoryError(
            f"trajectory: pose {np.argmin(proper)}: "
            "expected a rotation and a translation, no scale, no mirroring"
        )
