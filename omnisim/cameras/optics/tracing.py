"""Sequential ray tracing from a camera through the surfaces of its optical system."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.surface import Rod, Surface


class Fate(IntEnum):
    """Result of tracing a ray from the camera."""

    SEEN = 0  # leaves the system
    OUTSIDE = 1  # the pixel is outside the camera's own domain
    MISSED = 2  # misses a surface
    RIM = 3  # passes outside a surface's rim, or through its hole
    TOTAL_REFLECTION = 4  # is totally reflected at a boundary
    SHADOWED = 5  # is blocked by a mirror, its rim or an obstacle


class TracedRays(NamedTuple):
    """Rays of pixels where they leave the system, in its frame."""

    origins_m: Floats  # (..., 3): on the last surface
    directions: Floats  # (..., 3), unit
    valid: NDArray[np.bool_]  # (...,)
    fates: NDArray[np.uint8]  # (...,) values of `Fate`


class Paths(NamedTuple):
    """Paths of rays through a system."""

    points_m: Floats  # (surfaces + 1, n, 3): the camera, and the hit on each surface
    directions: Floats  # (n, 3), unit: beyond the last surface
    fates: NDArray[np.uint8]  # (n,) values of `Fate`


def trace(
    surfaces: Sequence[Surface],
    indices: Sequence[float],
    obstacles: Sequence[Rod],
    origins_m: Floats,
    directions: Floats,
    fates: NDArray[np.uint8],
    can_block: bool = True,
) -> Paths:
    """Trace rays (n, 3) from a camera; rays with a fate other than SEEN get NaN points.

    Args:
        surfaces: surfaces of the system, in the order of the rays from the camera.
        indices: (surfaces + 1) refractive indices between the surfaces.
        obstacles: opaque parts.
        origins_m, directions: (n, 3) rays, system frame.
        fates: (n,) values of `Fate`; only rays with SEEN are traced.
        can_block: True if mirrors and obstacles block rays that pass them.
    """
    points = np.full((len(surfaces) + 1, len(origins_m), 3), np.nan)
    points[0] = origins_m
    along, fates = directions.copy(), fates.copy()
    for number, surface in enumerate(surfaces):
        rows = np.flatnonzero(fates == Fate.SEEN)
        begin, toward = points[number, rows], along[rows]
        lengths, beyond_rim = surface.hits(begin, toward)
        hit = np.isfinite(lengths)
        fates[rows[~hit]] = np.where(beyond_rim[~hit], Fate.RIM, Fate.MISSED)
        rows, toward = rows[hit], toward[hit]
        at = begin[hit] + lengths[hit, None] * toward
        if can_block:
            blocked = _blocked(surfaces, obstacles, number, begin[hit], toward, lengths[hit])
            fates[rows[blocked]] = Fate.SHADOWED
        points[number + 1, rows] = at
        ratio = indices[number] / indices[number + 1]
        along[rows] = deflected(surface.normals(at), toward, surface.is_mirror, ratio)
        fates[rows[np.isnan(along[rows, 0])]] = Fate.TOTAL_REFLECTION
    if not can_block:
        return Paths(points, along, fates)
    rows = np.flatnonzero(fates == Fate.SEEN)
    endless = np.full(len(rows), np.inf)
    number = len(surfaces)
    blocked = _blocked(surfaces, obstacles, number, points[number, rows], along[rows], endless)
    fates[rows[blocked]] = Fate.SHADOWED
    return Paths(points, along, fates)


def deflected(normals: Floats, directions: Floats, is_mirror: bool, ratio: float = 1.0) -> Floats:
    """Directions (n, 3) beyond a surface; NaN where a boundary reflects totally.

    Args:
        normals: (n, 3) unit normals where rays meet the surface.
        directions: (n, 3) directions before the surface.
        is_mirror: True: reflect, False: refract.
        ratio: refractive index before a boundary over the index beyond it.
    """
    along = np.einsum("nj,nj->n", directions, normals)[:, None]
    outgoing: Floats
    if is_mirror:
        outgoing = directions - 2.0 * along * normals
    else:
        normals = np.where(along > 0.0, normals, -normals)
        cosine = np.abs(along)
        squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
        root = np.sqrt(np.where(squared >= 0.0, squared, np.nan))
        outgoing = ratio * directions + (root - ratio * cosine) * normals
    outgoing /= np.linalg.norm(outgoing, axis=1, keepdims=True)
    return outgoing


def _blocked(
    surfaces: Sequence[Surface],
    obstacles: Sequence[Rod],
    number: int,
    origins_m: Floats,
    directions: Floats,
    lengths_m: Floats,
) -> NDArray[np.bool_]:
    """Mask (n,) of path segments to surface `number` that are blocked."""
    blocked = np.zeros(len(origins_m), dtype=np.bool_)
    ends_m = np.where(np.isfinite(lengths_m), (1.0 - 1e-9) * lengths_m, np.inf)
    for obstacle in obstacles:
        blocked |= obstacle.hits(origins_m, directions) < ends_m
    for other, surface in enumerate(surfaces):
        if not surface.is_mirror or other == number:
            continue
        leaving = other == number - 1
        rows = np.arange(len(origins_m))
        if leaving:
            rows = np.flatnonzero(surface.may_return(origins_m, directions))
        hits = surface.hits(origins_m[rows], directions[rows], leaving)
        blocked[rows] |= hits.lengths_m < ends_m[rows]
    return blocked
