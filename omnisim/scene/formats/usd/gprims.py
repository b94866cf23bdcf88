"""Meshes and shapes of a stage as scene meshes, one per prim and material."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from omnisim.core.errors import SceneError
from omnisim.scene.formats.imported_scene import PLAIN_GRAY, Omissions, make_mesh
from omnisim.scene.formats.usd.corners import (
    Corners,
    PrimvarValues,
    find_primvar,
    integers,
    make_vertices,
    rows,
    triangulate,
)
from omnisim.scene.formats.usd.shapes import is_shape, read_shape
from omnisim.scene.formats.usd.surfaces import Appearance, Surfaces
from omnisim.scene.parts import AlphaMode, Material, Mesh

_PURPOSE = UsdShade.Tokens.preview


class Part(NamedTuple):
    """Scene mesh, and its origin (3,) in the frame of its prim."""

    mesh: int
    center: NDArray[np.float64]


class Gprims:
    """Meshes of a stage.

    Attributes:
        meshes, materials: scene meshes and materials created so far.
    """

    def __init__(
        self, surfaces: Surfaces, time: Usd.TimeCode, meters_per_unit: float, notices: Omissions
    ):
        self.meshes: list[Mesh] = []
        self.materials: list[Material] = []
        self._surfaces, self._time, self._unit = surfaces, time, meters_per_unit
        self._notices = notices
        self._parts: dict[tuple[str, ...], tuple[Part, ...]] = {}
        self._material_rows: dict[tuple[object, ...], int] = {}

    def parts(self, prim: Usd.Prim) -> tuple[Part, ...]:
        """Meshes of a prim, shared by all instance proxies of one prototype prim.

        Raises:
            SceneError: the mesh is damaged.
        """
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        bound = [_bound_material(one) for one in (prim, *(each.GetPrim() for each in subsets))]
        key = (str(source.GetPath()), *(str(one.GetPath()) if one else "" for one in bound))
        if key not in self._parts:
            self._parts[key] = tuple(self._read(prim, subsets, bound))
        return self._parts[key]

    def _read(
        self,
        prim: Usd.Prim,
        subsets: list[UsdGeom.Subset],
        bound: list[UsdShade.Material | None],
    ) -> list[Part]:
        if is_shape(prim):
            faces = shape_faces(prim, self._time, self._unit)
        else:
            faces = mesh_faces(prim, self._time, self._notices)
        if faces is None:
            return []
        rest = np.ones(len(faces.polygons), dtype=bool)
        parts = []
        for subset, material in zip(subsets, bound[1:], strict=True):
            chosen = np.zeros(faces.corners.sizes["uniform"], dtype=bool)
            indices = integers(subset.GetIndicesAttr().Get(self._time))
            chosen[indices[(indices >= 0) & (indices < len(chosen))]] = True
            mask = chosen[faces.polygons] & rest
            rest &= ~mask
            parts += self._part(prim, faces, mask, material or bound[0])
        return parts + self._part(prim, faces, rest, bound[0])

    def _part(
        self,
        prim: Usd.Prim,
        faces: Faces,
        mask: NDArray[np.bool_],
        bound: UsdShade.Material | None,
    ) -> list[Part]:
        """Mesh of the triangles selected by a mask, as a list of at most one."""
        if not mask.any():
            return []
        appearance = None if bound is None else self._surfaces.read(bound)
        uv = None
        if appearance is not None and appearance.uv is not None:
            uv = find_primvar(prim, appearance.uv.primvar, 2, self._time)
        colors = self._colors(prim, appearance)
        constant = colors is not None and colors.interpolation == "constant" and len(colors.values)
        vertices = make_vertices(
            faces.corners.of_triangles(mask), [faces.normals, uv, None if constant else colors]
        )
        normals, coordinates, vertex_colors = vertices.values
        if coordinates is not None and appearance is not None and appearance.uv is not None:
            affine = np.array(appearance.uv.uv_transform)
            with np.errstate(all="ignore"):
                coordinates[:, 1] = 1.0 - coordinates[:, 1]
                coordinates = coordinates @ affine[:, :2].T + affine[:, 2]
        color = colors.values[0] if constant and colors is not None else None
        material = self._material(prim, appearance, color, vertex_colors is not None)
        mesh, center = make_mesh(
            str(prim.GetPath()), faces.points[vertices.points], vertices.triangles, material,
            normals, coordinates, vertex_colors,
        )  # fmt: skip
        self.meshes.append(mesh)
        return [Part(len(self.meshes) - 1, center)]

    def _colors(self, prim: Usd.Prim, appearance: Appearance | None) -> PrimvarValues | None:
        """Linear RGBA of the appearance's primvars; without an appearance, of the display color."""
        names = ("displayColor", "displayOpacity")
        if appearance is not None:
            names = (appearance.color_primvar, appearance.opacity_primvar)
        color = find_primvar(prim, names[0], 3, self._time) if names[0] else None
        opacity = find_primvar(prim, names[1], 1, self._time) if names[1] else None
        if color is None and opacity is None:
            return None
        if color is None:
            assert opacity is not None
            gray = 1.0 if appearance is not None else PLAIN_GRAY
            color = opacity._replace(values=np.full((len(opacity.values), 3), gray))
        alphas = np.ones((len(color.values), 1))
        if opacity is not None:
            if len(opacity.values) == len(color.values) or len(opacity.values) == 1:
                alphas[:] = opacity.values
            else:
                self._notices.count("opacity of another interpolation than color is not drawn")
        with np.errstate(all="ignore"):
            return color._replace(values=np.concatenate((color.values, alphas), axis=1))

    def _material(
        self,
        prim: Usd.Prim,
        appearance: Appearance | None,
        color: NDArray[np.float64] | None,
        has_vertex_colors: bool,
    ) -> int:
        """Index of a material, with the sides and the constant color of a prim."""
        sided = bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get(self._time))
        factor = (1.0, 1.0, 1.0, 1.0) if color is None else tuple(color.tolist())
        if appearance is None and color is None and not has_vertex_colors:
            factor = (PLAIN_GRAY, PLAIN_GRAY, PLAIN_GRAY, 1.0)
        base = Material("displayColor") if appearance is None else appearance.material
        key = (base.name, id(appearance), sided, factor)
        if key not in self._material_rows:
            red, green, blue, alpha = (
                own * times for own, times in zip(base.base_color, factor, strict=True)
            )
            mode = base.alpha_mode
            if alpha < 1.0 and mode is AlphaMode.OPAQUE:
                mode = AlphaMode.BLEND
            self._material_rows[key] = len(self.materials)
            self.materials.append(
                replace(
                    base, base_color=(red, green, blue, alpha), alpha_mode=mode, double_sided=sided
                )
            )
        return self._material_rows[key]


def _bound_material(prim: Usd.Prim) -> UsdShade.Material | None:
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(_PURPOSE)[0]
    return material if material else None


# Triangles of meshes and shapes, with the elements that store their values.


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
    return np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0.0)
