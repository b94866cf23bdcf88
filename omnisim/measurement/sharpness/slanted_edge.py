"""Sharpness of slanted edges in an image; `UnusableEdge` names a flaw that prevents it.

`board_edges` and `find_edges` locate edges roughly. `measure_edge` fits an edge near such a line,
averages the pixels across it to an edge spread, and derives width and modulation transfer. Arrays
(1 + GROUPS, ...) are of all pixels, and of those without each group: the jackknife's samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree
from scipy.special import ndtr

from omnisim.cameras.optics.system_calibration import BoardCorners
from omnisim.core.arrays import Bools, Floats, Ints
from omnisim.core.errors import MeasurementError
from omnisim.measurement.inputs import (
    RAW_SUFFIXES,
    is_lossy,
    is_recording,
    read_photo,
    recorded_frames,
)
from omnisim.rendering.camera.degradations.encoding import Encoding

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
GROUPS = 8  # of pixels, for the jackknife
FREQUENCIES = np.arange(0.0, 1.0001, 0.01)  # cycles per pixel
_FLAT, _END = 1.0, 2.0  # where the window begins to fall, and ends, in widths of the edge
_MIN_TREND_PX = 3.0  # narrower sides show no trend
_NEAR_PX = 2.0  # distance from the edge up to which every bin needs a sample
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
        gaussian_filter1d(each.levels, _SMOOTHING_PX / BIN_PX, axis=1, mode="nearest")
        for each in (spread, other)
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


# Fit of an edge between two even areas, near a rough line, with sub-pixel accuracy.


MIN_LENGTH_PX = 20.0
MIN_SLANT_DEG = 2.0  # below it, an edge of usual length crosses too few pixel phases
MIN_CONTRAST = 0.05  # of the range of values
MIN_CONTRAST_TO_NOISE = 6.0
MAX_CLIPPED = 2e-3  # share of the region's pixels
MAX_UNEVENNESS = 0.06  # of the contrast: differences within one side
_SIGMAS = 5.0  # of noise that differences must exceed
_ITERATIONS = 12


class Flaw(Enum):
    """Reason why an edge is not measured; the value says what to do about it."""

    SHORT = f"shorter than {MIN_LENGTH_PX:g} px: come closer, or use a larger pattern"
    STRAIGHT = (
        f"slanted by less than {MIN_SLANT_DEG:g}° to rows or columns of pixels: turn the pattern "
        "or the camera by about 5°"
    )
    PHASES = "at an angle that leaves gaps between its samples: turn the pattern by a few degrees"
    CLIPPED = "clipped at the largest or smallest value: change the exposure"
    FAINT = "with too little contrast for their noise: use more light, or black on white"
    UNEVEN = "with uneven areas beside them: use a pattern of larger, plain areas"
    WIDE = "wider than the areas beside them: focus, or use a larger pattern"
    OUTSIDE = "too close to the border of the image: move the pattern"


class UnusableEdge(Exception):
    """Edge that is not measured; the only argument is its `Flaw`."""


@dataclass(frozen=True, eq=False)
class EdgeLine:
    """Approximate position of an edge."""

    # start_px, end_px: (2,) positions (u, v) of the ends
    start_px: Floats
    end_px: Floats
    reach_px: float  # distance from the edge, to both sides, without other edges


@dataclass(frozen=True, eq=False)
class FittedEdge:
    """Pixels around an edge, by their distance from it."""

    center_px: Floats  # (2,) point on the edge, in the middle of its length
    normal: Floats  # (2,) unit vector from the dark to the bright side at `center_px`
    # length_px, reach_px: length of the edge, and largest distance of a pixel from it
    length_px: float
    reach_px: float
    slant_deg: float  # angle to the pixel rows or columns, whichever is smaller
    distances_px: Floats  # (n,) signed distance of each pixel's center, positive on the bright side
    # rows, columns: (n,) indices of the pixels
    rows: Ints
    columns: Ints
    # contrast, noise: difference between the two sides, and sigma of a pixel's value; 1: white
    contrast: float
    noise: float


def fit_edge(light: Floats, clipped: Bools, line: EdgeLine) -> FittedEdge:
    """Fit a parabola along the edge near a line, and a normal distribution across it.

    Of linear values (height, width), 1: white; clipped pixels are at a limit of their values. A
    flaw of the edge raises `UnusableEdge`.
    """
    along = line.end_px - line.start_px
    length_px = float(np.hypot(*along))
    if length_px < MIN_LENGTH_PX:
        raise UnusableEdge(Flaw.SHORT)
    along = along / length_px
    _check_slant(along)
    middle_px = 0.5 * (line.start_px + line.end_px)
    # the pixels in a rectangle along the edge
    half = np.abs(along) * 0.5 * length_px + np.abs(along[::-1]) * line.reach_px
    first, last = np.ceil(middle_px - half).astype(int), np.floor(middle_px + half).astype(int)
    if (first < 0).any() or last[0] >= light.shape[1] or last[1] >= light.shape[0]:
        raise UnusableEdge(Flaw.OUTSIDE)
    columns, rows = np.meshgrid(np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1))
    u, v = columns - middle_px[0], rows - middle_px[1]
    is_near = np.abs(u * along[0] + v * along[1]) <= 0.5 * length_px
    is_near &= np.abs(v * along[0] - u * along[1]) <= line.reach_px
    rows, columns = rows[is_near], columns[is_near]
    if clipped[rows, columns].mean() > MAX_CLIPPED:
        raise UnusableEdge(Flaw.CLIPPED)
    offsets_px = np.stack((columns, rows), axis=-1) - middle_px
    values = light[rows, columns]
    across = np.array((-along[1], along[0]))
    side = offsets_px @ across > 0.0
    if values[side].mean() < values[~side].mean():
        across = -across
    position, distance = offsets_px @ along / (0.5 * length_px), offsets_px @ across
    parameters, noise = _fit(values, position, distance, line.reach_px)
    low, step, width_px, *curve = parameters.tolist()
    if step < MIN_CONTRAST:
        raise UnusableEdge(Flaw.FAINT)
    if not 0.0 < 3.0 * width_px < line.reach_px or abs(curve[0]) > 0.5 * line.reach_px:
        raise UnusableEdge(Flaw.WIDE)
    height = np.polynomial.polynomial.polyval(position, curve)
    tilt = (curve[1] + 2.0 * curve[2] * position) / (0.5 * length_px)
    distances = (distance - height) / np.hypot(1.0, tilt)
    _check_even(values - low, position, distances, step, 3.0 * width_px, noise)
    if step < MIN_CONTRAST_TO_NOISE * noise:
        raise UnusableEdge(Flaw.FAINT)
    slope = curve[1] / (0.5 * length_px)
    normal = (across - slope * along) / np.hypot(1.0, slope)
    slant_deg = _check_slant(normal)
    center_px = middle_px + curve[0] * across
    return FittedEdge(
        center_px, normal, length_px, line.reach_px, slant_deg, distances, rows, columns, step,
        noise,
    )  # fmt: skip


def _check_slant(direction: Floats) -> float:
    """Smaller angle of a direction to pixel rows or columns, in degrees; rejects small ones."""
    small, large = np.sort(np.abs(direction))
    slant_deg = float(np.degrees(np.arctan2(small, large)))
    if slant_deg < MIN_SLANT_DEG:
        raise UnusableEdge(Flaw.STRAIGHT)
    return slant_deg


def _fit(
    values: Floats, position: Floats, distance: Floats, reach_px: float
) -> tuple[Floats, float]:
    """Dark level, step, width in px and three coefficients of the curve (6,); and a pixel's noise.

    Pixels have light (n,), a position along the edge (n,) in [−1, 1], and a distance across it
    (n,), px, up to `reach_px`.
    """
    low = float(values[distance < -0.5 * reach_px].mean())
    high = float(values[distance > 0.5 * reach_px].mean())
    parameters = np.array((low, high - low, 0.1 * reach_px, 0.0, 0.0, 0.0))
    powers = np.stack((np.ones_like(position), position, position**2), axis=-1)
    residual = values
    for _ in range(_ITERATIONS):
        low, step, width = parameters[:3]
        scaled = (distance - powers @ parameters[3:]) / width
        share = ndtr(scaled)
        slope = np.exp(-0.5 * np.clip(scaled, -9.0, 9.0) ** 2) / np.sqrt(2.0 * np.pi)
        residual = values - low - step * share
        across = -step * slope / width
        design = np.column_stack(
            (np.ones_like(share), share, across * scaled, across[:, None] * powers)
        )
        change = np.linalg.lstsq(design, residual, rcond=1e-9)[0]
        parameters = parameters + change
        # a step that is too long would end far from the edge
        parameters[2] = np.clip(parameters[2], 0.1, reach_px)
        parameters[3:] = np.clip(parameters[3:], -reach_px, reach_px)
        if np.abs(change[2:]).max() < 1e-4:
            break
    away = np.abs(distance - powers @ parameters[3:]) > 3.0 * parameters[2]
    return parameters, float(residual[away].std()) if away.sum() > 1 else 0.0


def _check_even(
    values: Floats, position: Floats, distances: Floats, step: float, edge_px: float, noise: float
) -> None:
    """Reject an edge if a side has other edges or texture, or is too narrow to judge it."""
    for is_side in (distances > edge_px, distances < -edge_px):
        quarter = np.floor(2.0 * (position[is_side] + 1.0)).clip(0.0, 3.0)
        near = distances[is_side] ** 2 < np.median(distances[is_side] ** 2) if is_side.any() else 0
        block = (2.0 * quarter + near).astype(int)
        counts = np.bincount(block, minlength=8)
        if counts.min() < 2:
            raise UnusableEdge(Flaw.WIDE)
        means = np.bincount(block, values[is_side], minlength=8) / counts
        limit = MAX_UNEVENNESS * step + _SIGMAS * noise / np.sqrt(counts.min())
        if np.ptp(means) > min(limit, 2.0 * MAX_UNEVENNESS * step):
            raise UnusableEdge(Flaw.UNEVEN)


# Images of edges as linear light.


SUFFIXES = (".png", ".tif", ".tiff", ".pgm", ".exr")
LOSSY = (".jpg", ".jpeg")
MIN_BITS = 8


def find_edge_images(path: Path) -> list[Path]:
    """Image files in a folder, sorted by name; frames of a video or bag; or the file itself.

    Raises:
        MeasurementError: no images, or files of other formats.
    """
    if is_recording(path):
        return recorded_frames(path)
    files = [path] if path.is_file() else []
    if path.is_dir():
        files = [file for file in sorted(path.iterdir()) if not file.name.startswith(".")]
    expected = " ".join(SUFFIXES + LOSSY)
    if not files:
        raise MeasurementError(f"{path}: expected images ({expected}), got none")
    for file in files:
        if file.suffix.lower() not in SUFFIXES + LOSSY + RAW_SUFFIXES:
            raise MeasurementError(f"{file}: expected images ({expected}) only")
    return files


def read_edge_image(path: Path, encoding: Encoding | None) -> NDArray[Any]:
    """Stored values (height, width, 1 or 3) of an image; an encoding of None: linear.

    Raises:
        MeasurementError: the file is damaged, or is a JPEG or a video of unknown encoding.
    """
    if is_lossy(path) and encoding is None:
        kind = "JPEG" if path.suffix.lower() in LOSSY else "a video's"
        raise MeasurementError(
            f"{path}: {kind} values are not linear: save raw frames as PNG or TIFF, or give the "
            "camera's response, such as srgb"
        )
    pixels = read_photo(path)
    if pixels.shape[2] in (2, 4):  # transparency
        pixels = pixels[..., :-1]
    return pixels


def linear_light(
    pixels: NDArray[Any], encoding: Encoding | None, name: str
) -> tuple[Floats, Bools]:
    """Linear light (height, width, 1 or 3) of stored values, and a mask of clipped pixels.

    White is 1 for floats, and the largest value of the converter's bits for integers. Encoding
    None: linear.

    Raises:
        MeasurementError: not one or three channels, or values that are not finite.
    """
    values = pixels[..., None] if pixels.ndim == 2 else pixels
    if values.ndim != 3 or values.shape[2] not in (1, 3):
        raise MeasurementError(f"{name}: expected one or three channels, got {pixels.shape}")
    if np.issubdtype(values.dtype, np.integer):
        # the converter's bits may be the upper or the lower ones of 16
        used = int(np.bitwise_or.reduce(values, axis=None))
        shift = (used & -used).bit_length() - 1 if used else 0
        bits = max((used >> shift).bit_length(), MIN_BITS if shift == 0 else 1)
        largest = ((1 << bits) - 1) << shift
        clipped = np.any((values >= largest) | (values <= 0), axis=2)
        values = values / largest
    elif np.isfinite(values).all():
        clipped = np.zeros(values.shape[:2], dtype=bool)
    else:
        raise MeasurementError(f"{name}: expected finite values")
    light = values.astype(np.float64)
    if encoding is not None:
        light = encoding.linearized(np.maximum(light, 0.0))
    return light, clipped


# Approximate edges in an image: between the corners of a board, or all straight edges.


MAX_LENGTH_PX = 60.0  # longer ones are cut, so that each has one position in the field
MAX_EDGES = 120  # per image
_MIN_REACH_PX, _MAX_REACH_PX = 6.0, 20.0
_REACH = 0.4  # of the length of an edge: squares are as wide as long
_CORNER = 0.12  # share of a square's edge that its corners blur, at each end
_CORNER_PX = 1.5


def board_edges(board: BoardCorners) -> list[EdgeLine]:
    """Edges between neighboring corners of a board of squares."""
    tree = cKDTree(board.points_m)
    square_m = float(np.median(np.asarray(tree.query(board.points_m, k=[2])[0])))
    pairs = tree.query_pairs(1.2 * square_m)
    lines = (_between(*board.pixels_px[list(pair)]) for pair in sorted(pairs))
    return [line for line in lines if line]


def find_edges(light: Floats) -> list[EdgeLine]:
    """Straight edges in an image (height, width), slanted edges first, longer ones before shorter.

    Source: Grompone von Gioi et al., "LSD: a Line Segment Detector", IPOL, 2012.
    """
    import cv2

    top = float(np.percentile(light, 99.5))
    # dark edges are found as well as bright ones
    gray = np.sqrt(np.clip(light / max(top, 1e-6), 0.0, 1.0))
    found = cv2.createLineSegmentDetector().detect(np.rint(255.0 * gray).astype(np.uint8))[0]
    segments = np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(np.float64)
    along = np.abs(segments[:, 1] - segments[:, 0])
    lengths = np.hypot(along[:, 0], along[:, 1])
    is_straight = along.min(axis=1) < lengths * np.sin(np.radians(MIN_SLANT_DEG))
    edges: list[EdgeLine] = []
    for index in np.lexsort((-lengths, is_straight)).tolist():
        if lengths[index] < MIN_LENGTH_PX:
            continue
        start, end = segments[index]
        count = int(np.ceil(float(np.hypot(*(end - start))) / MAX_LENGTH_PX))
        ends = start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start)
        pieces = (_between(*pair) for pair in pairwise(ends))
        edges += [piece for piece in pieces if piece]
    return edges[:MAX_EDGES]


def _between(start_px: Floats, end_px: Floats) -> EdgeLine | None:
    """Edge between two corners, shortened at both ends, where the corners blur; None: too short."""
    length = float(np.hypot(*(end_px - start_px)))
    cut = max(_CORNER, _CORNER_PX / max(length, 1e-9))
    if length * (1.0 - 2.0 * cut) <= 1.0:
        return None
    offset = cut * (end_px - start_px)
    reach = float(np.clip(_REACH * length, _MIN_REACH_PX, _MAX_REACH_PX))
    return EdgeLine(start_px + offset, end_px - offset, reach)
