"""Robots of URDF and MuJoCo: a body, wheels, masses and sensors."""

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

CLEARANCE = 0.25  # of a wheel's diameter: what it climbs


class Mechanics(NamedTuple):
    """Robot of a model at rest, in the file's frame.

    Attributes:
        name: of the model.
        wheels: on joints about y.
        mass_kg: in all, or 0: unknown.
        center_m: (3,) center of mass.
        sensors: with distinct names.
        limits: keys of `[kinematics]` that the model states.
    """

    name: str
    wheels: Sequence[Wheel]
    mass_kg: float
    center_m: NDArray[np.float64]
    sensors: Sequence[ImportedSensor]
    limits: dict[str, float]


def imported_robot(
    found: Mechanics,
    source: Path,
    body: Scene | None,
    resources: Sequence[Path],
    notices: list[str],
) -> ImportedRobot:
    """Make the robot of a model; its base is on the ground between its wheels.

    Args:
        found: in the model.
        source: its file.
        body: in the file's frame, or None.
        resources: folders that the body needs.
        notices: grow by those of the drive.
    """
    drive = drive_of(found.wheels, notices)
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
        kinematics = drive.table | limits(speed | found.limits, notices)
    if found.mass_kg > 0.0:
        physics = {"mass_kg": round(found.mass_kg, 6)}
        height_m = round(float(found.center_m[2] - base_m[2]), 6)
        if height_m > 1e-3:
            physics["center_height_m"] = height_m
    notices += [notice for one in found.sensors for notice in one.notices]
    return ImportedRobot(
        name=found.name,
        source=source,
        section=f"Model {found.name!r}",
        sensors=found.sensors,
        notices=tuple(notices),
        comments=notices,
        body=body,
        resources=resources,
        base_m=base_m,
        kinematics=kinematics,
        footprint=size,
        physics=physics,
    )
