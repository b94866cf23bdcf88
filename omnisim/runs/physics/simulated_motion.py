"""Motion of a robot and of the objects around it, simulated in physics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.poses import wrap_angles
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import SplineMotion
from omnisim.core.trajectories.odometry import Odometry
from omnisim.runs.contacts import Contact
from omnisim.scene import Scene
from omnisim.scene.motion.object_motion import Along


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
            replace(one, motion=Along(self.objects[one.name])) if one.name in self.objects else one
            for one in scene.objects
        )
        return replace(scene, objects=objects)
