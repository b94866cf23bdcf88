"""Atlas of a scene: a rectangle of texels for each static instance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.baking.texel_sizes import (
    MOST_GIVEN_TEXELS,
    MOST_TEXELS,
    TEXEL_BUDGET,
    areas_m2,
    first_texel_m,
    texel_sizes_m,
)
from omnisim.baking.unwrapping import Unwrapping, unwrap
from omnisim.errors import SceneError
from omnisim.scene.model import Scene

GUTTER_PX = 2  # around each rectangle
_STEP_PX = 2
MAX_SIDE_PX = 8192
_LEAST_SCALE = 0.5  # of a mesh's page: below it its padding would be less than a texel
_LEAST_TEXELS = 1.0  # of an instance's area; a smaller one has one light all over
_LEAST_FILL, _SMALL_PAGE_PX = 0.02, 16384


class Atlas(NamedTuple):
    """Places of instances in an atlas.

    Attributes:
        unwrappings: by the index of the mesh.
        rects_px: (n, 4) int of the instances: left, top, width, height; zeros: it has none.
        back_rects_px: (n, 4) of the backs of those instances whose back is seen.
        texels_m: (n,) sizes of the instances' texels.
        size_px: width and height.
    """

    unwrappings: dict[int, Unwrapping]
    rects_px: NDArray[np.intp]
    back_rects_px: NDArray[np.intp]
    texels_m: NDArray[np.float64]
    size_px: tuple[int, int]

    def shares(self, rects_px: NDArray[np.intp]) -> dict[int, list[float]]:
        """Rectangles by the index of the instance, in shares of the atlas."""
        whole = np.array((*self.size_px, *self.size_px), dtype=np.float64)
        return {
            int(index): (rects_px[index] / whole).tolist()
            for index in np.flatnonzero(rects_px[:, 2])
        }


def automatic_atlas(scene: Scene, has_back: NDArray[np.bool_]) -> tuple[float, Atlas]:
    """Finest width of texels, of two digits, whose atlas keeps to `TEXEL_BUDGET`; the atlas."""
    texel_m = first_texel_m(scene, has_back)
    while True:
        texel_m = float(f"{texel_m:.2g}")
        atlas = build_atlas(scene, texel_m, has_back, MOST_TEXELS)
        needed = atlas.size_px[0] * atlas.size_px[1]
        if needed <= TEXEL_BUDGET:
            return texel_m, atlas
        texel_m *= max((needed / TEXEL_BUDGET) ** 0.5, 1.05)


def build_atlas(
    scene: Scene,
    texel_m: float,
    has_back: NDArray[np.bool_],
    most_texels: int = MOST_GIVEN_TEXELS,
) -> Atlas:
    """Unwrap the meshes of static instances, and pack a rectangle for each instance.

    Args:
        scene: to bake.
        texel_m: width of the finest texels.
        has_back: (n,) instances of which both sides are seen: they have two rectangles.
        most_texels: of one instance, about; texels of a larger one are wider.

    Raises:
        SceneError: texels so small that the atlas has more than `MAX_SIDE_PX`.
    """
    texels_m, areas = texel_sizes_m(scene, texel_m, has_back, most_texels), areas_m2(scene)
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
        if covered < _LEAST_TEXELS:
            continue
        if covered > MAX_SIDE_PX**2:
            raise _too_fine(texel_m, scene, covered)
        matrix = scene.instances[finest].world_from_mesh[:3, :3] / texels_m[finest]
        page = unwrap(scene.meshes[mesh], matrix)
        if page is None or not _is_worth(page, covered):
            continue
        unwrappings[mesh] = page
        for index in members:
            scale = float(np.clip(scales[index] / scales[finest], _LEAST_SCALE, 1.0))
            sizes_px[index] = np.ceil(np.array(page.size_px) * scale)
    both, size_px = pack(np.concatenate((sizes_px, sizes_px * has_back[:, None])))
    rects_px, back_rects_px = both[: len(sizes_px)], both[len(sizes_px) :]
    if max(size_px) > MAX_SIDE_PX:
        raise _too_fine(texel_m, scene, float(np.prod(size_px)))
    return Atlas(unwrappings, rects_px, back_rects_px, texels_m, size_px)


def pack(sizes_px: NDArray[np.intp]) -> tuple[NDArray[np.intp], tuple[int, int]]:
    """Rectangles (n, 4) of sizes (n, 2), with gutters, and the size of their atlas.

    The highest come first, each as near to the top as there is room below the others.
    """
    rects = np.zeros((len(sizes_px), 4), dtype=np.intp)
    used = np.flatnonzero(sizes_px.min(axis=1, initial=1))
    if not len(used):
        return rects, (1, 1)
    outer = -(-(sizes_px[used] + 2 * GUTTER_PX) // _STEP_PX)
    width = max(int(outer[:, 0].max()), int(np.ceil(np.sqrt(outer.prod(axis=1).sum()))))
    ends = np.zeros(width, dtype=np.intp)  # of what each column holds
    for at in np.lexsort((used, -outer[:, 0], -outer[:, 1])):
        wide, high = outer[at]
        tops = np.lib.stride_tricks.sliding_window_view(ends, wide).max(axis=1)
        left = int(tops.argmin())
        top = int(tops[left])
        ends[left : left + wide] = top + high
        corner = _STEP_PX * np.array((left, top)) + GUTTER_PX
        rects[used[at]] = *corner, *sizes_px[used[at]]
    return rects, (_STEP_PX * width, _STEP_PX * int(ends.max()))


def _scale(matrix: NDArray[np.float64]) -> float:
    """Mean factor of lengths."""
    return float(np.abs(np.linalg.det(matrix[:3, :3])) ** (1.0 / 3.0))


def _is_worth(page: Unwrapping, covered: float) -> bool:
    """Tell pages of charts from pages of padding, as crumbs of many small pieces have."""
    texels = page.size_px[0] * page.size_px[1]
    return texels <= _SMALL_PAGE_PX or covered >= _LEAST_FILL * texels


def _too_fine(texel_m: float, scene: Scene, texels: float) -> SceneError:
    fitting_m = texel_m * float(np.sqrt(texels)) / (0.7 * MAX_SIDE_PX)
    return SceneError(
        f"{scene.name}: texel_m = {texel_m:g}: expected an atlas of at most {MAX_SIDE_PX} px, "
        f"which about {fitting_m:.2g} makes"
    )


def corner_pixels(scene: Scene, atlas: Atlas, swapped: Sequence[bool]) -> NDArray[np.float32]:
    """Corners (m, 3, 2) of all triangles in the atlas, in texels; zeros where there are none.

    Args:
        scene: its instances, one after the other.
        atlas: of the scene.
        swapped: (n,) instances whose second and third corners are swapped.
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
        mine = placed[page.triangles].astype(np.float32)
        corners.append(mine[:, [0, 2, 1]] if swapped[index] else mine)
    return np.concatenate(corners)
