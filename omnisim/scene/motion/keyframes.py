"""Keyframe interpolation: stepwise, linear, or along cubic splines."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
# Exporters write constant values with float32 noise.
_NOISE = 1e-6


class Interpolation(Enum):
    """Interpolation modes of glTF."""

    STEP = "STEP"
    LINEAR = "LINEAR"
    CUBIC_SPLINE = "CUBICSPLINE"


@dataclass(frozen=True, eq=False)
class Keyframes:
    """Values over time; the first and the last value hold outside the time range.

    Attributes:
        times_s: (n,) non-decreasing times.
        values: (n, k), or (n, m, k) for m tracks; rotations are quaternions (x, y, z, w).
        interpolation: interpolation mode between two times.
        in_tangents, out_tangents: tangents of cubic splines, shaped like `values`, per second.
        are_rotations: True for quaternions, which are interpolated along the shorter arc.

    Source: glTF 2.0, appendix C.
    """

    times_s: Values
    values: Values
    interpolation: Interpolation = Interpolation.LINEAR
    in_tangents: Values | None = None
    out_tangents: Values | None = None
    are_rotations: bool = False

    @property
    def is_constant(self) -> bool:
        """True if the values are constant up to float32 noise."""
        noise = _NOISE * float(np.abs(self.values).max())
        tangents = [one for one in (self.in_tangents, self.out_tangents) if one is not None]
        duration_s = float(self.times_s[-1] - self.times_s[0])
        return bool(np.ptp(self.values, axis=0).max() <= noise) and all(
            float(np.abs(one).max()) * duration_s <= noise for one in tangents
        )

    def at(self, time_s: float) -> Values:
        """Value (k,) or values (m, k) at a time; quaternions may be unnormalized."""
        times_s = self.times_s
        last = int(np.searchsorted(times_s, time_s, side="right")) - 1
        if last < 0 or last + 1 == len(times_s) or self.interpolation is Interpolation.STEP:
            value: Values = self.values[max(last, 0)]
            return value
        step_s = float(times_s[last + 1] - times_s[last])
        share = (time_s - float(times_s[last])) / step_s
        if self.interpolation is Interpolation.CUBIC_SPLINE:
            return self._along_spline(last, share, step_s)
        first, second = self.values[last], self.values[last + 1]
        if self.are_rotations:
            return (
                _slerp(first, second, share) if first.ndim == 1 else _slerps(first, second, share)
            )
        straight: Values = first + share * (second - first)
        return straight

    def _along_spline(self, last: int, t: float, step_s: float) -> Values:
        assert self.in_tangents is not None
        assert self.out_tangents is not None
        t2, t3 = t * t, t * t * t
        value: Values = (
            (2.0 * t3 - 3.0 * t2 + 1.0) * self.values[last]
            + step_s * (t3 - 2.0 * t2 + t) * self.out_tangents[last]
            + (3.0 * t2 - 2.0 * t3) * self.values[last + 1]
            + step_s * (t3 - t2) * self.in_tangents[last + 1]
        )
        return value


def _slerp(first: Values, second: Values, share: float) -> Values:
    """Unit quaternion (4,) interpolated by a share of the shorter arc between two."""
    first, second = first / np.linalg.norm(first), second / np.linalg.norm(second)
    cosine = float(first @ second)
    if cosine < 0.0:  # a quaternion and its negative are the same rotation
        second, cosine = -second, -cosine
    angle = 2.0 * math.atan2(
        float(np.linalg.norm(second - first)), float(np.linalg.norm(second + first))
    )
    if angle == 0.0:
        return first
    turned: Values = (
        math.sin((1.0 - share) * angle) * first + math.sin(share * angle) * second
    ) / math.sin(angle)
    return turned


def _slerps(first: Values, second: Values, share: float) -> Values:
    """Unit quaternions (m, 4) interpolated by a share of the shorter arc between each pair."""
    first, second = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in (first, second))
    second = np.where(np.einsum("mk,mk->m", first, second)[:, None] < 0.0, -second, second)
    lengths = np.linalg.norm(second - first, axis=1), np.linalg.norm(second + first, axis=1)
    angles = 2.0 * np.arctan2(*lengths)[:, None]
    sines = np.where(angles == 0.0, 1.0, np.sin(angles))
    turned: Values = (
        np.sin((1.0 - share) * angles) * first + np.sin(share * angles) * second
    ) / sines
    return np.where(angles == 0.0, first, turned)
