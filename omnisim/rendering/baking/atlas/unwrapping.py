"""Unwrapping of meshes by xatlas into charts, each in a rectangle of texels on a page.

The edges of a chart lie at the centers of the outermost texels of its rectangle. A lookup between
texels therefore stays within the rectangle, and rectangles need no gap between them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.atlas.packing import pack
from omnisim.rendering.baking.atlas.xatlas_threads import atlas_of_sleeping_threads
from omnisim.scene.model import Mesh


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
