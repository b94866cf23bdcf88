"""Motion of a body: its pose, velocity and angular rate at any time.

All sensors of a robot use the same motion: images and their shutters, lidars, IMUs, odometry and
ground truth. If a plan made the drive, the plan is the motion (`omnisim.robots.motion_profile`);
otherwise it is a spline through poses, `SplineMotion`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
import scipy  # its submodules load on first use

from omnisim.core.arrays import Floats
from omnisim.core.poses import pose_from_rotation
from omnisim.core.trajectories.trajectory import Trajectory


class MotionStates(NamedTuple):
    """States of a body at given times."""

    world_from_base: Floats  # (n, 4, 4) poses
    velocity_mps: Floats  # (n, 3) velocity of the base's origin, world
    # (n, 3) acceleration of the base's origin, world; one-sided where it jumps
    acceleration_mps2: Floats
    angular_rate_radps: Floats  # (n, 3) angular rate, base

    def at_mount(self, base_from_mount: Floats) -> MotionStates:
        """States of a frame mounted on the body at `base_from_mount` (4, 4).

        The acceleration lacks the lever-arm part, which jumps with the angular acceleration.
        """
        lever_m = base_from_mount[:3, 3]
        swing = np.cross(self.angular_rate_radps, lever_m)
        rotations = self.world_from_base[:, :3, :3]
        return MotionStates(
            self.world_from_base @ base_from_mount,
            self.velocity_mps + np.einsum("nij,nj->ni", rotations, swing),
            self.acceleration_mps2,
            self.angular_rate_radps @ base_from_mount[:3, :3],
        )


class BodyMotion(ABC):
    """Motion of a body from start to end; before and after, the body rests."""

    # start_s, end_s: first and last time
    start_s: float
    end_s: float

    def at(self, times_s: Floats) -> MotionStates:
        """States at times (n,)."""
        times = np.asarray(times_s, dtype=np.float64)
        states = self._states(np.clip(times, self.start_s, self.end_s))
        moves = ((times >= self.start_s) & (times <= self.end_s))[:, None]
        rates = (np.where(moves, rate, 0.0) for rate in states[1:])
        return MotionStates(states.world_from_base, *rates)

    def pose_at(self, time_s: float) -> Floats:
        """Pose (4, 4) at a time."""
        return self.at(np.array([time_s])).world_from_base[0]

    @abstractmethod
    def _states(self, times_s: Floats) -> MotionStates:
        """States at times (n,) between start and end."""


# Smooth motion through poses: cubic splines, clamped at both ends and wherever the body rests.
#
# The velocity at an end is that of a parabola, with constant acceleration, through the three
# outermost poses. A recording that begins at rest therefore begins at rest here, and one that
# begins in motion does not brake first. A step without motion is rest: the motion on either side
# ends there with zero velocity and does not overshoot. Positions and rotations are separate: a
# body that turns on the spot stays in place.
#
# Source: de Boor, "A Practical Guide to Splines" (1978): clamped cubic splines. Rotations are
# cubic in the rotation vector from each pose to the next, with continuous rates: Kang and Park,
# "Cubic spline algorithms for orientation interpolation", IJNME 46 (1999), without its iteration.


REST = 1e-8  # meters and radians per step: files print nine digits
SMALL_RAD = 1e-4  # below it, power series of angles are exact up to rounding


class SplineMotion(BodyMotion):
    """Smooth motion through the poses of a trajectory.

    Args:
        trajectory: poses and times; a single pose is at rest.
        from_rest: True if the motion begins and ends at rest, whatever the poses suggest.
    """

    def __init__(self, trajectory: Trajectory, from_rest: bool = False):
        self.start_s, self.end_s = trajectory.times_s[[0, -1]].tolist()
        times, poses = trajectory.times_s - self.start_s, trajectory.world_from_base
        if len(times) == 1:
            times, poses = np.array([0.0, 1.0]), np.repeat(poses, 2, axis=0)
        positions, self._rotations = poses[:, :3, 3], poses[:, :3, :3]
        changes = np.swapaxes(self._rotations[:-1], 1, 2) @ self._rotations[1:]
        vectors = scipy.spatial.transform.Rotation.from_matrix(changes).as_rotvec()
        turned = np.concatenate((np.zeros((1, 3)), np.cumsum(vectors, axis=0)))
        slopes = _slopes(times, positions, from_rest)
        self._position = scipy.interpolate.CubicHermiteSpline(times, positions, slopes)
        self._rotation = _rotation_vectors(times, vectors, _slopes(times, turned, from_rest))

    def _states(self, times_s: Floats) -> MotionStates:
        times = times_s - self.start_s
        last = len(self._rotations) - 2
        step = np.clip(np.searchsorted(self._rotation.x, times, side="right") - 1, 0, last)
        vectors = self._rotation(times)
        turned = scipy.spatial.transform.Rotation.from_rotvec(vectors).as_matrix()
        return MotionStates(
            pose_from_rotation(self._rotations[step] @ turned, self._position(times)),
            self._position(times, 1),
            self._position(times, 2),
            _body_rates(vectors, self._rotation(times, 1)),
        )


def _slopes(times_s: Floats, values: Floats, from_rest: bool) -> Floats:
    """Slopes (n, 3) of clamped splines through values (n, 3), 0 at both ends of each rest."""
    slopes = np.zeros_like(values)
    last = len(values) - 1
    moves = np.linalg.norm(np.diff(values, axis=0), axis=1) > REST
    edges = np.flatnonzero(np.diff(np.concatenate(((False,), moves, (False,))).astype(np.int8)))
    for first, end in edges.reshape(-1, 2).tolist():  # of each run of moving steps
        part = slice(first, end + 1)
        times, own = times_s[part], values[part]
        begin, finish = np.zeros(3), np.zeros(3)
        if first == 0 and not from_rest:
            begin = _end_slope(times, own)
        if end == last and not from_rest:
            finish = -_end_slope(-times[::-1], own[::-1])
        spline = scipy.interpolate.CubicSpline(times, own, bc_type=((1, begin), (1, finish)))
        slopes[part] = spline(times, 1)
        slopes[[first, end]] = begin, finish  # exact to the last bit
    return slopes


def _end_slope(times_s: Floats, values: Floats) -> Floats:
    """Slope (3,) at the first of values (n, 3); 0 if it would point away from the next value."""
    chords = np.diff(values[:3], axis=0) / np.diff(times_s[:3])[:, None]
    if len(chords) == 1:
        return chords[0]
    first_s, both_s = times_s[1] - times_s[0], times_s[2] - times_s[0]
    slope: Floats = chords[0] - (chords[1] - chords[0]) * first_s / both_s
    return slope if slope @ chords[0] > 0.0 else np.zeros(3)


def _rotation_vectors(times_s: Floats, vectors: Floats, rates: Floats) -> scipy.interpolate.PPoly:
    """Rotation vectors relative to the previous pose, as cubics of time.

    They are made from the poses' times (n,), the vectors (n − 1, 3) from each pose to the next, and
    the angular rates (n, 3) at the poses, body.
    """
    steps_s = np.diff(times_s)[:, None]
    begin, finish = rates[:-1], _vector_rates(vectors, rates[1:])
    cubic = (begin + finish - 2.0 * vectors / steps_s) / steps_s**2
    square = (3.0 * vectors / steps_s - 2.0 * begin - finish) / steps_s
    parts = np.stack((cubic, square, begin, np.zeros_like(vectors)))
    return scipy.interpolate.PPoly(parts, times_s)


def _body_rates(vectors: Floats, slopes: Floats) -> Floats:
    """Angular rates (n, 3), body, of rotation vectors (n, 3) with slopes (n, 3)."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    square = np.maximum(angle, SMALL_RAD) ** 2
    cosine = np.where(angle < SMALL_RAD, 0.5, (1.0 - np.cos(angle)) / square)
    sine = (np.maximum(angle, SMALL_RAD) - np.sin(np.maximum(angle, SMALL_RAD))) / square**1.5
    once = np.cross(vectors, slopes)
    return slopes - cosine * once + sine * np.cross(vectors, once)


def _vector_rates(vectors: Floats, rates: Floats) -> Floats:
    """Slopes (n, 3) of rotation vectors (n, 3) with angular rates (n, 3), body."""
    angle = np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), SMALL_RAD)
    twice = 1.0 / angle**2 - 1.0 / (2.0 * angle * np.tan(0.5 * angle))
    once = np.cross(vectors, rates)
    return rates + 0.5 * once + twice * np.cross(vectors, once)
