"""Conversion of URDF and MuJoCo robots: body, wheels, masses and sensors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.robots.importers.gazebo.drive_plugins import limits
from omnisim.robots.importers.imported_robot import ImportedRobot, ImportedSensor, footprint
from omnisim.robots.importers.wheels import Wheel, drive_of
from omnisim.scene import Scene

CLEARANCE = 0.25  # ground clearance as a share of the wheel diameter


class Mechanics(NamedTuple):
    """Mechanics and sensors of a robot model in its rest pose, in the file's frame.

    Attributes:
        name: name of the model.
        wheels: wheels on joints about y.
        mass_kg: total mass; 0: unknown.
        center_m: (3,) center of mass.
        sensors: sensors with unique names.
        limits: limits that the model states, with the keys of `[kinematics]`.
    """

    name: str
    wheels: Sequence[Wheel]
    mass_kg: float
    center_m: NDArray[np.float64]
    sensors: Sequence[ImportedSensor]
    limits: dict[str, float]


def imported_robot(
    mechanics: Mechanics,
    source: Path,
    body: Scene | None,
    resources: Sequence[Path],
    notices: list[str],
) -> ImportedRobot:
    """Convert a model to a robot whose base is on the ground, centered between its wheels.

    Args:
        mechanics: wheels, mass and sensors of the model.
        source: file of the model.
        body: geometry in the file's frame, or None.
        resources: folders of packages that the body references.
        notices: list to which the notices about the drive and the sensors are appended.
    """
    drive = drive_of(mechanics.wheels, notices)
    base_m = np.zeros(3)
    if drive is not None:
        base_m = drive.base_m
    elif body is not None:
        base_m[2] = body.bounds_m()[0, 2]
    base_m = np.round(base_m, 6) + 0.0
    size = None if body is None else footprint(body, base_m)
    kinematics, physics = None, None
    if drive is not None:
        if size is not None:
            clearance_m = round(CLEARANCE * drive.table["wheel_diameter_m"], 6)
            size["clearance_m"] = min(clearance_m, round(0.5 * size["height_m"], 6))
        speed = {"max_speed_mps": drive.speed_mps} if drive.speed_mps > 0.0 else {}
        kinematics = drive.table | limits(speed | mechanics.limits, notices)
    if mechanics.mass_kg > 0.0:
        physics = {"mass_kg": round(mechanics.mass_kg, 6)}
        height_m = round(float(mechanics.center_m[2] - base_m[2]), 6)
        if height_m > 1e-3:
            physics["center_height_m"] = height_m
    notices += [notice for one in mechanics.sensors for notice in one.notices]
    return ImportedRobot(
        name=mechanics.name,
        source=source,
        section=f"Model {mechanics.name!r}",
        sensors=mechanics.sensors,
        notices=tuple(notices),
        comments=notices,
        body=body,
        resources=resources,
        base_m=base_m,
        kinematics=kinematics,
        footprint=size,
        physics=physics,
    )
