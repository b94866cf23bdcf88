"""Box around a vehicle's body: what stands on the floor and what touches the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.robot.robot_file import default_clearance_m
from omnisim.simulation.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class BodyBox:
    """Box in the base frame.

    Attributes:
        low_m, high_m: (3,) corners; the lower one is on the ground.
        clearance_m: above the ground; the wheels drive over what is lower.
    """

    low_m: NDArray[np.float64]
    high_m: NDArray[np.float64]
    clearance_m: float

    @classmethod
    def of(cls, vehicle: Vehicle) -> BodyBox | None:
        """Box of its footprint, or of its body where the robot file has none; None without both."""
        if (size := vehicle.footprint) is not None:
            half = 0.5 * np.array((size.length_m, size.width_m))
            low, high = np.array((*-half, 0.0)), np.array((*half, size.height_m))
            return cls(low, high, size.clearance_m)
        if vehicle.body is None or not vehicle.body.instances:
            return None
        low, high = vehicle.body.bounds_m()
        low[2], height_m = 0.0, float(high[2])
        return cls(low, high, default_clearance_m(height_m)) if height_m > 0.0 else None

    @property
    def reach_m(self) -> float:
        """Distance from the base's origin to its farthest corner on the ground."""
        ends = np.maximum(np.abs(self.low_m[:2]), np.abs(self.high_m[:2]))
        return float(np.hypot(*ends))
