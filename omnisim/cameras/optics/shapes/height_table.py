"""Coarse height table of a profile z(r), to find where rays may cross it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from omnisim.cameras.optics.shapes.shape import Floats

_STEPS = 1024


class HeightTable:
    """Heights of a profile at equal radial steps, to decide on which side of it points are.

    Args:
        sag_m: heights at given distances from the axis.
        radius_m: radius of the table's bounding box.
    """

    def __init__(self, sag_m: Callable[[Floats], Floats], radius_m: float):
        self._radius_m = radius_m
        self._heights = sag_m(np.linspace(0.0, radius_m, _STEPS + 1))
        self._steps = np.append(np.diff(self._heights), 0.0)
        margin = 1e-3 * (self._heights.max() - self._heights.min()) + 1e-9
        self._low, self._high = self._heights.min() - margin, self._heights.max() + margin

    def heights_above(self, origins_m: Floats, directions: Floats, lengths: Floats) -> Floats:
        """Heights above the surface at lengths (m, n) along rays (n, 3), interpolated linearly."""
        x, y, z = (origins_m[:, axis] + lengths * directions[:, axis] for axis in range(3))
        places = np.sqrt(x * x + y * y)
        places *= _STEPS / self._radius_m
        before = np.minimum(places.astype(np.intp), _STEPS)
        places -= before
        places *= self._steps.take(before)
        z -= self._heights.take(before)
        z -= places
        return z

    def span(self, origins_m: Floats, directions: Floats) -> tuple[Floats, Floats]:
        """Interval of lengths (n,) in which rays (n, 3) are inside the box; NaN: none."""
        low, high = self._low, self._high
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            square = np.sum(directions[:, :2] ** 2, axis=1)
            half = np.sum(directions[:, :2] * origins_m[:, :2], axis=1)
            rest = np.sum(origins_m[:, :2] ** 2, axis=1) - self._radius_m**2
            root = np.sqrt(half * half - square * rest)
            parallel = square == 0.0
            enter = np.where(parallel, np.where(rest <= 0.0, -np.inf, np.nan), -half - root)
            leave = np.where(parallel, np.where(rest <= 0.0, np.inf, np.nan), -half + root)
            enter, leave = (np.where(parallel, x, x / square) for x in (enter, leave))
            ends = (np.array([low, high]) - origins_m[:, 2:]) / directions[:, 2:]
            level = directions[:, 2] == 0.0
            between = (origins_m[:, 2] >= low) & (origins_m[:, 2] <= high)
            bottom = np.where(level, np.where(between, -np.inf, np.nan), ends.min(axis=1))
            top = np.where(level, np.where(between, np.inf, np.nan), ends.max(axis=1))
            near = np.maximum(np.maximum(enter, bottom), 0.0)
            return near, np.minimum(leave, top)
