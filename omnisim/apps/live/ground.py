"""Floor and obstacles of a scene for a robot that is driven by hand."""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from omnisim.robots.body_boxes import BodyBoxes
from omnisim.runs.contacts import meet_box
from omnisim.scene import Scene
from omnisim.scene.space.floor import HeightField, TriangleBvh, Triangles, triangles_within

MAX_TRIANGLES = 500_000  # larger scenes would delay the first step by seconds


class _HasPose(Protocol):
    @property
    def pose(self) -> NDArray[np.float64]: ...


class Ground:
    """Floor heights below a robot, and contacts of its body with the scene.

    Scenes with many triangles are too slow: their floor is taken as level, without contacts.

    Args:
        scene: static scene; dynamic objects are ignored.
        boxes: boxes around the parts of the robot's body; None: no contacts.
    """

    def __init__(self, scene: Scene, boxes: BodyBoxes | None):
        self._scene, self._boxes = scene, boxes
        self._is_small = scene.triangle_count <= MAX_TRIANGLES

    @cached_property
    def _triangles(self) -> Triangles:
        everywhere = np.full(3, np.inf)
        return triangles_within(self._scene, -everywhere, everywhere)

    @cached_property
    def _bvh(self) -> TriangleBvh:
        return TriangleBvh(self._triangles.corners_m)

    @cached_property
    def _field(self) -> HeightField:
        return HeightField(self._scene, np.full(2, -np.inf), np.full(2, np.inf))

    def height_m(self, point_m: tuple[float, float], near_m: float) -> float:
        """Height (z) of the floor at (x, y): the highest surface near the height `near_m`.

        Near means within the robot's ground clearance. Without such a surface: `near_m`.
        """
        if not self._is_small:
            return near_m
        reach_m = 0.05 if self._boxes is None else self._boxes.clearance_m
        heights = self._field.heights_m(np.array(point_m)[None, None]).ravel()
        near = heights[np.abs(heights - near_m) <= reach_m]
        return float(near.max()) if len(near) else near_m

    def contact(self, current: _HasPose, target: _HasPose) -> str:
        """Name of an instance that the body touches at the target pose but not at the current one.

        Empty without such an instance.
        """
        if self._boxes is None or not self._is_small:
            return ""
        new = self._touched(target.pose) - self._touched(current.pose)
        return min((self._scene.instances[one].name for one in new), default="")

    def _touched(self, world_from_base: NDArray[np.float64]) -> set[int]:
        assert self._boxes is not None
        touched: set[int] = set()
        for low, high in self._boxes.parts_m:
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            center = world_from_base[:3, :3] @ middle + world_from_base[:3, 3]
            extent = np.abs(world_from_base[:3, :3]) @ half
            _, hit = self._bvh.overlaps((center - extent)[None], (center + extent)[None])
            corners = self._triangles.corners_m[hit] - world_from_base[:3, 3]
            touching = meet_box(corners @ world_from_base[:3, :3] - middle, half)
            touched.update(self._triangles.instances[hit[touching]].tolist())
        return touched
