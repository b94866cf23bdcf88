"""Rise of brightness across a straight edge.

Source: ISO 12233:2023, edge spread function: pixels binned by their distance from the edge.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

BIN_PX = 0.25
MIN_LENGTH_PX = 6.0
MIN_CONTRAST = 20.0  # of 255
_REACH_PX = 8.0


def edge_rise_px(
    image: NDArray[np.uint8],
    start_px: NDArray[np.float64],
    end_px: NDArray[np.float64],
    clear: float = 0.4,
) -> float:
    """Distance over which an edge rises from 10 % to 90 %, px; NaN: too short, faint or blurred.

    Args:
        image: (height, width) gray image.
        start_px, end_px: (2,) ends of the edge, at corners of the board; the middle half of the
            edge is used.
    """
    along = end_px - start_px
    length = float(np.linalg.norm(along))
    if length < MIN_LENGTH_PX:
        return math.nan
    along = along / length
    across = np.array([-along[1], along[0]])
    middle, half = 0.5 * (start_px + end_px), 0.25 * length
    reach = min(_REACH_PX, clear * length)
    corner = np.abs(along) * half + np.abs(across) * reach
    low = np.floor(middle - corner).astype(np.int64).clip(0)
    high = np.ceil(middle + corner).astype(np.int64) + 1
    part = image[low[1] : high[1], low[0] : high[0]].astype(np.float64)
    if part.size < 12:
        return math.nan
    v, u = np.indices(part.shape)
    offsets = np.stack((u + low[0], v + low[1]), axis=-1) - middle
    inside = (np.abs(offsets @ along) <= half) & (np.abs(offsets @ across) <= reach)
    return _rise_px((offsets @ across)[inside], part[inside], reach)


def _rise_px(distances: NDArray[np.float64], levels: NDArray[np.float64], reach: float) -> float:
    """Distance between 10 % and 90 % of a rise, px; NaN: no clear rise.

    Args:
        distances: (n,) signed distances from the edge, px.
        levels: (n,) gray levels.
        reach: largest distance, px.
    """
    sides = levels[distances < -0.5 * reach], levels[distances > 0.5 * reach]
    if min(map(len, sides)) < 3:
        return math.nan
    black, white = (float(np.median(side)) for side in sides)
    if abs(white - black) < MIN_CONTRAST:
        return math.nan
    share = (levels - black) / (white - black)
    bins = np.floor((distances + reach) / BIN_PX).astype(np.int64)
    count = np.bincount(bins)
    filled = count > 0
    positions = np.bincount(bins, distances)[filled] / count[filled]
    profile = np.maximum.accumulate(np.bincount(bins, share)[filled] / count[filled])
    if profile[0] > 0.1 or profile[-1] < 0.9:
        return math.nan
    low, high = (float(np.interp(part, profile, positions)) for part in (0.1, 0.9))
    return high - low
