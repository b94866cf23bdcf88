"""Lightmap atlas of a scene: a rectangle of texels for each static instance."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence, Set
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Indices, Ints32
from omnisim.core.errors import SceneError
from omnisim.scene.model import Mesh, Scene

if TYPE_CHECKING:
    import xatlas


MAX_SIDE_PX = 8192
_FINE_STEPS = 20  # before texels double: only very wide ones make needles shorter
_MIN_TEXELS = 1.0  # of an instance's area; smaller instances have uniform light

MAX_GIVEN_TEXELS = 1 << 21  # per instance, if the texel size is given


class Atlas(NamedTuple):
    """Layout of instances in an atlas."""

    unwrappings: dict[int, Unwrapping]  # unwrapping by index of the mesh
    # (n, 4) int rectangles of the instances: left, top, width, height; zeros: none
    rects_px: Indices
    back_rects_px: Indices  # (n, 4) rectangles of the backs, for instances with a visible back
    texels_m: Floats  # (n,) texel width of each instance
    size_px: tuple[int, int]  # width and height

    def shares(self, rects_px: Indices) -> dict[int, list[float]]:
        """Rectangles by index of the instance, as shares of the atlas."""
        whole = np.array((*self.size_px, *self.size_px), dtype=np.float64)
        return {
            int(index): (rects_px[index] / whole).tolist()
            for index in np.flatnonzero(rects_px[:, 2])
        }

    def charts(self, mesh_of: Sequence[int]) -> Ints32:
        """Chart (height, width) of each texel, −1: none, by the mesh (n,) of each instance."""
        charts = np.full(self.size_px[::-1], -1, dtype=np.int32)
        number = 0
        for rects_px in (self.rects_px, self.back_rects_px):
            for index in np.flatnonzero(rects_px[:, 2]).tolist():
                for left, top, wide, high in self.unwrappings[mesh_of[index]].charts_px:
                    x, y = rects_px[index, :2] + (left, top)
                    charts[y : y + high, x : x + wide] = number
                    number += 1
        return charts


def automatic_atlas(scene: Scene, has_back: Bools, texels: int) -> tuple[float, Atlas]:
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
    scene: Scene, texel_m: float, has_back: Bools, limit: int = MAX_GIVEN_TEXELS
) -> Atlas:
    """Unwrap the meshes of static instances, and pack a rectangle for each instance.

    Args:
        texel_m: width of the finest texels.
        has_back: (n,) instances with two visible sides, which get two rectangles.
        limit: approximate maximum number of texels per instance; larger ones get wider texels.

    Raises:
        SceneError: texels are so small that the atlas exceeds `MAX_SIDE_PX`.
    """
    areas, finest_m = areas_m2(scene), coarseness(scene) * texel_m
    texels_m = _limited(areas * (1 + has_back), lengths_m(scene), finest_m, limit)
    volumes = [
        np.abs(np.linalg.det(instance.world_from_mesh[:3, :3])) for instance in scene.instances
    ]
    scales = np.array([volume ** (1.0 / 3.0) for volume in volumes]) / np.maximum(texels_m, 1e-12)
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


def _too_fine(texel_m: float, scene: Scene, texels: float) -> SceneError:
    fitting_m = texel_m * float(np.sqrt(texels)) / (0.7 * MAX_SIDE_PX)
    return SceneError(
        f"{scene.name}: texel_m = {texel_m:g}: expected about {fitting_m:.2g} or more, for an "
        f"atlas of at most {MAX_SIDE_PX} px"
    )


def corner_pixels(scene: Scene, atlas: Atlas, swapped: Sequence[bool]) -> Floats32:
    """Corners (m, 3, 2) of all triangles, in texels; 0 outside; `swapped`: second with third."""
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


def areas_m2(scene: Scene) -> Floats:
    """Areas (n,) of the instances."""
    areas = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        corners = mesh.positions.astype(np.float64) @ instance.world_from_mesh[:3, :3].T
        a, b, c = (corners[mesh.triangles[:, corner]] for corner in range(3))
        areas.append(0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()))
    return np.array(areas)


def lengths_m(scene: Scene) -> Floats:
    """Diagonals (n,) of the instances' bounding boxes."""
    lengths = []
    for instance in scene.instances:
        used = scene.meshes[instance.mesh].positions[scene.meshes[instance.mesh].triangles]
        placed = used.reshape(-1, 3).astype(np.float64) @ instance.world_from_mesh[:3, :3].T
        lengths.append(float(np.linalg.norm(np.ptp(placed, axis=0))) if len(placed) else 0.0)
    return np.array(lengths)


def coarseness(scene: Scene) -> Floats:
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


def first_texel_m(scene: Scene, has_back: Bools, texels: int) -> float:
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


def _limited(areas: Floats, lengths: Floats, texels_m: Floats, limit: int) -> Floats:
    """Texel sizes (n,) of instances by the areas of their visible sides, and their lengths."""
    sizes: Floats = np.maximum(texels_m, np.sqrt(areas / limit))
    return np.maximum(sizes, lengths / MAX_LENGTH)


def camera_places_m(scene: Scene) -> Floats:
    """Positions (n, 3) of cameras and vehicles."""
    height_m = scene.start.position_m[2]
    places = [scene.start.position_m, *(start.position_m for start in scene.starts)]
    places += [(x, y, height_m) for path in scene.paths for x, y in path.waypoints_m]
    return np.array(places, dtype=np.float64)


# Unwrapping of meshes by xatlas into charts, each in a rectangle of texels on a page.
#
# The edges of a chart lie at the centers of the outermost texels of its rectangle. A lookup between
# texels therefore stays within the rectangle, and rectangles need no gap between them.


class Unwrapping(NamedTuple):
    """Mesh with one texture coordinate per vertex; vertices on seams are split."""

    vertex_of: Ints32  # (v,) int32 original vertex of each split vertex
    triangles: Ints32  # (t, 3) int32 split vertices, in the mesh's order
    uv: Floats32  # (v, 2) float32 on the page, from 0 to 1
    charts_px: Indices  # (c, 4) chart rectangles: left, top, width, height
    size_px: tuple[int, int]  # width and height of the page, in texels


def unwrap(mesh: Mesh, texels_from_mesh: Floats) -> Unwrapping | None:
    """Unwrap a mesh, mapped by (3, 3) to lengths in texels, into charts; None: it has no area."""
    import xatlas

    positions = mesh.positions.astype(np.float64) @ texels_from_mesh.T
    options = xatlas.PackOptions()
    options.texels_per_unit, options.rotate_charts_to_axis = 1.0, True
    with atlas_of_sleeping_threads() as atlas:
        atlas.add_mesh(positions.astype(np.float32), mesh.triangles)
        atlas.generate(xatlas.ChartOptions(), options)
        if atlas.width == 0 or atlas.height == 0:
            return None
        vertex_of, triangles, uv = atlas[0]
        places_px = uv.astype(np.float64) * (atlas.width, atlas.height)
        _, chart_of = np.unique(atlas.get_mesh_vertex_assignment(0)[1], return_inverse=True)
    rects_px, size_px = _pack_charts(places_px, chart_of)
    return Unwrapping(
        vertex_of.astype(np.int32),
        triangles.astype(np.int32),
        (places_px / size_px).astype(np.float32),
        rects_px,
        size_px,
    )


def _pack_charts(places_px: Floats, chart_of: Indices) -> tuple[Indices, tuple[int, int]]:
    """Rectangles (c, 4) of charts and the page size; moves the vertices into the rectangles."""
    count = int(chart_of.max(initial=-1)) + 1
    low, high = (np.full((count, 2), sign * np.inf) for sign in (1, -1))
    np.minimum.at(low, chart_of, places_px)
    np.maximum.at(high, chart_of, places_px)
    steps = np.rint(high - low).astype(np.intp)  # between centers of the outermost texels
    rects_px, size_px = pack(steps + 1)
    scales = steps / np.maximum(high - low, 1e-9)
    offsets = rects_px[:, :2] + 0.5
    places_px[:] = offsets[chart_of] + (places_px - low[chart_of]) * scales[chart_of]
    return rects_px, size_px


# Atlases of xatlas that end safely.
#
# An atlas has threads of its own. At its end, it wakes them without holding their lock. A thread
# that is just about to sleep misses that, and the process waits for it forever: 1 of about 1600
# atlases that ended at once, on two cores.
_THREADS = Path("/proc/self/task")
_MAX_WAIT_S = 1.0


@contextmanager
def atlas_of_sleeping_threads() -> Iterator[xatlas.Atlas]:
    """Atlas whose threads sleep at the end of the context, after which it may be deleted."""
    import xatlas

    others = _threads()
    atlas = xatlas.Atlas()
    try:
        yield atlas
    finally:
        end_s = time.monotonic() + _MAX_WAIT_S  # other libraries' threads may work on
        for thread in _threads() - others:
            while _is_awake(thread) and time.monotonic() < end_s:
                time.sleep(0)  # lets it run


def _threads() -> Set[str]:
    """Numbers of this process's threads; empty: not on Linux."""
    return set(os.listdir(_THREADS)) if _THREADS.is_dir() else set()


def _is_awake(thread: str) -> bool:
    try:
        stat = (_THREADS / thread / "stat").read_text(encoding="ascii", errors="replace")
    except OSError:  # the thread has ended
        return False
    return stat.rpartition(")")[2].split()[0] != "S"


def pack(sizes_px: Indices) -> tuple[Indices, tuple[int, int]]:
    """Place rectangles of sizes (n, 2) side by side; return them (n, 4) and the page's size.

    Taller rectangles are placed first; each is as near to the top as earlier ones allow.
    """
    rects = np.zeros((len(sizes_px), 4), dtype=np.intp)
    used = np.flatnonzero(sizes_px.min(axis=1, initial=1))
    if not len(used):
        return rects, (1, 1)
    sizes = sizes_px[used]
    width = max(int(sizes[:, 0].max()), int(np.ceil(np.sqrt(sizes.prod(axis=1).sum()))))
    ends = np.zeros(width, dtype=np.intp)  # bottom of the occupied part of each column
    for at in np.lexsort((used, -sizes[:, 0], -sizes[:, 1])):
        wide, high = sizes[at]
        tops = np.lib.stride_tricks.sliding_window_view(ends, wide).max(axis=1)
        left = int(tops.argmin())
        top = int(tops[left])
        ends[left : left + wide] = top + high
        rects[used[at]] = left, top, wide, high
    return rects, (width, int(ends.max()))
