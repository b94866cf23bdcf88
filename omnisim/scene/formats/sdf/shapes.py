"""Triangles of SDF geometries other than meshes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene import primitives
from omnisim.scene.formats.xml.element import XmlElement
from omnisim.scene.polygons import surrounds, triangulate
from omnisim.scene.primitives import Surface

_LOOP_TOLERANCE_M = 1e-4  # Gazebo's tolerance between the ends of a closed polyline


class Shape(NamedTuple):
    """Surface in the frame of its visual.

    Attributes:
        surface: triangles.
        uv: texture coordinates (n, 2), (0, 0) at the top left; None: no texture coordinates.
        is_closed: back faces are never visible.
    """

    surface: Surface
    uv: NDArray[np.float64] | None = None
    is_closed: bool = True


def box(size: XmlElement) -> Shape:
    """Box with the whole texture on each side."""
    x, y, z = _sizes(size, "size", (1.0, 1.0, 1.0))
    uv = np.tile([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)], (6, 1))
    return Shape(primitives.box((0.5 * x, 0.5 * y, 0.5 * z)), uv)


def sphere(element: XmlElement, max_segments: int) -> Shape:
    """Sphere with its texture wrapped around once."""
    radius = element.positive("radius", 1.0)
    return _round(primitives.ellipsoid((radius,) * 3, max_segments), radius, max_segments)


def ellipsoid(element: XmlElement, max_segments: int) -> Shape:
    """Ellipsoid with its texture wrapped around once."""
    radii = _sizes(element, "radii", (1.0, 1.0, 1.0))
    return _round(primitives.ellipsoid(radii, max_segments), max(radii), max_segments)


def cylinder(element: XmlElement, max_segments: int) -> Shape:
    """Cylinder with its texture wrapped around once."""
    radius, length = element.positive("radius", 1.0), element.positive("length", 1.0)
    return _round(primitives.cylinder(radius, 0.5 * length, max_segments), radius, max_segments)


def cone(element: XmlElement, max_segments: int) -> Shape:
    """Cone, tip up."""
    radius, length = element.positive("radius", 0.5), element.positive("length", 1.0)
    return _round(primitives.cone(radius, 0.5 * length, max_segments), radius, max_segments)


def capsule(element: XmlElement, max_segments: int) -> Shape:
    """Capsule; its length excludes the hemispheres."""
    radius, length = element.positive("radius", 0.5), element.positive("length", 1.0)
    return _round(primitives.capsule(radius, 0.5 * length, max_segments), radius, max_segments)


def plane(element: XmlElement) -> Shape:
    """Rectangle perpendicular to its normal.

    Raises:
        SceneError: the normal is zero.
    """
    normal = np.array(element.vector("normal", (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(normal))
    if length < 1e-9:
        raise element.error("a <normal> other than 0 0 0", element.text("normal"))
    x, y = _sizes(element, "size", (1.0, 1.0))
    surface = primitives.rectangle(0.5 * x, 0.5 * y)
    across = surface.positions @ _axes(normal / length).T
    uv = np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
    return Shape(surface._replace(positions=across), uv, is_closed=False)


def polyline(elements: Sequence[XmlElement]) -> Shape:
    """Extrusion of closed polylines along z, from z = 0 to the first one's height.

    Raises:
        SceneError: the polylines enclose no area.
    """
    height = elements[0].positive("height", 1.0)
    loops = [_loop(element) for element in elements]
    points, triangles = triangulate(loops)
    if not len(triangles):
        raise elements[0].error("points around an area", "none")
    low = np.column_stack((points, np.zeros(len(points))))
    caps = primitives.join(
        Surface(low + (0.0, 0.0, height), triangles, None),
        Surface(low, triangles[:, ::-1], None),
    )
    walls = [_wall(loop, height, loops) for loop in loops]
    return Shape(primitives.join(caps, *walls))


def _wall(loop: NDArray[np.float64], height: float, loops: list[NDArray[np.float64]]) -> Surface:
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
    return Surface(corners.reshape(-1, 3), triangles, None)


def _loop(element: XmlElement) -> NDArray[np.float64]:
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


def _axes(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) whose z is the normal, by the smallest rotation from z up."""
    z = np.array((0.0, 0.0, 1.0))
    cosine = float(normal @ z)
    if cosine < -1.0 + 1e-12:
        return np.diag((1.0, -1.0, -1.0))
    cross = np.cross(z, normal)
    skew = np.cross(np.eye(3), cross)
    rotation: NDArray[np.float64] = np.eye(3) + skew + skew @ skew / (1.0 + cosine)
    return rotation


def _round(surface: Surface, radius_m: float, max_segments: int) -> Shape:
    """Shape around z with its texture wrapped around once."""
    count = primitives.segments(radius_m, max_segments) + 1
    index = np.arange(len(surface.positions))
    z = surface.positions[:, 2]
    low, high = float(z.min()), float(z.max())
    uv = np.column_stack((index % count / (count - 1), (high - z) / (high - low)))
    return Shape(surface, uv)


_FLAT = {"box": box, "plane": plane}
_ROUND = {
    "sphere": sphere, "ellipsoid": ellipsoid, "cylinder": cylinder, "cone": cone,
    "capsule": capsule,
}  # fmt: skip
SHAPES = frozenset((*_FLAT, *_ROUND, "polyline"))
ROUND = frozenset(_ROUND)
GEOMETRIES = frozenset((*SHAPES, "mesh", "heightmap", "image"))
_FEW = 20  # maximum number of round shapes at full resolution


def segment_limit(round_shapes: int) -> int:
    """Segments per circle, reduced such that many round shapes keep a constant triangle count."""
    fair = primitives.MAX_SEGMENTS * math.sqrt(_FEW / max(round_shapes, _FEW))
    return max(4 * round(fair / 4.0), primitives.MIN_SEGMENTS)


def make_shape(geometry: XmlElement, kind: XmlElement, max_segments: int) -> Shape:
    """Shape of a `<geometry>` from its child `kind`, or from all its polylines together.

    Args:
        geometry, kind: geometry element and its child element.
        max_segments: maximum number of segments of a circle.

    Raises:
        SceneError: invalid sizes.
    """
    tag = kind.element.tag
    if tag == "polyline":
        return polyline(list(geometry.children("polyline")))
    return _ROUND[tag](kind, max_segments) if tag in _ROUND else _FLAT[tag](kind)
