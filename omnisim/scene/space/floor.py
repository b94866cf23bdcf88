"""Heights of floors and of objects on them, and the hierarchy that finds a scene's triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Bools, Floats, Indices, Ints, triangle_bounds
from omnisim.core.short_repr import counted, short_repr
from omnisim.scene.model import Instance, Scene

# Corners are float32 and transformed by matrices: further digits are rounding errors, not slope.
HEIGHT_DIGITS = 5
EDGE = 1e-9  # share of a triangle's area: a point on a shared edge hits at least one triangle


class HeightField:
    """Upward-facing surfaces of a scene between two corners (2,) of its floor plan.

    Glass is included; ceilings, undersides of slabs and other downward-facing surfaces are not.
    """

    def __init__(self, scene: Scene, low_m: Floats, high_m: Floats):
        triangles = triangles_within(scene, low_m, high_m)
        self._triangles = triangles[triangles.seen_from_above]
        self._bvh = TriangleBvh(self._triangles.corners_m)

    def heights_m(self, points_m: Floats) -> Floats:
        """Heights (n, k, surfaces) at n groups of nearby points (n, k, 2).

        Heights are ascending; −inf pads short rows.
        """
        groups, size = points_m.shape[:2]
        ends = np.full((groups, 1), np.inf)
        low = np.concatenate((points_m.min(axis=1), -ends), axis=1)
        high = np.concatenate((points_m.max(axis=1), ends), axis=1)
        group, triangles = self._bvh.overlaps(low, high)
        heights = _heights_at(self._triangles.corners_m[triangles], points_m[group])
        points = group[:, None] * size + np.arange(size)
        hit = np.isfinite(heights)
        points, heights = points[hit], np.round(heights[hit], HEIGHT_DIGITS) + 0.0  # avoids -0.0
        counts = np.bincount(points, minlength=groups * size)
        order = np.lexsort((heights, points))
        ranks = np.arange(len(points)) - np.repeat(np.cumsum(counts), counts)
        table = np.full((groups * size, max(1, int(counts.max(initial=0)))), -np.inf)
        table[points[order], ranks] = heights[order]
        return table.reshape(groups, size, -1)


def floor_height_m(scene: Scene, point_m: ArrayLike, near_m: float = 0.0) -> float | None:
    """Height of the upward-facing surface at (x, y) nearest to a given height; None: no surface."""
    point = np.asarray(point_m, dtype=np.float64)
    heights = HeightField(scene, point, point).heights_m(point[None, None]).ravel()
    heights = heights[np.isfinite(heights)]
    if not len(heights):
        return None
    return float(heights[np.argmin(np.abs(heights - near_m))])


def _heights_at(corners_m: Floats, points_m: Floats) -> Floats:
    """Heights (n, k) of triangles (n, 3, 3) at points (n, k, 2); NaN outside a triangle."""
    a, b, c = corners_m[:, None, 0], corners_m[:, None, 1], corners_m[:, None, 2]
    total = _areas(a - c, b - c)
    with np.errstate(divide="ignore", invalid="ignore"):
        # barycentric coordinates, each from the edge opposite its corner
        of_a = _areas(b[..., :2] - points_m, c[..., :2] - points_m) / total
        of_b = _areas(c[..., :2] - points_m, a[..., :2] - points_m) / total
        of_c = 1.0 - of_a - of_b
        heights = c[..., 2] + of_a * (a - c)[..., 2] + of_b * (b - c)[..., 2]
        inside = (of_a >= -EDGE) & (of_b >= -EDGE) & (of_c >= -EDGE)  # false for NaN as well
    return np.where(inside, heights, np.nan)


def _areas(first_m: Floats, second_m: Floats) -> Floats:
    """Twice the signed areas (...) spanned by vectors (..., 2 or 3), seen from above."""
    return first_m[..., 0] * second_m[..., 1] - first_m[..., 1] * second_m[..., 0]


# Triangles of a scene in the world, and a bounding volume hierarchy over them.

MORTON_BITS = 16  # per axis
FEW = 5000  # pairs of a box and a triangle


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles in the world frame."""

    corners_m: Floats  # (n, 3, 3), one corner per row
    instances: Indices  # (n,) indices into `Scene.instances`
    seen_from_above: Bools  # (n,) mask of the triangles that face up or are double-sided

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.corners_m), "triangle"))

    def __getitem__(self, rows: Indices | Bools) -> Triangles:
        return Triangles(self.corners_m[rows], self.instances[rows], self.seen_from_above[rows])


def triangles_within(scene: Scene, low_m: Floats, high_m: Floats) -> Triangles:
    """Triangles whose bounds overlap a box with two corners (3,), or (2,) on the floor plan."""
    axes = len(low_m)
    corners, above, counts = [np.zeros((0, 3, 3))], [np.zeros(0, dtype=bool)], []
    for instance in scene.instances:
        triangles, up = _of_instance(scene, instance)
        low, high = triangle_bounds(triangles[..., :axes])
        near = np.all((low <= high_m) & (high >= low_m), axis=1)
        corners.append(triangles[near])
        above.append(up[near])
        counts.append(int(near.sum()))
    return Triangles(
        np.concatenate(corners), np.repeat(np.arange(len(counts)), counts), np.concatenate(above)
    )


def _of_instance(scene: Scene, instance: Instance) -> tuple[Floats, Bools]:
    """World corners (n, 3, 3), and a mask (n,) of the triangles visible from above."""
    mesh, matrix = scene.meshes[instance.mesh], instance.world_from_mesh
    positions = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    corners = positions[mesh.triangles]
    first, second = (corners[:, k, :2] - corners[:, 0, :2] for k in (1, 2))
    area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    if np.linalg.det(matrix[:3, :3]) < 0.0:  # mirroring flips the winding, not the front
        area = -area
    return corners, area > 0.0 if not scene.materials[mesh.material].double_sided else area != 0.0


class TriangleBvh:
    """Bounding volume hierarchy: a complete binary tree over triangles in Morton order.

    The order uses the floor plan only, which suits queries of columns and of boxes near the floor.

    Source: Lauterbach et al., "Fast BVH Construction on GPUs", Eurographics 2009.

    Args:
        corners_m: (n, 3, 3) corners of the triangles.
    """

    def __init__(self, corners_m: Floats):
        low, high = triangle_bounds(corners_m)
        self._order = np.argsort(_morton_codes(0.5 * (low + high)[:, :2]), kind="stable")
        leaves = 1 << max(0, len(corners_m) - 1).bit_length()
        # empty bounds pad the leaves and overlap nothing
        rows = np.full((2, leaves, 3), -np.inf)
        rows[0] = np.inf
        rows[0, : len(low)], rows[1, : len(high)] = low[self._order], high[self._order]
        self._levels = [rows]
        while rows.shape[1] > 1:
            first, second = rows[:, 0::2], rows[:, 1::2]
            rows = np.stack((np.minimum(first[0], second[0]), np.maximum(first[1], second[1])))
            self._levels.append(rows)

    def overlaps(self, low_m: Floats, high_m: Floats) -> tuple[Indices, Indices]:
        """Pairs of a box and a triangle whose bounds overlap; boxes may be infinite.

        Args:
            low_m, high_m: (n, 3) smallest and largest corners of the boxes.

        Returns:
            Indices (pairs,) of the boxes and of the triangles, sorted by both.
        """
        boxes = np.arange(len(low_m))
        nodes = np.zeros(len(low_m), dtype=np.intp)
        is_few = len(boxes) * self._levels[0].shape[1] < FEW
        levels = self._levels[:1] if is_few else self._levels[::-1]
        for depth, (low, high) in enumerate(levels):
            if is_few:  # faster than one level after the other
                nodes = np.tile(np.arange(len(low)), len(boxes))
                boxes = np.repeat(boxes, len(low))
            elif depth > 0:
                boxes = np.repeat(boxes, 2)
                nodes = (nodes[:, None] * 2 + (0, 1)).ravel()
            meets = np.all(low[nodes] <= high_m[boxes], axis=1)
            meets &= np.all(high[nodes] >= low_m[boxes], axis=1)
            boxes, nodes = boxes[meets], nodes[meets]
        triangles = self._order[nodes] if len(self._order) else nodes
        order = np.lexsort((triangles, boxes))
        return boxes[order], triangles[order]


def _morton_codes(points_m: Floats) -> Ints:
    """Morton codes (n,) of points (n, 2) along a Z-order curve."""
    if not len(points_m):
        return np.zeros(0, dtype=np.int64)
    low = points_m.min(axis=0)
    size = np.maximum(points_m.max(axis=0) - low, np.finfo(np.float64).tiny)
    cells = ((points_m - low) / size * (2**MORTON_BITS - 1)).astype(np.int64)
    codes = np.zeros(len(points_m), dtype=np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(2):
            codes |= (cells[:, axis] >> bit & 1) << (2 * bit + axis)
    return codes
