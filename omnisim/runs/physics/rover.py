"""Robots on wheels, as physics has them: masses, wheels and boxes by the robot file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import TrajectoryError
from omnisim.core.short_repr import short_repr
from omnisim.robots.body_boxes import BodyBoxes
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.robot_file import Chassis
from omnisim.robots.vehicle import Vehicle

# Of robots whose file does not say.
DENSITY_KGPM3 = 100.0  # of the footprint's box
TRACK, WHEELBASE, CENTER_HEIGHT = 0.8, 0.5, 0.25  # of the footprint's width, length and height
WHEEL_PER_CLEARANCE = 4.0
# Assumed of all robots.
WHEEL_WIDTH = 0.4  # of the diameter
WHEEL_MASS = 0.03  # of the robot's
CASTOR, CASTOR_LOAD = 0.35, 0.4  # behind the axle, of the length; and its share of the weight


@dataclass(frozen=True, eq=False)
class Rover:
    """Robot on wheels that are driven by pairs, left and right.

    Attributes:
        name: of the vehicle.
        kinematics: its limits.
        mass_kg: in all.
        center_m: (3,) center of mass, base.
        size_m: (3,) of the box around it.
        friction: of its tyres.
        wheels_m: (n, 3) middles of the driven wheels, base: the left ones, then the right ones.
        wheel_radius_m: of the driven wheels.
        castor_m: (3,) middle of the castor, whose radius is its height; None: it has none.
        parts_m: (n, 2, 3) corners of the boxes of its body.
    """

    name: str
    kinematics: Kinematics
    mass_kg: float
    center_m: NDArray[np.float64]
    size_m: NDArray[np.float64]
    friction: float
    wheels_m: NDArray[np.float64]
    wheel_radius_m: float
    castor_m: NDArray[np.float64] | None
    parts_m: NDArray[np.float64]

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), f"{self.mass_kg:g} kg")

    @classmethod
    def of(cls, vehicle: Vehicle, chassis: Chassis) -> Rover:
        """Robot of a vehicle.

        Raises:
            TrajectoryError: it has no size, or no [kinematics].
        """
        boxes, kinematics = BodyBoxes.of(vehicle), vehicle.kinematics
        if boxes is None or kinematics is None:
            missing = "[kinematics]" if kinematics is None else "a [footprint] or a body"
            raise TrajectoryError(f"robot {vehicle.name!r}: expected {missing} with --physics")
        middle, size = 0.5 * (boxes.low_m + boxes.high_m), boxes.high_m - boxes.low_m
        length_m, width_m, height_m = size.tolist()
        diameter_m = min(WHEEL_PER_CLEARANCE * boxes.clearance_m, height_m)
        radius_m = 0.5 * (chassis.wheel_diameter_m or diameter_m)
        center = np.array((*middle[:2], chassis.center_height_m or CENTER_HEIGHT * height_m))
        half_track_m = 0.5 * (chassis.track_m or TRACK * width_m)
        if kinematics.drive == "skid_steer":
            half_base_m, castor = 0.5 * (chassis.wheelbase_m or WHEELBASE * length_m), None
        else:
            half_base_m, behind_m = 0.0, CASTOR * length_m
            castor = np.array((-behind_m, 0.0, min(radius_m, CASTOR * length_m)))
            center[0] = -CASTOR_LOAD * behind_m
        axles = (half_base_m, -half_base_m) if half_base_m > 0.0 else (0.0,)
        wheels = [(x, y, radius_m) for y in (half_track_m, -half_track_m) for x in axles]
        return cls(
            vehicle.name,
            kinematics,
            chassis.mass_kg or DENSITY_KGPM3 * float(np.prod(size)),
            center,
            size,
            chassis.friction,
            np.array(wheels),
            radius_m,
            castor,
            boxes.parts_m,
        )

    @property
    def track_m(self) -> float:
        """Distance between the middles of the tyres, left and right."""
        return float(np.ptp(self.wheels_m[:, 1]))

    @property
    def effective_track_m(self) -> float:
        """Track of a robot without skidding that turns as much by the same wheel speeds.

        In a slow turn on the spot each tyre slides against its friction, which is the same for all:
        the torques about the middle balance where it is 1 + (wheelbase / track)² of the track.

        Source: by the tyres' balance of torques; Mandow et al., "Experimental kinematics for
        wheeled skid-steer mobile robots", IROS 2007, measure such tracks on a Pioneer.
        """
        wheelbase_m = float(np.ptp(self.wheels_m[:, 0]))
        return self.track_m * (1.0 + (wheelbase_m / self.track_m) ** 2)
