"""Sampling density of an image on a cube face: visible region and resolution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.core.arrays import Bools, Floats, Indices

# Samples per face edge, corners included: a rim first reaches a face at the middle of an edge or at
# a corner.
GRID = 65
GRID_STEP = 2.0 / (GRID - 1)
# The pole of an image stretches one direction without bound, and the rim of an orthographic lens
# shrinks one to zero. Both are limited: an image stretched more than four times as much across as
# along counts as four times, and no pixel counts as wider than 32 of the smallest.
MAX_ANISOTROPY = 4.0
MIN_DENSITY_SHARE = 1.0 / 32.0
WHOLE_FACE: Floats = np.array([[-1.0, -1.0], [1.0, 1.0]])
_STEP = 1e-5  # step of a tangent for derivatives: far above rounding errors, far below a texel


class RegionDensity(NamedTuple):
    """Sampling density of the image in a region of a face."""

    min_px_per_tan: float  # pixels per tangent of 1
    max_px_per_tan: float
    # (2, 2) lower and upper bounds of tangents (right, down); regions of a face do not overlap
    region: Floats
    seen_region: Floats  # (2, 2) bounds of the part of the region that the image samples


@dataclass(frozen=True, eq=False)
class SamplingDensity:
    """Sampling density of the image on a face, from samples spread over the face."""

    tangents: Floats  # (n, 2) of the samples; the grid comes first, row by row
    seen: Bools  # (n,) samples that the image looks up
    # (n,) pixels per tangent of 1, in the directions of the largest and smallest density; 0 and
    # infinity: unknown
    max_px_per_tan: Floats
    min_px_per_tan: Floats

    def whole(self) -> list[RegionDensity]:
        """Density of the whole face; empty if the image sees nothing of it."""
        return self._densities([WHOLE_FACE]) if self.seen.any() else []

    def subdivide(self, texels_per_pixel: float, tile_texels: float) -> list[RegionDensity]:
        """Densities of the face's regions after the cuts that save texels.

        The density of an image varies over a face: 45° below the horizon, a mirror shows an angle
        in half as many pixels as above it. The cuts are greedy: the cut that saves the most comes
        first, and each half is cut again.

        Args:
            texels_per_pixel: texels per pixel side.
            tile_texels: cost of an additional tile, texels.
        """
        if not self.seen.any():
            return []
        count = GRID * GRID
        seen = self.seen[:count].reshape(GRID, GRID).copy()
        for corners in _corners(self.tangents[count:]):
            seen[corners] = True
        # a cell between samples takes their larger density, and is seen if one of them is
        density = dilate(self.max_px_per_tan[:count].reshape(GRID, GRID)) * texels_per_pixel
        whole = ((0, 0), (GRID - 1, GRID - 1))
        cells = _cut_cell(density, dilate(seen), tile_texels, *whole)
        return self._densities([-1.0 + GRID_STEP * np.array(cell, dtype=float) for cell in cells])

    def _densities(self, regions: list[Floats]) -> list[RegionDensity]:
        """Densities within tangent bounds (2, 2), for the regions that the image sees."""
        return [density for region in regions if (density := self._density(region)) is not None]

    def _density(self, region: Floats) -> RegionDensity | None:
        # the visible part may begin anywhere between two samples
        first, last = region[0] - GRID_STEP, region[1] + GRID_STEP
        near = np.all((self.tangents >= first) & (self.tangents <= last), axis=-1)
        seen = self.tangents[near & self.seen]
        if not len(seen):
            return None
        seen_region = np.stack((seen.min(axis=0) - GRID_STEP, seen.max(axis=0) + GRID_STEP))
        seen_region = np.clip(seen_region, region[0], region[1])
        if np.any(seen_region[0] >= seen_region[1]):
            return None
        densest = float(self.max_px_per_tan[near].max())
        if densest == 0.0:  # no derivative here: take the face's
            densest = float(self.max_px_per_tan.max())
            near = np.ones_like(near)
        sparsest = float(self.min_px_per_tan[near].min()) if densest > 0.0 else 1.0
        sparsest = max(sparsest, MIN_DENSITY_SHARE * densest, 1e-6)
        return RegionDensity(sparsest, densest, region, seen_region)


def density_of_camera(
    camera: CentralCamera, face_from_optical: Floats, seen: Floats
) -> SamplingDensity:
    """Density of a camera's image.

    Args:
        face_from_optical: (3, 3) rotation from the optical frame to the face.
        seen: tangents (n, 2) that the image looks up.
    """
    grid = _grid()
    tangents = np.concatenate((grid, seen))

    def pixels(right: float, down: float) -> tuple[Floats, Bools]:
        local = np.ones((len(tangents), 3))
        local[:, :2] = tangents + np.array([right, down])
        return camera.pixel_from_ray(local @ face_from_optical)

    at, valid = pixels(0.0, 0.0)
    size = (camera.width_px, camera.height_px)
    valid = valid & np.all((at >= -1.0) & (at <= size), axis=-1)
    max_px_per_tan, min_px_per_tan = np.zeros(len(valid)), np.full(len(valid), np.inf)
    if not valid.any():
        return SamplingDensity(tangents, valid, max_px_per_tan, min_px_per_tan)
    right, right_valid = pixels(_STEP, 0.0)
    down, down_valid = pixels(0.0, _STEP)
    steps = np.stack((right - at, down - at), axis=-1)
    inner = valid & right_valid & down_valid
    # A full-sphere image has a cut somewhere, and all azimuths meet at its poles: a step jumps
    # there. No face is so dense that a step elsewhere would move the image by a pixel.
    smooth = inner & np.all(np.abs(steps) < 1.0, axis=(-2, -1))
    inner = smooth if smooth.any() else inner
    # singular values: sum and difference of the lengths of the conformal and anticonformal parts
    (a, b), (c, d) = (steps[inner] / _STEP).transpose(1, 2, 0)
    conformal, anticonformal = np.hypot(a + d, c - b), np.hypot(a - d, c + b)
    largest, smallest = 0.5 * (conformal + anticonformal), 0.5 * np.abs(conformal - anticonformal)
    max_px_per_tan[inner] = np.minimum(largest, MAX_ANISOTROPY * smallest)
    min_px_per_tan[inner] = smallest
    valid[len(grid) :] = True
    return SamplingDensity(tangents, valid, max_px_per_tan, min_px_per_tan)


def density_of_rays(tangents: Floats, px_per_tan: Floats) -> SamplingDensity:
    """Density from rays at tangents (n, 2) of a face, with pixels per tangent of 1 (n,)."""
    density = np.zeros((GRID, GRID))
    for corners in _corners(tangents):
        np.maximum.at(density, corners, px_per_tan)
    flat = density.ravel()
    return SamplingDensity(_grid(), flat > 0.0, flat, np.where(flat > 0.0, flat, np.inf))


def _corners(tangents: Floats) -> Iterator[tuple[Indices, Indices]]:
    """Row and column (n,) of the four samples of the grid around tangents (n, 2), one by one."""
    column, row = np.clip(np.floor((tangents.T + 1.0) / GRID_STEP).astype(int), 0, GRID - 2)
    for down in (0, 1):
        for right in (0, 1):
            yield row + down, column + right


def _grid() -> Floats:
    """Tangents (GRID², 2) of the samples spread over a face, row by row."""
    line = np.linspace(-1.0, 1.0, GRID)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def dilate(values: NDArray[Any], distance: int = 1, outside: float = 0) -> NDArray[Any]:
    """Maximum over all values within a distance along rows and columns of each, and `outside`."""
    for _ in range(2):
        padded = np.pad(values, [(distance, distance), (0, 0)], constant_values=outside)
        rows = [padded[first : first + len(values)] for first in range(2 * distance + 1)]
        values = reduce(np.maximum, rows).T
    return values


Cell = tuple[tuple[int, int], tuple[int, int]]  # column and row of the first and last sample


def _cut_cell(
    density: Floats, seen: Bools, tile_texels: float, first: tuple[int, int], last: tuple[int, int]
) -> list[Cell]:
    """Cells of a range between two samples after the best cuts, without unseen cells."""
    rows, columns = slice(first[1], last[1] + 1), slice(first[0], last[0] + 1)
    inside, seen_inside = density[rows, columns], seen[rows, columns]
    if not seen_inside.any():
        return []
    # along rows: cuts between above and below; along columns: between left and right
    below = _prefix_texels(inside, seen_inside, tile_texels)
    above = _prefix_texels(inside[::-1], seen_inside[::-1], tile_texels)[::-1]
    left = _prefix_texels(inside.T, seen_inside.T, tile_texels)
    right = _prefix_texels(inside.T[::-1], seen_inside.T[::-1], tile_texels)[::-1]
    row_costs, column_costs = (below + above)[1:-1], (left + right)[1:-1]
    cheapest_row = row_costs.min(initial=np.inf)
    cheapest_column = column_costs.min(initial=np.inf)
    if min(cheapest_row, cheapest_column) >= below[-1]:
        return [(first, last)]
    if cheapest_row <= cheapest_column:
        row = first[1] + 1 + int(np.argmin(row_costs))
        halves = ((first, (last[0], row)), ((first[0], row), last))
    else:
        column = first[0] + 1 + int(np.argmin(column_costs))
        halves = ((first, (column, last[1])), ((column, first[1]), last))
    return [cell for half in halves for cell in _cut_cell(density, seen, tile_texels, *half)]


def _prefix_texels(density: Floats, seen: Bools, tile_texels: float) -> Floats:
    """Cost in texels of a tile of rows 0 to i, per i."""
    count = np.arange(len(seen))
    any_row = seen.any(axis=1)
    last = np.maximum.accumulate(np.where(any_row, count, -1))
    first = int(np.argmax(any_row)) if any_row.any() else 0
    prefix = np.maximum.accumulate(seen, axis=0)
    width = seen.shape[1] - 1 - np.argmax(prefix[:, ::-1], axis=1) - np.argmax(prefix, axis=1)
    scale = GRID_STEP * np.maximum.accumulate(density.max(axis=1))
    height = np.maximum(last - first, 1)
    texels = (height * scale + 2.0) * (np.maximum(width, 1) * scale + 2.0) + tile_texels
    return np.where(last >= 0, texels, 0.0)
