"""World of a drive: the vehicle on its trajectory, other vehicles, and the scene's objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.robot.sensor_names import folder_name
from omnisim.scene import Scene
from omnisim.scene.labels import BODY
from omnisim.simulation.fingerprint import fingerprint
from omnisim.simulation.is_written import is_written
from omnisim.trajectories import Trajectory, write_trajectory
from omnisim.world import WorldState


@dataclass(frozen=True, eq=False)
class OtherVehicle:
    """Vehicle that a drive's own vehicle meets.

    Attributes:
        body: in its base frame, or None: invisible.
        truth: poses of its base.
    """

    body: Scene | None
    truth: Trajectory


@dataclass(frozen=True, eq=False)
class DriveWorld:
    """Motion of the world in which a vehicle drives.

    Attributes:
        scene: with its dynamic objects.
        body: of the vehicle, or None: invisible.
        truth: poses of the vehicle's base.
        vehicle: name of the vehicle in the world.
        others: other vehicles by name.
        motion: of the vehicle's base between those poses; None: straight and even.
    """

    scene: Scene
    body: Scene | None
    truth: Trajectory
    vehicle: str = BODY
    others: Mapping[str, OtherVehicle] = field(default_factory=dict)
    motion: Trajectory | None = None

    @property
    def bodies(self) -> dict[str, Scene]:
        """Bodies of all vehicles that have one, by name."""
        bodies = {self.vehicle: self.body, **{name: one.body for name, one in self.others.items()}}
        return {name: body for name, body in bodies.items() if body is not None}

    def state_at(self, time_s: float) -> WorldState:
        """State of the world; vehicles rest before and after their trajectories."""
        motion = self.truth if self.motion is None else self.motion
        return WorldState(
            {
                self.vehicle: motion.pose_at(time_s),
                **{name: one.truth.pose_at(time_s) for name, one in self.others.items()},
                **{one.name: one.motion.pose_at(time_s) for one in self.scene.objects},
            },
            time_s,
        )

    def manifest(self) -> dict[str, Any]:
        """Other vehicles for a run's manifest; empty where there are none."""
        if not self.others:
            return {}
        others = {
            name: fingerprint(one.body, one.truth.times_s, one.truth.world_from_base)
            for name, one in self.others.items()
        }
        return {"world": {"vehicle": self.vehicle, "others": others}}

    def write_poses(self, folder: Path) -> None:
        """Write the poses of all that moves beside the vehicle, at its times, where missing.

        Raises:
            OutputError: a file cannot be written.
        """
        times_s = self.truth.times_s
        motions = {name: one.truth.pose_at for name, one in self.others.items()}
        motions |= {one.name: one.motion.pose_at for one in self.scene.objects}
        if motions:
            folder.mkdir(exist_ok=True)
        for name, pose_at in motions.items():
            target = folder / f"{folder_name(name)}.tum"
            if is_written(target):
                continue
            poses = np.stack([pose_at(float(time_s)) for time_s in times_s])
            write_trajectory(target, Trajectory(times_s, poses))
