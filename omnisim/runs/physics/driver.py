"""Robots with the trajectories that they follow in physics."""

from __future__ import annotations

from dataclasses import dataclass

from omnisim.core.short_repr import short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.runs.physics.rover import Rover


@dataclass(frozen=True, eq=False)
class Driver:
    """Robot that follows a planned motion.

    Attributes:
        rover: robot on wheels.
        planned: planned trajectory; the robot begins at its first pose.
        motion: planned motion; the robot rests before and after it.
        where: name of the path in messages.
        ignores_limits: True to continue after the robot leaves the path or tips over.
    """

    rover: Rover
    planned: Trajectory
    motion: BodyMotion
    where: str
    ignores_limits: bool = False

    def __repr__(self) -> str:
        return short_repr(self, repr(self.rover), repr(self.where))
