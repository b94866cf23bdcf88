"""Cascades of directional lights: square regions of the scene, smaller ones near the viewpoint.

The largest region contains all static geometry. The others follow the viewpoint in whole texels,
so that shadow edges do not crawl, and so rarely that most frames reuse them.
Source: Engel, "Cascaded Shadow Maps", ShaderX5, 2006.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Half the width of a single map, meters: its texels are 12 mm.
_MAX_SINGLE_M = 24.0
_RATIO = 4.0  # between the widths of two cascades
MAX_CASCADES = 4
STEPS = 4  # of the viewpoint per half width
CELLS = 2 * STEPS  # grid cells per side of a cascade that follows the viewpoint
_BEYOND = 4.0  # half widths beyond the scene, for flying objects


class Cascades:
    """Cascades of one directional light.

    Args:
        axes: (3, 3) axes of the light: rows x, y and forward.
        boxes_m: (n, 2, 3), minimum and maximum corners of the static geometry, from the anchor.
        count: number of cascades, at most `MAX_CASCADES`.

    Attributes:
        axes: see the arguments.
        halves_m: half widths, ascending.
        depths_m: minimum and maximum z along the axes.
        depth_scale: half the largest width as a share of the depth.
    """

    def __init__(self, axes: NDArray[np.float64], boxes_m: NDArray[np.float64], count: int):
        self.axes = axes
        low_m, high_m = _extent_m(axes, boxes_m)
        self._middle_m = 0.5 * (low_m + high_m)[:2]
        half_m = _half_m(low_m, high_m)
        self.halves_m = tuple(half_m / _RATIO**level for level in reversed(range(count)))
        self._steps_m = np.array(self.halves_m)[:-1, None] / STEPS  # of those that follow
        depth_m = 2.0 * _BEYOND * half_m + 3.0 * float(high_m[2] - low_m[2])
        # a power of two, as a constant of the shaders
        self.depth_scale = 2.0 ** -math.ceil(math.log2(depth_m / half_m))
        near_m = 0.5 * float(low_m[2] + high_m[2] - half_m / self.depth_scale)
        self.depths_m = near_m, near_m + half_m / self.depth_scale

    def middles_m(self, viewpoint_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Centers (cascades, 2) along the axes, for a viewpoint (3,) relative to the anchor."""
        near: NDArray[np.float64] = self._steps(viewpoint_m) * self._steps_m
        return np.concatenate((near, self._middle_m[None]))

    def first_cells(self, viewpoint_m: NDArray[np.float64]) -> NDArray[np.intp]:
        """First grid cells (following, 2) of the cascades that follow a viewpoint (3,).

        Cells are a step wide; a cascade has `CELLS` per side. Cell 0 begins at the anchor.
        """
        return self._steps(viewpoint_m).astype(np.intp) - STEPS

    def _steps(self, viewpoint_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Centers (following, 2) of the cascades that follow a viewpoint, in steps."""
        return np.round(self.axes[:2] @ viewpoint_m / self._steps_m)


def cascade_count(axes: NDArray[np.float64], boxes_m: NDArray[np.float64]) -> int:
    """Number of cascades that a light needs."""
    half_m, count = _half_m(*_extent_m(axes, boxes_m)), 1
    while half_m > _MAX_SINGLE_M and count < MAX_CASCADES:
        half_m /= _RATIO
        count += 1
    return count


def _extent_m(
    axes: NDArray[np.float64], boxes_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Minimum and maximum coordinates (3,) of boxes (n, 2, 3) along axes."""
    if not len(boxes_m):
        return np.zeros(3), np.zeros(3)
    centers = boxes_m.mean(axis=1) @ axes.T
    extents = 0.5 * (boxes_m[:, 1] - boxes_m[:, 0]) @ np.abs(axes).T
    return (centers - extents).min(axis=0), (centers + extents).max(axis=0)


def _half_m(low_m: NDArray[np.float64], high_m: NDArray[np.float64]) -> float:
    return max(0.5 * float((high_m - low_m)[:2].max()), 0.01) * 1.01
