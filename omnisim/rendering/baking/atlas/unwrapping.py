"""Unwrapping of meshes by xatlas into charts, each in a rectangle of texels on a page.

The edges of a chart lie at the centers of the outermost texels of its rectangle. A lookup between
texels therefore stays within the rectangle, and rectangles need no gap between them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Set
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Mesh

if TYPE_CHECKING:
    import xatlas


class Unwrapping(NamedTuple):
    """Mesh with one texture coordinate per vertex; vertices on seams are split.

    Attributes:
        vertex_of: (v,) int32 original vertex of each split vertex.
        triangles: (t, 3) int32 split vertices, in the mesh's order.
        uv: (v, 2) float32 on the page, from 0 to 1.
        charts_px: (c, 4) chart rectangles: left, top, width, height.
        size_px: width and height of the page, in texels.
    """

    vertex_of: NDArray[np.int32]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    charts_px: NDArray[np.intp]
    size_px: tuple[int, int]


def unwrap(mesh: Mesh, texels_from_mesh: NDArray[np.float64]) -> Unwrapping | None:
    """Unwrap a mesh into charts that do not overlap.

    Args:
        mesh: mesh to unwrap.
        texels_from_mesh: (3, 3) linear map from mesh coordinates to lengths in texels.

    Returns:
        Unwrapping; None: the mesh has no surface area.
    """
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


def _pack_charts(
    places_px: NDArray[np.float64], chart_of: NDArray[np.intp]
) -> tuple[NDArray[np.intp], tuple[int, int]]:
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
        _wait_until_asleep(_threads() - others)


def _threads() -> Set[str]:
    """Numbers of this process's threads; empty: not on Linux."""
    return set(os.listdir(_THREADS)) if _THREADS.is_dir() else set()


def _wait_until_asleep(threads: Set[str]) -> None:
    """Wait until threads sleep, at most a second: some may be other libraries', and work on."""
    end_s = time.monotonic() + _MAX_WAIT_S
    for thread in threads:
        while _is_awake(thread) and time.monotonic() < end_s:
            time.sleep(0)  # lets it run


def _is_awake(thread: str) -> bool:
    try:
        stat = (_THREADS / thread / "stat").read_text(encoding="ascii", errors="replace")
    except OSError:  # the thread has ended
        return False
    return stat.rpartition(")")[2].split()[0] != "S"


# Packing of rectangles of texels.


def pack(sizes_px: NDArray[np.intp]) -> tuple[NDArray[np.intp], tuple[int, int]]:
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
