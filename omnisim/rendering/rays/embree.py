"""Embree, through embreex: nearest triangles along rays, in float32."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.extras import require_extra

NO_TRIANGLE = -1
_FAR_M = np.float32(1e37)  # Embree's own limit


def put_rows(
    columns: tuple[NDArray[Any], ...], rows: NDArray[np.intp], values: tuple[NDArray[Any], ...]
) -> None:
    """Overwrite some rows of columns (n, …)."""
    for column, new_values in zip(columns, values, strict=True):
        column[rows] = new_values


class EmbreeHits(NamedTuple):
    """Nearest triangles along rays."""

    triangles: NDArray[np.int32]  # (n,) indices; `NO_TRIANGLE`: none
    ranges_m: NDArray[np.float32]  # (n,) in lengths of the direction
    u: NDArray[np.float32]  # (n,) weight of the second corner
    v: NDArray[np.float32]  # (n,) weight of the third corner
    normals: NDArray[np.float32]  # (n, 3) plane normals on the front side, not of unit length

    def take(self, indices: NDArray[np.intp]) -> EmbreeHits:
        """The selected hits."""
        return EmbreeHits._make(values[indices] for values in self)

    def put(self, indices: NDArray[np.intp], hits: EmbreeHits) -> None:
        """Overwrite the selected hits."""
        put_rows(self, indices, hits)


class EmbreeMesh:
    """Bounding volume hierarchy of triangles; embreex frees the GIL while it casts.

    Args:
        positions_m: (n, 3) vertices.
        triangles: (m, 3) indices of the corners.

    Raises:
        OmnisimError: embreex is not installed.
    """

    def __init__(self, positions_m: NDArray[np.float32], triangles: NDArray[np.int32]):
        check_embree()
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene()
        positions_m = np.ascontiguousarray(positions_m, dtype=np.float32)
        # embreex needs at least one triangle
        self._is_empty = len(triangles) == 0
        if not self._is_empty:
            triangles = np.ascontiguousarray(triangles, dtype=np.int32)
            self._mesh = TriangleMesh(self._scene, positions_m, triangles)  # owns the vertices

    @classmethod
    def of_corners(cls, corners_m: NDArray[np.floating]) -> EmbreeMesh:
        """Mesh of triangles (m, 3, 3) without shared vertices."""
        positions = corners_m.reshape(-1, 3).astype(np.float32)
        return cls(positions, np.arange(len(positions), dtype=np.int32).reshape(-1, 3))

    def triangles_hit(
        self, origins_m: NDArray[np.float32], directions: NDArray[np.float32]
    ) -> NDArray[np.int32]:
        """Indices (n,) of the nearest triangles along rays (n, 3); `NO_TRIANGLE`: none."""
        if self._is_empty:
            return np.full(len(origins_m), NO_TRIANGLE, dtype=np.int32)
        return self._scene.run(origins_m, directions)

    def hits(
        self,
        origins_m: NDArray[np.float32],
        directions: NDArray[np.float32],
        far: NDArray[np.float32] | None = None,
    ) -> EmbreeHits:
        """Nearest triangles along rays (n, 3), hit on either side.

        Args:
            origins_m: (n, 3) origins of the rays.
            directions: (n, 3) directions of any length.
            far: (n,) ends of the rays, in lengths of the direction; None: unlimited.
        """
        if self._is_empty:
            none = np.zeros(len(origins_m), dtype=np.float32)
            missed = np.full(len(none), NO_TRIANGLE, dtype=np.int32)
            return EmbreeHits(missed, none, none, none, np.zeros((len(none), 3), np.float32))
        ends = None if far is None else np.minimum(far, _FAR_M)
        columns = self._scene.run(origins_m, directions, dists=ends, output=True)
        return EmbreeHits(
            columns["primID"], columns["tfar"], columns["u"], columns["v"], columns["Ng"]
        )


def check_embree(feature: str = "casting rays") -> None:
    """Check that embreex, an optional package, is installed for a feature.

    Raises:
        OmnisimError: embreex is missing; names the command that installs it.
    """
    require_extra("rays", feature)
