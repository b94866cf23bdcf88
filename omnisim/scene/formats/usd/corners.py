"""Primvar values at triangle corners, for any interpolation, and vertices shared by corners."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_MAX_KEY = 2**62


class Corners(NamedTuple):
    """Corners (c,) of triangles, with the elements that store their values.

    Attributes:
        sizes: number of elements, by interpolation.
        rows: (c,) element indices, by interpolation.
    """

    sizes: dict[str, int]
    rows: dict[str, NDArray[np.int64]]

    @classmethod
    def of(
        cls,
        point_count: int,
        face_count: int,
        vertices: NDArray[np.int64],
        corners: NDArray[np.int64],
        faces: NDArray[np.int64],
    ) -> Corners:
        """Corners of all triangles of a mesh.

        Args:
            point_count, face_count: numbers of points and faces of the mesh.
            vertices: (face corners,) point indices.
            corners: (m, 3) indices into `vertices`.
            faces: (m,) face index of each triangle.
        """
        flat = corners.ravel()
        points = vertices[flat]
        return cls(
            {
                "constant": 1, "uniform": face_count, "varying": point_count,
                "vertex": point_count, "faceVarying": len(vertices),
            },
            {
                "constant": np.zeros(len(flat), np.int64), "uniform": np.repeat(faces, 3),
                "varying": points, "vertex": points, "faceVarying": flat,
            },
        )  # fmt: skip

    def of_triangles(self, chosen: NDArray[np.bool_]) -> Corners:
        """Corners of the triangles selected by a mask (m,)."""
        kept = np.repeat(chosen, 3)
        return Corners(self.sizes, {key: rows[kept] for key, rows in self.rows.items()})


class PrimvarValues(NamedTuple):
    """Values of a primvar.

    Attributes:
        values: (k, width) distinct or per-element values.
        interpolation: interpolation mode of UsdGeomPrimvar.
        indices: (elements,) indices into `values`; None: one value per element.
    """

    values: NDArray[np.float64]
    interpolation: str
    indices: NDArray[np.int64] | None = None

    @property
    def is_shared(self) -> bool:
        """True if all corners at one point have the same value."""
        return self.interpolation in ("constant", "varying", "vertex")

    def rows(self, corners: Corners) -> NDArray[np.int64] | None:
        """Rows (c,) of the values at corners; None: the number of values does not match."""
        rows, size = corners.rows.get(self.interpolation), corners.sizes.get(self.interpolation)
        elements = len(self.values) if self.indices is None else len(self.indices)
        if rows is None or size is None or elements != size or not elements:
            return None
        if self.indices is None:
            return rows
        value_rows = self.indices[rows]
        if len(value_rows) and (value_rows.min() < 0 or value_rows.max() >= len(self.values)):
            return None
        return value_rows


class Vertices(NamedTuple):
    """Vertices shared by triangles.

    Attributes:
        points: (n,) point indices in the mesh.
        triangles: (m, 3) indices into `points`.
        values: (n, width) values of each primvar; None for one that is missing or does not match.
    """

    points: NDArray[np.int64]
    triangles: NDArray[np.int64]
    values: list[NDArray[np.float64] | None]


def make_vertices(corners: Corners, primvars: list[PrimvarValues | None]) -> Vertices:
    """Merge corners at one point with equal values into shared vertices."""
    points = corners.rows["vertex"]
    rows = [None if one is None else one.rows(corners) for one in primvars]
    code = points
    for primvar, own in zip(primvars, rows, strict=True):
        if primvar is not None and own is not None and not primvar.is_shared:
            code = _paired(code, _ranks(primvar.values)[own])
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    return Vertices(
        points[first],
        inverse.reshape(-1, 3),
        [
            None if primvar is None or own is None else primvar.values[own[first]]
            for primvar, own in zip(primvars, rows, strict=True)
        ],
    )


def _paired(first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.int64]:
    """Keys (n,) that are equal if and only if both numbers are equal."""
    size = int(second.max(initial=0)) + 1
    if int(first.max(initial=0)) >= _MAX_KEY // size:
        first = np.unique(first, return_inverse=True)[1]
    return first * size + second


def _ranks(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Ranks (k,) that are equal if and only if rows (k, width) are equal as float32."""
    with np.errstate(all="ignore"):
        bits = (values.astype(np.float32) + np.float32(0.0)).view(np.uint32).astype(np.uint64)
    ranks: NDArray[np.int64] = np.unique(bits[:, 0], return_inverse=True)[1]
    for column in bits.T[1:]:
        pairs = ranks.astype(np.uint64) << np.uint64(32) | column
        ranks = np.unique(pairs, return_inverse=True)[1]
    return ranks
