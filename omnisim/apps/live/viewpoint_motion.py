"""Motion of the viewpoint by keys or to clicked points: free flight, or a robot on wheels.

The scene's floor carries robots, and its surfaces stop them and free flight.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats
from omnisim.core.poses import pose, wrap_angle
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.vehicle import BodyBoxes
from omnisim.runs.contacts import meet_box
from omnisim.scene import Scene
from omnisim.scene.space.floor import HeightField, TriangleBvh, Triangles, triangles_within
from omnisim.scene.space.start_pose import nearest_points

Point = tuple[float, float, float]
MAX_TRIANGLES = 500_000  # larger scenes would delay the first step by seconds
MIN_CLEARANCE_M = 0.01  # a viewpoint nearer to a surface flies freely: it may be in a plane
_PUSHES = 4  # away from the nearest surfaces, per step
_NEARER = 0.999  # of the distance to keep: rounding is no contact
FLIGHT_MPS, TURN_DEGPS = 1.0, 70.0  # full speed and turn rate of free flight
SPEED_UP_S = 0.15  # time constant of acceleration in free flight
NEAR_M, NEAR_RAD = 0.02, math.radians(2.0)  # tolerances for reaching a point
MAX_STEP_S = 0.2  # maximum motion time between two images, so that a pause causes no jump
MAX_POSITION_M = 1e5
EYE_M = 0.1  # distance that free flight keeps from surfaces, if it begins farther away
# Decimals of positions in meters and of angles in degrees, so that commands repeat them exactly.
DIGITS_M, DIGITS_DEG = 4, 3


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
        self._field: HeightField | None = None

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
        everywhere = np.full(2, np.inf)
        self._field = self._field or HeightField(self._scene, -everywhere, everywhere)
        heights = self._field.heights_m(np.array(point_m)[None, None]).ravel()
        near = heights[np.abs(heights - near_m) <= reach_m]
        return float(near.max()) if len(near) else near_m

    def contact(self, current: Place, target: Place) -> str:
        """Name of an instance that the body touches at the target pose but not at the current one.

        Empty without such an instance.
        """
        if self._boxes is None or not self._is_small:
            return ""
        new = self._touched(target.pose) - self._touched(current.pose)
        return min((self._scene.instances[index].name for index in new), default="")

    def _touched(self, world_from_base: Floats) -> set[int]:
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

    def turn(self, yaw_deg: float, pitch_deg: float) -> None:
        """Turn by the yaw angle, without acceleration; ignores the pitch angle."""
        super().turn(yaw_deg, 0.0)

    def advance(self, seconds: float) -> None:
        """Advance along an arc for a time in seconds; a contact stops the robot."""
        seconds = min(seconds, MAX_STEP_S)
        if seconds <= 0.0:
            return
        limits = self._limits
        rates = limits.max_acceleration_mps2, limits.max_turn_acceleration_radps2
        steps = seconds * np.array(rates)
        self._speeds += np.clip(np.subtract(self._requested_speeds(), self._speeds), -steps, steps)
        speed_mps, rate_radps = self._speeds.tolist()
        if not (speed_mps or rate_radps):
            return
        x, y, z = self.place.position_m
        yaw = math.radians(self.place.yaw_deg)
        middle = yaw + 0.5 * rate_radps * seconds
        x += speed_mps * seconds * math.cos(middle)
        y += speed_mps * seconds * math.sin(middle)
        z = self._ground.height_m((x, y), z)
        next_place = Place((x, y, z), math.degrees(yaw + rate_radps * seconds)).rounded()
        self.blocked_by = self._ground.contact(self.place, next_place)
        if self.blocked_by:
            self._speeds[:], self.goal_m = 0.0, None
        else:
            self.place = next_place

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
