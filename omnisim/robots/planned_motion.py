"""Planned motion in closed form: legs and turns on the spot with trapezoidal speed profiles.

Acceleration jumps at the corners of a trapezoid; speed and turn rate are continuous. Every segment
starts and ends at rest.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import pose_from_rotation, rotation_from_yaw
from omnisim.core.trajectories.body_motion import BodyMotion, MotionStates
from omnisim.core.trajectories.spline_motion import SplineMotion

FloatOrArray = TypeVar("FloatOrArray", float, NDArray[np.float64])


@dataclass(frozen=True)
class Trapezoid(Generic[FloatOrArray]):
    """Trapezoidal speed profile from rest to rest, of one motion or of (n,) motions.

    Attributes:
        amount: distance in meters or angle in radians, above 0.
        top_rate: maximum rate, reached if the amount suffices.
        acceleration: magnitude while accelerating and braking.
    """

    amount: FloatOrArray
    top_rate: FloatOrArray
    acceleration: FloatOrArray

    @property
    def ramp_s(self) -> FloatOrArray:
        """Time to accelerate, which equals the time to brake."""
        a = self.acceleration
        return np.minimum(self.top_rate / a, np.sqrt(self.amount / a))

    @property
    def duration_s(self) -> FloatOrArray:
        """Time from rest to rest."""
        # the two ramps together cover what one ramp's time at the top rate would
        return self.ramp_s + self.amount / (self.acceleration * self.ramp_s)

    def amounts_at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances or angles (n,) at times (n,) since the start."""
        ramp, a = self.ramp_s, self.acceleration
        left = self.duration_s - times_s
        cruising = a * ramp * (times_s - 0.5 * ramp)
        braking = self.amount - 0.5 * a * left * left
        speeding = 0.5 * a * times_s * times_s
        return np.where(times_s < ramp, speeding, np.where(left < ramp, braking, cruising))

    def rates_at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rates (n,) at times (n,) since the start."""
        a = self.acceleration
        left = self.duration_s - times_s
        return a * np.minimum(np.minimum(times_s, left), self.ramp_s)

    def accelerations_at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Accelerations (n,) at times (n,) since the start."""
        ramp, a = self.ramp_s, self.acceleration
        left = self.duration_s - times_s
        return np.where(times_s < ramp, a, np.where(left < ramp, -a, 0.0))

    def times_at(self, amounts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times (n,) at distances or angles (n,): the inverse of `amounts_at`."""
        ramp, a = self.ramp_s, self.acceleration
        ramp_amount = 0.5 * a * ramp * ramp
        left = np.maximum(self.amount - amounts, 0.0)
        cruising = amounts / (a * ramp) + 0.5 * ramp
        braking = self.duration_s - np.sqrt(2.0 * left / a)
        speeding = np.sqrt(2.0 * amounts / a)
        return np.where(
            amounts < ramp_amount, speeding, np.where(left < ramp_amount, braking, cruising)
        )


@dataclass(frozen=True)
class Segment:
    """Leg or turn on the spot, from rest to rest.

    Attributes:
        start: x and y in meters, yaw in radians.
        move_m: displacement of a leg; (0, 0) for a turn.
        turn_rad: angle of a turn; 0 for a leg.
        top_rate, acceleration: limits of its speed or turn rate.
        start_s: start time.
        stretch: duration relative to the time-optimal one.
        way: poses over meters or radians on an uneven floor; None: straight, or about z.
    """

    start: tuple[float, float, float]
    move_m: tuple[float, float]
    turn_rad: float
    top_rate: float
    acceleration: float
    start_s: float = 0.0
    stretch: float = 1.0
    way: SplineMotion | None = None

    @property
    def planar_amount(self) -> float:
        """Meters or radians in the floor plan."""
        return math.hypot(*self.move_m) or abs(self.turn_rad)

    @property
    def amount(self) -> float:
        """Meters or radians along the actual motion, slopes included."""
        return self.planar_amount if self.way is None else self.way.end_s

    @property
    def trapezoid(self) -> Trapezoid[float]:
        """Speed profile before stretching."""
        return Trapezoid(self.amount, self.top_rate, self.acceleration)

    @property
    def duration_s(self) -> float:
        """Time from rest to rest."""
        return self.stretch * self.trapezoid.duration_s

    def poses_at(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """x, y, yaw (n, 3) at fractions (n,) of the motion in the floor plan."""
        change = np.array((*self.move_m, self.turn_rad))
        return np.array(self.start) + shares[:, None] * change


class PlannedMotion(BodyMotion):
    """Motion along consecutive segments.

    Args:
        segments: segments; each starts at the end pose and end time of the previous one.
        height_m: height of the base in segments without a `way`.
    """

    def __init__(self, segments: Sequence[Segment], height_m: float = 0.0):
        self.segments, self._height_m = tuple(segments), height_m
        self._starts_s = np.array([one.start_s for one in segments])
        self._stretch = np.array([one.stretch for one in segments])
        columns = [(one.amount, one.top_rate, one.acceleration) for one in segments]
        self._trapezoids = np.array(columns).T
        self._planar = np.array([(*one.start, *one.move_m, one.turn_rad) for one in segments])
        self._is_uneven = np.array([one.way is not None for one in segments])
        self.start_s = segments[0].start_s
        self.end_s = segments[-1].start_s + segments[-1].duration_s

    def at_height(self, height_m: float) -> PlannedMotion:
        """Copy of the motion with the base at another height on an even floor."""
        return PlannedMotion(self.segments, height_m)

    def _states(self, times_s: NDArray[np.float64]) -> MotionStates:
        last = len(self.segments) - 1
        index = np.clip(np.searchsorted(self._starts_s, times_s, side="right") - 1, 0, last)
        stretch = self._stretch[index]
        times = (times_s - self._starts_s[index]) / stretch
        law = Trapezoid(*self._trapezoids[:, index])
        times = np.clip(times, 0.0, law.duration_s)
        rates, accelerations = law.rates_at(times), law.accelerations_at(times)
        states = self._even(
            index, law.amount, law.amounts_at(times), rates / stretch, accelerations / stretch**2
        )
        for number in np.unique(index[self._is_uneven[index]]).tolist():
            own = index == number
            part = Trapezoid(law.amount[own], law.top_rate[own], law.acceleration[own])
            way = self.segments[number].way
            assert way is not None
            moved = way.at(np.clip(part.amounts_at(times[own]), 0.0, way.end_s))
            rate = (rates / stretch)[own, None]
            acceleration = (accelerations / stretch**2)[own, None]
            states.world_from_base[own] = moved.world_from_base
            states.velocity_mps[own] = moved.velocity_mps * rate
            states.acceleration_mps2[own] = (
                moved.acceleration_mps2 * rate**2 + moved.velocity_mps * acceleration
            )
            states.angular_rate_radps[own] = moved.angular_rate_radps * rate
        return states

    def _even(
        self,
        index: NDArray[np.intp],
        amount: NDArray[np.float64],
        amounts: NDArray[np.float64],
        rates: NDArray[np.float64],
        accelerations: NDArray[np.float64],
    ) -> MotionStates:
        """States (n,) on an even floor: straight, or about z."""
        start, change = self._planar[index, :3], self._planar[index, 3:]
        planar = start + (amounts / amount)[:, None] * change
        per_amount = change / amount[:, None]
        height_m = np.full(len(index), self._height_m)
        positions = np.column_stack((planar[:, :2], height_m))
        turn_rates = np.zeros((len(index), 3))
        turn_rates[:, 2] = per_amount[:, 2] * rates
        ahead = np.column_stack((per_amount[:, :2], np.zeros(len(index))))
        return MotionStates(
            pose_from_rotation(rotation_from_yaw(planar[:, 2]), positions),
            ahead * rates[:, None],
            ahead * accelerations[:, None],
            turn_rates,
        )


def in_sequence(segments: Sequence[Segment]) -> list[Segment]:
    """Chain segments in time: each starts when the previous one ends, the first at 0 s."""
    timed: list[Segment] = []
    start_s = 0.0
    for one in segments:
        timed.append(dataclasses.replace(one, start_s=start_s))
        start_s += one.duration_s
    return timed
