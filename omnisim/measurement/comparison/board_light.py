"""Light on a board: gray levels of even patches, and smooth light fitted to them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from omnisim.core.errors import MeasurementError
from omnisim.measurement.comparison.printed_pattern import Patches, PrintedPattern
from omnisim.measurement.geometry.board_view import BoardView
from omnisim.measurement.geometry.placed_board import PlacedBoard

Floats = NDArray[np.float64]
_SHARES = np.linspace(0.3, 0.7, 5)  # of a patch's sides, where its level is taken
_TERMS = 6
_FEW = 3  # terms of a plane, of boards of which little is visible
_ROUNDS = 8
MIN_PATCHES = 9  # of ink and of paper, for a polynomial of each


class BoardLight(NamedTuple):
    """Smooth light on a board: quadratic polynomials of the position, of paper and of ink.

    Ink has its own polynomial: it shines, and the lens's stray light, which is the same for both,
    is much to it. Beyond the fitted patches, the light is that of their edge.

    Attributes:
        low_m, high_m: (2,) corners of the rectangle of all patches.
        paper, ink: (6,) coefficients of 1, x, y, x², x y, y², with x and y from -1 to 1 in the
            rectangle.
    """

    low_m: Floats
    high_m: Floats
    paper: Floats
    ink: Floats

    def at(self, positions_m: Floats, is_black: NDArray[np.bool_]) -> Floats:
        """Light (...) at positions (..., 2) of ink or paper (...)."""
        terms = _terms(positions_m, self.low_m, self.high_m)
        light: Floats = np.maximum(np.where(is_black, terms @ self.ink, terms @ self.paper), 0.0)
        return light


def fit_light(patches: Patches, light: Floats, is_used: NDArray[np.bool_]) -> BoardLight:
    """Fit smooth light to the patches of a board.

    Of boards with few patches, the light of ink is taken as a constant share of that of paper.

    Args:
        patches: patches of the board.
        light: (patches,) linear light.
        is_used: (patches,) False: patches whose light is unknown.
    """
    low: Floats = patches.rectangles_m[:, :2].min(axis=0)
    high: Floats = patches.rectangles_m[:, 2:].max(axis=0)
    terms = _terms(patches.centers_m, low, high)[is_used]
    light, is_black = light[is_used], patches.is_black[is_used]
    if min(is_black.sum(), (~is_black).sum()) >= MIN_PATCHES:
        paper: Floats = np.zeros(_TERMS)
        ink: Floats = np.zeros(_TERMS)
        for color, of_color in ((paper, ~is_black), (ink, is_black)):
            color[:] = np.linalg.lstsq(terms[of_color], light[of_color], rcond=None)[0]
        return BoardLight(low, high, paper, ink)
    coefficients: Floats = np.zeros(_TERMS)
    count = _TERMS if len(light) >= 2 * _TERMS else _FEW
    share = float(np.median(light[is_black]) / max(np.median(light[~is_black]), 1e-9))
    for _ in range(_ROUNDS):
        design = terms[:, :count] * np.where(is_black, share, 1.0)[:, None]
        coefficients[:count] = np.linalg.lstsq(design, light, rcond=None)[0]
        lit = (terms @ coefficients)[is_black]
        share = float(light[is_black] @ lit / (lit @ lit))
    return BoardLight(low, high, coefficients, share * coefficients)


def visible_patches(pattern: PrintedPattern, view: BoardView) -> Patches:
    """Patches between corners that were detected in an image.

    Raises:
        MeasurementError: fewer than 3 patches of ink or of paper.
    """
    known = {tuple(point) for point in np.round(view.points_m, 9).tolist()}
    is_seen = np.array(
        [
            {(left, top), (right, top), (right, bottom), (left, bottom)} <= known
            for left, top, right, bottom in np.round(pattern.patches.between_m, 9).tolist()
        ]
    )
    patches = pattern.patches.select(is_seen)
    if min(patches.is_black.sum(), (~patches.is_black).sum()) < _FEW:
        raise MeasurementError(f"{view.name}: too little of the board is visible")
    return patches


def patch_levels(image: NDArray[np.uint8] | NDArray[np.float32], pixels_px: Floats) -> Floats:
    """Median levels (patches,) of an image at samples (patches, samples, 2) of patches."""
    levels = map_coordinates(
        image.astype(np.float64), np.moveaxis(pixels_px[..., ::-1], -1, 0), order=1, mode="nearest"
    )
    middle: Floats = np.median(levels, axis=-1)
    return middle


def patch_samples_px(patches: Patches, board: PlacedBoard) -> Floats:
    """Pixels (patches, samples, 2) in the middle of patches; NaN where the camera shows nothing."""
    across, down = (shares.ravel() for shares in np.meshgrid(_SHARES, _SHARES))
    left, top, right, bottom = patches.rectangles_m.T[..., None]
    positions = np.stack((left + across * (right - left), top + down * (bottom - top)), axis=-1)
    seen = board.pixels(positions)
    return np.where(seen.valid[..., None], seen.positions_px, np.nan)


def matching_pattern(
    image: NDArray[np.uint8], patterns: list[PrintedPattern], board: PlacedBoard, view: BoardView
) -> PrintedPattern:
    """Pattern whose ink is darkest in an image, compared with its paper.

    Args:
        image: (height, width) gray image.
        patterns: patterns of the same cells.
        board: the board in the image.
        view: detected corners, among which the cells are compared.
    """
    if len(patterns) == 1:
        return patterns[0]
    centers = patterns[0].cell_centers_m
    low, high = view.points_m.min(axis=0), view.points_m.max(axis=0)
    is_used = ((centers > low) & (centers < high)).all(axis=-1)
    seen = board.pixels(centers[is_used])
    positions = np.where(seen.valid[:, None], seen.positions_px, 0.0)
    levels = patch_levels(image, positions[:, None])

    def contrast(pattern: PrintedPattern) -> float:
        is_black = pattern.is_black[is_used] & seen.valid
        is_white = ~pattern.is_black[is_used] & seen.valid
        return float(levels[is_white].mean() - levels[is_black].mean())

    return max(patterns, key=contrast)


def _terms(positions_m: Floats, low_m: Floats, high_m: Floats) -> Floats:
    """Powers (..., 6) of positions (..., 2), clipped to a rectangle."""
    scaled = np.clip((positions_m - low_m) / np.maximum(high_m - low_m, 1e-9), 0.0, 1.0)
    x, y = np.moveaxis(2.0 * scaled - 1.0, -1, 0)
    return np.stack((np.ones_like(x), x, y, x * x, x * y, y * y), axis=-1)
