"""Motion of the viewpoint by keys or to clicked points: free flight, or a robot on wheels.

The scene's floor carries robots, and its surfaces stop them and free flight.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.poses import pose, wrap_angle
from omnisim.robots.kinematics import Kinematics
from omnisim.runs.commanded_motion import WheelState, next_state
from omnisim.runs.ground import Ground, Point

FLIGHT_MPS, TURN_DEGPS = 1.0, 70.0  # full speed and turn rate of free flight
SPEED_UP_S = 0.15  # time constant of acceleration in free flight
NEAR_M, NEAR_RAD = 0.02, math.radians(2.0)  # tolerances for reaching a point
MAX_STEP_S = 0.2  # maximum motion time between two images, so that a pause causes no jump
MAX_POSITION_M = 1e5
EYE_M = 0.1  # distance that free flight keeps from surfaces, if it begins farther away
# Decimals of positions in meters and of angles in degrees, so that commands repeat them exactly.
DIGITS_M, DIGITS_DEG = 4, 3


@dataclass(frozen=True)
class MotionCommand:
    """Motion requested by keys; all components but `fast` range from −1 to 1."""

    # requested velocity, as shares of the full speed
    ahead: float = 0.0
    left: float = 0.0
    up: float = 0.0
    turn: float = 0.0  # requested turn rate, positive to the left
    tilt: float = 0.0  # requested pitch rate, positive front down
    fast: float = 1.0  # factor of all other components, from 0.1 to 4

    @property
    def is_rest(self) -> bool:
        """True if no motion is requested."""
        return not (self.ahead or self.left or self.up or self.turn or self.tilt)


@dataclass(frozen=True)
class Place:
    """Position in meters and attitude in degrees, in the world."""

    position_m: Point
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0

    @property
    def pose(self) -> Floats:
        """Pose (4, 4) in the world."""
        angles = {"yaw_deg": self.yaw_deg, "pitch_deg": self.pitch_deg, "roll_deg": self.roll_deg}
        return pose(self.position_m, **angles)

    def rounded(self) -> Place:
        """Copy rounded to the decimals of a command line, with angles wrapped to ±180°."""
        x, y, z = (
            round(min(max(value, -MAX_POSITION_M), MAX_POSITION_M), DIGITS_M) + 0.0
            for value in self.position_m
        )
        yaw, pitch, roll = (
            round(math.degrees(wrap_angle(math.radians(angle))), DIGITS_DEG) + 0.0
            for angle in (self.yaw_deg, self.pitch_deg, self.roll_deg)
        )
        return Place((x, y, z), yaw, pitch, roll)


class Pilot(ABC):
    """Motion of the viewpoint or the robot."""

    def __init__(self, place: Place, degrees_of_freedom: int):
        self.place = place  # current pose
        self.has_walls = True  # surfaces stop free flight; robots always stop at what they touch
        self.command = MotionCommand()  # requested by keys
        self.goal_m: tuple[float, float] | None = None  # clicked point (x, y) on the ground
        self.blocked_by = ""  # instance that blocks the motion; empty: none
        self._speeds = np.zeros(degrees_of_freedom)

    @property
    def is_moving(self) -> bool:
        """True while a key is pressed, a goal is set, or a speed is not zero."""
        return not self.command.is_rest or self.goal_m is not None or bool(np.any(self._speeds))

    @abstractmethod
    def advance(self, seconds: float) -> None:
        """Advance the motion by a time in seconds."""

    def stop(self) -> None:
        """Clear the keys, the goal and the speeds."""
        self.command, self.goal_m = MotionCommand(), None
        self._speeds[:] = 0.0

    def turn(self, yaw_deg: float, pitch_deg: float) -> None:
        """Turn by angles, without acceleration, as the mouse drags the image."""
        pitch = min(max(self.place.pitch_deg + pitch_deg, -89.0), 89.0)
        yaw_deg = self.place.yaw_deg + yaw_deg
        self.place = replace(self.place, yaw_deg=yaw_deg, pitch_deg=pitch).rounded()


class FreeFlight(Pilot):
    """Viewpoint without a body: flies along its heading, and slides along surfaces.

    Args:
        place: initial pose.
        ground: surfaces that stop it; None: it flies through everything.
    """

    def __init__(self, place: Place, ground: Ground | None = None):
        super().__init__(place, 5)  # speeds ahead, left, up in m/s; yaw, pitch in °/s
        self._ground = ground
        self._clearance_m = 0.0  # distance to keep from surfaces: the largest so far, up to EYE_M

    def stop(self) -> None:
        """Clear the keys, the goal, the speeds and the distance kept from surfaces."""
        super().stop()
        self._clearance_m = 0.0

    def advance(self, seconds: float) -> None:
        """Advance by a time in seconds; speeds approach those of the keys within about 0.2 s."""
        seconds = min(seconds, MAX_STEP_S)
        command, place = self.command, self.place
        shares = command.ahead, command.left, command.up, command.turn, command.tilt
        full = FLIGHT_MPS, FLIGHT_MPS, FLIGHT_MPS, TURN_DEGPS, TURN_DEGPS
        asked = np.array(shares) * command.fast * full
        if not command.is_rest:
            self.goal_m = None
        self._speeds += (asked - self._speeds) * min(1.0, seconds / SPEED_UP_S)
        if command.is_rest and np.all(np.abs(self._speeds) < (0.02, 0.02, 0.02, 1.0, 1.0)):
            self._speeds[:] = 0.0
        x, y, z = place.position_m
        yaw = math.radians(place.yaw_deg)
        ahead, left, up, yaw_rate, pitch_rate = (self._speeds * seconds).tolist()
        x += math.cos(yaw) * ahead - math.sin(yaw) * left
        y += math.sin(yaw) * ahead + math.cos(yaw) * left
        if self.goal_m is not None:
            way = np.subtract(self.goal_m, (x, y))
            length = float(np.hypot(*way))
            step = min(length, 2.0 * FLIGHT_MPS * seconds)
            x, y = (np.array((x, y)) + way * (step / max(length, 1e-9))).tolist()
            if length - step < 1e-6:
                self.goal_m = None
        pitch = min(max(place.pitch_deg + pitch_rate, -89.0), 89.0)
        position_m = self._stopped(place.position_m, (x, y, z + up))
        self.place = Place(position_m, place.yaw_deg + yaw_rate, pitch, place.roll_deg).rounded()

    def _stopped(self, start_m: Point, end_m: Point) -> Point:
        """End of a straight way, or the point to which surfaces let it slide."""
        self.blocked_by = ""
        length_m = math.dist(start_m, end_m)
        if self._ground is None or not self.has_walls or not length_m:
            return end_m
        offset_m, _ = self._ground.nearest(start_m, EYE_M)
        nearest_m = min(EYE_M, float(np.linalg.norm(offset_m)))
        self._clearance_m = max(self._clearance_m, nearest_m)
        reached_m, name = self._ground.slide(start_m, end_m, self._clearance_m)
        if math.dist(start_m, reached_m) < 0.1 * length_m:
            self.blocked_by, self.goal_m = name, None
        return reached_m


class ViewpointDrive(Pilot):
    """Robot on wheels with limited speed and acceleration, level on the floor below its base."""

    def __init__(self, place: Place, kinematics: Kinematics, ground: Ground):
        super().__init__(place, 2)  # speed in m/s, turn rate in rad/s
        self._limits, self._ground = kinematics, ground
        self._state = WheelState(*place.position_m, math.radians(place.yaw_deg))

    def turn(self, yaw_deg: float, pitch_deg: float) -> None:
        """Turn by the yaw angle, without acceleration; ignores the pitch angle."""
        super().turn(yaw_deg, 0.0)

    def advance(self, seconds: float) -> None:
        """Advance along an arc for a time in seconds; a contact stops the robot."""
        seconds = min(seconds, MAX_STEP_S)
        if seconds <= 0.0:
            return
        before = self._state  # a place is rounded, perhaps into a wall
        if self.place != _place_of(before):
            yaw_rad = math.radians(self.place.yaw_deg)
            before = WheelState(*self.place.position_m, yaw_rad)
        before = WheelState(*before[:4], *self._speeds.tolist())
        asked = self._requested_speeds()
        self._state, self.blocked_by = next_state(
            before, asked, self._limits, self._ground, seconds
        )
        self._speeds[:] = self._state.speed_mps, self._state.turn_rate_radps
        if self.blocked_by:
            self.goal_m = None
        self.place = _place_of(self._state)

    def _requested_speeds(self) -> tuple[float, float]:
        """Speed in m/s and turn rate in rad/s requested by the keys or the goal."""
        limits, command = self._limits, self.command
        most_radps = min(limits.max_turn_rate_radps, math.radians(120.0))
        if not command.is_rest:
            self.goal_m = None
            share = min(1.0, command.fast)
            turn = min(max(command.turn + command.left, -1.0), 1.0)
            return command.ahead * limits.max_speed_mps * share, 0.6 * turn * most_radps * share
        if self.goal_m is None:
            return 0.0, 0.0
        way = np.subtract(self.goal_m, self.place.position_m[:2])
        length = float(np.hypot(*way))
        if length < NEAR_M:
            self.goal_m = None
            return 0.0, 0.0
        bearing = math.atan2(way[1], way[0]) - math.radians(self.place.yaw_deg)
        off = wrap_angle(bearing)
        rate = min(max(3.0 * off, -most_radps), most_radps)
        if abs(off) > 0.3:
            return 0.0, rate
        braking = math.sqrt(2.0 * limits.max_acceleration_mps2 * length)
        return min(limits.max_speed_mps, braking, 2.0 * length), rate


def _place_of(state: WheelState) -> Place:
    return Place(state[:3], math.degrees(state.yaw_rad)).rounded()
