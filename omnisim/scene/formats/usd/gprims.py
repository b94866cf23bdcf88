"""Meshes and shapes of a stage as scene meshes, one per prim and material."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from omnisim.core.arrays import Bools, Floats, Ints
from omnisim.core.errors import SceneError
from omnisim.scene import primitives
from omnisim.scene.formats.imported_scene import PLAIN_GRAY, Omissions, make_mesh
from omnisim.scene.formats.usd.surfaces import Appearance, Surfaces
from omnisim.scene.parts import AlphaMode, Material, Mesh
from omnisim.scene.primitives import PrimitiveSurface, clip_ears

_PURPOSE = UsdShade.Tokens.preview


class GprimPart(NamedTuple):
    """Scene mesh, and its origin (3,) in the frame of its prim."""

    mesh: int
    center: Floats


class Gprims:
    """Scene meshes and materials of a stage, those created so far."""

    def __init__(
        self, surfaces: Surfaces, time: Usd.TimeCode, meters_per_unit: float, notices: Omissions
    ):
        self.meshes: list[Mesh] = []
        self.materials: list[Material] = []
        self._surfaces, self._time, self._unit = surfaces, time, meters_per_unit
        self._notices = notices
        self._parts: dict[tuple[str, ...], tuple[GprimPart, ...]] = {}
        self._material_rows: dict[tuple[object, ...], int] = {}

    def parts(self, prim: Usd.Prim) -> tuple[GprimPart, ...]:
        """Meshes of a prim, shared by all instance proxies of one prototype prim."""
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        bindings = map(
            UsdShade.MaterialBindingAPI, (prim, *(subset.GetPrim() for subset in subsets))
        )
        bound = [binding.ComputeBoundMaterial(_PURPOSE)[0] or None for binding in bindings]
        key = (
            str(source.GetPath()),
            *(str(material.GetPath()) if material else "" for material in bound),
        )
        if key not in self._parts:
            self._parts[key] = tuple(self._read(prim, subsets, bound))
        return self._parts[key]

    def _read(
        self, prim: Usd.Prim, subsets: list[UsdGeom.Subset], bound: list[UsdShade.Material | None]
    ) -> list[GprimPart]:
        if is_shape(prim):
            faces = shape_faces(prim, self._time, self._unit)
        else:
            faces = mesh_faces(prim, self._time, self._notices)
        if faces is None:
            return []
        rest, parts = np.ones(len(faces.polygons), dtype=bool), []
        for subset, material in zip(subsets, bound[1:], strict=True):
            chosen = np.zeros(faces.corners.sizes["uniform"], dtype=bool)
            indices = integers(subset.GetIndicesAttr().Get(self._time))
            chosen[indices[(indices >= 0) & (indices < len(chosen))]] = True
            mask = chosen[faces.polygons] & rest
            rest &= ~mask
            parts += self._part(prim, faces, mask, material or bound[0])
        return parts + self._part(prim, faces, rest, bound[0])

    def _part(
        self, prim: Usd.Prim, faces: Faces, mask: Bools, bound: UsdShade.Material | None
    ) -> list[GprimPart]:
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
            str(prim.GetPath()), material, faces.points[vertices.points], vertices.triangles,
            normals, coordinates, vertex_colors,
        )  # fmt: skip
        self.meshes.append(mesh)
        return [GprimPart(len(self.meshes) - 1, center)]

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
        color: Floats | None,
        has_vertex_colors: bool,
    ) -> int:
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


# Triangles of meshes and shapes, with the elements that store their values.

_NO_SUBDIVISION = ("none", "")


class Faces(NamedTuple):
    """Triangles of a prim."""

    points: NDArray[np.floating]  # (n, 3) positions
    corners: FaceCorners  # corners of the triangles
    polygons: Ints  # (m,) polygon index of each triangle
    normals: PrimvarValues | None  # normals as a primvar; None: flat shading


def shape_faces(prim: Usd.Prim, time: Usd.TimeCode, meters_per_unit: float) -> Faces | None:
    """Triangles of a parametric shape; None: no triangles."""
    surface = read_shape(prim, time, meters_per_unit)
    if not len(surface.triangles):
        return None
    triangles = surface.triangles[:, ::-1] if _is_left_handed(prim, time) else surface.triangles
    vertices = triangles.ravel().astype(np.int64)
    corners = np.arange(len(vertices)).reshape(-1, 3)
    polygons = np.zeros(len(corners), np.int64)  # a shape counts as one face
    return Faces(
        surface.positions,
        FaceCorners.of(len(surface.positions), 1, vertices, corners, polygons),
        polygons,
        None if surface.normals is None else PrimvarValues(surface.normals, "vertex"),
    )


def mesh_faces(prim: Usd.Prim, time: Usd.TimeCode, notices: Omissions) -> Faces | None:
    """Triangles of a mesh; None: no triangles."""
    mesh = UsdGeom.Mesh(prim)
    points = rows(mesh.GetPointsAttr().Get(time), 3)
    counts = integers(mesh.GetFaceVertexCountsAttr().Get(time))
    vertices = integers(mesh.GetFaceVertexIndicesAttr().Get(time))
    if points is None or not len(points) or not len(counts):
        return None
    if counts.min() < 0 or counts.sum() != len(vertices):
        raise SceneError(
            f"{prim.GetPath()}.faceVertexCounts: expected a sum of {len(vertices)}, as there are "
            f"faceVertexIndices, got {counts.sum()}"
        )
    if len(vertices) and (vertices.min() < 0 or vertices.max() >= len(points)):
        worst = vertices.min() if vertices.min() < 0 else vertices.max()
        raise SceneError(
            f"{prim.GetPath()}.faceVertexIndices: expected points below {len(points)}, got {worst}"
        )
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
    normals = find_primvar(prim, "normals", 3, time)
    if normals is None and (values := rows(mesh.GetNormalsAttr().Get(time), 3)) is not None:
        normals = PrimvarValues(values, str(mesh.GetNormalsInterpolation()))
    if normals is None and str(mesh.GetSubdivisionSchemeAttr().Get()) not in _NO_SUBDIVISION:
        notices.count("subdivision: the control mesh is drawn, with smooth normals", "mesh")
        normals = PrimvarValues(_smooth_normals(points, vertices[corners]), "vertex")
    return Faces(
        points,
        FaceCorners.of(len(points), len(counts), vertices, corners, polygons),
        polygons,
        normals,
    )


def _is_left_handed(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    orientation = UsdGeom.Gprim(prim).GetOrientationAttr().Get(time)
    return bool(orientation == UsdGeom.Tokens.leftHanded)


@np.errstate(all="ignore")  # a mesh with non-finite values is rejected later
def _smooth_normals(points: Floats, triangles: Ints) -> Floats:
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


# Parametric shapes of USD: cubes, spheres, cylinders, cones, capsules, planes.

_SHAPES = ("Cube", "Sphere", "Plane", "Cylinder", "Cone", "Capsule")
_MAX_SIZE = 1e12
# Rotations of a shape around z to each axis; columns are the shape's axes.
_FROM_Z = {
    "X": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "Y": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "Z": np.eye(3),
}


def is_shape(prim: Usd.Prim) -> bool:
    """True for a parametric shape."""
    return str(prim.GetTypeName()).removesuffix("_1") in _SHAPES


def read_shape(prim: Usd.Prim, time: Usd.TimeCode, meters_per_unit: float) -> PrimitiveSurface:
    """Triangles of a shape in stage units, with a resolution that suits its size in meters."""

    def size_m(key: str) -> float:
        value = prim.GetAttribute(key).Get(time)
        if not isinstance(value, float) or not (math.isfinite(value) and 0.0 <= value < _MAX_SIZE):
            raise SceneError(f"{prim.GetPath()}.{key} = {value!r:.40}: expected a number ≥ 0")
        return value * meters_per_unit

    kind, axis = str(prim.GetTypeName()).removesuffix("_1"), prim.GetAttribute("axis")
    along = str(axis.Get(time)) if axis else "Z"
    has_two_radii = bool(prim.GetAttribute("radiusBottom"))
    radii = ("radiusBottom", "radiusTop") if has_two_radii else ("radius", "radius")
    if kind == "Cube":
        surface = primitives.box(np.full(3, 0.5 * size_m("size")))
    elif kind == "Sphere":
        surface = primitives.ellipsoid(np.full(3, size_m("radius")))
    elif kind == "Plane":  # faces +axis; its width is along x, or along z if it faces x
        width, length = 0.5 * size_m("width"), 0.5 * size_m("length")
        surface = primitives.rectangle(*((width, length) if along == "Z" else (length, width)))
    elif kind == "Capsule":
        bottom, top = map(size_m, radii)
        if bottom != top:
            raise SceneError(f"{prim.GetPath()}: expected a capsule of one radius, got two")
        surface = primitives.capsule(bottom, 0.5 * size_m("height"))
    else:
        half_length, (bottom, top) = 0.5 * size_m("height"), map(size_m, radii)
        if kind == "Cylinder" and bottom == top:
            surface = primitives.cylinder(bottom, half_length)
        else:
            surface = _frustum(bottom, 0.0 if kind == "Cone" else top, half_length)
    turn = _FROM_Z.get(along, np.eye(3))
    return PrimitiveSurface(
        surface.positions @ turn.T / meters_per_unit,
        surface.triangles,
        None if surface.normals is None else surface.normals @ turn.T,
    )


def _frustum(bottom_m: float, top_m: float, half_length_m: float) -> PrimitiveSurface:
    """Cylinder around z with its ends scaled to two radii."""
    whole = primitives.cylinder(max(bottom_m, top_m), half_length_m)
    assert whole.normals is not None
    radii = np.where(whole.positions[:, 2] < 0.0, bottom_m, top_m) / max(bottom_m, top_m, 1e-300)
    positions, normals = whole.positions.copy(), whole.normals.copy()
    positions[:, :2] *= radii[:, None]
    side = np.abs(normals[:, 2]) < 0.5
    normals[side, 2] = (bottom_m - top_m) / max(2.0 * half_length_m, 1e-300)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    corners = positions[whole.triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return PrimitiveSurface(positions, whole.triangles[areas > 0.0], normals)


# Corners of a mesh's faces: primvars, polygons as triangles, corners as vertices.

_MAX_KEY = 2**62


class FaceCorners(NamedTuple):
    """Corners (c,) of triangles, with the elements that store their values."""

    sizes: dict[str, int]  # number of elements, by interpolation
    rows: dict[str, Ints]  # (c,) element indices, by interpolation

    @classmethod
    def of(
        cls, point_count: int, face_count: int, vertices: Ints, corners: Ints, faces: Ints
    ) -> FaceCorners:
        """Corners of all triangles of a mesh.

        Its `vertices` (face corners,) are indices of points; `corners` (m, 3) are indices into
        these, and `faces` (m,) the triangles' faces.
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

    def of_triangles(self, chosen: Bools) -> FaceCorners:
        """Corners of the triangles selected by a mask (m,)."""
        kept = np.repeat(chosen, 3)
        return FaceCorners(self.sizes, {key: rows[kept] for key, rows in self.rows.items()})


class PrimvarValues(NamedTuple):
    """Values of a primvar."""

    values: Floats  # (k, width) distinct or per-element values
    interpolation: str  # interpolation mode of UsdGeomPrimvar
    indices: Ints | None = None  # (elements,) indices into `values`; None: one value per element

    @property
    def is_shared(self) -> bool:
        """True if all corners at one point have the same value."""
        return self.interpolation in ("constant", "varying", "vertex")

    def rows(self, corners: FaceCorners) -> Ints | None:
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
    """Vertices shared by triangles."""

    points: Ints  # (n,) point indices in the mesh
    triangles: Ints  # (m, 3) indices into `points`
    # (n, width) values of each primvar; None for one that is missing or does not match
    values: list[Floats | None]


def make_vertices(corners: FaceCorners, primvars: list[PrimvarValues | None]) -> Vertices:
    """Merge corners at one point with equal values into shared vertices."""
    points = corners.rows["vertex"]
    rows = [None if primvar is None else primvar.rows(corners) for primvar in primvars]
    code = points
    for primvar, own in zip(primvars, rows, strict=True):
        if primvar is not None and own is not None and not primvar.is_shared:
            ranks = _ranks(primvar.values)[own]
            size = int(ranks.max(initial=0)) + 1
            if int(code.max(initial=0)) >= _MAX_KEY // size:
                code = np.unique(code, return_inverse=True)[1]
            code = code * size + ranks  # equal if and only if both numbers are
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    return Vertices(
        points[first],
        inverse.reshape(-1, 3),
        [
            None if primvar is None or own is None else primvar.values[own[first]]
            for primvar, own in zip(primvars, rows, strict=True)
        ],
    )


def _ranks(values: Floats) -> Ints:
    """Ranks (k,) that are equal if and only if rows (k, width) are equal as float32."""
    with np.errstate(all="ignore"):
        bits = (values.astype(np.float32) + np.float32(0.0)).view(np.uint32).astype(np.uint64)
    ranks: Ints = np.unique(bits[:, 0], return_inverse=True)[1]
    for column in bits.T[1:]:
        pairs = ranks.astype(np.uint64) << np.uint64(32) | column
        ranks = np.unique(pairs, return_inverse=True)[1]
    return ranks


# Triangulation of polygons in 3D: fans for convex ones, ear clipping for the others.

_FLAT = 1e-9  # tolerance relative to the largest turn, against rounding errors at reflex corners


def triangulate(
    points: NDArray[np.floating], counts: NDArray[np.integer], vertices: NDArray[np.integer]
) -> tuple[Ints, Ints]:
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
        rotated = np.take_along_axis(loops, (first[:, None] + np.arange(count)) % count, axis=1)
        apexes = np.broadcast_to(rotated[:, :1], (len(loops), count - 2))
        fans = np.stack((apexes, rotated[:, 1:-1], rotated[:, 2:]), axis=2)
        corners.append(fans[~is_concave].reshape(-1, 3))
        polygons.append(np.repeat(rows[~is_concave], count - 2))
        for row in np.flatnonzero(is_concave):
            axis = int(np.argmax(np.abs(normals[row])))  # projected along it, counter-clockwise
            across = np.roll(np.arange(3), -axis)[1:]
            plan = positions[row][:, across if normals[row][axis] >= 0.0 else across[::-1]]
            ears = clip_ears([plan])
            corners.append(loops[row][ears])
            polygons.append(np.full(len(ears), rows[row]))
    every = np.concatenate(polygons)
    order = np.argsort(every, kind="stable")
    return np.concatenate(corners)[order], every[order]


def _turns(corners: Floats) -> tuple[Floats, Floats]:
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


def rows(value: object, width: int) -> Floats | None:
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


def integers(value: object) -> Ints:
    """Integer array (k,) of an attribute; empty if missing or of another type."""
    array = np.asarray(value)
    return array.astype(np.int64).reshape(-1) if array.dtype.kind in "iu" else np.zeros(0, np.int64)


def texts(value: object) -> list[str]:
    """Strings of an array attribute; empty if missing."""
    return [str(each) for each in np.array(() if value is None else value).reshape(-1)]
