"""Triangles of meshes and shapes, with the elements that store their values."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from omnisim.core.errors import SceneError
from omnisim.scene.formats.omissions import Omissions
from omnisim.scene.formats.usd.corners import Corners, PrimvarValues
from omnisim.scene.formats.usd.polygons import triangulate
from omnisim.scene.formats.usd.primvars import find_primvar, integers, rows
from omnisim.scene.formats.usd.shapes import read_shape

_NO_SUBDIVISION = ("none", "")


class Faces(NamedTuple):
    """Triangles of a prim.

    Attributes:
        points: (n, 3) positions.
        corners: corners of the triangles.
        polygons: (m,) polygon index of each triangle.
        normals: normals as a primvar; None: flat shading.
    """

    points: NDArray[np.floating]
    corners: Corners
    polygons: NDArray[np.int64]
    normals: PrimvarValues | None


def shape_faces(prim: Usd.Prim, time: Usd.TimeCode, meters_per_unit: float) -> Faces | None:
    """Triangles of a parametric shape; None: no triangles.

    Raises:
        SceneError: an invalid size.
    """
    surface = read_shape(prim, time, meters_per_unit)
    if not len(surface.triangles):
        return None
    is_left_handed = _is_left_handed(prim, time)
    triangles = surface.triangles[:, ::-1] if is_left_handed else surface.triangles
    vertices = triangles.ravel().astype(np.int64)
    corners = np.arange(len(vertices)).reshape(-1, 3)
    polygons = np.zeros(len(corners), np.int64)  # a shape counts as one face
    return Faces(
        surface.positions,
        Corners.of(len(surface.positions), 1, vertices, corners, polygons),
        polygons,
        None if surface.normals is None else PrimvarValues(surface.normals, "vertex"),
    )


def mesh_faces(prim: Usd.Prim, time: Usd.TimeCode, notices: Omissions) -> Faces | None:
    """Triangles of a mesh; None: no triangles.

    Raises:
        SceneError: counts that do not match the corners, or invalid point indices.
    """
    mesh = UsdGeom.Mesh(prim)
    points = rows(mesh.GetPointsAttr().Get(time), 3)
    counts = integers(mesh.GetFaceVertexCountsAttr().Get(time))
    vertices = integers(mesh.GetFaceVertexIndicesAttr().Get(time))
    if points is None or not len(points) or not len(counts):
        return None
    _check_topology(prim, len(points), counts, vertices)
    if mesh.GetPointsAttr().ValueMightBeTimeVarying():
        notices.count("animation: rests at its first frame")
    if prim.HasAPI("SkelBindingAPI"):
        notices.count("skeleton: the mesh is drawn as it is stored")
    corners, polygons = triangulate(points, counts, vertices)
    holes = integers(mesh.GetHoleIndicesAttr().Get(time))
    if len(holes):
        kept = ~np.isin(polygons, holes)
        corners, polygons = corners[kept], polygons[kept]
    if not len(corners):
        return None
    if _is_left_handed(prim, time):
        corners = corners[:, ::-1]
    normals = _normals(mesh, time)
    if normals is None and str(mesh.GetSubdivisionSchemeAttr().Get()) not in _NO_SUBDIVISION:
        notices.count("subdivision: the control mesh is drawn, with smooth normals", "mesh")
        normals = PrimvarValues(_smooth_normals(points, vertices[corners]), "vertex")
    return Faces(
        points,
        Corners.of(len(points), len(counts), vertices, corners, polygons),
        polygons,
        normals,
    )


def _normals(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> PrimvarValues | None:
    primvar = find_primvar(mesh.GetPrim(), "normals", 3, time)
    if primvar is not None:
        return primvar
    values = rows(mesh.GetNormalsAttr().Get(time), 3)
    return None if values is None else PrimvarValues(values, str(mesh.GetNormalsInterpolation()))


def _check_topology(
    prim: Usd.Prim, points: int, counts: NDArray[np.int64], vertices: NDArray[np.int64]
) -> None:
    """Check that the face counts match the corners, and that the corners index existing points.

    Raises:
        SceneError: the counts or indices are invalid; names the mesh.
    """
    if counts.min() < 0 or counts.sum() != len(vertices):
        raise SceneError(
            f"{prim.GetPath()}.faceVertexCounts: expected a sum of {len(vertices)}, as there are "
            f"faceVertexIndices, got {counts.sum()}"
        )
    if len(vertices) and (vertices.min() < 0 or vertices.max() >= points):
        worst = vertices.min() if vertices.min() < 0 else vertices.max()
        raise SceneError(
            f"{prim.GetPath()}.faceVertexIndices: expected points below {points}, got {worst}"
        )


def _is_left_handed(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    orientation = UsdGeom.Gprim(prim).GetOrientationAttr().Get(time)
    return bool(orientation == UsdGeom.Tokens.leftHanded)


@np.errstate(all="ignore")  # a mesh with non-finite values is rejected later
def _smooth_normals(
    points: NDArray[np.float64], triangles: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Normals (n, 3) at points, area-weighted over their triangles."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    sums = np.stack(
        [
            np.bincount(triangles.ravel(), np.repeat(areas[:, axis], 3), len(points))
            for axis in range(3)
        ],
        axis=1,
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    normals: NDArray[np.float64] = np.divide(
        sums, lengths, out=np.zeros_like(sums), where=lengths > 0.0
    )
    return normals
