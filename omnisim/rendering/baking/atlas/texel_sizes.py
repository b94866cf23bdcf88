"""Texel sizes: fine near cameras, coarser with the distance from them, and of large instances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Scene

_NEAR_M = 4.0  # up to this distance texels have the finest size
MAX_GIVEN_TEXELS = 1 << 21  # per instance, if the texel size is given
MAX_LENGTH = 4096  # of an instance, in texels; a needle has few texels and a long chart
_FINEST_M = 0.01


def areas_m2(scene: Scene) -> NDArray[np.float64]:
    """Areas (n,) of the instances."""
    areas = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        corners = mesh.positions.astype(np.float64) @ instance.world_from_mesh[:3, :3].T
        a, b, c = (corners[mesh.triangles[:, corner]] for corner in range(3))
        areas.append(0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()))
    return np.array(areas)


def lengths_m(scene: Scene) -> NDArray[np.float64]:
    """Diagonals (n,) of the instances' bounding boxes."""
    lengths = []
    for instance in scene.instances:
        used = scene.meshes[instance.mesh].positions[scene.meshes[instance.mesh].triangles]
        placed = used.reshape(-1, 3).astype(np.float64) @ instance.world_from_mesh[:3, :3].T
        lengths.append(float(np.linalg.norm(np.ptp(placed, axis=0))) if len(placed) else 0.0)
    return np.array(lengths)


def coarseness(scene: Scene) -> NDArray[np.float64]:
    """Factors (n,) of the texel size, by the distance of the instance's triangles from cameras."""
    places = camera_places_m(scene)
    nearest_m = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        placed = mesh.positions.astype(np.float64) @ instance.world_from_mesh[:3, :3].T
        corners = (placed + instance.world_from_mesh[:3, 3])[mesh.triangles]
        low, high = corners.min(axis=1), corners.max(axis=1)
        off = np.maximum(np.maximum(low - places[:, None], places[:, None] - high), 0.0)
        nearest_m.append(np.sqrt(np.einsum("ptc,ptc->pt", off, off).min(initial=np.inf)))
    factors: NDArray[np.float64] = np.maximum(np.array(nearest_m) / _NEAR_M, 1.0)
    return factors


def max_texels(texels: int) -> int:
    """Maximum number of texels per instance in an atlas, if the texel size is not given."""
    return texels // 16


def first_texel_m(scene: Scene, has_back: NDArray[np.bool_], texels: int) -> float:
    """Texel size whose charts fill an atlas of `texels` texels without gaps."""
    areas, factors = areas_m2(scene) * (1 + has_back), coarseness(scene)
    lengths, most = lengths_m(scene), max_texels(texels)
    texel_m = _FINEST_M
    for _ in range(20):  # the share of the largest instance depends on the size
        needed = float((areas / _limited(areas, lengths, factors * texel_m, most) ** 2).sum())
        if needed <= texels:
            break
        texel_m *= max(float(np.sqrt(needed / texels)), 1.02)
    return texel_m


def texel_sizes_m(
    scene: Scene, texel_m: float, has_back: NDArray[np.bool_], limit: int
) -> NDArray[np.float64]:
    """Texel sizes (n,) of the instances; instances with a back have twice as many texels."""
    areas = areas_m2(scene) * (1 + has_back)
    return _limited(areas, lengths_m(scene), coarseness(scene) * texel_m, limit)


def _limited(
    areas: NDArray[np.float64],
    lengths: NDArray[np.float64],
    texels_m: NDArray[np.float64],
    limit: int,
) -> NDArray[np.float64]:
    sizes: NDArray[np.float64] = np.maximum(texels_m, np.sqrt(areas / limit))
    return np.maximum(sizes, lengths / MAX_LENGTH)


def camera_places_m(scene: Scene) -> NDArray[np.float64]:
    """Positions (n, 3) of cameras and vehicles."""
    height_m = scene.start.position_m[2]
    places = [scene.start.position_m, *(start.position_m for start in scene.starts)]
    places += [(x, y, height_m) for path in scene.paths for x, y in path.waypoints_m]
    return np.array(places, dtype=np.float64)
