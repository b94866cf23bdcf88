"""Convex pieces of a scene, for collisions in physics engines.

A connected part of an instance's surface is one piece if it is a convex solid or small: a hull, a
box or a ball. Other parts, such as rooms, floors and terrain, become one slab behind each flat
convex facet. Rooms thus stay hollow, and nothing floats on a room's hull.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Indices
from omnisim.core.short_repr import short_repr
from omnisim.scene import Scene

WELDED_M = 1e-5  # grid spacing by which close vertices are merged
SMALL_M = 0.4  # parts that fit into a cube of this side collide as their hulls
ON_HULL_M = 0.01  # maximum depth of a dent in a part that counts as convex
COVERED = 0.98  # minimum share of the hull that a closed surface covers
THINNEST_M = 1e-4  # minimum ratio of a solid's volume to its surface area
SLAB_M = 0.02  # thickness of the slab behind a facet
LEVEL_COSINE = 0.7  # minimum cosine between a floor's normal and the vertical
NARROWEST_M = 1e-4  # minimum height of a triangle; flatter ones are slivers


@dataclass(frozen=True, eq=False)
class ConvexPiece:
    """Convex piece of an instance."""

    name: str  # of the instance
    shape: SolidShape  # shape in the scene's frame

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), self.shape.kind)


@dataclass(frozen=True, eq=False)
class SolidRegion:
    """Box within which a scene collides."""

    # low_m, high_m: (3,) corners
    low_m: Floats
    high_m: Floats
    free_points_m: Floats  # (n, 3) points in free space: a part of the scene around one is hollow

    @classmethod
    def everywhere(cls) -> SolidRegion:
        """Unbounded region."""
        return cls(np.full(3, -np.inf), np.full(3, np.inf), np.zeros((0, 3)))

    def meets(self, corners_m: Floats) -> Bools:
        """Mask (n,) of the corner sets (n, k, 3) whose bounds meet the region."""
        low, high = corners_m.min(axis=1), corners_m.max(axis=1)
        return np.all((low <= self.high_m) & (high >= self.low_m), axis=1)


def convex_pieces(scene: Scene, region: SolidRegion) -> list[ConvexPiece]:
    """Pieces of a scene's static instances in a region."""
    pieces = []
    for instance in scene.instances:
        mesh, matrix = scene.meshes[instance.mesh], instance.world_from_mesh
        positions = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        if not region.meets(positions[None])[0]:
            continue
        triangles = mesh.triangles.astype(np.intp)
        if np.linalg.det(matrix[:3, :3]) < 0.0:  # mirrored: keep the front side
            triangles = triangles[:, ::-1]
        vertices, triangles = _welded(positions, triangles)
        if not len(triangles):
            continue
        two_sided = scene.materials[mesh.material].double_sided
        for part in connected_parts(triangles, len(vertices)):
            vertex_sets = _pieces_of(vertices, part, two_sided, region)
            shapes = (SolidShape.of(points) for points in vertex_sets)
            pieces += [ConvexPiece(instance.name, shape) for shape in shapes if shape is not None]
    return pieces


def hull_of(scene: Scene) -> SolidShape | None:
    """Hull of all instances; None: the scene is flat."""
    points = [
        scene.meshes[instance.mesh].positions.astype(np.float64)
        @ instance.world_from_mesh[:3, :3].T
        + instance.world_from_mesh[:3, 3]
        for instance in scene.instances
    ]
    return SolidShape.of(np.concatenate(points))


def _welded(positions_m: Floats, triangles: Triangles) -> tuple[Floats, Triangles]:
    """Merged vertices (n, 3), and the triangles (m, 3) between them, without slivers."""
    cells = np.round(positions_m / WELDED_M).astype(np.int64)
    _, first, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    vertices, triangles = positions_m[first], number.reshape(-1)[triangles]
    corners = vertices[triangles]
    areas = np.linalg.norm(area_vectors(corners), axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return vertices, triangles[2.0 * areas > NARROWEST_M * longest]


def _pieces_of(
    vertices_m: Floats, part: Triangles, two_sided: bool, region: SolidRegion
) -> list[Floats]:
    """Vertices (n, 3) of each piece of a connected part."""
    points = vertices_m[np.unique(part)]
    if not region.meets(points[None])[0]:
        return []
    size = np.ptp(points, axis=0)
    hull = convex_hull(points)
    if hull is not None and hull.volume > THINNEST_M * hull.area:
        is_small = bool(np.all(size <= SMALL_M))
        is_solid = is_small or _is_solid(hull, vertices_m[part], two_sided)
        heights_m = region.free_points_m @ hull.equations[:, :3].T + hull.equations[:, 3]
        if is_solid and not np.any(np.all(heights_m < 0.0, axis=1)):
            return [points[hull.vertices]]
    part = part[region.meets(vertices_m[part])]
    return [_slab(vertices_m[facet], two_sided) for facet in convex_facets(vertices_m, part)]


def _is_solid(hull: scipy.spatial.ConvexHull, corners_m: Floats, two_sided: bool) -> bool:
    """True if triangles (n, 3, 3) lie on their hull, face outwards and cover it."""
    vectors = area_vectors(corners_m)
    areas = np.linalg.norm(vectors, axis=1)
    heights = corners_m.mean(axis=1) @ hull.equations[:, :3].T + hull.equations[:, 3]
    nearest = np.argmax(heights, axis=1)
    if np.any(heights[np.arange(len(heights)), nearest] < -ON_HULL_M):
        return False
    outwards = np.einsum("ni,ni->n", vectors, hull.equations[nearest, :3])
    if not two_sided and areas[outwards < 0.0].sum() > (1.0 - COVERED) * areas.sum():
        return False
    return bool(areas.sum() >= COVERED * hull.area) or (
        not two_sided and areas.sum() >= 0.5 * hull.area  # such as a box without its bottom
    )


def _slab(corners_m: Floats, two_sided: bool) -> Floats:
    """Vertices (k, 3) of a facet's slab: behind it, below a floor, or about a two-sided wall."""
    normal = area_vectors(corners_m).sum(axis=0)
    normal /= np.linalg.norm(normal)
    points = corners_m.reshape(-1, 3)
    if not two_sided:
        return np.concatenate((points, points - SLAB_M * normal))
    if abs(normal[2]) >= LEVEL_COSINE:
        return np.concatenate((points, points - SLAB_M * np.sign(normal[2]) * normal))
    return np.concatenate((points - 0.5 * SLAB_M * normal, points + 0.5 * SLAB_M * normal))


# Facets of a surface: its triangles merged into planar convex polygons.


FLAT_SINE = 0.01  # maximum sine between normals of one facet: half a degree
AREA_SLACK = 1e-3  # relative area by which a hull may exceed its convex polygon

Triangles = Indices  # (n, 3) indices of vertices


def area_vectors(corners_m: Floats) -> Floats:
    """Normals (n, 3) of triangles (n, 3, 3), scaled by their areas."""
    edges = corners_m[:, 1:] - corners_m[:, :1]
    return 0.5 * np.cross(edges[:, 0], edges[:, 1])


def connected_parts(triangles: Triangles, vertex_count: int) -> list[Triangles]:
    """Triangles of each connected part; triangles that share a vertex are connected."""
    links = triangles[:, (0, 1)], triangles[:, (1, 2)]
    rows, columns = (np.concatenate(each) for each in zip(*(link.T for link in links), strict=True))
    return _grouped(triangles, _components(rows, columns, vertex_count)[triangles[:, 0]])


def convex_facets(vertices_m: Floats, triangles: Triangles) -> list[Triangles]:
    """Triangles of each facet: merged across shared edges while flat and convex."""
    if not len(triangles):
        return []
    normals = area_vectors(vertices_m[triangles])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first, second = _neighbors(triangles)
    flat = np.einsum("ni,ni->n", normals[first], normals[second]) > np.sqrt(1.0 - FLAT_SINE**2)
    regions = _grouped(triangles, _components(first[flat], second[flat], len(triangles)))
    return [facet for region in regions for facet in _convex(vertices_m, region)]


def _convex(vertices_m: Floats, region: Triangles) -> list[Triangles]:
    """Convex polygons of a flat region, grown one triangle at a time.

    Source: Hertel and Mehlhorn, "Fast triangulation of simple polygons" (1983): a triangulation
    without its inessential edges; here in one sweep, edge by edge.
    """
    if len(region) == 1 or _is_convex(vertices_m, region):
        return [region]
    owner = np.arange(len(region))
    members = {k: [k] for k in range(len(region))}
    for first, second in zip(*(each.tolist() for each in _neighbors(region)), strict=True):
        a, b = int(owner[first]), int(owner[second])
        if a == b:
            continue
        both = members[a] + members[b]
        if _is_convex(vertices_m, region[both]):
            owner[members[b]] = a
            members[a] = both
            del members[b]
    return [region[rows] for rows in members.values()]


def _is_convex(vertices_m: Floats, region: Triangles) -> bool:
    """True if a flat region's area equals that of its hull."""
    vectors = area_vectors(vertices_m[region])
    normal = vectors.sum(axis=0)
    area = float(np.linalg.norm(normal))
    points = vertices_m[np.unique(region)]
    axes = np.linalg.svd(normal[None])[2][1:]  # two axes perpendicular to the normal
    hull = convex_hull(points @ axes.T)
    return hull is None or bool(hull.volume <= area * (1.0 + AREA_SLACK))


def _neighbors(triangles: Triangles) -> tuple[Indices, Indices]:
    """Pairs of triangles that share an edge: two index arrays (pairs,), ordered by edge."""
    edges = np.sort(triangles[:, ((0, 1), (1, 2), (2, 0))].reshape(-1, 2), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = np.flatnonzero(np.all(edges[order[1:]] == edges[order[:-1]], axis=1))
    return order[same] // 3, order[same + 1] // 3


def _components(first: Indices, second: Indices, count: int) -> NDArray[np.int32]:
    """Component number (count,) of each node in a graph of `count` nodes."""
    links = scipy.sparse.coo_matrix((np.ones(len(first)), (first, second)), (count, count))
    return scipy.sparse.csgraph.connected_components(links, directed=False)[1]


def _grouped(triangles: Triangles, numbers: NDArray[np.int32]) -> list[Triangles]:
    """Triangles grouped by their numbers."""
    order = np.argsort(numbers, kind="stable")
    ends = np.flatnonzero(np.diff(numbers[order])) + 1
    return np.split(triangles[order], ends)


# Convex hulls of points, without Qhull's warnings.


def convex_hull(points: Floats) -> scipy.spatial.ConvexHull | None:
    """Hull of points (n, axes); None: they are degenerate (flat)."""
    try:
        return scipy.spatial.ConvexHull(points, qhull_options="Pp")
    except scipy.spatial.QhullError:
        return None


# Shapes of convex pieces: balls, boxes, or else hulls.


ROUND = 0.02  # maximum difference of a ball's vertex radii, relative
FULL_BALL = 0.9 * 4.0 / 3.0 * math.pi  # minimum hull volume of a ball of radius 1
RIGHT_ANGLE = 1e-3  # maximum cosine between axes at a right angle
FULL = 0.999  # minimum share of its bounding box that a box's hull fills


@dataclass(frozen=True, eq=False)
class SolidShape:
    """Shape of a piece in the frame of its vertices."""

    kind: Literal["ball", "box", "hull"]
    center_m: Floats  # (3,) center
    axes: Floats  # (3, 3) axes of a box, in columns; identity for other kinds
    half_m: Floats  # (3,) half sides of a box, or radius of a ball
    vertices_m: Floats  # (n, 3) corners of the hull, relative to the center

    @classmethod
    def of(cls, vertices_m: Floats) -> SolidShape | None:
        """Shape of the hull of vertices (n, 3); None: the vertices are coplanar."""
        hull = convex_hull(vertices_m)
        if hull is None:
            return None
        corners = vertices_m[hull.vertices]
        if (shape := _ball(corners, hull) or _box(corners, hull)) is not None:
            return shape
        center = corners.mean(axis=0)
        return cls("hull", center, np.eye(3), np.zeros(3), corners - center)


def _ball(corners_m: Floats, hull: scipy.spatial.ConvexHull) -> SolidShape | None:
    center = 0.5 * (corners_m.min(axis=0) + corners_m.max(axis=0))
    radii = np.linalg.norm(corners_m - center, axis=1)
    radius = float(radii.max())
    if radii.min() < (1.0 - ROUND) * radius or hull.volume < FULL_BALL * radius**3:
        return None
    return SolidShape("ball", center, np.eye(3), np.full(3, radius), corners_m - center)


def _box(corners_m: Floats, hull: scipy.spatial.ConvexHull) -> SolidShape | None:
    axes: list[Floats] = []
    for normal in hull.equations[:, :3]:
        if all(abs(float(axis @ normal)) < RIGHT_ANGLE for axis in axes):
            axes.append(normal)
    if len(axes) < 3:
        return None
    rotation = np.stack((axes[0], axes[1], np.cross(axes[0], axes[1])), axis=1)
    along = corners_m @ rotation
    low, high = along.min(axis=0), along.max(axis=0)
    if hull.volume < FULL * float(np.prod(high - low)):
        return None
    center = rotation @ (0.5 * (low + high))
    return SolidShape("box", center, rotation, 0.5 * (high - low), corners_m - center)
