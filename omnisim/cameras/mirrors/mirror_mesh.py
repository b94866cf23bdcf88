"""Mesh of a mirror, and its texture coordinates on the unfolded cube (the paper's Fig. 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core.short_repr import short_repr


@dataclass(frozen=True)
class MirrorMesh:
    """Triangles with vertices on the mirror, in the mirror frame.

    Attributes:
        vertices_m: (n, 3) float64, meters.
        normals: (n, 3) float64, unit, on the reflecting side.
        triangles: (m, 3) int64, counter-clockwise seen from the pinhole.
        polygons: polygon count as in the paper: each triangle at the apex is one polygon, and so is
            each cell of two triangles in the other rings.
        sectors: number of polygons around the axis.
        rings: number of polygons from the apex to the rim.
    """

    vertices_m: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[np.int64]
    polygons: int
    sectors: int
    rings: int

    def __repr__(self) -> str:
        shape = f"{self.sectors} sectors × {self.rings} rings"
        return short_repr(self, f"{self.polygons:,} polygons", shape)

    @property
    def edge_middles_m(self) -> NDArray[np.float64]:
        """Midpoints (n, 3) of all edges; some are beyond the rim, seen from the viewpoint."""
        corners = self.vertices_m[self.triangles]
        return (0.5 * (corners + np.roll(corners, 1, axis=1))).reshape(-1, 3)

    @property
    def rim_middles_m(self) -> NDArray[np.float64]:
        """Midpoints (sectors, 3) of the rim edges."""
        rim = self.vertices_m[-self.sectors :]
        return 0.5 * (rim + np.roll(rim, 1, axis=0))


@dataclass(frozen=True)
class UnfoldedMirrorMesh:
    """Mirror mesh clipped along the cube edges, with one copy of each vertex per face.

    Attributes:
        vertices_m: (n, 3) float64, mirror frame, meters.
        normals: (n, 3) float64, unit.
        texture_coordinates: (n, 2) float64 in [0, 1] on the unfolded cube (`omnisim.core.cube`),
            origin at the top left of the image.
        triangles: (m, 3) int64, counter-clockwise seen from the pinhole.
    """

    vertices_m: NDArray[np.float64]
    normals: NDArray[np.float64]
    texture_coordinates: NDArray[np.float64]
    triangles: NDArray[np.int64]
