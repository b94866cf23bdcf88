"""Motions of a scene's dynamic objects: poses as functions of world time.

All motions are in the world frame. Angles are counter-clockwise, seen from above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Protocol

import numpy as np
from pydantic import AfterValidator, Field

from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import AboveZero, Number, Parameters, Point
from omnisim.core.poses import pose_from_rotation, rotation_from_yaw, rotation_type
from omnisim.core.world import Pose

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.core.trajectories import Trajectory

Vector = tuple[float, float, float]


class ObjectMotion(Protocol):
    """Motion of an object: its pose as a function of time."""

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4) at a time in seconds."""
        ...


@dataclass(frozen=True)
class Rest:
    """Static pose."""

    position_m: Point = (0.0, 0.0, 0.0)
    """Position of a static object's origin in the world, m. Default: the world's origin."""
    yaw_deg: Number = 0.0
    """Heading of a static object, degrees. Default: 0."""

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4), the same at all times."""
        return pose_from_rotation(rotation_from_yaw(math.radians(self.yaw_deg)), self.position_m)


@dataclass(frozen=True)
class FreeBody(Rest):
    """Static pose of a body that physics can push."""

    mass_kg: Annotated[Number, Field(ge=1e-3, le=1e6)] = 1.0
    """Mass, kg, of a static object that robots can push with `--physics`. Default: immovable."""


@dataclass(frozen=True, eq=False)
class Along:
    """Motion along a trajectory, at rest before and after it."""

    trajectory: Trajectory  # poses of the object over time
    repeats: bool = False  # restart the motion at its end

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4), interpolated linearly in position and evenly in rotation."""
        times_s = self.trajectory.times_s
        if self.repeats and len(times_s) > 1:
            time_s = times_s[0] + (time_s - times_s[0]) % (times_s[-1] - times_s[0])
        return self.trajectory.pose_at(time_s)


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("expected a number other than 0")
    return value


@dataclass(frozen=True)
class Orbit(Parameters, name="orbit"):
    """Motion on a horizontal circle at constant speed, facing forward."""

    center_m: Point
    """Center of the circle in the world, m."""
    radius_m: AboveZero
    """Radius of the circle, m."""
    period_s: Annotated[Number, AfterValidator(_not_zero)]
    """Duration of one turn, s; negative: clockwise."""
    start_deg: Number = 0.0
    """Direction from the center at 0 s, degrees from the world's x."""

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4) on the circle at a time."""
        angle = self.angle_at(time_s)
        offset_m = self.radius_m * np.array([math.cos(angle), math.sin(angle), 0.0])
        yaw = angle + math.copysign(0.5 * math.pi, self.period_s)
        return pose_from_rotation(rotation_from_yaw(yaw), np.array(self.center_m) + offset_m)

    def angle_at(self, time_s: float) -> float:
        """Direction from the center, radians, accumulated over turns."""
        return math.radians(self.start_deg) + 2.0 * math.pi * time_s / self.period_s


@dataclass(frozen=True)
class Shuttle(Parameters, name="shuttle"):
    """Back-and-forth motion between two points, slow at both ends: half a cosine each way."""

    from_m: Point
    """Start point at 0 s in the world, m."""
    to_m: Point
    """Other end, which the object faces."""
    period_s: AboveZero
    """Duration of a round trip, s."""

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4) on the straight path at a time."""
        start, way = np.array(self.from_m), np.subtract(self.to_m, self.from_m)
        yaw = math.atan2(way[1], way[0])
        return pose_from_rotation(rotation_from_yaw(yaw), start + self.share_at(time_s) * way)

    def share_at(self, time_s: float) -> float:
        """Fraction of the path covered from the first end to the second."""
        return 0.5 - 0.5 * math.cos(2.0 * math.pi * time_s / self.period_s)


@dataclass(frozen=True, eq=False)
class Rolling:
    """Motion of a ball that rolls on level ground without slipping.

    The rotation axis is horizontal and perpendicular to the path, without spin about the vertical.
    """

    motion: Along | Orbit | Shuttle  # motion of the ball's center
    radius_m: float  # radius of the ball

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4) with the motion's position and the ball's rotation."""
        rolled: Pose = self.motion.pose_at(time_s)
        rolled[:3, :3] = self._rotation_at(time_s)
        return rolled

    def _rotation_at(self, time_s: float) -> Floats:
        motion = self.motion
        if isinstance(motion, Shuttle):
            way = np.subtract(motion.to_m, motion.from_m)
            return _rotation(_axis(way, self.radius_m) * motion.share_at(time_s))
        if isinstance(motion, Orbit):
            # in a frame that rotates with the ball about the center, both rates are constant
            turned = motion.angle_at(time_s) - motion.angle_at(0.0)
            rolled_rad = -turned * motion.radius_m / self.radius_m
            start = rotation_from_yaw(motion.angle_at(0.0))
            in_turning = _rotation(np.array([rolled_rad, 0.0, -turned]))
            return rotation_from_yaw(motion.angle_at(time_s)) @ in_turning @ start.T
        trajectory, laps = motion.trajectory, 0
        times_s, positions_m = trajectory.times_s, trajectory.positions_m
        if motion.repeats and len(times_s) > 1:
            laps, time_s = divmod(time_s - times_s[0], times_s[-1] - times_s[0])
            time_s += times_s[0]
        step = int(np.clip(np.searchsorted(times_s, time_s, side="right") - 1, 0, len(times_s) - 1))
        part_m = motion.trajectory.pose_at(time_s)[:3, 3] - positions_m[step]
        rotation: Floats = _rotation(_axis(part_m, self.radius_m)) @ self._legs[step]
        if laps:
            lap = rotation_type().from_matrix(self._legs[-1])
            rotation = rotation @ _rotation(laps * lap.as_rotvec())
        return rotation

    @cached_property
    def _legs(self) -> list[Floats]:
        """Rotations (3, 3) of the ball at the trajectory's poses."""
        assert isinstance(self.motion, Along)
        rotations = [np.eye(3)]
        for leg_m in np.diff(self.motion.trajectory.positions_m, axis=0):
            rotations.append(_rotation(_axis(leg_m, self.radius_m)) @ rotations[-1])
        return rotations


def _axis(way_m: Floats, radius_m: float) -> Floats:
    """Rotation vector (3,) of a ball that rolls along a horizontal displacement (3,)."""
    return np.array([-way_m[1], way_m[0], 0.0]) / radius_m


def _rotation(vector: Floats) -> Floats:
    return rotation_type().from_rotvec(vector).as_matrix()
