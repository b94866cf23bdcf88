"""Sizes of texels: fine near the places of cameras, coarser with the distance from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Scene
from omnisim.scene.parts import instance_bounds_m

TEXEL_BUDGET = 1 << 20  # of the atlas: 6 MB of half floats
_FILL = 0.55  # share of an atlas that charts cover, seen in our scenes
_NEAR_M = 4.0  # up to here texels are as fine as they are anywhere
_LARGEST_SHARE = 0.125  # of the budget, for one instance
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


def coarseness(scene: Scene) -> NDArray[np.float64]:
    """Factors (n,) of the texels' size, by the instances' distance from where cameras are."""
    if not scene.instances:
        return np.empty(0)
    boxes = instance_bounds_m(scene.meshes, scene.instances)
    distances_m = [
        np.linalg.norm(np.maximum(np.maximum(boxes[:, 0] - one, one - boxes[:, 1]), 0.0), axis=1)
        for one in _places_m(scene)
    ]
    factors: NDArray[np.float64] = np.maximum(np.min(distances_m, axis=0) / _NEAR_M, 1.0)
    return factors


def automatic_texel_m(scene: Scene, has_back: NDArray[np.bool_]) -> float:
    """Finest size with which the atlas is about `TEXEL_BUDGET` texels; of two digits."""
    areas, factors = areas_m2(scene) * (1 + has_back), coarseness(scene)
    texels = _FILL * TEXEL_BUDGET
    texel_m = _FINEST_M
    for _ in range(20):  # the share of the largest depends on the size
        texel_m = max(texel_m, _FINEST_M)
        sizes = _limited(areas, factors, texel_m)
        needed = float((areas / sizes**2).sum())
        if needed <= texels:
            break
        texel_m *= max(float(np.sqrt(needed / texels)), 1.02)
    return float(f"{texel_m:.2g}")


def texel_sizes_m(scene: Scene, texel_m: float, has_back: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Sizes (n,) of the instances' texels; those with a back have twice as many."""
    return _limited(areas_m2(scene) * (1 + has_back), coarseness(scene), texel_m)


def _limited(
    areas: NDArray[np.float64], factors: NDArray[np.float64], texel_m: float
) -> NDArray[np.float64]:
    least_m = np.sqrt(areas / (_LARGEST_SHARE * TEXEL_BUDGET))
    sizes: NDArray[np.float64] = np.maximum(factors * texel_m, least_m)
    return sizes


def _places_m(scene: Scene) -> list[NDArray[np.float64]]:
    """Places (3,) of cameras and vehicles."""
    height_m = scene.start.position_m[2]
    places = [scene.start.position_m, *(start.position_m for start in scene.starts)]
    places += [(x, y, height_m) for path in scene.paths for x, y in path.waypoints_m]
    return [np.array(one) for one in places]
