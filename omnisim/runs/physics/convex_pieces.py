"""Convex pieces of a scene, for collisions in physics engines.

A connected part of an instance's surface is one piece if it is a convex solid or small: a hull, a
box or a ball. Other parts, such as rooms, floors and terrain, become one slab behind each flat
convex facet. Rooms thus stay hollow, and nothing floats on a room's hull.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.core.short_repr import short_repr
from omnisim.runs.physics.facets import Triangles, area_vectors, connected_parts, convex_facets
from omnisim.runs.physics.hulls import convex_hull
from omnisim.runs.physics.shapes import Shape
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
    """Convex piece of an instance.

    Attributes:
        name: name of the instance.
        shape: shape in the scene's frame.
    """

    name: str
    shape: Shape

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), self.shape.kind)


@dataclass(frozen=True, eq=False)
class Region:
    """Box within which a scene collides.

    Attributes:
        low_m, high_m: (3,) corners.
        free_points_m: (n, 3) points in free space: a part of the scene around one is hollow.
    """

    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]
    free_points_m: NDArray[np.float64]

    @classmethod
    def everywhere(cls) -> Region:
        """Unbounded region."""
        return cls(np.full(3, -np.inf), np.full(3, np.inf), np.zeros((0, 3)))

    def meets(self, corners_m: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask (n,) of the corner sets (n, k, 3) whose bounds meet the region."""
        low, high = corners_m.min(axis=1), corners_m.max(axis=1)
        overlapping: NDArray[np.bool_] = np.all((low <= self.high_m) & (high >= self.low_m), axis=1)
        return overlapping


def convex_pieces(scene: Scene, region: Region) -> list[ConvexPiece]:
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
            shapes = (Shape.of(points) for points in vertex_sets)
            pieces += [ConvexPiece(instance.name, shape) for shape in shapes if shape is not None]
    return pieces


def hull_of(scene: Scene) -> Shape | None:
    """Hull of all instances; None: the scene is flat."""
    points = [
        scene.meshes[one.mesh].positions.astype(np.float64) @ one.world_from_mesh[:3, :3].T
        + one.world_from_mesh[:3, 3]
        for one in scene.instances
    ]
    return Shape.of(np.concatenate(points))


def _welded(
    positions_m: NDArray[np.float64], triangles: Triangles
) -> tuple[NDArray[np.float64], Triangles]:
    """Merged vertices (n, 3), and the triangles (m, 3) between them, without slivers."""
    cells = np.round(positions_m / WELDED_M).astype(np.int64)
    _, first, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    vertices, triangles = positions_m[first], number.reshape(-1)[triangles]
    corners = vertices[triangles]
    areas = np.linalg.norm(area_vectors(corners), axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return vertices, triangles[2.0 * areas > NARROWEST_M * longest]


def _pieces_of(
    vertices_m: NDArray[np.float64],
    part: Triangles,
    two_sided: bool,
    region: Region,
) -> list[NDArray[np.float64]]:
    """Vertices (n, 3) of each piece of a connected part."""
    points = vertices_m[np.unique(part)]
    if not region.meets(points[None])[0]:
        return []
    size = np.ptp(points, axis=0)
    hull = convex_hull(points)
    if hull is not None and hull.volume > THINNEST_M * hull.area:
        is_small = bool(np.all(size <= SMALL_M))
        is_solid = is_small or _is_solid(hull, vertices_m[part], two_sided)
        if is_solid and not np.any(_inside(hull, region.free_points_m)):
            return [points[hull.vertices]]
    part = part[region.meets(vertices_m[part])]
    return [_slab(vertices_m[facet], two_sided) for facet in convex_facets(vertices_m, part)]


def _is_solid(
    hull: scipy.spatial.ConvexHull, corners_m: NDArray[np.float64], two_sided: bool
) -> bool:
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


def _inside(hull: scipy.spatial.ConvexHull, points_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.all(
        points_m @ hull.equations[:, :3].T + hull.equations[:, 3] < 0.0, axis=1
    )
    return inside


def _slab(corners_m: NDArray[np.float64], two_sided: bool) -> NDArray[np.float64]:
    """Vertices (k, 3) of a facet's slab: behind it, below a floor, or about a two-sided wall.

    Args:
        corners_m: (n, 3, 3) corners of the facet's triangles.
        two_sided: True if the facet is visible from both sides.
    """
    normal = area_vectors(corners_m).sum(axis=0)
    normal /= np.linalg.norm(normal)
    points = corners_m.reshape(-1, 3)
    if not two_sided:
        return np.concatenate((points, points - SLAB_M * normal))
    if abs(normal[2]) >= LEVEL_COSINE:
        return np.concatenate((points, points - SLAB_M * np.sign(normal[2]) * normal))
    return np.concatenate((points - 0.5 * SLAB_M * normal, points + 0.5 * SLAB_M * normal))
