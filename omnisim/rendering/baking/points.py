"""Points on patches: positions where light is gathered, with surface orientation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.atlas.patches import BACK, Patches
from omnisim.rendering.baking.transport import INSIDE, Transport
from omnisim.rendering.rays.caster import RayHits
from omnisim.rendering.rays.ray_scene import RayScene

Floats = NDArray[np.float32]
_BATCH = 1 << 17
# Directions of probing rays, along the normal and two axes of the plane.
_PROBING = np.array(
    [[1.0, 0.0, 0.0], [0.5, 0.866, 0.0], [0.5, -0.433, 0.75], [0.5, -0.433, -0.75]], np.float32
)
_MAX_INSIDE = 1  # maximum number of probing rays inside of a solid


class Points(NamedTuple):
    """Points on patches.

    Attributes:
        origins_m: (n, 3) relative to `Transport.center_m`, beside the surface, on the patch's side.
        normals: (n, 3) unit, interpolated, on the patch's side.
        planes: (n, 3) unit, triangle normals, on the patch's side.
    """

    origins_m: Floats
    normals: Floats
    planes: Floats


def points_at(
    rays: RayScene, transport: Transport, patches: Patches, first: int, last: int
) -> Points:
    """Points of the entries first to last of `Patches.of_sample`."""
    geometry = rays.caster.geometry
    samples = patches.samples.take(patches.of_sample[first:last])
    bounds = np.clip(patches.first, first, last)
    counts = bounds[1:] - bounds[:-1]
    is_back = np.repeat(patches.sides == BACK, counts)
    corners_m = geometry.corners_m(samples.triangles)
    planes = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    planes /= np.maximum(np.linalg.norm(planes, axis=1, keepdims=True), 1e-30)
    planes[is_back] *= -1.0
    placed_m = np.einsum("nk,nkc->nc", samples.weights, corners_m)
    hits = RayHits(
        samples.triangles, np.zeros(len(planes)), samples.weights, planes.astype(np.float32)
    )
    origins_m = placed_m - transport.center_m + transport.start_m * planes
    return Points(origins_m.astype(np.float32), rays.shading.normals(hits), hits.planes)


def usable(rays: RayScene, transport: Transport, patches: Patches) -> Patches:
    """Patches without the samples that are inside a solid or close below a surface.

    Light of such samples, as at the foot of a wall or below a rug, would darken the texel's edge.
    """
    kept = [np.empty(0, np.bool_)]
    spacing_m = np.repeat(patches.spacing_m, np.diff(patches.first))
    for first in range(0, len(patches.of_sample), _BATCH):
        last = min(first + _BATCH, len(patches.of_sample))
        points = points_at(rays, transport, patches, first, last)
        near_m = 0.5 * spacing_m[first:last]
        across = np.cross(points.planes, np.roll(points.planes, 1, axis=1) + (0.3, 0.1, -0.2))
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        axes = np.stack((points.planes, across, np.cross(points.planes, across)), axis=1)
        inside = np.zeros(last - first, dtype=np.intp)
        for shares in _PROBING:
            directions = np.einsum("k,nkc->nc", shares, axes).astype(np.float32)
            hits = transport.cast(points.origins_m, directions)
            is_back = transport.is_back(hits) & ~transport.is_frosted(hits)
            inside += (hits.patches == INSIDE) | (is_back & (hits.ranges_m < near_m))
        kept.append(inside <= _MAX_INSIDE)
    return patches.kept(np.concatenate(kept))
