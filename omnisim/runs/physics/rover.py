"""Robots on wheels in physics: masses, wheels and boxes from the robot file."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import wrap_angle, yaw_from_rotation
from omnisim.core.short_repr import short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.robots.body_boxes import BodyBoxes
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.robot_file import Chassis
from omnisim.robots.vehicle import Vehicle

# Defaults for robot files without these values.
DENSITY_KGPM3 = 100.0  # density of the footprint's box
TRACK, WHEELBASE, CENTER_HEIGHT = 0.8, 0.5, 0.25  # shares of the footprint's width, length, height
WHEEL_PER_CLEARANCE = 4.0
# Assumptions about all robots.
WHEEL_WIDTH = 0.4  # share of the diameter
WHEEL_MASS = 0.03  # share of the robot's mass
CASTER, CASTER_LOAD = 0.35, 0.4  # share of the length behind the axle; share of the weight on it


@dataclass(frozen=True, eq=False)
class Rover:
    """Robot on wheels driven in two groups, left and right."""

    name: str  # name of the vehicle
    kinematics: Kinematics  # limits of the motion
    mass_kg: float  # total mass
    center_m: Floats  # (3,) center of mass in the base frame
    size_m: Floats  # (3,) size of the bounding box
    friction: float  # friction coefficient of the tires
    # (n, 3) centers of the driven wheels in the base frame: left ones, then right ones
    wheels_m: Floats
    wheel_radius_m: float  # radius of the driven wheels
    # (3,) center of the caster, at the height of its radius; None: no caster
    caster_m: Floats | None
    parts_m: Floats  # (n, 2, 3) corners of the body's boxes

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), f"{self.mass_kg:g} kg")

    @classmethod
    def of(cls, vehicle: Vehicle, chassis: Chassis) -> Rover:
        """Robot of a vehicle.

        Raises:
            TrajectoryError: the vehicle has no size, or no [kinematics].
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
            half_base_m, caster = 0.5 * (chassis.wheelbase_m or WHEELBASE * length_m), None
        else:
            half_base_m, behind_m = 0.0, CASTER * length_m
            caster = np.array((-behind_m, 0.0, min(radius_m, CASTER * length_m)))
            center[0] = -CASTER_LOAD * behind_m
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
            caster,
            boxes.parts_m,
        )

    @property
    def track_m(self) -> float:
        """Distance between the centers of the left and right tires."""
        return float(np.ptp(self.wheels_m[:, 1]))

    @property
    def effective_track_m(self) -> float:
        """Track of a robot without skidding that turns equally at the same wheel speeds.

        In a slow rotation on the spot each tire slides against friction of equal magnitude. The
        torques about the center balance where the effective track is 1 + (wheelbase / track)² times
        the track.

        Source: torque balance of the tires; Mandow et al., "Experimental kinematics for
        wheeled skid-steer mobile robots", IROS 2007, measure such tracks on a Pioneer.
        """
        wheelbase_m = float(np.ptp(self.wheels_m[:, 0]))
        return self.track_m * (1.0 + (wheelbase_m / self.track_m) ** 2)


# Robots with the trajectories that they follow in physics.


@dataclass(frozen=True, eq=False)
class Driver:
    """Robot that follows a planned motion."""

    rover: Rover  # robot on wheels
    planned: Trajectory  # planned trajectory; the robot begins at its first pose
    motion: BodyMotion  # planned motion; the robot rests before and after it
    where: str  # name of the path in messages
    ignores_limits: bool = False  # True to continue after the robot leaves the path or tips over

    def __repr__(self) -> str:
        return short_repr(self, repr(self.rover), repr(self.where))


# Path following: wheel speeds that keep a robot on its planned motion.


AHEAD_PER_S, TURN_PER_S = 4.0, 6.0  # gains on the error along the path, and on the heading error
TURN_PER_M2 = 16.0  # gain on the lateral error, per meter driven
RESERVE = 1.25  # factor on the limits, which allows the robot to catch up


class PathFollower:
    """Tracking controller that knows the robot's true pose.

    Source: Kanayama et al., "A stable tracking control method for an autonomous mobile robot", ICRA
    1990, with a correction of the heading that does not vanish at rest.

    Args:
        motion: planned motion; its x, y and yaw are tracked.
        rover: robot on wheels.
        times_s: (n,) times of the commands.
    """

    def __init__(self, motion: BodyMotion, rover: Rover, times_s: Floats):
        states = motion.at(times_s)
        poses = states.world_from_base
        planar = np.column_stack((poses[:, :2, 3], yaw_from_rotation(poses)))
        turn_rates = np.einsum("ni,ni->n", poses[:, 2, :3], states.angular_rate_radps)
        self._poses, self._rates = planar, np.column_stack((states.velocity_mps[:, :2], turn_rates))
        self._rover = rover

    def distance_m(self, command: int, base: Floats) -> float:
        """Distance of the base, position and quaternion wxyz (7,), from the reference."""
        x, y, _ = self._poses[command].tolist()
        return math.hypot(x - float(base[0]), y - float(base[1]))

    def wheel_rates(self, command: int, base: Floats) -> tuple[float, float]:
        """Rates of the left and the right wheels in rad/s at a command.

        Args:
            command: index of the command.
            base: (7,) true position and quaternion wxyz of the robot's base.
        """
        x_m, y_m, _, w, i, j, k = base.tolist()
        yaw = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
        x, y, wanted_yaw = self._poses[command].tolist()
        vx, vy, turn_rate = self._rates[command].tolist()
        speed = vx * math.cos(wanted_yaw) + vy * math.sin(wanted_yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        ahead = cos * (x - x_m) + sin * (y - y_m)
        left = cos * (y - y_m) - sin * (x - x_m)
        off = wrap_angle(wanted_yaw - yaw)
        limits = self._rover.kinematics
        speed = _limited(speed * math.cos(off) + AHEAD_PER_S * ahead, limits.max_speed_mps)
        turn_rate += TURN_PER_M2 * speed * left + TURN_PER_S * off
        turn_rate = _limited(turn_rate, limits.max_turn_rate_radps)
        difference = 0.5 * self._rover.effective_track_m * turn_rate
        radius = self._rover.wheel_radius_m
        return (speed - difference) / radius, (speed + difference) / radius


def _limited(rate: float, limit: float) -> float:
    return max(-RESERVE * limit, min(RESERVE * limit, rate))
