"""Rays of non-central cameras, and the tiles in which one viewpoint sees the points on them.

Rays of pixel centers are traced. Those of the samples between them are interpolated where they vary
smoothly, and traced at rims.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera, Rays, pixel_grid
from omnisim.cameras.optics.centrality import common_point
from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.core.cube import FACE_FROM_RIG
from omnisim.core.errors import GraphicsError
from omnisim.rendering.atlas.sampling_density import GRID_STEP, density_of_rays, dilate
from omnisim.rendering.atlas.tile_plan import (
    ONE_SAMPLE_BIAS,
    SUPERSAMPLED_BIAS,
    TilePlan,
    plan_densities,
)
from omnisim.rendering.camera.omnicamera import OmniCamera

MARGIN_PX = 2  # around the image, as in capture/parallax.frag
# Distance within which all pixels must have a ray for a pixel's samples to be interpolated without
# a test: rays bend strongly near a rim. At most the margin.
_SMOOTH_PX = 2
_MISS_PX = 0.02  # maximum error of interpolated rays
_VIEWPOINT_RAYS = 10_000  # rays to which the viewpoint is the nearest point
# Maximum stretch of pixels; more stretched ones are drawn with this stretch.
IMAGE_ANISOTROPY = 2.0
_PERCENTILE = 90.0  # % of the pixels, whose mip level applies
_GUTTER_PX = 2  # samples of a pixel are looked up in the tile of its center
_MAX_RAYS = 20_000  # maximum number of rays with near and far points in the estimate
_STEP = 2.0 * GRID_STEP  # tangents between points: neighborhoods of points count as visible
_INNER = slice(MARGIN_PX, -MARGIN_PX), slice(MARGIN_PX, -MARGIN_PX)


class SampleRays(NamedTuple):
    """Rays (n,) of samples, in the frame of the image's rays."""

    directions: Floats  # (n, 3), unit
    origins_m: Floats  # (n, 3)
    footprints: Floats32  # (n, 2, 3) changes of the direction to the next samples


@dataclass(frozen=True, eq=False)
class ParallaxRays:
    """Rays of pixel centers, from which those of samples are interpolated, or sample rays."""

    supersampling: int  # samples per pixel side
    directions: Floats32  # (height + 2 margins, width + 2 margins, 3) unit; 0: no ray
    origins_m: Floats32  # origins of these rays, same shape
    smooth: Bools  # (height, width) pixels whose sample rays are interpolated
    rim_numbers: Indices  # (height, width) row of each other pixel in the arrays below; −1: no ray
    rim_directions: Floats32  # (n, samples, 3), samples row by row
    rim_origins_m: Floats32  # origins of these, same shape
    rim_valid: Bools  # (n, samples) mask of the samples with a ray

    @staticmethod
    def interpolated(
        supersampling: int, directions: Floats32, origins_m: Floats32, smooth: Bools
    ) -> ParallaxRays:
        """Rays whose samples are all interpolated; the arguments are the attributes."""
        own = np.zeros((0, supersampling**2, 3), dtype=np.float32)
        numbers = np.full(smooth.shape, -1, dtype=np.intp)
        is_valid = np.zeros(own.shape[:2], dtype=np.bool_)
        return ParallaxRays(
            supersampling, directions, origins_m, smooth, numbers, own, own, is_valid
        )

    @property
    def shown(self) -> Bools:
        """Pixels (height, width) with at least one sample ray."""
        return self.smooth | (self.rim_numbers >= 0)

    def valid_bits(self) -> NDArray[np.uint64]:
        """Bit mask per pixel (height × width,) of its samples with a ray, first sample lowest."""
        count = self.supersampling**2
        bits = np.where(self.smooth, np.uint64((1 << count) - 1), np.uint64(0))
        powers = np.uint64(1) << np.arange(count, dtype=np.uint64)
        rim = self.rim_numbers >= 0
        bits[rim] = (self.rim_valid * powers).sum(axis=1)[self.rim_numbers[rim]]
        return bits.ravel()

    def valid_shares(self) -> Floats32:
        """Share (height, width) of each pixel's samples that have a ray."""
        shares = self.smooth.astype(np.float32)
        rim = self.rim_numbers >= 0
        shares[rim] = self.rim_valid.mean(axis=1)[self.rim_numbers[rim]]
        return shares

    @cached_property
    def valid(self) -> Bools:
        """Pixels (height, width) whose center has a ray."""
        return np.asarray(self.directions[_INNER].any(axis=-1))

    @property
    def longest_m(self) -> float:
        """Length of the longest origin vector."""
        traced = self.origins_m[self.directions.any(axis=-1)], self.rim_origins_m[self.rim_valid]
        lengths_m = [np.linalg.norm(origins_m, axis=-1) for origins_m in traced]
        return float(np.concatenate(lengths_m).max(initial=0.0))

    def centers(self) -> tuple[Floats, Floats]:
        """Directions and origins (n, 3) of the valid pixel centers, row by row."""
        directions, origins_m = (
            values[_INNER][self.valid].astype(np.float64)
            for values in (self.directions, self.origins_m)
        )
        return directions, origins_m

    def seen_from(self, viewpoint_m: Floats) -> ParallaxRays:
        """The same rays, origins relative to a point (3,)."""
        offset_m = viewpoint_m.astype(np.float32)
        return replace(
            self, origins_m=self.origins_m - offset_m, rim_origins_m=self.rim_origins_m - offset_m
        )

    def of(self, rows: Indices, columns: Indices, parts: Indices) -> SampleRays:
        """Rays of samples (n,) by row, column and sample number in the pixel (n,)."""
        side = self.supersampling
        at = (np.stack((parts % side, parts // side), axis=1) + 0.5) / side - 0.5
        # parabolas through the previous, own and next pixel
        weights = np.stack((0.5 * at * (at - 1.0), 1.0 - at * at, 0.5 * at * (at + 1.0)), axis=1)
        directions, origins_m = np.zeros((2, len(rows), 3))
        row, column = rows + MARGIN_PX, columns + MARGIN_PX
        for down in range(3):
            for right in range(3):
                weight = (weights[:, down, 1] * weights[:, right, 0])[:, None]
                neighbor = row + down - 1, column + right - 1
                directions += weight * self.directions[neighbor]
                origins_m += weight * self.origins_m[neighbor]
        rightward = self.directions[row, column + 1] - self.directions[row, column - 1]
        downward = self.directions[row + 1, column] - self.directions[row - 1, column]
        footprints: Floats32 = np.stack((rightward, downward), axis=1)
        footprints /= 2 * side
        numbers = self.rim_numbers[rows, columns]
        rim = np.flatnonzero(numbers >= 0)
        directions[rim] = self.rim_directions[numbers[rim], parts[rim]]
        origins_m[rim] = self.rim_origins_m[numbers[rim], parts[rim]]
        # beyond the rim there is no next sample
        footprints[rim] = 0.0
        directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-30)
        return SampleRays(directions, origins_m, footprints)


def rays_by_color(sensor: OmniCamera) -> tuple[list[ParallaxRays], Floats]:
    """Sample rays of an optical system, relative to the viewpoint, and the viewpoint (3,), rig.

    Returns:
        One set of rays, or one each for R, G and B; and the point nearest to all rays.

    Raises:
        GraphicsError: no ray sees anything.
    """
    assert isinstance(sensor.model, NonCentralCamera)
    cameras = sensor.model.by_color()
    rays = [sample_rays(camera, sensor.supersampling, sensor.mesh_polygons) for camera in cameras]
    if not all(ray.shown.any() for ray in rays):
        raise GraphicsError("camera: no pixel of the image sees anything of the scene")
    directions, origins_m = rays[len(rays) // 2].centers()
    every = slice(None, None, max(1, len(directions) // _VIEWPOINT_RAYS))
    viewpoint_m = common_point(origins_m[every], directions[every])
    return [ray.seen_from(viewpoint_m) for ray in rays], viewpoint_m


def sample_rays(
    camera: CentralCamera, supersampling: int, polygons: int | None = None
) -> ParallaxRays:
    """Rays of the samples of a camera's pixels, in the rig frame.

    Rays of the pixel centers are traced. The rays of all samples are traced near the edges of the
    visible region, and everywhere for a mesh; they are stored where interpolation would fail.

    Args:
        polygons: number of polygons of the mirror mesh; None: exact.
    """
    width, height = camera.width_px, camera.height_px
    trace = _tracer(camera, polygons)
    around = pixel_grid(width + 2 * MARGIN_PX, height + 2 * MARGIN_PX) - MARGIN_PX
    directions, origins_m, valid = trace(around)
    smooth, near = ~dilate(~valid, _SMOOTH_PX)[_INNER], dilate(valid)[_INNER]
    beside = ~dilate(~valid)[_INNER]  # pixels with all neighbors valid: interpolation possible
    rays = ParallaxRays.interpolated(supersampling, directions, origins_m, smooth)
    rim = np.argwhere(near if polygons is not None else near & ~smooth)
    offsets = (pixel_grid(supersampling, supersampling).reshape(-1, 2) + 0.5) / supersampling - 0.5
    directions, origins_m, valid = trace(rim[:, None, ::-1] + offsets)
    # beside rays interpolated between neighboring pixels
    count = supersampling**2
    rows, columns = np.repeat(rim, count, axis=0).T
    between = rays.of(rows, columns, np.tile(np.arange(count), len(rim)))
    misses = np.linalg.norm(between.directions.reshape(directions.shape) - directions, axis=-1)
    steps = supersampling * np.linalg.norm(between.footprints, axis=-1)
    bent = misses.max(axis=1) > _MISS_PX * steps.reshape(len(rim), 2 * count).min(axis=1)
    bent |= ~beside[tuple(rim.T)] | ~valid.all(axis=1)
    rays.smooth[tuple(rim.T)] = ~bent
    kept = bent & valid.any(axis=1)
    rays.rim_numbers[tuple(rim[kept].T)] = np.arange(kept.sum())
    return replace(
        rays, rim_directions=directions[kept], rim_origins_m=origins_m[kept], rim_valid=valid[kept]
    )


_Traced = tuple[Floats32, Floats32, Bools]


def _tracer(camera: CentralCamera, polygons: int | None) -> Callable[[Floats], _Traced]:
    """Function from pixels to directions and origins (..., 3), rig, and validity; 0 if invalid."""
    ray_from_pixel: Callable[[Floats], Rays] = camera.ray_from_pixel
    if polygons is not None and isinstance(camera, NonCentralCamera):
        from omnisim.cameras.optics.mesh_rays import MeshRays

        ray_from_pixel = MeshRays(camera, polygons).ray_from_pixel

    def trace(pixels: Floats) -> _Traced:
        rays = ray_from_pixel(pixels)
        assert rays.origins_m is not None
        found = []
        for part in (rays.directions, rays.origins_m):
            values = np.where(rays.valid[..., None], part, 0.0)
            rig = np.einsum("...j,ij->...i", values, camera.rig_from_optical)
            found.append(rig.astype(np.float32))
        return found[0], found[1], rays.valid

    return trace


def parallax_tiles(
    colors: Sequence[ParallaxRays],
    texels_per_pixel: float,
    near_m: float,
    max_anisotropy: float = IMAGE_ANISOTROPY,
) -> TilePlan:
    """Plan the tiles in which a viewpoint at the rig's origin sees all points on the rays.

    Args:
        colors: rays of the samples, rig frame, one entry per color with its own rays.
        texels_per_pixel: texels per pixel side.
        near_m: minimum distance of points.
        max_anisotropy: stretch limit of pixels; more stretched ones are drawn with this limit.

    Raises:
        GraphicsError: the image shows too small a region.
    """
    supersampling = colors[0].supersampling
    seen = [_seen_rays(rays, near_m, max_anisotropy, _MAX_RAYS // len(colors)) for rays in colors]
    points = [part for sampled in seen for part in sampled.points]
    places, densest = (np.concatenate(parts) for parts in zip(*points, strict=True))
    densities = []
    for on_it, tangents in _on_faces(places):
        # away from a face's middle, tangents grow faster than angles
        wider = np.sqrt(1.0 + np.square(tangents).sum(axis=1))
        densities.append(density_of_rays(tangents, densest[on_it] / wider))
    bias = ONE_SAMPLE_BIAS if supersampling == 1 else SUPERSAMPLED_BIAS

    def plan(max_level: int) -> TilePlan:
        density = texels_per_pixel / supersampling
        return plan_densities(densities, density, None, True, bias, max_level, _GUTTER_PX)

    first = plan(0)
    level = max(0, int(_mip_level(first, seen[0].directions, seen[0].along) + bias))
    return plan(level) if level else first


class _SeenRays(NamedTuple):
    """Rays of pixels with valid neighbors, and directions of the points on them."""

    directions: Floats  # (n, 3)
    along: Floats  # (n,) radians between samples, in the longer direction
    points: list[tuple[Floats, Floats]]  # (m, 3), samples per radian (m,)


def _seen_rays(
    rays: ParallaxRays, near_m: float, max_anisotropy: float, max_rays: int
) -> _SeenRays:
    directions, origins_m = rays.directions, rays.origins_m
    valid = np.asarray(directions.any(axis=-1))
    whole = valid[:-1, :-1] & valid[:-1, 1:] & valid[1:, :-1]
    if not whole.any():
        raise GraphicsError("camera: the image shows too little of the scene")
    centers = directions[:-1, :-1][whole].astype(np.float64)
    steps = np.stack(
        (directions[:-1, 1:][whole] - centers, directions[1:, :-1][whole] - centers), -1
    )
    # singular values in closed form; of the samples, because mip levels refer to samples
    gram = np.einsum("nji,njk->nik", steps, steps)
    mean = 0.5 * (gram[:, 0, 0] + gram[:, 1, 1])
    spread = np.hypot(0.5 * (gram[:, 0, 0] - gram[:, 1, 1]), gram[:, 0, 1])
    along = np.sqrt(mean + spread) / rays.supersampling
    across = np.sqrt(np.maximum(mean - spread, 0.0)) / rays.supersampling
    densest = 1.0 / np.maximum(across, along / max_anisotropy)
    points = [(centers, densest)]
    some = slice(None, None, max(1, len(centers) // max_rays))
    near, densest = centers[some], densest[some]
    origins_m = origins_m[:-1, :-1][whole][some].astype(np.float64)
    # over all points of a ray
    turn = float(np.linalg.norm(origins_m, axis=1).max()) / near_m
    for nearness in np.linspace(0.0, 1.0 / near_m, 2 + math.ceil(turn / _STEP))[1:]:
        points.append((near + nearness * origins_m, densest))
    return _SeenRays(centers, along, points)


def _on_faces(directions: Floats) -> Iterator[tuple[Indices, Floats]]:
    """Indices of the directions (n, 3) on each face, and their tangents (m, 2).

    Equivalent to `face_index` and `face_tangents`, but faster: a face's axes are the rig's.
    """
    sizes = np.abs(directions)
    axis = np.where(sizes[:, 1] > sizes[:, 0], 1, 0)
    axis[sizes[:, 2] > np.maximum(sizes[:, 0], sizes[:, 1])] = 2
    ahead = directions[np.arange(len(directions)), axis] > 0.0
    for axes in FACE_FROM_RIG:
        columns, signs = np.abs(axes).argmax(axis=1), axes.sum(axis=1)
        on_it = np.flatnonzero((axis == columns[2]) & (ahead == (signs[2] > 0.0)))
        local = directions[on_it][:, columns] * signs
        yield on_it, local[:, :2] / local[:, 2:]


def _mip_level(plan: TilePlan, directions: Floats, along: Floats) -> float:
    """Level at which texels are as wide as the spacing of samples at directions (n, 3), radians.

    A percentile: beyond a rim's last pixels, and at poles, the spacing is unbounded.
    """
    texels = [np.ones(1)]
    for face, (on_it, tangents) in enumerate(_on_faces(directions)):
        wider = 0.5 * (1.0 + np.square(tangents).sum(axis=1)) * along[on_it]
        for tile in plan.tiles:
            if tile.face == face:
                first, last = tile.region
                inside = np.all((tangents >= first) & (tangents < last), axis=1)
                texels.append(tile.face_size_px * wider[inside])
    return float(np.log2(np.percentile(np.concatenate(texels), _PERCENTILE)))
