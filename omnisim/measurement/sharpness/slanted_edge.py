"""Sharpness of one edge anywhere in an image; `UnusableEdge` names a flaw that prevents it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter1d

from omnisim.core.arrays import Bools, Floats
from omnisim.measurement.sharpness.edge_fit import (
    EdgeLine,
    FittedEdge,
    Flaw,
    UnusableEdge,
    fit_edge,
)

GREEN = 1
_NARROWER = 0.6  # of the reach, for a second try beside other edges


@dataclass(frozen=True, eq=False)
class EdgeSharpness:
    """Sharpness of an edge."""

    image: int  # number of the image
    center_px: Floats  # (2,) position (u, v)
    normal: Floats  # (2,) unit vector from the dark to the bright side
    length_px: float
    slant_deg: float  # angle to the pixel rows or columns, the smaller
    mtf50: float  # frequency at which the modulation is one half, cycles per pixel
    mtf50_sigma: float
    rise_px: float  # distance from 10 to 90 % of the edge
    rise_sigma_px: float
    asymmetry: float  # distance from 10 to 50 % minus distance from 50 to 90 %, over their sum
    transfer: Floats  # (frequencies,) modulation transfer at `FREQUENCIES`
    # (2,) distances of the red and of the blue edge from the green one, toward the bright side
    shifts_px: Floats
    shift_sigmas_px: Floats  # (2,); NaN, as are the shifts: a gray image

    @property
    def variance_px2(self) -> float:
        """Variance of the optics' blur along `normal`, as a normal distribution.

        Together with square pixels it gives the same MTF50. Negative if the edge is sharper than
        square pixels alone would make it.
        """
        return self._variance_px2(self.mtf50)

    @property
    def variance_sigma_px2(self) -> float:
        """Standard deviation of `variance_px2`."""
        step = 1e-4
        rate = self._variance_px2(self.mtf50 + step) - self._variance_px2(self.mtf50 - step)
        return abs(rate) / (2.0 * step) * self.mtf50_sigma

    def _variance_px2(self, mtf50: float) -> float:
        pixel = float(np.prod(np.sinc(mtf50 * self.normal)))  # transfer of a square pixel
        return float(np.log(2.0 * pixel) / (2.0 * np.pi**2 * mtf50**2))


def measure_edge(light: Floats, clipped: Bools, line: EdgeLine, image: int = 0) -> EdgeSharpness:
    """Measure an edge near a line, in linear values (height, width, 1 or 3) of which 1 is white.

    Clipped pixels are at a limit of their values; `image` is the image's number.
    """
    main = light[..., GREEN if light.shape[2] == 3 else 0]
    try:
        edge = fit_edge(main, clipped, line)
    except UnusableEdge as reason:
        if reason.args[0] is not Flaw.UNEVEN:
            raise
        narrower = EdgeLine(line.start_px, line.end_px, _NARROWER * line.reach_px)
        edge = fit_edge(main, clipped, narrower)
    spread = edge_spread(main[edge.rows, edge.columns], edge)
    low, middle, high = (crossings(spread, level) for level in (0.1, 0.5, 0.9))
    transfer = modulation_transfer(spread, float(high[0] - low[0]))
    mtf50 = half_modulation(transfer)
    shift, shift_sigma = np.full(2, np.nan), np.full(2, np.nan)
    if light.shape[2] == 3:
        for index, channel in enumerate((0, 2)):
            other = edge_spread(light[edge.rows, edge.columns, channel], edge)
            estimates = shifts(spread, other, float(high[0] - low[0]))
            shift[index], shift_sigma[index] = estimates[0], deviation(estimates)
    asymmetry = float((2.0 * middle[0] - low[0] - high[0]) / (high[0] - low[0]))
    return EdgeSharpness(
        image, edge.center_px, edge.normal, edge.length_px, edge.slant_deg,
        float(mtf50[0]), deviation(mtf50), float(high[0] - low[0]), deviation(high - low),
        asymmetry, transfer[0], shift, shift_sigma,
    )  # fmt: skip


# Edge spread and modulation transfer of a fitted edge.
#
# Source: ISO 12233:2017, annex D (e-SFR): distances in bins of a quarter of a pixel, derivative,
# window, Fourier transform, correction of the derivative. Unlike there, distances are perpendicular
# to the edge, which treats all directions alike, and the width of the bins is corrected for.


BIN_PX = 0.25
GROUPS = 8  # of pixels, each left out once: their spread is the standard deviation
FREQUENCIES = np.arange(0.0, 1.0001, 0.01)  # cycles per pixel
_FLAT, _END = 1.0, 2.0  # rises to both sides where the window begins to fall, and ends
_MIN_TREND_PX = 3.0
_NEAR_PX = 2.0  # around the edge every bin needs a sample
_SHIFT_ITERATIONS = 4
_SMOOTHING_PX = 1.0


@dataclass(frozen=True, eq=False)
class EdgeSpread:
    """Edge spread functions of all pixels, and of all pixels without each of the groups."""

    distances_px: Floats  # (bins,) centers of the bins
    levels: Floats  # (1 + GROUPS, bins) from 0 (dark) to 1 (bright); the first row is of all pixels


def edge_spread(values: Floats, edge: FittedEdge) -> EdgeSpread:
    """Edge spread of the values (n,) of an edge's pixels."""
    count = 2 * int(edge.reach_px / BIN_PX)
    centers = _centers_px(count)
    bins = np.floor(edge.distances_px / BIN_PX + 0.5 * count).astype(np.int64)
    inside = (bins >= 0) & (bins < count)
    group = np.random.default_rng(0).integers(0, GROUPS, len(bins))
    index = (group * count + bins)[inside]

    def sums(weights: Floats | None) -> Floats:
        total = np.bincount(
            index, None if weights is None else weights[inside], minlength=GROUPS * count
        ).reshape(GROUPS, count)
        return np.concatenate((total.sum(axis=0)[None], total.sum(axis=0) - total))

    counts, distances, levels = sums(None), sums(edge.distances_px), sums(values)
    if (counts[0] == 0)[np.abs(centers) < _NEAR_PX].any():
        raise UnusableEdge(Flaw.PHASES)
    spreads = np.empty_like(levels)
    for row, has in enumerate(counts > 0):
        at, means = distances[row, has] / counts[row, has], levels[row, has] / counts[row, has]
        # from the pixels' mean distance to the bin's center; interpolation would smooth
        centered = means + np.gradient(means, at) * (centers[has] - at)
        spreads[row] = np.interp(centers, centers[has], centered)
    ends = count // 6
    low = spreads[:, :ends].mean(axis=1, keepdims=True)
    high = spreads[:, -ends:].mean(axis=1, keepdims=True)
    return EdgeSpread(centers, (spreads - low) / (high - low))


def modulation_transfer(spread: EdgeSpread, rise_px: float) -> Floats:
    """Modulation transfer (1 + GROUPS, frequencies) at `FREQUENCIES`.

    `rise_px`, from 10 to 90 % of the edge, sets the width of the window.
    """
    distances = np.abs(spread.distances_px)
    first, last = _FLAT * rise_px + 1.0, min(_END * rise_px + 3.0, distances.max())
    line = np.gradient(spread.levels, BIN_PX, axis=1)
    line -= _trend(spread, last)[:, None]
    fall = np.clip((distances - first) / max(last - first, BIN_PX), 0.0, 1.0)
    line *= 0.5 + 0.5 * np.cos(np.pi * fall)
    cosines, sines = _waves(len(distances))
    transfer = np.hypot(line @ cosines, line @ sines) / np.abs(line.sum(axis=1, keepdims=True))
    # of the difference between next bins, and of the mean over a bin
    correction = np.sinc(2.0 * BIN_PX * FREQUENCIES) * np.sinc(BIN_PX * FREQUENCIES)
    return transfer / correction


@lru_cache(maxsize=64)
def _waves(count: int) -> tuple[Floats, Floats]:
    """Cosines and sines (bins, frequencies) of `FREQUENCIES` at the centers of `count` bins."""
    phases = 2.0 * np.pi * np.outer(_centers_px(count), FREQUENCIES)
    return np.cos(phases), np.sin(phases)


def _centers_px(count: int) -> Floats:
    """Signed distances (count,) of the bins' centers from the edge, px."""
    return BIN_PX * (np.arange(count, dtype=np.float64) - 0.5 * (count - 1))


def _trend(spread: EdgeSpread, edge_px: float) -> Floats:
    """Slopes (1 + GROUPS,) of light per px, mean of both sides beyond `edge_px`; 0: too narrow."""
    slopes = np.zeros(len(spread.levels))
    for is_side in (spread.distances_px > edge_px, spread.distances_px < -edge_px):
        if is_side.sum() * BIN_PX < _MIN_TREND_PX:
            return np.zeros_like(slopes)
        distances = spread.distances_px[is_side] - spread.distances_px[is_side].mean()
        slopes += 0.5 * (spread.levels[:, is_side] @ distances) / (distances @ distances)
    return np.asarray(slopes, dtype=np.float64)


def half_modulation(transfer: Floats) -> Floats:
    """Lowest frequency (1 + GROUPS,) at which the transfer is one half, cycles per pixel."""
    below = transfer < 0.5
    if not below.any(axis=1).all():
        raise UnusableEdge(Flaw.UNEVEN)
    last = below.argmax(axis=1)
    rows = np.arange(len(transfer))
    before, after = transfer[rows, last - 1], transfer[rows, last]
    step = FREQUENCIES[1] - FREQUENCIES[0]
    return FREQUENCIES[last] - step * (0.5 - after) / (before - after)


def crossings(spread: EdgeSpread, level: float) -> Floats:
    """Distance (1 + GROUPS,), px, at which each edge spread function rises through a level.

    Of several crossings, the one nearest to the edge.
    """
    middle = len(spread.distances_px) // 2
    result = np.empty(len(spread.levels))
    for row, levels in enumerate(spread.levels):
        is_above = levels >= level
        rises = np.flatnonzero(~is_above[:-1] & is_above[1:])
        if not len(rises):
            raise UnusableEdge(Flaw.WIDE)
        at = rises[np.argmin(np.abs(rises + 0.5 - middle))]
        share = (level - levels[at]) / (levels[at + 1] - levels[at])
        result[row] = spread.distances_px[at] + share * BIN_PX
    return result


def shifts(spread: EdgeSpread, other: EdgeSpread, rise_px: float) -> Floats:
    """Distance (1 + GROUPS,), px, from the first to the second spread, toward the bright side.

    Both are smoothed, because colors differ in sharpness, and interpolation moves fine detail less.
    The fit includes offset and contrast, and only uses bins near the edge, to exclude other edges.
    """
    reach_px = rise_px + 2.0 * _SMOOTHING_PX
    near = np.abs(spread.distances_px) < reach_px
    expected, measured = (
        gaussian_filter1d(one.levels, _SMOOTHING_PX / BIN_PX, axis=1, mode="nearest")
        for one in (spread, other)
    )
    result = np.zeros(len(expected))
    for row, levels in enumerate(measured):
        slopes = np.gradient(levels, BIN_PX)
        result[row] = result[0]
        for _ in range(1 if row else _SHIFT_ITERATIONS):  # groups are close to all pixels
            at = spread.distances_px[near] + result[row]
            moved = np.interp(at, spread.distances_px, levels)
            slope = np.interp(at, spread.distances_px, slopes)
            design = np.stack((slope, moved, np.ones_like(moved)), axis=-1)
            change = np.linalg.lstsq(design, expected[row, near], rcond=None)[0]
            # a difference of levels scales the slope, too
            step_px = change[0] / change[1] if change[1] > 0.1 else 0.0
            result[row] = np.clip(result[row] + step_px, -reach_px, reach_px)
    return result


def deviation(estimates: Floats) -> float:
    """Standard deviation of an estimate, by the jackknife over its values (1 + GROUPS,)."""
    left_out = estimates[1:]
    return float(np.sqrt((GROUPS - 1) * np.mean((left_out - left_out.mean()) ** 2)))
