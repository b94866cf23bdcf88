"""Bounding boxes of a vehicle's body: one for the floor below it, several for contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.short_repr import counted, short_repr
from omnisim.robots.robot_file import default_clearance_m
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene
from omnisim.scene.space.floor import triangles_within


@dataclass(frozen=True, eq=False)
class BodyBoxes:
    """Bounding boxes of a vehicle in the base frame."""

    # low_m, high_m: (3,) corners of the box around the whole robot; its lower side is the ground
    low_m: Floats
    high_m: Floats
    clearance_m: float  # ground clearance; the wheels drive over lower obstacles
    # (n, 2, 3) corners of the boxes around the body's nodes, cut off below the clearance; without a
    # body, the footprint's box
    parts_m: Floats

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.parts_m), "part"))

    @classmethod
    def of(cls, vehicle: Vehicle) -> BodyBoxes | None:
        """Boxes of the footprint and the body; None if the vehicle has neither."""
        parts = np.zeros((0, 2, 3)) if vehicle.body is None else _node_bounds(vehicle.body)
        size = vehicle.footprint
        if size is not None:
            half = 0.5 * np.array((size.length_m, size.width_m))
            low, high = np.array((*-half, 0.0)), np.array((*half, size.height_m))
            clearance_m = size.clearance_m
        elif len(parts) and parts[:, 1, 2].max() > 0.0:
            low, high = parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)
            low[2] = 0.0
            clearance_m = default_clearance_m(float(high[2]))
        else:
            return None
        if not len(parts):
            parts = np.stack((low, high))[None]
        parts = parts[parts[:, 1, 2] > clearance_m]
        parts[:, 0, 2] = np.maximum(parts[:, 0, 2], clearance_m)
        return cls(low, high, clearance_m, parts)

    @property
    def reach_m(self) -> float:
        """Distance from the base's origin to its farthest corner on the ground."""
        ends = np.maximum(np.abs(self.low_m[:2]), np.abs(self.high_m[:2]))
        return float(np.hypot(*ends))


def _node_bounds(body: Scene) -> Floats:
    """Corners (n, 2, 3) of the bounding boxes of a body's nodes that have triangles."""
    everywhere = np.full(3, np.inf)
    triangles = triangles_within(body, -everywhere, everywhere)
    names = np.array([instance.name for instance in body.instances])[triangles.instances]
    nodes = (triangles.corners_m[names == name].reshape(-1, 3) for name in np.unique(names))
    bounds = [(corners.min(axis=0), corners.max(axis=0)) for corners in nodes]
    return np.array(bounds).reshape(-1, 2, 3)
