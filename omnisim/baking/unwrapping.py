"""Unwrapping of meshes into charts on a page of texels, by xatlas."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Mesh

PADDING_PX = 2  # between charts, so that each has a texel of its own around it


class Unwrapping(NamedTuple):
    """Mesh with one texture coordinate at each vertex: vertices on seams are split.

    Attributes:
        vertex_of: (v,) int32, vertex of the mesh that each one is.
        triangles: (t, 3) int32 of these vertices, in the mesh's order.
        uv: (v, 2) float32 on the page, from 0 to 1.
        size_px: width and height of the page, in texels.
    """

    vertex_of: NDArray[np.int32]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    size_px: tuple[int, int]


def unwrap(mesh: Mesh, texels_from_mesh: NDArray[np.float64]) -> Unwrapping | None:
    """Unwrap a mesh into charts that do not overlap.

    Args:
        mesh: of a scene.
        texels_from_mesh: (3, 3) linear map to lengths in texels.

    Returns:
        None: it has no surface.
    """
    import xatlas

    positions = mesh.positions.astype(np.float64) @ texels_from_mesh.T
    atlas = xatlas.Atlas()
    atlas.add_mesh(positions.astype(np.float32), mesh.triangles)
    options = xatlas.PackOptions()
    options.texels_per_unit, options.padding, options.bilinear = 1.0, PADDING_PX, True
    options.rotate_charts_to_axis = True
    atlas.generate(xatlas.ChartOptions(), options)
    if atlas.width == 0 or atlas.height == 0:
        return None
    vertex_of, triangles, uv = atlas[0]
    return Unwrapping(
        vertex_of.astype(np.int32),
        triangles.astype(np.int32),
        uv.astype(np.float32),
        (int(atlas.width), int(atlas.height)),
    )
