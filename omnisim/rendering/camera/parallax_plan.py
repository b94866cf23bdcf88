"""Tiles for non-central rays: all directions in which their points are seen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.cube import FACE_FROM_RIG
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.atlas.sampling_density import (
    GRID_STEP,
    SamplingDensity,
    density_of_rays,
)
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan, plan_densities
from omnisim.rendering.opengl.capture.parallax_rays import ParallaxRays
from omnisim.rendering.sensor_tiles import ONE_SAMPLE_BIAS, SUPERSAMPLED_BIAS

# Maximum stretch of pixels; more stretched ones are drawn with this stretch.
IMAGE_ANISOTROPY = 2.0
_PERCENTILE = 90.0  # % of the pixels, whose mip level applies
_GUTTER_PX = 2  # samples of a pixel are looked up in the tile of its center
_MAX_RAYS = 20_000  # maximum number of rays with near and far points in the estimate
_STEP = 2.0 * GRID_STEP  # tangents between points: neighborhoods of points count as visible


class _SeenRays(NamedTuple):
    """Rays of pixels with valid neighbors, and directions of the points on them."""

    directions: NDArray[np.float64]  # (n, 3)
    along: NDArray[np.float64]  # (n,) radians between samples, in the longer direction
    points: list[tuple[NDArray[np.float64], NDArray[np.float64]]]  # (m, 3), samples per radian (m,)


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
    densities = _densities(*(np.concatenate(parts) for parts in zip(*points, strict=True)))
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


def _densities(places: NDArray[np.float64], densest: NDArray[np.float64]) -> list[SamplingDensity]:
    """Density of each face, from directions of points (n, 3) and samples per radian (n,)."""
    densities = []
    for on_it, tangents in _on_faces(places):
        # away from a face's middle, tangents grow faster than angles
        wider = np.sqrt(1.0 + np.square(tangents).sum(axis=1))
        densities.append(density_of_rays(tangents, densest[on_it] / wider))
    return densities


def _on_faces(
    directions: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.float64]]]:
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


def _mip_level(
    plan: TilePlan, directions: NDArray[np.float64], along: NDArray[np.float64]
) -> float:
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


def _singular_values(steps: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Larger and smaller singular values (n,) of matrices (n, 3, 2), in closed form."""
    gram = np.einsum("nji,njk->nik", steps, steps)
    mean = 0.5 * (gram[:, 0, 0] + gram[:, 1, 1])
    spread = np.hypot(0.5 * (gram[:, 0, 0] - gram[:, 1, 1]), gram[:, 0, 1])
    return np.sqrt(mean + spread), np.sqrt(np.maximum(mean - spread, 0.0))
