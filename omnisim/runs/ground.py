"""Floor below a robot, what its body touches, and the surfaces that stop a flying viewpoint."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Bools, Floats, Indices, triangle_bounds
from omnisim.robots.vehicle import BodyBoxes
from omnisim.runs.contacts import meet_box
from omnisim.scene import Scene
from omnisim.scene.space.floor import HeightField, TriangleBvh, Triangles, triangles_within
from omnisim.scene.space.start_pose import nearest_points

Point = tuple[float, float, float]
MAX_TRIANGLES = 500_000  # larger scenes would delay the first step by seconds
MIN_CLEARANCE_M = 0.01  # a viewpoint nearer to a surface flies freely: it may be in a plane
AROUND_M = 1.0  # triangles up to here are kept at hand, as the robot moves on
_PUSHES = 4  # away from the nearest surfaces, per step
_NEARER = 0.999  # of the distance to keep: rounding is no contact


class Ground:
    """Floor heights below a robot, contacts of its body with the scene, and walls of free flight.

    Scenes with many triangles are too slow: their floor is taken as level, without contacts.

    Args:
        scene: static scene; dynamic objects are ignored.
        boxes: boxes around the parts of the robot's body; None: no contacts.
    """

    def __init__(self, scene: Scene, boxes: BodyBoxes | None = None):
        self._scene, self._boxes = scene, boxes
        self._is_small = scene.triangle_count <= MAX_TRIANGLES
        self._field: tuple[Floats, HeightField] | None = None  # around a point of the floor plan
        self._last_near = (np.full(3, np.inf), np.full(3, -np.inf)), np.zeros(0, dtype=np.intp)

    @cached_property
    def _triangles(self) -> Triangles:
        everywhere = np.full(3, np.inf)
        return triangles_within(self._scene, -everywhere, everywhere)

    @cached_property
    def _bvh(self) -> TriangleBvh:
        return TriangleBvh(self._triangles.corners_m)

    def height_m(self, point_m: tuple[float, float], near_m: float) -> float:
        """Height (z) of the floor at (x, y): the highest surface near the height `near_m`.

        Near means within the robot's ground clearance. Without such a surface: `near_m`.
        """
        if not self._is_small:
            return near_m
        reach_m = 0.05 if self._boxes is None else self._boxes.clearance_m
        point = np.array(point_m)
        if self._field is None or np.any(np.abs(point - self._field[0]) > AROUND_M):
            self._field = point, HeightField(self._scene, point - AROUND_M, point + AROUND_M)
        heights = self._field[1].heights_m(point[None, None]).ravel()
        near = heights[np.abs(heights - near_m) <= reach_m]
        return float(near.max()) if len(near) else near_m

    def contact(self, current: Floats, target: Floats) -> str:
        """Name of an instance that the body touches at a target pose (4, 4) but not at the current.

        Empty without such an instance.
        """
        if self._boxes is None or not self._is_small:
            return ""
        touched = self._touched(target)
        new = touched - self._touched(current) if touched else touched
        return min((self._scene.instances[index].name for index in new), default="")

    def _touched(self, world_from_base: Floats) -> set[int]:
        assert self._boxes is not None
        parts, rotation, at = self._boxes.parts_m, world_from_base[:3, :3], world_from_base[:3, 3]
        if not len(parts):
            return set()
        middles, halves = parts.mean(axis=1), 0.5 * (parts[:, 1] - parts[:, 0])
        centers, extents = middles @ rotation.T + at, halves @ np.abs(rotation).T
        lows, highs = centers - extents, centers + extents
        near = self._near(lows.min(axis=0), highs.max(axis=0))
        near = near[_overlap(self._bounds[:, near], lows.min(axis=0), highs.max(axis=0))]
        touched: set[int] = set()
        for part in range(len(parts)) if len(near) else ():
            hit = near[_overlap(self._bounds[:, near], lows[part], highs[part])]
            corners = (self._triangles.corners_m[hit] - at) @ rotation - middles[part]
            touching = meet_box(corners, halves[part])
            touched.update(self._triangles.instances[hit[touching]].tolist())
        return touched

    @cached_property
    def _bounds(self) -> Floats:
        """Corners (2, n, 3) of the boxes around the triangles."""
        return np.stack(triangle_bounds(self._triangles.corners_m))

    def _near(self, low_m: Floats, high_m: Floats) -> Indices:
        """Triangles that may overlap a box (3,), found anew only where the box leaves the last."""
        (low, high), near = self._last_near
        if np.any(low_m < low) or np.any(high_m > high):
            low, high = low_m - AROUND_M, high_m + AROUND_M
            _, near = self._bvh.overlaps(low[None], high[None])
            self._last_near = (low, high), near
        return near

    def nearest(self, point_m: ArrayLike, reach_m: float) -> tuple[Floats, int]:
        """Offset (3,) from a point to the nearest triangle, and its index; −1: none in reach."""
        point = np.asarray(point_m, dtype=np.float64)
        if self._is_small:
            _, near = self._bvh.overlaps((point - reach_m)[None], (point + reach_m)[None])
            offsets_m, distances_m = nearest_points(self._triangles.corners_m[near] - point)
            if len(near) and distances_m.min() < reach_m:
                first = int(distances_m.argmin())
                return offsets_m[first], int(near[first])
        return np.full(3, np.inf), -1

    def slide(self, start_m: Point, end_m: Point, clearance_m: float) -> tuple[Point, str]:
        """End of a straight way that keeps a distance from all surfaces and slides along them.

        Args:
            clearance_m: distance to keep; below `MIN_CLEARANCE_M` the way is free.

        Returns:
            End that is reached, and the name of the last instance on the way; empty: none.
        """
        if clearance_m < MIN_CLEARANCE_M:
            return end_m, ""
        point, name = np.array(start_m, dtype=np.float64), ""
        way = np.array(end_m, dtype=np.float64) - point
        steps = math.ceil(2.0 * math.dist(start_m, end_m) / clearance_m)  # none passes a surface
        for _ in range(steps):
            before, point = point, point + way / steps
            for _ in range(_PUSHES):
                offset_m, triangle = self.nearest(point, _NEARER * clearance_m)
                if triangle < 0:
                    break
                name = self._scene.instances[self._triangles.instances[triangle]].name
                point = point - offset_m * (clearance_m / np.linalg.norm(offset_m) - 1.0)
            else:  # in a corner
                point = before
        x, y, z = point.tolist()
        return (x, y, z), name


def _overlap(bounds_m: Floats, low_m: Floats, high_m: Floats) -> Bools:
    """Mask (n,) of the boxes (2, n, 3) that overlap a box (3,)."""
    overlapping: Bools = np.all((bounds_m[0] <= high_m) & (bounds_m[1] >= low_m), axis=1)
    return overlapping
