"""Rays of non-central cameras, and the tiles in which their points are seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from omnisim.cameras import CentralCamera, NonCentralCamera, Rays, pixel_grid
from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.core.cube import FACE_FROM_RIG
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.atlas.sampling_density import GRID_STEP, density_of_rays, dilate
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan, plan_densities
from omnisim.rendering.opengl.capture.parallax_rays import MARGIN_PX, ParallaxRays
from omnisim.rendering.sensor_tiles import ONE_SAMPLE_BIAS, SUPERSAMPLED_BIAS

# Maximum stretch of pixels; more stretched ones are drawn with this stretch.
IMAGE_ANISOTROPY = 2.0
_PERCENTILE = 90.0  # % of the pixels, whose mip level applies
_GUTTER_PX = 2  # samples of a pixel are looked up in the tile of its center
_MAX_RAYS = 20_000  # maximum number of rays with near and far points in the estimate
_STEP = 2.0 * GRID_STEP  # tangents between points: neighborhoods of points count as visible


class _SeenRays(NamedTuple):
    """Rays of pixels with valid neighbors, and directions of the points on them."""

    directions: Floats  # (n, 3)
    along: Floats  # (n,) radians between samples, in the longer direction
    points: list[tuple[Floats, Floats]]  # (m, 3), samples per radian (m,)


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
    points = [part for one in seen for part in one.points]
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
    # of the samples, because mip levels refer to samples
    along, across = (values / rays.supersampling for values in _singular_values(steps))
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
                (left, top), (right, bottom) = tile.region
                u, v = tangents.T
                inside = (u >= left) & (u < right) & (v >= top) & (v < bottom)
                texels.append(tile.face_size_px * wider[inside])
    return float(np.log2(np.percentile(np.concatenate(texels), _PERCENTILE)))


def _singular_values(steps: Floats) -> tuple[Floats, Floats]:
    """Larger and smaller singular values (n,) of matrices (n, 3, 2), in closed form."""
    gram = np.einsum("nji,njk->nik", steps, steps)
    mean = 0.5 * (gram[:, 0, 0] + gram[:, 1, 1])
    spread = np.hypot(0.5 * (gram[:, 0, 0] - gram[:, 1, 1]), gram[:, 0, 1])
    return np.sqrt(mean + spread), np.sqrt(np.maximum(mean - spread, 0.0))


# Rays of a supersampled image, interpolated between pixels where they vary smoothly.


# Distance within which all pixels must have a ray for a pixel's samples to be interpolated without
# a test: rays bend strongly near a rim. At most the margin.
_SMOOTH_PX = 2
_MISS_PX = 0.02  # maximum error of interpolated rays


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
    inner = slice(MARGIN_PX, -MARGIN_PX), slice(MARGIN_PX, -MARGIN_PX)
    smooth, near = ~dilate(~valid, _SMOOTH_PX)[inner], dilate(valid)[inner]
    beside = ~dilate(~valid)[inner]  # pixels with all neighbors valid: interpolation possible
    rays = ParallaxRays.interpolated(supersampling, directions, origins_m, smooth)
    rim = np.argwhere(near if polygons is not None else near & ~smooth)
    offsets = (pixel_grid(supersampling, supersampling).reshape(-1, 2) + 0.5) / supersampling - 0.5
    own = trace(rim[:, None, ::-1] + offsets)
    bent = ~beside[tuple(rim.T)] | ~own[2].all(axis=1) | _bent(rays, rim, own[0])
    rays.smooth[tuple(rim.T)] = ~bent
    kept = bent & own[2].any(axis=1)
    rim = rim[kept]
    rays.rim_numbers[tuple(rim.T)] = np.arange(len(rim))
    return replace(
        rays, rim_directions=own[0][kept], rim_origins_m=own[1][kept], rim_valid=own[2][kept]
    )


def _bent(rays: ParallaxRays, pixels: Indices, own: Floats32) -> Bools:
    """Mask of pixels (n, 2), row and column, whose sample directions cannot be interpolated.

    The directions (n, samples, 3) differ from those interpolated between neighboring pixels.
    """
    count = rays.supersampling**2
    rows, columns = np.repeat(pixels, count, axis=0).T
    between = rays.of(rows, columns, np.tile(np.arange(count), len(pixels)))
    misses = np.linalg.norm(between.directions.reshape(own.shape) - own, axis=-1).max(axis=1)
    steps = rays.supersampling * np.linalg.norm(between.footprints, axis=-1)
    return np.asarray(misses > _MISS_PX * steps.reshape(len(pixels), 2 * count).min(axis=1))


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
