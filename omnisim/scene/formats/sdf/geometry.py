"""Geometries: meshes and their submeshes, shapes, height maps."""

from __future__ import annotations

import io
import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from PIL import Image

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import SceneError
from omnisim.core.files.sources import SourceReader
from omnisim.core.short_repr import counted
from omnisim.scene import primitives
from omnisim.scene.formats.gltf.nodes import NO_ANIMATION, AnimationChoice
from omnisim.scene.formats.gltf.reader import read_gltf
from omnisim.scene.formats.imported_scene import FileAxes, material_notices, world_from_file
from omnisim.scene.formats.mesh.other_formats import check_format, read_other
from omnisim.scene.formats.resources import AssetResolver
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.parts import Instance, Material, Mesh
from omnisim.scene.primitives import PrimitiveSurface, grid_triangles, surrounds, triangulate
from omnisim.scene.textures import TextureStore

_GLTF = {".glb", ".gltf"}
_COLLADA = {".dae", ".zae"}
_TEXTURE_FOLDERS = ("../materials/textures", "materials/textures", "../textures")


class MeshFile(NamedTuple):
    """Contents of a mesh file."""

    # instances in the file's axes; `world_from_mesh` is still file_from_mesh, in meters
    instances: tuple[Instance, ...]
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    data: bytes = b""  # content of a COLLADA file, for Gazebo's submesh names; otherwise empty


class MeshLibrary:
    """Mesh files by path. As in Gazebo, their axes are not rotated."""

    def __init__(self, textures: TextureStore, reader: SourceReader) -> None:
        self._notices: dict[str, list[tuple[str, str]]] = {}  # by text without its count
        self._textures, self._reader = textures, reader
        self._files: dict[Path, MeshFile | str] = {}

    @property
    def notices(self) -> list[str]:
        """One line for each feature that is not drawn, with the first of several files."""
        return [
            f"{name}: {notice}"
            if not others
            else f"{name} and {counted(len(others), 'more file')}: {text}"
            for text, ((name, notice), *others) in self._notices.items()
        ]

    def load(self, path: Path) -> MeshFile | str:
        """Contents of a file, or the reason why it cannot be read.

        Raises:
            SceneError: the extra for COLLADA is not installed.
        """
        if path not in self._files:
            if path.suffix.lower() in _COLLADA:
                check_format(path)
            try:
                self._files[path] = self._read(path)
            except SceneError as reason:
                self._files[path] = str(reason).removeprefix(f"{path}: ")
        return self._files[path]

    def _read(self, path: Path) -> MeshFile:
        suffix = path.suffix.lower()
        if suffix not in _GLTF:
            check_format(path)
        try:
            data = self._reader.read(path)
        except OSError as reason:
            raise SceneError(f"cannot be read: {reason.strerror}") from None
        if not data:
            raise SceneError("is an empty file")
        folder = path.parent
        assets = AssetResolver(path, self._reader, [folder / inner for inner in _TEXTURE_FOLDERS])
        meters_from_file = world_from_file(suffix, data, FileAxes("z"))
        if suffix in _GLTF:
            none = AnimationChoice(NO_ANIMATION)
            read = read_gltf(data, self._textures, assets, np.eye(4), none)
        else:
            read = read_other(path, data, self._textures, assets)
        if not read.instances:
            raise SceneError("has no triangles")
        for notice in (*assets.notices, *material_notices(read), *read.notices):
            text = re.sub(r" \([\d,]+ [a-z ]+\)$", "", notice)
            self._notices.setdefault(text, []).append((path.name, notice))
        instances = tuple(
            replace(instance, world_from_mesh=meters_from_file @ instance.world_from_mesh)
            for instance in read.instances
        )
        return MeshFile(instances, read.meshes, read.materials, data if suffix == ".dae" else b"")


def submesh(file: MeshFile, name: str) -> tuple[Instance, ...]:
    """Instances of a submesh, whose node or mesh has the name, possibly with a number appended.

    In COLLADA files, node names decide, as in Gazebo, then geometry names if no node matches.
    """
    if file.data:
        names = _submesh_names(file.data)
        for kind in (0, 1):
            chosen = (
                instance
                for instance in file.instances
                if names.get(instance.name, ("", ""))[kind] == name
            )
            if instances := tuple(chosen):
                return instances
        return ()
    named = [
        (instance, (instance.name, file.meshes[instance.mesh].name)) for instance in file.instances
    ]
    exact = tuple(instance for instance, names in named if name in names)
    # readers append numbers to make names unique
    numbered = re.compile(re.escape(name) + r"[._\- ]*\d+")
    return exact or tuple(
        instance for instance, names in named if any(map(numbered.fullmatch, names))
    )


def _submesh_names(data: bytes) -> dict[str, tuple[str, str]]:
    """Names of COLLADA's submeshes and of their geometries, keyed by trimesh's mesh names.

    Gazebo names a submesh after the node that instantiates it. An unnamed node takes the name of
    its nearest named ancestor, or else `unnamed_submesh_N`.

    Source: gz-common, graphics/src/ColladaLoader.cc, `LoadNode`.
    """
    import collada  # type: ignore[import-untyped]  # slow to import
    from collada.scene import GeometryNode, Node  # type: ignore[import-untyped]

    unnamed = (f"unnamed_submesh_{number}" for number in itertools.count())

    def instances(node: Any, ancestor: str) -> Iterator[tuple[Any, str]]:
        """Geometries below a node in file order, each with the name of its node."""
        if isinstance(node, GeometryNode):
            yield node.geometry, ancestor
        if not isinstance(node, Node):
            return
        target = getattr(node, "node", node)  # the target, if this is an instance of a node
        name = target.xmlnode.get("name") or ancestor
        children = node.children or ()
        below = iter(
            [list(instances(child, name)) for child in children if isinstance(child, Node)]
        )
        if not name and any(isinstance(child, GeometryNode) for child in node.children):
            name = next(unnamed)
        for child in children:
            yield from next(below) if isinstance(child, Node) else instances(child, name)

    tolerated = [  # by trimesh, and so here
        collada.common.DaeError, collada.common.DaeIncompleteError,
        collada.common.DaeMalformedError, collada.common.DaeBrokenRefError,
        collada.common.DaeUnsupportedError,
    ]  # fmt: skip
    surfaces = collada.polylist.Polylist, collada.triangleset.TriangleSet
    names: dict[str, tuple[str, str]] = {}
    counts: dict[str | None, int] = {}
    for root in collada.Collada(io.BytesIO(data), ignore=tolerated).scene.nodes:
        for geometry, owner in instances(root, ""):
            for primitive in geometry.primitives:
                if isinstance(primitive, surfaces) and primitive.vertex is not None:
                    mesh = trimesh.util.unique_name(geometry.id, contains=names, counts=counts)
                    names[mesh] = owner, geometry.id
    return names


def centered(file: MeshFile, instances: tuple[Instance, ...]) -> tuple[Instance, ...]:
    """Instances moved to the origin, each by the center of its own bounding box.

    Source: gz-rendering, Ogre2MeshFactory: each part of a submesh is centered separately.
    """
    moved = []
    for instance in instances:
        file_from_mesh = instance.world_from_mesh.copy()
        points = file.meshes[instance.mesh].positions @ file_from_mesh[:3, :3].T
        file_from_mesh[:3, 3] = -0.5 * (points.min(axis=0) + points.max(axis=0))
        moved.append(replace(instance, world_from_mesh=file_from_mesh))
    return tuple(moved)


# Triangles of SDF geometries other than meshes.

# Corners of a whole texture on a rectangle.
_CORNER_UV = np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
_LOOP_TOLERANCE_M = 1e-4  # Gazebo's tolerance between the ends of a closed polyline


class VisualShape(NamedTuple):
    """Surface in the frame of its visual."""

    surface: PrimitiveSurface  # triangles
    # texture coordinates (n, 2), (0, 0) at the top left; None: no texture coordinates
    uv: Floats | None = None
    is_closed: bool = True  # back faces are never visible


def _plane(element: XmlElement) -> VisualShape:
    """Rectangle perpendicular to its normal."""
    normal = np.array(element.vector("normal", (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(normal))
    if length < 1e-9:
        raise element.error("a <normal> other than 0 0 0", element.text("normal"))
    x, y = _sizes(element, "size", (1.0, 1.0))
    surface = primitives.rectangle(0.5 * x, 0.5 * y)
    across = surface.positions @ _axes(normal / length).T
    return VisualShape(surface._replace(positions=across), _CORNER_UV, is_closed=False)


def _polyline(elements: Sequence[XmlElement]) -> VisualShape:
    """Extrusion of closed polylines along z, from z = 0 to the first one's height."""
    height = elements[0].positive("height", 1.0)
    loops = [_loop(element) for element in elements]
    points, triangles = triangulate(loops)
    if not len(triangles):
        raise elements[0].error("points around an area", "none")
    low = np.column_stack((points, np.zeros(len(points))))
    caps = primitives.join(
        PrimitiveSurface(low + (0.0, 0.0, height), triangles, None),
        PrimitiveSurface(low, triangles[:, ::-1], None),
    )
    walls = [_wall(loop, height, loops) for loop in loops]
    return VisualShape(primitives.join(caps, *walls))


def _wall(loop: Floats, height: float, loops: list[Floats]) -> PrimitiveSurface:
    """Lateral surface of an extrusion, facing out."""
    count = len(loop)
    following = np.roll(loop, -1, axis=0)
    along = following[0] - loop[0]
    # if a point just right of the first edge is outside, the front faces that side
    right = 0.5 * (loop[0] + following[0]) + 1e-6 * np.array((along[1], -along[0]))
    if sum(surrounds(other, right) for other in loops) % 2:
        loop = loop[::-1]
        following = np.roll(loop, -1, axis=0)
    low, high = np.zeros((count, 1)), np.full((count, 1), height)
    corners = np.stack(
        [np.hstack(pair) for pair in
         ((loop, low), (following, low), (following, high), (loop, high))], axis=1
    )  # fmt: skip
    first = 4 * np.arange(count)[:, None]
    triangles = np.concatenate((first + (0, 1, 2), first + (0, 2, 3)))
    return PrimitiveSurface(corners.reshape(-1, 3), triangles, None)


def _loop(element: XmlElement) -> Floats:
    points = np.array([point.numbers(2) for point in element.children("point")]).reshape(-1, 2)
    if len(points) > 1 and np.linalg.norm(points[0] - points[-1]) < _LOOP_TOLERANCE_M:
        points = points[:-1]
    if len(points) < 3:
        raise element.error("three points or more", len(points))
    return points


def _sizes(element: XmlElement, path: str, default: tuple[float, ...]) -> tuple[float, ...]:
    sizes = element.vector(path, default)
    size_element = element.find(path)
    if size_element is not None and min(sizes) <= 0.0:
        raise size_element.error("numbers > 0")
    return sizes


def _axes(normal: Floats) -> Floats:
    """Rotation (3, 3) whose z is the normal, by the smallest rotation from z up."""
    z = np.array((0.0, 0.0, 1.0))
    cosine = float(normal @ z)
    if cosine < -1.0 + 1e-12:
        return np.diag((1.0, -1.0, -1.0))
    cross = np.cross(z, normal)
    skew = np.cross(np.eye(3), cross)
    return np.eye(3) + skew + skew @ skew / (1.0 + cosine)


def _round(surface: PrimitiveSurface, radius_m: float, max_segments: int) -> VisualShape:
    count = primitives.segments(radius_m, max_segments) + 1
    index = np.arange(len(surface.positions))
    z = surface.positions[:, 2]
    low, high = float(z.min()), float(z.max())
    uv = np.column_stack((index % count / (count - 1), (high - z) / (high - low)))
    return VisualShape(surface, uv)


ROUND = frozenset(("sphere", "ellipsoid", "cylinder", "cone", "capsule"))
SHAPES = frozenset((*ROUND, "box", "plane", "polyline"))
GEOMETRIES = frozenset((*SHAPES, "mesh", "heightmap", "image"))
_FEW = 20  # maximum number of round shapes at full resolution


def segment_limit(round_shapes: int) -> int:
    """Segments per circle, reduced such that many round shapes keep a constant triangle count."""
    fair = primitives.MAX_SEGMENTS * math.sqrt(_FEW / max(round_shapes, _FEW))
    return max(4 * round(fair / 4.0), primitives.MIN_SEGMENTS)


def make_shape(geometry: XmlElement, kind: XmlElement, max_segments: int) -> VisualShape:
    """Shape of a `<geometry>` from its child `kind`, or from all its polylines together.

    A box has the whole texture on each side; on round shapes, of at most `max_segments`, it
    is wrapped around once. The length of a capsule excludes the hemispheres.
    """
    tag = kind.tag
    if tag == "polyline":
        return _polyline(list(geometry.children("polyline")))
    if tag == "plane":
        return _plane(kind)
    if tag == "box":
        sizes = _sizes(kind, "size", (1.0, 1.0, 1.0))
        return VisualShape(
            primitives.box([0.5 * size for size in sizes]), np.tile(_CORNER_UV, (6, 1))
        )
    if tag == "ellipsoid":
        radii = _sizes(kind, "radii", (1.0, 1.0, 1.0))
        return _round(primitives.ellipsoid(radii, max_segments), max(radii), max_segments)
    radius = kind.positive("radius", 0.5 if tag in ("cone", "capsule") else 1.0)
    if tag == "sphere":
        surface = primitives.ellipsoid((radius,) * 3, max_segments)
    else:
        make = {"cylinder": primitives.cylinder, "cone": primitives.cone}
        half_length = 0.5 * kind.positive("length", 1.0)
        surface = make.get(tag, primitives.capsule)(radius, half_length, max_segments)
    return _round(surface, radius, max_segments)


# Terrain from gray images, with textures that vary with height.
#
# The brightest pixel is at the height of the map's size, and black is at 0. The first image row
# is at the largest y.

MAX_POINTS = 513  # per side, about half a million triangles
_BAKED_PX = (256, 2048)  # minimum and maximum side of a texture blended from several layers


class Layer(NamedTuple):
    """Texture layer of a terrain."""

    image: Image.Image  # RGB image, which repeats
    size_m: float  # side length of one repetition
    # from_m, fade_m: height at which the layer starts, and height range over which it fades in
    from_m: float = 0.0
    fade_m: float = 0.0


def read_levels(image: Image.Image) -> Floats | None:
    """Levels (rows, columns) in [0, 1], at most `MAX_POINTS` per side; None: not a gray image."""
    if image.mode.startswith("I"):
        levels = np.asarray(image, dtype=np.float64) / 65535.0
    elif image.mode == "F":  # an elevation model in meters
        return None
    else:
        levels = np.asarray(image.convert("RGB"), dtype=np.float64)[..., 0] / 255.0
    if min(levels.shape) < 2:
        return None
    kept = (np.linspace(0, count - 1, min(count, MAX_POINTS)) for count in levels.shape)
    return levels[np.ix_(*(rows.round().astype(np.intp) for rows in kept))]


def terrain(element: XmlElement, levels: Floats, tile_m: float) -> VisualShape:
    """Surface of a `<heightmap>` with levels (rows, columns) in [0, 1].

    A side of a texture's repetition is `tile_m` long; 0: that of the whole terrain.
    """
    size = terrain_size_m(element)
    rows, columns = levels.shape
    x, y = np.linspace(-0.5, 0.5, columns) * size[0], np.linspace(-0.5, 0.5, rows) * size[1]
    heights = levels[::-1] / max(float(levels.max()), 1e-9) * size[2]
    grid_x, grid_y = np.meshgrid(x, y)
    positions = np.stack((grid_x, grid_y, heights), axis=-1)
    slope_y, slope_x = np.gradient(heights, y, x)
    normals = np.stack((-slope_x, -slope_y, np.ones_like(heights)), axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    tiles = (size[0] / tile_m, size[1] / tile_m) if tile_m > 0.0 else (1.0, 1.0)
    uv = np.stack((grid_x / size[0] + 0.5, 0.5 - grid_y / size[1]), axis=-1) * tiles
    surface = PrimitiveSurface(
        positions.reshape(-1, 3) + element.vector("pos", (0.0, 0.0, 0.0)),
        grid_triangles(rows, columns),
        normals.reshape(-1, 3),
    )
    return VisualShape(surface, uv.reshape(-1, 2), is_closed=False)


def terrain_size_m(element: XmlElement) -> tuple[float, ...]:
    """Width, depth and height of a `<heightmap>`."""
    size = element.vector("size", (1.0, 1.0, 1.0))
    if min(size[:2]) <= 0.0:
        raise (element.find("size") or element).error("a width and depth > 0")
    return size


def blend(layers: list[Layer], levels: Floats, size: tuple[float, ...]) -> Image.Image:
    """Image of a whole terrain from above, blended from its layers, low to high.

    Its levels (rows, columns) are in [0, 1]; its size is in m.
    """
    # texels across the whole terrain
    finest = max(max(layer.image.size) * max(size[:2]) / layer.size_m for layer in layers)
    side = round(min(max(finest, _BAKED_PX[0]), _BAKED_PX[1]))
    gray = Image.fromarray((levels / max(float(levels.max()), 1e-9)).astype(np.float32))
    heights = np.asarray(gray.resize((side, side), Image.Resampling.BILINEAR)) * size[2]
    baked = _tiled(layers[0], size, side).astype(np.float32)
    for layer in layers[1:]:
        weights = (heights - layer.from_m) / max(layer.fade_m, 1e-6)
        weights = np.clip(weights, 0.0, 1.0)[..., None]
        baked += weights * (_tiled(layer, size, side) - baked)
    return Image.fromarray(np.rint(baked).astype(np.uint8))


def _tiled(layer: Layer, size: tuple[float, ...], side: int) -> Bytes:
    width, height = (
        min(max(1, round(side * layer.size_m / extent)), 4 * side) for extent in size[:2]
    )
    tile = np.asarray(layer.image.convert("RGB").resize((width, height)))
    repeats = -(-side // height), -(-side // width), 1
    return np.tile(tile, repeats)[:side, :side]
