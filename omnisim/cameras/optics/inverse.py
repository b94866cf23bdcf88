"""Projection of points to pixels by Fermat's principle: Newton's method on the path length.

The optical path from the camera through one point on each surface to the target is stationary. The
unknowns are the points on the surfaces, with two coordinates each. Steps are taken in the tangent
planes, with the surface curvature in the Hessian, and end on the surfaces.

Source: Fermat; for one mirror Swaminathan, Grossberg & Nayar 2001. Newton's method on a surface:
Absil, Mahony & Sepulchre, Optimization Algorithms on Matrix Manifolds (2008), chapter 6.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
import scipy  # its submodules load on first use
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import CentralCamera, Pixels
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.surface import Surface
from omnisim.cameras.optics.tracing import Fate, Paths

_GRID = 64  # starting rays of Newton's method per image side
_FAR_TURN = 0.5  # chord between neighboring rays above which more rays are traced between them
_MAX_CELLS, _PARTS = 256, 8  # number of refined grid cells, and subdivisions per side
_MARGIN = 0.02  # margin around the image, as a share of its side
_STARTS = 4  # nearest rays by direction, of which the best is used
_ITERATIONS = 30
_CONVERGED = 1e-13  # step size, as a share of the path length
_MAX_STEP = 0.5  # maximum step relative to the surface's radius of curvature and distance
_RETRIES = (0, 1, 2, 3, 5, 8, 13, 21)  # ranks among all rays by distance from the point
_POINTS_PER_BATCH = 1 << 13
_MISS = (
    1e-7  # maximum distance between a pixel's ray and its point, relative to the point's distance
)
_NEAREST = 64  # nearest rays that start the search for all pixels, besides the local minima
_SAME_PX = 1e-5


class Targets(NamedTuple):
    """Points to project."""

    points: Floats  # (n, 3), system frame: positions in meters, or directions
    weight: float  # 1: positions; 0: directions to infinity

    def take(self, rows: NDArray[np.int64] | slice) -> Targets:
        """Selected targets."""
        return Targets(self.points[rows], self.weight)


class TraceableSystem(Protocol):
    """Parts of an optical system that its inverse needs."""

    @property
    def camera(self) -> CentralCamera: ...  # noqa: D102

    @property
    def surfaces(self) -> tuple[Surface, ...]: ...  # noqa: D102

    @property
    def indices(self) -> tuple[float, ...]: ...  # noqa: D102

    @property
    def system_from_camera(self) -> NDArray[np.float64]: ...  # noqa: D102

    def paths(self, pixels_px: ArrayLike) -> Paths:
        """Paths of the rays of pixels (n, 2)."""
        ...

    def camera_directions(self, points_m: Floats) -> Floats:
        """Unit directions (n, 3), camera frame, to points (n, 3) in the system frame."""
        ...


class Inverse:
    """Solver from points to pixels; traces its starting rays once.

    Args:
        system: optical system to invert.

    Raises:
        OpticsError: no pixel sees anything.
    """

    def __init__(self, system: TraceableSystem):
        self._system = system
        self._camera_m = system.system_from_camera[:3, 3]
        grid = _grid(system.camera)
        paths = system.paths(grid.reshape(-1, 2))
        self._seen = (paths.fates == Fate.SEEN).reshape(grid.shape[:2])
        more = _between(grid, paths.directions.reshape(*grid.shape[:2], 3))
        if len(more):  # appended to the grid's rays
            paths = _joined(paths, system.paths(more))
        rows = np.flatnonzero(paths.fates == Fate.SEEN)
        self._points_m = paths.points_m[1:, rows]  # (surfaces, rays, 3)
        self._directions = paths.directions[rows]
        self._origins_m = paths.points_m[-1, rows]
        self._middle_m = self._origins_m.mean(axis=0) if len(rows) else np.zeros(3)
        self._tree = scipy.spatial.cKDTree(self._directions) if len(rows) else None

    def pixels(self, targets: Targets) -> Pixels:
        """Pixels (n, 2) of points; valid if the pixel's ray passes through the point."""
        positions_px = np.zeros((len(targets.points), 2))
        valid = np.zeros(len(targets.points), dtype=np.bool_)
        if self._tree is None:
            return Pixels(positions_px, valid)
        finite = np.flatnonzero(np.isfinite(targets.points).all(axis=1))
        for first in range(0, len(finite), _POINTS_PER_BATCH):
            rows = finite[first : first + _POINTS_PER_BATCH]
            positions_px[rows], valid[rows] = self._solved(targets.take(rows))
        return Pixels(positions_px, valid)

    def all_pixels(self, target: Targets) -> Floats:
        """All pixels (n, 2) that show one point, searched from each locally nearest ray."""
        all_misses = self._misses(target)[0]
        misses = np.full(self._seen.shape, np.inf)
        misses[self._seen] = all_misses[: int(self._seen.sum())]
        around = scipy.ndimage.minimum_filter(misses, size=3, mode="constant", cval=np.inf)
        is_least = (misses == around)[self._seen]
        nearest = np.argsort(all_misses)[:_NEAREST]  # near a fold, two pixels are close
        starts = np.union1d(np.flatnonzero(is_least), nearest)
        many = Targets(np.repeat(target.points, len(starts), axis=0), target.weight)
        pixels, valid = self._from_starts(many, starts)
        kept: list[Floats] = []
        for pixel in pixels[valid]:
            if all(np.abs(pixel - other).max() > _SAME_PX for other in kept):
                kept.append(pixel)
        return np.array(kept).reshape(-1, 2)

    def _solved(self, targets: Targets) -> Pixels:
        """Pixels by the nearest ray; retries with other rays where it fails."""
        assert self._tree is not None
        toward = targets.points - targets.weight * self._middle_m
        toward = toward / np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-300)
        count = min(_STARTS, len(self._directions))
        nearest = np.asarray(self._tree.query(toward, k=np.arange(1, count + 1))[1])
        misses = np.stack([self._miss(targets, nearest[:, k]) for k in range(count)], axis=1)
        starts = nearest[np.arange(len(nearest)), misses.argmin(axis=1)]
        positions_px, valid = self._from_starts(targets, starts)
        rest = np.flatnonzero(~valid)
        if len(rest):
            # only rays of the even grid: the first ranks among the dense rays are all in one place
            all_misses = self._misses(targets.take(rest))[:, : int(self._seen.sum())]
            order = np.argsort(all_misses, axis=1)
            tried = starts[rest]
            for rank in _RETRIES[: order.shape[1]]:
                candidates = order[:, min(rank, order.shape[1] - 1)]
                again = np.flatnonzero(~valid[rest] & (candidates != tried))
                pixels, good = self._from_starts(targets.take(rest[again]), candidates[again])
                positions_px[rest[again[good]]], valid[rest[again[good]]] = pixels[good], True
        return Pixels(positions_px, valid)

    def _miss(self, targets: Targets, rays: NDArray[np.int64]) -> Floats:
        """Squared chord (n,) between each ray's direction and the direction to its target."""
        toward = targets.points - targets.weight * self._origins_m[rays]
        toward = toward / np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-300)
        return np.sum((toward - self._directions[rays]) ** 2, axis=1)

    def _misses(self, targets: Targets) -> Floats:
        """Squared chords (n, rays) between rays and the directions from them to each target."""
        return np.stack(
            [
                self._miss(
                    Targets(np.broadcast_to(point, self._origins_m.shape), targets.weight),
                    np.arange(len(self._origins_m)),
                )
                for point in targets.points
            ]
        )

    def _from_starts(self, targets: Targets, starts: NDArray[np.int64]) -> Pixels:
        """Pixels by Newton's method from rays (n,); valid if their traced rays agree."""
        points = self._stationary(targets, self._points_m[:, starts])
        directions = self._system.camera_directions(
            points[0] if len(points) else targets.points + (1.0 - targets.weight) * self._camera_m
        )
        directions[~np.isfinite(directions).all(axis=1)] = (0.0, 0.0, -1.0)
        pixels = self._system.camera.pixel_from_ray(directions).positions_px
        pixels = np.where(np.isfinite(pixels), pixels, 0.0)
        paths = self._system.paths(pixels)
        toward = targets.points - targets.weight * np.nan_to_num(paths.points_m[-1])
        length = np.linalg.norm(toward, axis=1, keepdims=True)
        miss = np.linalg.norm(toward / np.maximum(length, 1e-300) - paths.directions, axis=1)
        return Pixels(pixels, (paths.fates == Fate.SEEN) & (miss < _MISS))

    def _stationary(self, targets: Targets, starts_m: Floats) -> Floats:
        """Points (surfaces, n, 3) of stationary paths, from initial points."""
        points = starts_m.copy()
        active = np.arange(points.shape[1])
        for _ in range(_ITERATIONS if len(points) else 0):
            if len(active) == 0:
                break
            moving_points = points[:, active]
            with np.errstate(all="ignore"):  # points that diverge; tracing their rays rejects them
                steps, limits = self._newton_steps(targets.take(active), moving_points)
                lengths = np.linalg.norm(steps, axis=2)
                shares = np.minimum(1.0, (limits / np.maximum(lengths, 1e-300)).min(axis=0))
                moving_points = moving_points + shares[:, None] * steps
                for number, surface in enumerate(self._system.surfaces):
                    moving_points[number] = _retracted(surface, moving_points[number])
            points[:, active] = moving_points
            moving = (lengths > _CONVERGED * limits).any(axis=0)
            active = active[moving & np.isfinite(moving_points).all(axis=(0, 2))]
        return points

    def _newton_steps(self, targets: Targets, points: Floats) -> tuple[Floats, Floats]:
        """Newton steps (surfaces, n, 3) in the tangent planes, and their limits (surfaces, n)."""
        surfaces, indices = self._system.surfaces, self._system.indices
        count, n = len(surfaces), points.shape[1]
        begins = np.concatenate((np.broadcast_to(self._camera_m, (1, n, 3)), points))
        ends = np.concatenate((points, targets.points[None]))
        ways = ends - begins  # from each point to the next
        if targets.weight == 0.0:
            ways[-1] = targets.points
        lengths = np.linalg.norm(ways, axis=2)
        ways /= lengths[..., None]
        inverse_lengths = 1.0 / lengths
        if targets.weight == 0.0:
            inverse_lengths[-1] = 0.0
        weights = np.array(indices)[:, None] * inverse_lengths
        across = np.eye(3) - ways[..., :, None] * ways[..., None, :]
        across *= weights[..., None, None]
        gradient = np.zeros((n, 2 * count))
        hessian = np.zeros((n, 2 * count, 2 * count))
        limits = np.linalg.norm(points - self._camera_m, axis=2)
        if targets.weight:
            limits[-1] = np.minimum(limits[-1], lengths[-1])
        bases = []
        for number, surface in enumerate(surfaces):
            pull = indices[number] * ways[number] - indices[number + 1] * ways[number + 1]
            local = surface.points_from_system(points[number])
            slope = surface.shape.level(local).gradients
            curvature = surface.shape.hessians(local)
            slope = surface.directions_to_system(slope)
            squared = np.einsum("nj,nj->n", slope, slope)
            multiplier = np.einsum("nj,nj->n", pull, slope) / squared
            bending = np.sqrt(np.einsum("nij,nij->n", curvature, curvature) / squared)
            limits[number] = np.minimum(limits[number], 1.0 / np.maximum(bending, 1e-300))
            rotation = surface.system_from_surface[:3, :3]
            bend = np.einsum("ia,nab,jb->nij", rotation, curvature, rotation)
            block = across[number] + across[number + 1] - multiplier[:, None, None] * bend
            basis = _tangents(slope)
            bases.append(basis)
            at = slice(2 * number, 2 * number + 2)
            gradient[:, at] = np.einsum("nja,nj->na", basis, pull)
            hessian[:, at, at] = np.einsum("nia,nij,njb->nab", basis, block, basis)
            if number > 0:
                before = slice(2 * number - 2, 2 * number)
                mixed = -np.einsum("nia,nij,njb->nab", bases[-2], across[number], basis)
                hessian[:, before, at] = mixed
                hessian[:, at, before] = np.swapaxes(mixed, 1, 2)
        steps = -_solutions(hessian, gradient)
        moves: Floats = np.stack(
            [
                np.einsum("nja,na->nj", basis, steps[:, 2 * number : 2 * number + 2])
                for number, basis in enumerate(bases)
            ]
        )
        return moves, _MAX_STEP * limits


def _grid(camera: CentralCamera) -> Floats:
    """Pixels (rows, columns, 2) across the image and a margin around it."""
    sides = [
        np.linspace(-0.5 - _MARGIN * size, size - 0.5 + _MARGIN * size, _GRID)
        for size in (camera.width_px, camera.height_px)
    ]
    return np.stack(np.meshgrid(*sides), axis=-1)


def _between(grid: Floats, directions: Floats) -> Floats:
    """Pixels (n, 2) within grid cells over which rays turn far, as at the tip of a cone."""
    turns = np.zeros((len(grid) - 1, len(grid) - 1))
    for corner in (directions[1:, :-1], directions[:-1, 1:], directions[1:, 1:]):
        turn = np.linalg.norm(corner - directions[:-1, :-1], axis=2)
        turns = np.maximum(turns, np.nan_to_num(turn))  # NaN: one of the rays is not seen
    cells = np.argwhere(turns > _FAR_TURN)[:_MAX_CELLS]
    shares = (np.arange(_PARTS) + 0.5) / _PARTS
    first, last = grid[cells[:, 0], cells[:, 1]], grid[cells[:, 0] + 1, cells[:, 1] + 1]
    offsets = np.stack(np.meshgrid(shares, shares), axis=-1).reshape(-1, 2)
    pixels: Floats = first[:, None] + (last - first)[:, None] * offsets
    return pixels.reshape(-1, 2)


def _joined(first: Paths, second: Paths) -> Paths:
    """Concatenate the paths of rays."""
    return Paths(
        np.concatenate((first.points_m, second.points_m), axis=1),
        np.concatenate((first.directions, second.directions)),
        np.concatenate((first.fates, second.fates)),
    )


def _tangents(normals: Floats) -> Floats:
    """Orthonormal bases (n, 3, 2) of the planes perpendicular to normals (n, 3) of any length."""
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    smallest = np.eye(3)[np.abs(unit).argmin(axis=1)]
    first = np.cross(unit, smallest)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, np.cross(unit, first)), axis=2)


def _retracted(surface: Surface, points_m: Floats) -> Floats:
    """Points (n, 3) moved onto a surface's shape along its gradient."""
    local = surface.points_from_system(points_m)
    for _ in range(3):
        values, gradients = surface.shape.level(local)
        squared = np.einsum("nj,nj->n", gradients, gradients)
        local = local - (values / squared)[:, None] * gradients
    return surface.directions_to_system(local) + surface.system_from_surface[:3, 3]


def _solutions(matrices: Floats, vectors: Floats) -> Floats:
    """Solutions (n, m) of linear systems (n, m, m); NaN where one is singular or not finite."""
    good = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(vectors).all(axis=1)
    solutions = np.full(vectors.shape, np.nan)
    rows = np.flatnonzero(good)
    if len(rows):
        scale = np.abs(matrices[rows]).max(axis=(1, 2))
        unit = matrices[rows] / scale[:, None, None]
        kept = np.abs(np.linalg.det(unit)) > 1e-300
        # solves the scaled matrices that were tested: before rounding they may be singular
        solved = np.linalg.solve(unit[kept], vectors[rows[kept]][..., None])[..., 0]
        solutions[rows[kept]] = solved / scale[kept, None]
    return solutions
