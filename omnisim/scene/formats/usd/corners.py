"""Corners of a mesh's faces: primvars, polygons as triangles, corners as vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from omnisim.scene.polygons import clip_ears

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


# Triangulation of polygons in 3D: fans for convex ones, ear clipping for the others.


_FLAT = 1e-9  # tolerance relative to the largest turn, against rounding errors at reflex corners


def triangulate(
    points: NDArray[np.floating], counts: NDArray[np.integer], vertices: NDArray[np.integer]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangulate planar or nearly planar polygons, in their order.

    Args:
        points: (n, 3) positions.
        counts: (polygons,) number of corners of each; polygons with less than three are dropped.
        vertices: (corners,) indices into `points`, polygon by polygon.

    Returns:
        Triangle corners (m, 3) as indices into `vertices`, and their polygons (m,).
    """
    starts = np.cumsum(counts, dtype=np.int64) - counts
    corners, polygons = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for count in np.unique(counts[counts >= 3]):
        rows = np.flatnonzero(counts == count)
        loops = starts[rows, None] + np.arange(count)
        positions = points[vertices[loops]].astype(np.float64)
        turns, normals = _turns(positions)
        is_reflex = turns < -_FLAT * np.abs(turns).max(axis=1, keepdims=True)
        # the diagonal of a quad starts at its reflex corner
        first = is_reflex.argmax(axis=1) if count == 4 else np.zeros(len(loops), np.int64)
        is_concave = is_reflex.any(axis=1) & (count > 4)
        corners.append(_fans(loops, first)[~is_concave].reshape(-1, 3))
        polygons.append(np.repeat(rows[~is_concave], count - 2))
        for row in np.flatnonzero(is_concave):
            ears = clip_ears([_projected(positions[row], normals[row])])
            corners.append(loops[row][ears])
            polygons.append(np.full(len(ears), rows[row]))
    every = np.concatenate(polygons)
    order = np.argsort(every, kind="stable")
    return np.concatenate(corners)[order], every[order]


def _fans(loops: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangle fans (n, k - 2, 3) of polygons (n, k), from the `first` (n,) corner of each."""
    count = loops.shape[1]
    rotated = np.take_along_axis(loops, (first[:, None] + np.arange(count)) % count, axis=1)
    apexes = np.broadcast_to(rotated[:, :1], (len(loops), count - 2))
    return np.stack((apexes, rotated[:, 1:-1], rotated[:, 2:]), axis=2)


def _turns(
    corners: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turns (n, k) of polygons (n, k, 3), negative at reflex corners, and unit normals (n, 3).

    Source: Newell's normal; Sutherland et al., "A Characterization of Ten Hidden-Surface
    Algorithms", 1974.
    """
    after, before = np.roll(corners, -1, axis=1), np.roll(corners, 1, axis=1)
    origin = corners[:, :1]
    normals = np.cross(corners - origin, after - origin).sum(axis=1)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    crossed = np.cross(corners - before, after - corners)
    return np.einsum("nkd,nd->nk", crossed, normals), normals


def _projected(corners: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Polygon (k, 2) projected along its normal's main axis, counter-clockwise."""
    axis = int(np.argmax(np.abs(normal)))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    return corners[:, [u, v] if normal[axis] >= 0.0 else [v, u]]


# Primvars of prims as NumPy arrays.


def find_primvar(prim: Usd.Prim, name: str, width: int, time: Usd.TimeCode) -> PrimvarValues | None:
    """Own or inherited primvar of a prim; None: missing, or of another width."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    values = rows(primvar.Get(time), width)
    if values is None:
        return None
    indices = None
    if primvar.IsIndexed():
        stored = primvar.GetIndices(time)
        indices = np.array(() if stored is None else stored, dtype=np.int64).reshape(-1)
    return PrimvarValues(values, str(primvar.GetInterpolation()), indices)


def rows(value: object, width: int) -> NDArray[np.float64] | None:
    """Attribute value as rows (k, width); None: another type or width."""
    if value is None or isinstance(value, str):
        return None
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.size % width or array.ndim > 2:
        return None
    if array.ndim == 2 and array.shape[1] != width:
        return None
    with np.errstate(invalid="ignore"):
        return array.astype(np.float64).reshape(-1, width)


def integers(value: object) -> NDArray[np.int64]:
    """Integer array (k,) of an attribute; empty if missing or of another type."""
    array = np.asarray(value)
    return array.astype(np.int64).reshape(-1) if array.dtype.kind in "iu" else np.zeros(0, np.int64)


def texts(value: object) -> list[str]:
    """Strings of an array attribute; empty if missing."""
    return [str(each) for each in np.array(() if value is None else value).reshape(-1)]
