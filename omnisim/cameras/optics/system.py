"""Optical systems: a central camera behind surfaces that reflect and refract.

The system frame is the optical frame of the nominal camera, without misalignment (x right, y down,
z forward, into the mirror). Outgoing rays are in the sensor's optical frame, which has the same
axes; the system defines its origin.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, NamedTuple, Self

import numpy as np
import scipy  # its submodules load on first use
from numpy.typing import ArrayLike
from pydantic import Field

from omnisim.cameras import CentralCamera, NonCentralCamera, Pixels, Rays, pixel_grid, summary
from omnisim.cameras.camera import (
    CameraParameters,
    Uniforms,
    as_directions,
    as_pixels,
)
from omnisim.cameras.optics.surface import (
    WAVELENGTHS_UM,
    Fate,
    Medium,
    Place,
    Primary,
    Rod,
    Surface,
    TracedPaths,
    TracedRays,
    medium_parameter,
    pose_parameters,
    refractive_index,
    trace,
)
from omnisim.core.arrays import Floats, Ints
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    BASE_FROM_OPTICAL_LOOKING_DOWN,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import NOT_IN_FILES, Flag
from omnisim.core.poses import check_pose, pose_from_rotation
from omnisim.core.short_repr import counted, short_repr

ORIENTATIONS = {
    "up": RIG_FROM_OPTICAL_LOOKING_UP,
    "ahead": BASE_FROM_OPTICAL_LOOKING_AHEAD,
    "down": BASE_FROM_OPTICAL_LOOKING_DOWN,
}


@dataclass(frozen=True, eq=False)
class OpticalSystem:
    """Non-central camera with mirrors and refracting surfaces; immutable.

    Attributes:
        camera: central camera, whose pixels are the system's pixels.
        surfaces: mirrors and boundaries, in the order of the rays from the camera.
        obstacles: opaque parts that can block rays.
        system_from_camera: (4, 4) pose of the camera's optical frame: its misalignment.
        orientation: (3, 3) rig_from_optical in a level rig; None: up into a mirror, else the
            camera's own.

    Raises:
        OmnisimError: the camera is non-central, there is no surface, a medium or color is unknown,
            or a misalignment or orientation is not a pose.
    """

    camera: CentralCamera
    surfaces: tuple[Surface, ...]
    obstacles: Annotated[tuple[Rod, ...], Field(max_length=64)] = ()
    medium: Medium = "air"
    """Medium around the camera: a name, a refractive index, or three indices for R, G and B."""
    system_from_camera: Floats = field(default_factory=lambda: np.eye(4), metadata=NOT_IN_FILES)
    origin_m: Place = (0.0, 0.0, 0.0)
    """Origin of the sensor's frame, meters in the system's frame; default: the camera's pinhole."""
    color: Primary | None = None
    """Primary color whose wavelength is traced; default: helium's d line."""
    orientation: Floats | None = field(default=None, metadata=NOT_IN_FILES)
    chromatic: Flag = False
    """Render red, green and blue along rays of their own wavelengths, at three times the cost.
    Ground truth uses green."""

    model_name = "optics"
    domain_limit_rad = None

    def __post_init__(self) -> None:
        if not isinstance(self.camera, CentralCamera):
            raise OpticsError(f"camera: expected a camera model, got {type(self.camera).__name__}")
        if isinstance(self.camera, NonCentralCamera):
            raise OpticsError("camera: expected a central camera, got an optical system")
        check_pose(self.system_from_camera)
        if self.orientation is not None:
            check_pose(pose_from_rotation(self.orientation, (0.0, 0.0, 0.0)))
        if not self.surfaces:
            raise OpticsError("surfaces: expected at least one, got none")
        if self.chromatic and self.color is not None:
            raise OpticsError(f"color: expected none, as chromatic is true, got {self.color!r}")
        assert self.indices  # raises if a medium is unknown

    def __repr__(self) -> str:
        mirrors = sum(surface.is_mirror for surface in self.surfaces)
        boundaries = counted(len(self.surfaces) - mirrors, "boundary", "boundaries")
        return short_repr(self, summary(self.camera), counted(mirrors, "mirror"), boundaries)

    @property
    def width_px(self) -> int:
        """Image width."""
        return self.camera.width_px

    @property
    def height_px(self) -> int:
        """Image height."""
        return self.camera.height_px

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """Principal point (u, v) of the camera."""
        return self.camera.principal_point_px

    @property
    def rig_from_optical(self) -> Floats:
        """Orientation (3, 3) in a level rig; default: up with a mirror, otherwise the camera's."""
        if self.orientation is not None:
            return self.orientation
        has_mirror = any(surface.is_mirror for surface in self.surfaces)
        return RIG_FROM_OPTICAL_LOOKING_UP if has_mirror else self.camera.rig_from_optical

    @cached_property
    def indices(self) -> tuple[float, ...]:
        """Refractive indices (surfaces + 1), starting at the camera."""
        media = [self.medium]
        for surface in self.surfaces:
            media.append(media[-1] if surface.medium is None else surface.medium)
        color = "G" if self.chromatic else self.color
        return tuple(refractive_index(medium, color) for medium in media)

    def surface(self, number: int, source: str) -> Surface:
        """Surface with the given number; `source` names the system in messages.

        Raises:
            OpticsError: the number is invalid.
        """
        if not 0 <= number < len(self.surfaces):
            expected = f"expected 0 to {len(self.surfaces) - 1}"
            raise OpticsError(f"{source}: surface: {expected}, got {number}")
        return self.surfaces[number]

    def scaled(self, scale: float) -> Self:
        """The same view in an image `scale` times as large; sizes are rounded."""
        return dataclasses.replace(self, camera=self.camera.scaled(scale))

    def of_color(self, color: Primary | None) -> Self:
        """The same system at the wavelength of "R", "G" or "B"; None: at the d line."""
        return dataclasses.replace(self, color=color, chromatic=False)

    def by_color(self) -> tuple[Self, ...]:
        """Systems for R, G and B if the system is chromatic and refracts; otherwise itself."""
        if not self.chromatic or all(surface.is_mirror for surface in self.surfaces):
            return (self,)
        return tuple(self.of_color(color) for color in WAVELENGTHS_UM)

    def paths(self, pixels_px: ArrayLike) -> TracedPaths:
        """Paths of the rays of pixels (n, 2), in the system frame."""
        rays = self.camera.ray_from_pixel(pixels_px)
        fates = np.where(rays.valid, Fate.SEEN, Fate.OUTSIDE).astype(np.uint8)
        directions = rays.directions @ self.system_from_camera[:3, :3].T
        origins = np.tile(self.system_from_camera[:3, 3], (len(directions), 1))
        if rays.origins_m is not None:
            origins += rays.origins_m @ self.system_from_camera[:3, :3].T
        return trace(self.surfaces, self.indices, self.obstacles, origins, directions, fates)

    def rays(self, pixels_px: ArrayLike) -> TracedRays:
        """Rays of pixels (..., 2) where they leave the system, in the sensor's optical frame."""
        pixels = as_pixels(pixels_px)
        paths = self.paths(pixels.reshape(-1, 2))
        shape = pixels.shape[:-1]
        valid = paths.fates == Fate.SEEN
        origins = np.where(valid[:, None], paths.points_m[-1] - self.origin_m, 0.0)
        directions = np.where(valid[:, None], paths.directions, (0.0, 0.0, 1.0))
        points, along = origins.reshape(*shape, 3), directions.reshape(*shape, 3)
        return TracedRays(points, along, valid.reshape(shape), paths.fates.reshape(shape))

    def all_rays(self) -> TracedRays:
        """Rays (height, width) of all pixels."""
        return self.rays(pixel_grid(self.width_px, self.height_px))

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2) with their origins, as a camera model returns them."""
        rays = self.rays(pixels_px)
        return Rays(rays.directions, rays.valid, rays.origins_m)

    def pixel_from_point(self, points_m: ArrayLike) -> Pixels:
        """Pixels of points (..., 3) in the sensor's optical frame; valid where they are seen.

        A point that is seen more than once gets one of its pixels, see `pixels_from_point`.
        """
        points = as_directions(points_m)
        return self._pixels(points + self.origin_m, 1.0)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) to points at infinity."""
        return self._pixels(as_directions(directions), 0.0)

    def pixels_from_point(self, point_m: ArrayLike) -> Floats:
        """All pixels (n, 2) of a point (3,) in the sensor's optical frame."""
        point = as_directions(point_m) + self.origin_m
        return self.inverse.all_pixels(Targets(point[None], 1.0))

    @cached_property
    def inverse(self) -> Inverse:
        """Solver from points to pixels."""
        return Inverse(self)

    def camera_directions(self, points_m: Floats) -> Floats:
        """Unit directions (n, 3), camera frame, to points (n, 3) in the system frame."""
        moved = points_m - self.system_from_camera[:3, 3]
        rotated: Floats = np.einsum("nj,ji->ni", moved, self.system_from_camera[:3, :3])
        rotated /= np.maximum(np.linalg.norm(rotated, axis=1, keepdims=True), 1e-300)
        return rotated

    def _pixels(self, points: Floats, weight: float) -> Pixels:
        pixels = self.inverse.pixels(Targets(points.reshape(-1, 3), weight))
        shape = points.shape[:-1]
        return Pixels(pixels.positions_px.reshape(*shape, 2), pixels.valid.reshape(shape))

    def uniforms(self) -> Uniforms:
        """Raise, because no shader traces these rays.

        Raises:
            OpticsError: always.
        """
        raise OpticsError("camera: an optical system has no shader")

    def parameters(self) -> CameraParameters:
        """Model name and all keys and values of an optics file, enough to rebuild the system."""
        medium, pose = medium_parameter(self.medium), pose_parameters(self.system_from_camera)
        parameters: CameraParameters = {"model": self.model_name, "medium": medium}
        parameters["origin_m"] = list(self.origin_m)
        if self.orientation is not None:
            named = (
                k for k, known in ORIENTATIONS.items() if np.array_equal(known, self.orientation)
            )
            parameters["looking"] = next(named, None) or self.orientation.tolist()
        if self.color is not None:
            parameters["color"] = self.color
        if self.chromatic:
            parameters["chromatic"] = True
        parameters["camera"] = {**self.camera.parameters(), **pose}
        parameters["surfaces"] = [surface.parameters() for surface in self.surfaces]
        if self.obstacles:
            parameters["obstacles"] = [obstacle.parameters() for obstacle in self.obstacles]
        return parameters


# Projection of points to pixels by Fermat's principle: Newton's method on the path length.
#
# The optical path from the camera through one point on each surface to the target is stationary.
# The unknowns are the points on the surfaces, with two coordinates each. Steps are taken in the
# tangent planes, with the surface curvature in the Hessian, and end on the surfaces.
#
# Source: Fermat; for one mirror Swaminathan, Grossberg & Nayar 2001. Newton's method on a
# surface: Absil, Mahony & Sepulchre, Optimization Algorithms on Matrix Manifolds (2008), chapter
# 6.


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
# Maximum distance between a pixel's ray and its point, relative to the point's distance.
_MISS = 1e-7
_NEAREST = 64  # nearest rays that start the search for all pixels, besides the local minima
_SAME_PX = 1e-5


class Targets(NamedTuple):
    """Points to project."""

    points: Floats  # (n, 3), system frame: positions in meters, or directions
    weight: float  # 1: positions; 0: directions to infinity

    def take(self, rows: Ints | slice) -> Targets:
        """Selected targets."""
        return Targets(self.points[rows], self.weight)


class Inverse:
    """Solver from points to pixels; traces its starting rays once.

    Raises:
        OpticsError: no pixel sees anything.
    """

    def __init__(self, system: OpticalSystem):
        self._system = system
        self._camera_m = system.system_from_camera[:3, 3]
        grid = _grid(system.camera)
        paths = system.paths(grid.reshape(-1, 2))
        self._seen = (paths.fates == Fate.SEEN).reshape(grid.shape[:2])
        more = _between(grid, paths.directions.reshape(*grid.shape[:2], 3))
        if len(more):  # appended to the grid's rays
            others = system.paths(more)
            paths = TracedPaths(
                np.concatenate((paths.points_m, others.points_m), axis=1),
                np.concatenate((paths.directions, others.directions)),
                np.concatenate((paths.fates, others.fates)),
            )
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

    def _miss(self, targets: Targets, rays: Ints) -> Floats:
        """Squared chord (n,) between each ray's direction and the direction to its target."""
        toward = targets.points - targets.weight * self._origins_m[rays]
        toward = toward / np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-300)
        return np.sum((toward - self._directions[rays]) ** 2, axis=1)

    def _misses(self, targets: Targets) -> Floats:
        """Squared chords (n, rays) between rays and the directions from them to each target."""
        rays, shape = np.arange(len(self._origins_m)), self._origins_m.shape
        each = (Targets(np.broadcast_to(point, shape), targets.weight) for point in targets.points)
        return np.stack([self._miss(target, rays) for target in each])

    def _from_starts(self, targets: Targets, starts: Ints) -> Pixels:
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
            basis = across_bases(slope / np.linalg.norm(slope, axis=1, keepdims=True))
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
        parts = zip(bases, np.split(steps, count, axis=1), strict=True)
        moves: Floats = np.stack([np.einsum("nja,na->nj", *part) for part in parts])
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


def across_bases(directions: Floats) -> Floats:
    """Orthonormal bases (..., 3, 2) of the planes perpendicular to unit directions (..., 3)."""
    smallest = np.eye(3)[np.abs(directions).argmin(axis=-1)]
    first = np.cross(directions, smallest)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack((first, np.cross(directions, first)), axis=-1)


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
