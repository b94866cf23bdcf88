"""Robots on wheels in physics, for the engine in `simulation.py`.

A `Rover` is made of a robot file, a `Driver` gives it a planned motion, a `PathFollower` steers it
there, and a `SimulatedMotion` is what came of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import wrap_angle, wrap_angles, yaw_from_rotation
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import BodyMotion, SplineMotion
from omnisim.core.trajectories.odometry import Odometry
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.robot_file import Chassis
from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.runs.contacts import Contact
from omnisim.scene import Scene
from omnisim.scene.motion.object_motion import Along

# Defaults for robot files without these values.
DENSITY_KGPM3 = 100.0  # density of the footprint's box
TRACK, WHEELBASE, CENTER_HEIGHT = 0.8, 0.5, 0.25  # shares of the footprint's width, length, height
WHEEL_PER_CLEARANCE = 4.0
# Assumed caster: share of the length behind the axle; share of the weight on it.
CASTER, CASTER_LOAD = 0.35, 0.4


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


AHEAD_PER_S, TURN_PER_S = 4.0, 6.0  # gains on the error along the path, and on the heading error
TURN_PER_M2 = 16.0  # gain on the lateral error, per meter driven
RESERVE = 1.25  # factor on the limits, which allows the robot to catch up


class PathFollower:
    """Tracking controller that knows the robot's true pose, for commands to wheels at times (n,).

    Source: Kanayama et al., "A stable tracking control method for an autonomous mobile robot", ICRA
    1990, with a correction of the heading that does not vanish at rest.
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

        `base` (7,) is the true position and quaternion wxyz of the robot's base.
        """
        x_m, y_m, _, w, i, j, k = base.tolist()
        yaw = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
        x, y, wanted_yaw = self._poses[command].tolist()
        vx, vy, turn_rate = self._rates[command].tolist()
        speed = vx * math.cos(wanted_yaw) + vy * math.sin(wanted_yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        ahead = cos * (x - x_m) + sin * (y - y_m)
        left = cos * (y - y_m) - sin * (x - x_m)
        yaw_error = wrap_angle(wanted_yaw - yaw)
        limits = self._rover.kinematics
        speed = _limited(speed * math.cos(yaw_error) + AHEAD_PER_S * ahead, limits.max_speed_mps)
        turn_rate += TURN_PER_M2 * speed * left + TURN_PER_S * yaw_error
        turn_rate = _limited(turn_rate, limits.max_turn_rate_radps)
        difference = 0.5 * self._rover.effective_track_m * turn_rate
        radius = self._rover.wheel_radius_m
        return (speed - difference) / radius, (speed + difference) / radius


def _limited(rate: float, limit: float) -> float:
    return max(-RESERVE * limit, min(RESERVE * limit, rate))


@dataclass(frozen=True)
class Slip:
    """Slip of the wheels: their readings against the robot's true motion."""

    distance: float  # extra meters that the wheels report per meter driven
    turn: float  # extra radians that the wheels report per radian turned
    end_m: float  # distance between the ends of the motion and of dead reckoning

    def __str__(self) -> str:
        return (
            f"slip of {100.0 * self.distance:.2g} % ahead and {100.0 * self.turn:.2g} % in turns; "
            f"dead reckoning by the wheels ends {self.end_m:.2f} m off"
        )


@dataclass(frozen=True, eq=False)
class SimulatedMotion:
    """Motion in small steps over a whole drive."""

    base: Trajectory  # poses of the robot's base
    # (n, 2) distances that the left and the right tires have rolled by the base's times
    wheels_m: Floats
    effective_track_m: float  # track that converts differences of the wheels' distances into turns
    objects: Mapping[str, Trajectory]  # poses of the free objects, by name, at the same times
    # contact times by the touched object's name, ordered by first contact
    contact_times_s: Mapping[str, Floats]
    engine: str  # name and version of the physics engine
    step_s: float  # time step of the engine

    def __repr__(self) -> str:
        return short_repr(self, repr(self.base), counted(len(self.objects), "free object"))

    @cached_property
    def smooth(self) -> SplineMotion:
        """Continuous motion of the base, also between the engine's states."""
        return SplineMotion(self.base)

    def at(self, times_s: Floats) -> Trajectory:
        """Trajectory of the base at times (n,)."""
        return Trajectory(times_s, self.smooth.at(times_s).world_from_base)

    def readings_at(self, times_s: Floats) -> Odometry:
        """Error-free readings of the wheels at times (n,)."""
        start = self.smooth.pose_at(float(times_s[0]))
        yaw = float(np.arctan2(start[1, 0], start[0, 0]))
        ways = [np.interp(times_s, self.base.times_s, way) for way in self.wheels_m.T]
        left, right = (np.diff(way) for way in ways)
        turns = (right - left) / self.effective_track_m
        return Odometry(times_s, 0.5 * (left + right), turns, (*start[:2, 3].tolist(), yaw))

    def contacts_at(self, truth: Trajectory) -> tuple[Contact, ...]:
        """Contacts by object, at the steps of a trajectory, in the order in which they begin."""
        contacts = []
        for name, contact_times_s in self.contact_times_s.items():
            steps = np.searchsorted(truth.times_s, contact_times_s, side="right") - 1
            first_s = float(contact_times_s[0])
            x, y = self.base.pose_at(first_s)[:2, 3].tolist()
            contacts.append(Contact(name, int(steps[0]), first_s, (x, y), len(np.unique(steps))))
        return tuple(contacts)

    @property
    def slip(self) -> Slip:
        """Slip over the whole motion."""
        readings = self.readings_at(self.base.times_s)
        driven_m = self.base.path_length_m
        turned = float(np.abs(wrap_angles(np.diff(self.base.yaw_rad))).sum())
        reported_m = float(np.abs(readings.distances_m).sum())
        reported_rad = float(np.abs(readings.turns_rad).sum())
        return Slip(
            reported_m / driven_m - 1.0 if driven_m > 0.0 else 0.0,
            reported_rad / turned - 1.0 if turned > 0.0 else 0.0,
            math.dist(readings.planar_poses[-1, :2], self.base.positions_m[-1, :2]),
        )

    def manifest(self) -> dict[str, Any]:
        """Engine and slip, for a run's manifest."""
        return {
            "engine": self.engine,
            "step_s": self.step_s,
            "slip": {key: round(value, 6) for key, value in asdict(self.slip).items()},
        }

    def scene_with_motions(self, scene: Scene) -> Scene:
        """Scene whose free objects follow their simulated motion."""
        objects = tuple(
            replace(moving, motion=Along(self.objects[moving.name]))
            if moving.name in self.objects
            else moving
            for moving in scene.objects
        )
        return replace(scene, objects=objects)
