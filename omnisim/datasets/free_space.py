"""Free space: the floor of a scene on which a footprint stands without touching anything.

The floor plan is divided into cells. Points on all triangles, closer together than cells, tell the
height of each cell's floor and which cells have surfaces between what is driven over and the height
of what stands there. A place is free as far as the nearest such cell is away.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.errors import PlanError
from omnisim.scene.floor import floor_height_m
from omnisim.scene.model import Scene
from omnisim.scene.triangles import Triangles, triangles_within
from omnisim.short_repr import short_repr

MOST_CELLS = 1000  # to a side of the floor plan, around the scene's start
CELLS_PER_RADIUS = 4.0
# From a surface to the point on it that is known, and from both ends to the middles of their cells.
MARGIN_CELLS = 2.0 / 3.0 + math.sqrt(2.0)
LEAST_UP = 0.5  # cosine of the steepest floor's slope: 60°
LARGE_CELLS = 16.0  # a triangle of the floor that reaches further is looked up cell by cell
EDGE = 1e-9  # share of a triangle: a point on the edge of two is on one of them at least


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Free floor of a scene for a footprint.

    Attributes:
        low_m: (2,) corner of the floor plan, world.
        cell_m: side of a cell.
        floor_m: (rows, columns) height of the floor along y and x; NaN: there is none.
        clearance_m: (rows, columns) distance to the nearest obstacle on the floor plan.
        is_free: (rows, columns) the footprint stands there.
    """

    low_m: NDArray[np.float64]
    cell_m: float
    floor_m: NDArray[np.float32]
    clearance_m: NDArray[np.float32]
    is_free: NDArray[np.bool_]

    def __repr__(self) -> str:
        return short_repr(self, f"{self.area_m2:.1f} m² free")

    @property
    def area_m2(self) -> float:
        """Free area."""
        return float(self.is_free.sum()) * self.cell_m**2

    def places(self) -> NDArray[np.intp]:
        """Free cells (n, 2), rows and columns."""
        return np.argwhere(self.is_free)

    def cell_of(self, point_m: NDArray[np.float64]) -> tuple[int, int] | None:
        """Row and column of a point (2,), or None: it is beyond the floor plan."""
        column, row = np.floor((point_m - self.low_m) / self.cell_m).astype(int)
        rows, columns = self.is_free.shape
        return (row, column) if 0 <= row < rows and 0 <= column < columns else None

    def is_free_at(self, point_m: NDArray[np.float64]) -> bool:
        """True where the footprint stands at a point (2,)."""
        cell = self.cell_of(point_m)
        return cell is not None and bool(self.is_free[cell])

    def clears(self, cell: tuple[int, int], radius_m: float) -> bool:
        """True where another footprint, as high, stands anywhere in a cell."""
        has_floor = bool(np.isfinite(self.floor_m[cell]))
        return has_floor and self.clearance_m[cell] >= radius_m + MARGIN_CELLS * self.cell_m

    def point_in(self, cell: NDArray[np.intp], shares: tuple[float, float]) -> NDArray[np.float64]:
        """Point (3,) on the floor, at shares of a cell's sides."""
        row, column = cell
        x, y = self.low_m + self.cell_m * (np.array((column, row)) + shares)
        return np.array((x, y, self.floor_m[row, column]))


def find_free_space(
    scene: Scene,
    radius_m: float,
    height_m: float,
    step_m: float,
    floor_m: float | None = None,
    from_start: bool = True,
) -> FreeSpace:
    """Find the free floor of a scene.

    Args:
        scene: static scene.
        radius_m: of the footprint.
        height_m: of what stands on it: surfaces above do not count.
        step_m: surfaces no higher than this above the floor do not count.
        floor_m: height of the floor; None: the one below the scene's start.
        from_start: only what hangs together with the scene's start, or, where that is not free,
            the largest part.

    Raises:
        PlanError: there is no such place.
    """
    cell_m = radius_m / CELLS_PER_RADIUS
    low, high = (corner[:2] for corner in scene.bounds_m())
    start = np.array(scene.start.position_m[:2])
    low = np.maximum(low, start - 0.5 * MOST_CELLS * cell_m) - cell_m
    high = np.minimum(high, start + 0.5 * MOST_CELLS * cell_m) + cell_m
    columns, rows = np.maximum(np.ceil((high - low) / cell_m).astype(int), 1)
    if floor_m is None:
        floor_m = _floor_at_start(scene)
    triangles = triangles_within(scene, low, high)
    grid = _Grid(low, cell_m, (int(rows), int(columns)))
    floor = grid.floor(triangles, floor_m, step_m)
    obstacles = grid.obstacles(triangles, floor, step_m, height_m)
    clearance = scipy.ndimage.distance_transform_edt(~obstacles).astype(np.float32) * cell_m
    free = np.isfinite(floor) & (clearance >= radius_m + MARGIN_CELLS * cell_m)
    if from_start:
        free = _region(free, grid.cells(start[None])[0])
    if not free.any():
        raise PlanError(
            f"{scene.name}: no free floor at {floor_m:.3g} m for a radius of {radius_m:g} m and a "
            f"height of {height_m:g} m: expected a smaller radius_m, or another floor_m"
        )
    return FreeSpace(low, cell_m, floor, clearance, free)


def _floor_at_start(scene: Scene) -> float:
    x, y, z = scene.start.position_m
    below = floor_height_m(scene, (x, y), scene.bounds_m()[0][2])
    found = [floor_height_m(scene, (x, y), near) for near in np.linspace(0.0, z, 16)]
    heights = [height for height in (below, *found) if height is not None and height <= z]
    return max(heights) if heights else float(scene.bounds_m()[0][2])


def _region(free: NDArray[np.bool_], start: NDArray[np.intp]) -> NDArray[np.bool_]:
    """The part of the free cells that the start is in, or else the largest."""
    parts, count = scipy.ndimage.label(free)
    if not count:
        return free
    row, column = start
    inside = 0 <= row < free.shape[0] and 0 <= column < free.shape[1]
    own = int(parts[row, column]) if inside else 0
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    region: NDArray[np.bool_] = parts == (own or int(np.argmax(sizes)))
    return region


@dataclass(frozen=True, eq=False)
class _Grid:
    """Cells of a floor plan."""

    low_m: NDArray[np.float64]
    cell_m: float
    shape: tuple[int, int]

    def cells(self, points_m: NDArray[np.float64]) -> NDArray[np.intp]:
        """Rows and columns (n, 2) of points (n, 2 or 3)."""
        columns_rows = np.floor((points_m[:, :2] - self.low_m) / self.cell_m).astype(np.intp)
        return columns_rows[:, ::-1]

    def floor(self, triangles: Triangles, floor_m: float, step_m: float) -> NDArray[np.float32]:
        """Heights of the floor at the cells' middles: the highest surface seen from above that a
        step leads to from the given height. A plate on the ground is the floor, a table is not."""
        corners = triangles[triangles.seen_from_above].corners_m
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat = np.abs(normals[:, 2]) > LEAST_UP * np.linalg.norm(normals, axis=1)
        reach_m = max(step_m, 0.5 * self.cell_m)
        near = np.abs(corners[..., 2] - floor_m).min(axis=1) <= reach_m
        corners = corners[flat & near]
        heights = np.full(self.shape, np.nan, dtype=np.float32)
        large = np.ptp(corners[..., :2], axis=1).max(axis=1) > LARGE_CELLS * self.cell_m
        for corner in corners[large]:
            (top, left), (bottom, right) = self._cells_below(corner)
            rows, columns = np.mgrid[top:bottom, left:right]
            middles = self.low_m + self.cell_m * (np.stack((columns, rows), axis=-1) + 0.5)
            z = heights_in(corner, middles)
            z[np.abs(z - floor_m) > reach_m] = np.nan
            part = heights[top:bottom, left:right]
            np.fmax(part, z, out=part, casting="same_kind")
        for points in surface_points(corners[~large], self.cell_m):
            points = points[np.abs(points[:, 2] - floor_m) <= reach_m]
            rows, columns, points = self._inside(points)
            np.fmax.at(heights, (rows, columns), points[:, 2].astype(np.float32))
        return heights

    def _inside(
        self, points_m: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
        """Rows and columns (k,) of the points (n, 3) on the floor plan, and these points."""
        cells = self.cells(points_m)
        is_inside = np.all((cells >= 0) & (cells < self.shape), axis=1)
        rows, columns = cells[is_inside].T
        return rows, columns, points_m[is_inside]

    def _cells_below(self, corners_m: NDArray[np.float64]) -> NDArray[np.intp]:
        """First and last cell, exclusive, below some points (n, 3)."""
        cells = self.cells(corners_m)
        found: NDArray[np.intp] = np.stack((cells.min(axis=0), cells.max(axis=0) + 1))
        return np.clip(found, 0, self.shape)

    def obstacles(
        self, triangles: Triangles, floor: NDArray[np.float32], step_m: float, height_m: float
    ) -> NDArray[np.bool_]:
        """Cells with a surface between a step and a height above the floor there."""
        found = np.zeros(self.shape, dtype=bool)
        if not np.isfinite(floor).any():
            return found
        lowest, highest = float(np.nanmin(floor)), float(np.nanmax(floor))
        filled = np.where(np.isfinite(floor), floor, lowest)
        band = (lowest + step_m, highest + height_m)
        for points in surface_points(triangles.corners_m, self.cell_m, band):
            rows, columns, points = self._inside(points)
            above = points[:, 2] - filled[rows, columns]
            inside = (above > step_m) & (above < height_m)
            found[rows[inside], columns[inside]] = True
        return found


def heights_in(
    corners_m: NDArray[np.float64], points_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heights (...,) of a triangle (3, 3) above points (..., 2); NaN beside it."""
    a, b, c = corners_m
    matrix = np.column_stack((a[:2] - c[:2], b[:2] - c[:2]))
    first, second = np.moveaxis((points_m - c[:2]) @ np.linalg.inv(matrix).T, -1, 0)
    third = 1.0 - first - second
    inside = np.minimum(np.minimum(first, second), third) >= -EDGE
    return np.where(inside, first * a[2] + second * b[2] + third * c[2], np.nan)


def surface_points(
    corners_m: NDArray[np.float64],
    spacing_m: float,
    band_m: tuple[float, float] = (-np.inf, np.inf),
) -> Iterator[NDArray[np.float64]]:
    """Points (n, 3) on triangles (m, 3, 3) between two heights, in parts.

    Triangles are halved across their longest edge until that is short: each point of them is within
    the spacing of a point that is found.
    """
    while len(corners_m):
        z = corners_m[..., 2]
        corners_m = corners_m[(z.max(axis=1) >= band_m[0]) & (z.min(axis=1) <= band_m[1])]
        edges = np.roll(corners_m, -1, axis=1) - corners_m
        squares = np.einsum("nij,nij->ni", edges, edges)
        longest = squares.argmax(axis=1)
        rows = np.arange(len(corners_m))
        is_short = squares[rows, longest] <= spacing_m**2
        yield corners_m[is_short].mean(axis=1)
        rows, longest = rows[~is_short], longest[~is_short]
        first, second = corners_m[rows, longest], corners_m[rows, (longest + 1) % 3]
        third, middle = corners_m[rows, (longest + 2) % 3], 0.5 * (first + second)
        corners_m = np.concatenate(
            (np.stack((first, middle, third), axis=1), np.stack((middle, second, third), axis=1))
        )
