"""Robots of URDF and MuJoCo as robot files: a body, wheels, masses and sensors."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.robots.importers.gazebo.drive_plugins import limits
from omnisim.robots.importers.imported_model import (
    ImportedModel,
    ImportedSensor,
    footprint,
    imported_model,
)
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


def robot_file(
    found: Mechanics,
    source: Path,
    output: Path,
    body: Scene | None,
    resources: Sequence[Path],
    notices: list[str],
) -> ImportedModel:
    """Make the robot file of a model; its base is on the ground between its wheels.

    Args:
        found: in the model.
        source: its file.
        output: the robot file that it is for.
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
    table: dict[str, Any] = {}
    if body is not None:
        table["body"] = os.path.relpath(source, output.parent)
        if np.any(base_m):
            table["body_offset_m"] = (-base_m + 0.0).tolist()
        if resources:
            table["resources"] = [os.path.relpath(one, output.parent) for one in resources]
        table["footprint"] = footprint(body, base_m)
        if drive is not None:
            clearance_m = round(CLEARANCE * drive.table["wheel_diameter_m"], 6)
            table["footprint"]["clearance_m"] = min(
                clearance_m, round(0.5 * table["footprint"]["height_m"], 6)
            )
    if drive is not None:
        speed = {"max_speed_mps": drive.speed_mps} if drive.speed_mps > 0.0 else {}
        stated = speed | found.limits
        table["kinematics"] = drive.table | limits(stated, notices)
    if found.mass_kg > 0.0:
        height_m = float(found.center_m[2] - base_m[2])
        table["physics"] = {
            "mass_kg": round(found.mass_kg, 6),
            **({"center_height_m": round(height_m, 6)} if height_m > 1e-3 else {}),
        }
    notices += [notice for one in found.sensors for notice in one.notices]
    return imported_model(found.name, source, output, table, found.sensors, body, notices, base_m)
