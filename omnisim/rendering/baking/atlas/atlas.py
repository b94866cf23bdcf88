"""Lightmap atlas of a scene: a rectangle of texels for each static instance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.rendering.baking.atlas.unwrapping import Unwrapping, pack, unwrap
from omnisim.scene.model import Scene

MAX_SIDE_PX = 8192
_FINE_STEPS = 20  # before texels double: only very wide ones make needles shorter
_MIN_TEXELS = 1.0  # of an instance's area; smaller instances have uniform light

MAX_GIVEN_TEXELS = 1 << 21  # per instance, if the texel size is given


class Atlas(NamedTuple):
    """Layout of instances in an atlas.

    Attributes:
        unwrappings: unwrapping by index of the mesh.
        rects_px: (n, 4) int rectangles of the instances: left, top, width, height; zeros: none.
        back_rects_px: (n, 4) rectangles of the backs, for instances with a visible back.
        texels_m: (n,) texel width of each instance.
        size_px: width and height.
    """

    unwrappings: dict[int, Unwrapping]
    rects_px: NDArray[np.intp]
    back_rects_px: NDArray[np.intp]
    texels_m: NDArray[np.float64]
    size_px: tuple[int, int]

    def shares(self, rects_px: NDArray[np.intp]) -> dict[int, list[float]]:
        """Rectangles by index of the instance, as shares of the atlas."""
        whole = np.array((*self.size_px, *self.size_px), dtype=np.float64)
        return {
            int(index): (rects_px[index] / whole).tolist()
            for index in np.flatnonzero(rects_px[:, 2])
        }

    def charts(self, mesh_of: Sequence[int]) -> NDArray[np.int32]:
        """Chart (height, width) of each texel; -1: none.

        Args:
            mesh_of: (n,) mesh of each instance.
        """
        charts = np.full(self.size_px[::-1], -1, dtype=np.int32)
        number = 0
        for rects_px in (self.rects_px, self.back_rects_px):
            for index in np.flatnonzero(rects_px[:, 2]).tolist():
                for left, top, wide, high in self.unwrappings[mesh_of[index]].charts_px:
                    x, y = rects_px[index, :2] + (left, top)
                    charts[y : y + high, x : x + wide] = number
                    number += 1
        return charts


def automatic_atlas(scene: Scene, has_back: NDArray[np.bool_], texels: int) -> tuple[float, Atlas]:
    """Finest texel width, of two digits, with at most `texels` texels; and its atlas."""
    texel_m, attempts = first_texel_m(scene, has_back, texels), 0
    while True:
        texel_m = float(f"{texel_m:.2g}")
        atlas = build_atlas(scene, texel_m, has_back, max_texels(texels))
        needed = atlas.size_px[0] * atlas.size_px[1]
        if needed <= texels:
            return texel_m, atlas
        texel_m *= max((needed / texels) ** 0.5, 1.05 if attempts < _FINE_STEPS else 2.0)
        attempts += 1


def build_atlas(
    scene: Scene,
    texel_m: float,
    has_back: NDArray[np.bool_],
    limit: int = MAX_GIVEN_TEXELS,
) -> Atlas:
    """Unwrap the meshes of static instances, and pack a rectangle for each instance.

    Args:
        scene: scene to bake.
        texel_m: width of the finest texels.
        has_back: (n,) instances with two visible sides, which get two rectangles.
        limit: approximate maximum number of texels per instance; larger ones get wider texels.

    Raises:
        SceneError: texels are so small that the atlas exceeds `MAX_SIDE_PX`.
    """
    texels_m, areas = texel_sizes_m(scene, texel_m, has_back, limit), areas_m2(scene)
    scales = np.array(
        [_scale(instance.world_from_mesh) for instance in scene.instances]
    ) / np.maximum(texels_m, 1e-12)
    unwrappings: dict[int, Unwrapping] = {}
    sizes_px = np.zeros((len(scene.instances), 2), dtype=np.intp)
    of_mesh: dict[int, list[int]] = {}
    for index, instance in enumerate(scene.instances):
        of_mesh.setdefault(instance.mesh, []).append(index)
    for mesh, members in of_mesh.items():
        finest = max(members, key=lambda index: float(scales[index]))
        covered = areas[finest] / texels_m[finest] ** 2
        if covered < _MIN_TEXELS:
            continue
        if covered > MAX_SIDE_PX**2:
            raise _too_fine(texel_m, scene, covered)
        matrix = scene.instances[finest].world_from_mesh[:3, :3] / texels_m[finest]
        page = unwrap(scene.meshes[mesh], matrix)
        if page is None:
            continue
        unwrappings[mesh] = page
        sizes_px[members] = page.size_px
        texels_m[members] *= scales[members] / scales[finest]
    both, size_px = pack(np.concatenate((sizes_px, sizes_px * has_back[:, None])))
    rects_px, back_rects_px = both[: len(sizes_px)], both[len(sizes_px) :]
    if max(size_px) > MAX_SIDE_PX:
        raise _too_fine(texel_m, scene, float(np.prod(size_px)))
    return Atlas(unwrappings, rects_px, back_rects_px, texels_m, size_px)


def _scale(matrix: NDArray[np.float64]) -> float:
    """Mean scale factor of lengths."""
    return float(np.abs(np.linalg.det(matrix[:3, :3])) ** (1.0 / 3.0))


def _too_fine(texel_m: float, scene: Scene, texels: float) -> SceneError:
    fitting_m = texel_m * float(np.sqrt(texels)) / (0.7 * MAX_SIDE_PX)
    return SceneError(
        f"{scene.name}: texel_m = {texel_m:g}: expected an atlas of at most {MAX_SIDE_PX} px, "
        f"which about {fitting_m:.2g} makes"
    )


def corner_pixels(scene: Scene, atlas: Atlas, swapped: Sequence[bool]) -> NDArray[np.float32]:
    """Corners (m, 3, 2) of all triangles in the atlas, in texels; zeros outside of the atlas.

    Args:
        scene: scene whose instances are taken in order.
        atlas: atlas of the scene.
        swapped: (n,) instances with swapped second and third corners.
    """
    corners = [np.empty((0, 3, 2), np.float32)]
    for index, instance in enumerate(scene.instances):
        left, top, wide, high = atlas.rects_px[index]
        if wide == 0:
            count = len(scene.meshes[instance.mesh].triangles)
            corners.append(np.zeros((count, 3, 2), np.float32))
            continue
        page = atlas.unwrappings[instance.mesh]
        placed = page.uv.astype(np.float64) * (wide, high) + (left, top)
        triangles_px = placed[page.triangles].astype(np.float32)
        corners.append(triangles_px[:, [0, 2, 1]] if swapped[index] else triangles_px)
    return np.concatenate(corners)


# Texel sizes: fine near cameras, coarser with the distance from them, and of large instances.


_NEAR_M = 4.0  # up to this distance texels have the finest size
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
    return np.maximum(np.array(nearest_m) / _NEAR_M, 1.0)


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
