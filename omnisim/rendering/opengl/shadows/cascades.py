"""Cascades of directional lights: square parts of the scene, smaller ones around the viewpoint.

The largest has all that is static. Those around the viewpoint move in whole steps of the texels,
so that edges of shadows do not crawl, and so seldom that most frames find them drawn.
Source: Engel, "Cascaded Shadow Maps", ShaderX5, 2006.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Half the width of a single map, meters: its texels are 12 mm then.
_LARGEST_SINGLE_M = 24.0
_RATIO = 4.0  # of widths
MAX_CASCADES = 4
STEPS = 4  # of the viewpoint in half the width
_BEYOND = 4.0  # half widths beyond the scene, for what flies above it


class Cascades:
    """Cascades of one directional light.

    Args:
        axes: (3, 3) of the light, rows x, y and forward.
        boxes_m: (n, 2, 3), smallest and largest corners of what is static, from the anchor.
        count: cascades, at most `MAX_CASCADES`.

    Attributes:
        axes: as given.
        halves_m: half their widths, small to large.
        depths_m: nearest and farthest z along the axes.
        depth_scale: half the largest width as a share of the depth.
    """

    def __init__(self, axes: NDArray[np.float64], boxes_m: NDArray[np.float64], count: int):
        self.axes = axes
        low_m, high_m = _extent_m(axes, boxes_m)
        self._middle_m = 0.5 * (low_m + high_m)[:2]
        half_m = _half_m(low_m, high_m)
        self.halves_m = tuple(half_m / _RATIO**level for level in reversed(range(count)))
        depth_m = 2.0 * _BEYOND * half_m + 3.0 * float(high_m[2] - low_m[2])
        # a power of two, as shaders are compiled with it
        self.depth_scale = 2.0 ** -math.ceil(math.log2(depth_m / half_m))
        near_m = 0.5 * float(low_m[2] + high_m[2] - half_m / self.depth_scale)
        self.depths_m = near_m, near_m + half_m / self.depth_scale

    def middles_m(self, viewpoint_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Middles (cascades, 2) along the axes, for a viewpoint (3,) from the anchor."""
        steps_m = np.array(self.halves_m)[:-1, None] / STEPS
        at_m = self.axes[:2] @ viewpoint_m
        near: NDArray[np.float64] = np.round(at_m / steps_m) * steps_m
        return np.concatenate((near, self._middle_m[None]))


def cascade_count(axes: NDArray[np.float64], boxes_m: NDArray[np.float64]) -> int:
    """Number of cascades that a light needs."""
    half_m, count = _half_m(*_extent_m(axes, boxes_m)), 1
    while half_m > _LARGEST_SINGLE_M and count < MAX_CASCADES:
        half_m /= _RATIO
        count += 1
    return count


def _extent_m(
    axes: NDArray[np.float64], boxes_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and largest coordinates (3,) of boxes (n, 2, 3) along axes."""
    if not len(boxes_m):
        return np.zeros(3), np.zeros(3)
    centers = boxes_m.mean(axis=1) @ axes.T
    extents = 0.5 * (boxes_m[:, 1] - boxes_m[:, 0]) @ np.abs(axes).T
    return (centers - extents).min(axis=0), (centers + extents).max(axis=0)


def _half_m(low_m: NDArray[np.float64], high_m: NDArray[np.float64]) -> float:
    return max(0.5 * float((high_m - low_m)[:2].max()), 0.01) * 1.01
