"""Free space: floor of a scene on which a footprint stands without contact.

The floor plan is divided into cells. Triangles are sampled more densely than the cells. The samples
give each cell's floor height. A cell is an obstacle if a sample lies above the maximum step height
and below the height of the object, both measured from the floor. The distance from a cell to the
nearest obstacle is the cell's clearance.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy  # its submodules load when first used

from omnisim.core.arrays import Bools, Floats, Floats32, Indices, triangle_bounds
from omnisim.core.errors import PlanError
from omnisim.core.files.atomic_file import atomic_write
from omnisim.core.short_repr import short_repr
from omnisim.scene.model import Scene
from omnisim.scene.space.floor import HeightField, triangles_within

MAX_CELLS = 1000  # per side of the floor plan, around the scene's start
CELLS_PER_RADIUS = 4.0
# Distances from a surface to its nearest sampled point, and from both ends to their cells' middles.
MARGIN_CELLS = 2.0 / 3.0 + math.sqrt(2.0)
WINDOW_CELLS = 160, 320  # from the start to the sides of smaller floor plans, tried first
LARGE_CELLS = 16.0  # larger triangles of the floor are looked up cell by cell


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Free floor of a scene for a footprint."""

    # (2,) corner of the floor plan with the smallest x and y, world frame
    low_m: Floats
    cell_m: float  # side of a cell
    # (rows, columns) height of each cell's floor, rows along y, columns along x; NaN: no floor
    floor_m: Floats32
    # (rows, columns) horizontal distance from each cell to the nearest obstacle
    clearance_m: Floats32
    is_free: Bools  # (rows, columns) True: the footprint can stand in the cell

    def __repr__(self) -> str:
        return short_repr(self, f"{self.area_m2:.1f} m² free")

    @property
    def area_m2(self) -> float:
        """Free area."""
        return float(self.is_free.sum()) * self.cell_m**2

    def free_cells(self) -> Indices:
        """Row and column (n, 2) of each free cell."""
        return np.argwhere(self.is_free)

    def cell_of(self, point_m: Floats) -> tuple[int, int] | None:
        """Row and column of the cell that contains a point (2,); None: outside the floor plan."""
        column, row = np.floor((point_m - self.low_m) / self.cell_m).astype(int)
        rows, columns = self.is_free.shape
        return (row, column) if 0 <= row < rows and 0 <= column < columns else None

    def is_free_at(self, point_m: Floats) -> bool:
        """True if the footprint can stand at a point (2,)."""
        cell = self.cell_of(point_m)
        return cell is not None and bool(self.is_free[cell])

    def clears(self, cell: tuple[int, int], radius_m: float) -> bool:
        """True if an object of another radius and the same height can stand anywhere in a cell."""
        has_floor = bool(np.isfinite(self.floor_m[cell]))
        return has_floor and self.clearance_m[cell] >= radius_m + MARGIN_CELLS * self.cell_m

    def point_in(self, cell: Indices, shares: tuple[float, float]) -> Floats:
        """Point (3,) on a cell's floor; `shares` of the cell's sides along x and y, 0 to 1."""
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
        radius_m: radius of the footprint.
        height_m: height of the object: surfaces higher above the floor are no obstacles.
        step_m: maximum step height: surfaces up to this height above the floor are no obstacles.
        floor_m: height of the floor; None: of the highest surface below the scene's start.
        from_start: True: only the part connected to the scene's start, or the largest part if the
            start is not free; False: all free cells.

    Raises:
        PlanError: there is no free floor.
    """
    start = np.array(scene.start.position_m[:2])
    grid = _Grid.of_scene(scene, radius_m / CELLS_PER_RADIUS)
    if floor_m is None:  # the highest surface below the scene's start, or its lowest point
        heights = HeightField(scene, start, start).heights_m(start[None, None])
        below = heights[np.isfinite(heights) & (heights <= scene.start.position_m[2])]
        floor_m = float(below.max(initial=scene.bounds_m()[0][2]))
    reach_m = radius_m + MARGIN_CELLS * grid.cell_m
    windows = grid.windows(start) if from_start else ()
    for window in (*windows, grid):
        floor, clearance = window.floor_and_clearance(scene, floor_m, step_m, height_m)
        free = np.isfinite(floor) & (clearance >= reach_m)
        if from_start:
            free = _region(free, window.cells(start[None])[0], or_largest=window is grid)
        if window is not grid:  # surfaces beyond its edge may be as near as the edge
            edge_m = window.edge_distance_m()
            clearance = np.minimum(clearance, edge_m)
            if np.any(edge_m[free] <= reach_m):
                continue
        if free.any():
            return FreeSpace(window.low_m, window.cell_m, floor, clearance, free)
    raise PlanError(
        f"{scene.name}: no free floor at {floor_m:.3g} m for a radius of {radius_m:g} m and a "
        f"height of {height_m:g} m: expected a smaller radius_m, or another floor_m"
    )


def _region(free: Bools, start: Indices, or_largest: bool) -> Bools:
    """Mask (rows, columns) of the free cells connected to the start's cell.

    If the start is not free: the largest connected part with `or_largest`, else no cell.
    """
    parts, _ = scipy.ndimage.label(free)
    row, column = start
    inside = 0 <= row < free.shape[0] and 0 <= column < free.shape[1]
    own = int(parts[row, column]) if inside else 0
    if not own and or_largest:
        sizes = np.bincount(parts.ravel())
        sizes[0] = 0
        own = int(np.argmax(sizes))
    return (parts == own) & free


@dataclass(frozen=True, eq=False)
class _Grid:
    """Cells of a floor plan."""

    low_m: Floats
    cell_m: float
    shape: tuple[int, int]

    @classmethod
    def of_scene(cls, scene: Scene, cell_m: float) -> _Grid:
        """Grid of a scene's floor plan, at most `MAX_CELLS` wide around the scene's start."""
        low, high = (corner[:2] for corner in scene.bounds_m())
        start = np.array(scene.start.position_m[:2])
        low = np.maximum(low, start - 0.5 * MAX_CELLS * cell_m) - cell_m
        high = np.minimum(high, start + 0.5 * MAX_CELLS * cell_m) + cell_m
        columns, rows = np.maximum(np.ceil((high - low) / cell_m).astype(int), 1)
        return cls(low, cell_m, (int(rows), int(columns)))

    @property
    def high_m(self) -> Floats:
        """Corner (2,) of the floor plan with the largest x and y."""
        return self.low_m + self.cell_m * np.array(self.shape[::-1])

    def windows(self, point_m: Floats) -> Iterator[_Grid]:
        """Smaller grids of the same cells around a point (2,), smallest first."""
        row_column = self.cells(point_m[None])[0]
        for half in WINDOW_CELLS:
            first = np.clip(row_column - half, 0, self.shape)
            last = np.clip(row_column + half, 0, self.shape)
            rows, columns = (last - first).tolist()
            if 0 < 2 * rows * columns < math.prod(self.shape):  # otherwise it saves nothing
                low_m = self.low_m + self.cell_m * first[::-1]
                yield _Grid(low_m, self.cell_m, (rows, columns))

    def edge_distance_m(self) -> Floats32:
        """Distances (rows, columns) from the cells' middles to the nearest edge."""
        along = [np.minimum(np.arange(count), np.arange(count)[::-1]) for count in self.shape]
        distances = np.minimum(along[0][:, None], along[1]) + np.float32(0.5)
        return (distances * np.float32(self.cell_m)).astype(np.float32)

    def floor_and_clearance(
        self, scene: Scene, floor_m: float, step_m: float, height_m: float
    ) -> tuple[Floats32, Floats32]:
        """Heights of the floor, and clearances, (rows, columns) each, as in `FreeSpace`."""
        triangles = triangles_within(scene, self.low_m, self.high_m)
        reach_m = max(step_m, 0.5 * self.cell_m)
        from_floor_m = np.abs(triangles.corners_m[..., 2] - floor_m)
        walked = is_flat(triangles.corners_m) & triangles.seen_from_above
        floor = self._floor(
            triangles.corners_m[walked & (from_floor_m.min(axis=1) <= reach_m)], floor_m, reach_m
        )
        # a plan that is all floor has no obstacle
        others = triangles.corners_m[~(walked & (from_floor_m.max(axis=1) <= reach_m))]
        obstacles = self._obstacles(others, floor, step_m, height_m)
        clearance = scipy.ndimage.distance_transform_edt(~obstacles).astype(np.float32)
        return floor, clearance * np.float32(self.cell_m)

    def cells(self, points_m: Floats) -> Indices:
        """Rows and columns (n, 2) of points (n, 2 or 3)."""
        columns_rows = np.floor((points_m[:, :2] - self.low_m) / self.cell_m).astype(np.intp)
        return columns_rows[:, ::-1]

    def _floor(self, corners: Floats, floor_m: float, reach_m: float) -> Floats32:
        """Heights (rows, columns) of the floor at the cells' middles; NaN: no floor.

        The floor is the highest surface at most `reach_m` above or below `floor_m`: a plate on the
        ground is part of it, a table is not.
        """
        heights = np.full(self.shape, np.nan, dtype=np.float32)
        large = np.ptp(corners[..., :2], axis=1).max(axis=1) > LARGE_CELLS * self.cell_m
        for corner in corners[large]:
            cells = self.cells(corner)
            bounds: Indices = np.stack((cells.min(axis=0), cells.max(axis=0) + 1))
            (top, left), (bottom, right) = np.clip(bounds, 0, self.shape)
            rows, columns = np.mgrid[top:bottom, left:right]
            middles = self.low_m + self.cell_m * (np.stack((columns, rows), axis=-1) + 0.5)
            z = heights_in(corner, middles)
            z[np.abs(z - floor_m) > reach_m] = np.nan
            part = heights[top:bottom, left:right]
            np.fmax(part, z, out=part, casting="same_kind")
        for points in surface_points(corners[~large], self.cell_m):
            points = points[np.abs(points[:, 2] - floor_m) <= reach_m]
            numbers, rows, columns = self._inside(points)
            np.fmax.at(heights, (rows, columns), points[numbers, 2].astype(np.float32))
        return heights

    def _inside(self, points_m: Floats) -> tuple[Indices, ...]:
        """Indices (k,) of the points (n, 2 or 3) on the floor plan, and their rows and columns."""
        cells = self.cells(points_m)
        numbers = np.flatnonzero(np.all((cells >= 0) & (cells < self.shape), axis=1))
        rows, columns = cells[numbers].T
        return numbers, rows, columns

    def _obstacles(self, corners: Floats, floor: Floats32, step_m: float, height_m: float) -> Bools:
        """Mask (rows, columns) of cells with a surface `step_m` to `height_m` above the floor."""
        blocked = np.zeros(self.shape, dtype=bool)
        if not np.isfinite(floor).any():
            return blocked
        lowest, highest = float(np.nanmin(floor)), float(np.nanmax(floor))
        filled = np.where(np.isfinite(floor), floor, lowest)
        low_m = np.array((*self.low_m, lowest + step_m))
        high_m = np.array((*self.high_m, highest + height_m))
        flat = is_flat(corners)
        for own, counts in ((corners[flat], "middle"), (corners[~flat], "all")):
            for pieces in columns_of(own, self.cell_m, low_m, high_m):
                middles, z = pieces.mean(axis=1), pieces[..., 2]
                numbers, rows, columns = self._inside(middles)
                # a walkable slope counts at its middle, as the floor does
                low, high = (
                    (middles[numbers, 2],) * 2
                    if counts == "middle"
                    else (z.min(axis=1)[numbers], z.max(axis=1)[numbers])
                )
                below = filled[rows, columns]
                inside = (high > below + step_m) & (low < below + height_m)
                blocked[rows[inside], columns[inside]] = True
        return blocked


# Files of free floors, computed once for a data set and read by all of its processes.


PATTERN = ".free-*.npz"  # hidden, as they are not part of the data set


def free_space_path(folder: Path, fingerprint: str, scene: int) -> Path:
    """Path of the free floor of a scene, by the plan's fingerprint and the scene's index."""
    return folder / f".free-{fingerprint}-{scene}.npz"


def read_free_space(path: Path) -> FreeSpace | None:
    """Read a free floor; None: the file is missing or damaged."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            low_m, cell_m = arrays["low_m"], float(arrays["cell_m"])
            floor_m, clearance_m, is_free = (
                arrays[key] for key in ("floor_m", "clearance_m", "is_free")
            )
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    same = floor_m.shape == clearance_m.shape == is_free.shape
    return FreeSpace(low_m, cell_m, floor_m, clearance_m, is_free) if same else None


def write_free_space(path: Path, free: FreeSpace) -> None:
    """Write a free floor, atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.savez(
            file,
            low_m=free.low_m,
            cell_m=np.float64(free.cell_m),
            floor_m=free.floor_m,
            clearance_m=free.clearance_m,
            is_free=free.is_free,
        )


# Parts of triangles that are small compared with the cells of a floor plan.


MIN_UP = 0.5  # cosine of the maximum slope of floor: 60°
EDGE = 1e-9  # share of a triangle: a point on a common edge is in at least one triangle


def is_flat(corners_m: Floats) -> Bools:
    """Mask (n,) of triangles (n, 3, 3) with a slope below 60°, whichever side is up."""
    normals = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    return np.abs(normals[:, 2]) > MIN_UP * np.linalg.norm(normals, axis=1)


def heights_in(corners_m: Floats, points_m: Floats) -> Floats:
    """Heights (...,) of a triangle (3, 3) at points (..., 2) of the floor plan; NaN outside it."""
    a, b, c = corners_m
    matrix = np.column_stack((a[:2] - c[:2], b[:2] - c[:2]))
    first, second = np.moveaxis((points_m - c[:2]) @ np.linalg.inv(matrix).T, -1, 0)
    third = 1.0 - first - second
    inside = np.minimum(np.minimum(first, second), third) >= -EDGE
    return np.where(inside, first * a[2] + second * b[2] + third * c[2], np.nan)


def surface_points(
    corners_m: Floats, spacing_m: float, band_m: tuple[float, float] = (-np.inf, np.inf)
) -> Iterator[Floats]:
    """Points (n, 3) on triangles (m, 3, 3) within a band of heights, in batches.

    Triangles are halved across their longest edge until it is at most `spacing_m` long. Each point
    of a triangle is then within `spacing_m` of a returned point. Triangles beyond the band, lowest
    and highest height, are skipped.
    """
    while len(corners_m):
        low, high = triangle_bounds(corners_m[..., 2])
        corners_m = corners_m[(high >= band_m[0]) & (low <= band_m[1])]
        short, corners_m = _halved(corners_m, spacing_m)
        yield short.mean(axis=1)


def columns_of(
    corners_m: Floats, spacing_m: float, low_m: Floats, high_m: Floats
) -> Iterator[Floats]:
    """Parts (n, 3, 3) of triangles (m, 3, 3) in a box, in batches; each is small on the floor plan.

    The height of a part is not limited.
    """
    while len(corners_m):
        low, high = triangle_bounds(corners_m)
        near = np.all((high >= low_m) & (low <= high_m), axis=1)
        short, corners_m = _halved(corners_m[near], spacing_m, axes=2)
        yield short


def _halved(corners_m: Floats, spacing_m: float, axes: int = 3) -> tuple[Floats, Floats]:
    """Triangles with edges up to `spacing_m` along the first axes, and the halves of all others."""
    planned = corners_m[..., :axes]
    edges = planned[:, (1, 2, 0)] - planned
    squares = np.einsum("nij,nij->ni", edges, edges)
    longest = squares.argmax(axis=1)
    is_short = np.take_along_axis(squares, longest[:, None], 1)[:, 0] <= spacing_m**2
    rows, longest = np.flatnonzero(~is_short), longest[~is_short]
    first, second = corners_m[rows, longest], corners_m[rows, (longest + 1) % 3]
    third, middle = corners_m[rows, (longest + 2) % 3], 0.5 * (first + second)
    halves = np.empty((2 * len(rows), 3, 3))
    own, other = halves[: len(rows)], halves[len(rows) :]
    own[:, 0], own[:, 1], own[:, 2] = first, middle, third
    other[:, 0], other[:, 1], other[:, 2] = middle, second, third
    return corners_m[is_short], halves
