"""Triangles of a scene in the world, and a bounding volume hierarchy over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core.short_repr import counted, short_repr
from omnisim.scene.model import Instance, Scene

MORTON_BITS = 16  # per axis


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles in the world frame.

    Attributes:
        corners_m: (n, 3, 3), one corner per row.
        instances: (n,) indices into `Scene.instances`.
        seen_from_above: (n,) mask of the triangles that face up or are double-sided.
    """

    corners_m: NDArray[np.float64]
    instances: NDArray[np.intp]
    seen_from_above: NDArray[np.bool_]

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.corners_m), "triangle"))

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Triangles:
        return Triangles(self.corners_m[rows], self.instances[rows], self.seen_from_above[rows])


def triangles_within(
    scene: Scene, low_m: NDArray[np.float64], high_m: NDArray[np.float64]
) -> Triangles:
    """Triangles whose bounds overlap a box with two corners (3,), or (2,) on the floor plan."""
    axes = len(low_m)
    corners, above, counts = [np.zeros((0, 3, 3))], [np.zeros(0, dtype=bool)], []
    for instance in scene.instances:
        triangles, up = _of_instance(scene, instance)
        low, high = bounds_of(triangles[..., :axes])
        near = np.all((low <= high_m) & (high >= low_m), axis=1)
        corners.append(triangles[near])
        above.append(up[near])
        counts.append(int(near.sum()))
    return Triangles(
        np.concatenate(corners),
        np.repeat(np.arange(len(counts)), counts),
        np.concatenate(above),
    )


def _of_instance(scene: Scene, instance: Instance) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
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

    def __init__(self, corners_m: NDArray[np.float64]):
        low, high = bounds_of(corners_m)
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

    def overlaps(
        self, low_m: NDArray[np.float64], high_m: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs of a box and a triangle whose bounds overlap; boxes may be infinite.

        Args:
            low_m, high_m: (n, 3) smallest and largest corners of the boxes.

        Returns:
            Indices (pairs,) of the boxes and of the triangles, sorted by both.
        """
        boxes = np.arange(len(low_m))
        nodes = np.zeros(len(low_m), dtype=np.intp)
        for depth, (low, high) in enumerate(reversed(self._levels)):
            if depth > 0:
                boxes = np.repeat(boxes, 2)
                nodes = (nodes[:, None] * 2 + (0, 1)).ravel()
            meets = np.all(low[nodes] <= high_m[boxes], axis=1)
            meets &= np.all(high[nodes] >= low_m[boxes], axis=1)
            boxes, nodes = boxes[meets], nodes[meets]
        triangles = self._order[nodes] if len(self._order) else nodes
        order = np.lexsort((triangles, boxes))
        return boxes[order], triangles[order]


def bounds_of(
    corners_m: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Smallest and largest coordinates (n, axes) of triangles (n, 3, axes)."""
    a, b, c = corners_m[:, 0], corners_m[:, 1], corners_m[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _morton_codes(points_m: NDArray[np.float64]) -> NDArray[np.int64]:
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
