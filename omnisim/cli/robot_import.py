"""`omnisim robot import`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from omnisim.atomic_file import atomic_write, check_target
from omnisim.errors import OutputError
from omnisim.robot import parse_robot
from omnisim.robot.usarsim import import_robot
from omnisim.simulation import Vehicle


@dataclass(frozen=True)
class ImportRequest:
    """The arguments of the command, as its help explains them."""

    configuration: Path
    output: Path
    robot_class: str | None
    unreal_units: bool
    origin_height_m: float | None


def run(request: ImportRequest, out: Console, err: Console) -> None:
    """Write the robot file and say what is in it, and what is not.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    output = request.output
    if output.suffix.lower() != ".toml":
        raise OutputError(f"{output}: unknown format for a robot file: want .toml")
    check_target(output)
    imported = import_robot(
        request.configuration,
        request.robot_class,
        request.unreal_units,
        request.origin_height_m,
    )
    if output.exists() and output.samefile(request.configuration):
        raise OutputError(f"{output}: is the configuration itself: want another name")
    robot = parse_robot(tomllib.loads(imported.text), str(output), output.parent)
    Vehicle.from_robot(robot)  # what is written can be used
    with atomic_write(output) as partial:
        partial.write_text(imported.text, encoding="utf-8", newline="\n")
    for notice in imported.notices:
        err.print("note: ", notice, sep="", markup=False)
    sensors = ", ".join(f"{mount.name} ({mount.type})" for mount in robot.mounts)
    out.print(
        f"{output}: {robot.name} of [{imported.section}], {sensors or 'no sensors'}", markup=False
    )
