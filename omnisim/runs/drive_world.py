"""World of a drive: the vehicle on its trajectory, other vehicles, and the scene's objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.files.atomic_file import is_written
from omnisim.core.files.sources import fingerprint
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.core.world import Pose, WorldState
from omnisim.scene import Scene
from omnisim.scene.labels import BODY
from omnisim.sensors.sensor_names import folder_name


@dataclass(frozen=True, eq=False)
class MovingVehicle:
    """Vehicle in motion through the world.

    Attributes:
        body: body in the base frame, or None: invisible.
        truth: poses of the base at the steps.
        motion: continuous motion of the base, also between the steps.
    """

    body: Scene | None
    truth: Trajectory
    motion: BodyMotion

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4) of the base; at a step, bit for bit the step's pose."""
        step = int(np.searchsorted(self.truth.times_s, time_s))
        if step < len(self.truth) and self.truth.times_s[step] == time_s:
            return np.array(self.truth.world_from_base[step])
        return self.motion.pose_at(time_s)


@dataclass(frozen=True, eq=False)
class DriveWorld:
    """Motion of the world in which a vehicle drives.

    Attributes:
        scene: scene with its dynamic objects.
        ego: the vehicle and its motion.
        vehicle: name of the vehicle in the world.
        others: other vehicles by name.
    """

    scene: Scene
    ego: MovingVehicle
    vehicle: str = BODY
    others: Mapping[str, MovingVehicle] = field(default_factory=dict)

    @property
    def bodies(self) -> dict[str, Scene]:
        """Bodies of the visible vehicles, by name."""
        bodies = {name: one.body for name, one in self._vehicles.items()}
        return {name: body for name, body in bodies.items() if body is not None}

    def state_at(self, time_s: float) -> WorldState:
        """State of the world; vehicles rest before and after their trajectories."""
        return WorldState(
            {
                **{name: one.pose_at(time_s) for name, one in self._vehicles.items()},
                **{one.name: one.motion.pose_at(time_s) for one in self.scene.objects},
            },
            time_s,
        )

    @property
    def _vehicles(self) -> dict[str, MovingVehicle]:
        return {self.vehicle: self.ego, **self.others}

    def manifest(self) -> dict[str, Any]:
        """Other vehicles for a run's manifest; empty without other vehicles."""
        if not self.others:
            return {}
        others = {name: fingerprint(one.body) for name, one in self.others.items()}
        return {"world": {"vehicle": self.vehicle, "others": others}}

    def write_poses(self, folder: Path) -> None:
        """Write the missing files with poses of the other vehicles and of dynamic objects.

        The poses are at the vehicle's times.

        Raises:
            OutputError: a file cannot be written.
        """
        times_s = self.ego.truth.times_s
        motions = {name: one.pose_at for name, one in self.others.items()}
        motions |= {one.name: one.motion.pose_at for one in self.scene.objects}
        if motions:
            folder.mkdir(exist_ok=True)
        for name, pose_at in motions.items():
            target = folder / f"{folder_name(name)}.tum"
            if is_written(target):
                continue
            poses = np.stack([pose_at(float(time_s)) for time_s in times_s])
            write_trajectory(target, Trajectory(times_s, poses))
