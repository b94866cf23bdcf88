"""`omnisim robot`."""

from __future__ import annotations

import math
import re
import tomllib

from omnisim.apps.cli.console import out, print_note
from omnisim.apps.cli.options import refuse_given
from omnisim.apps.cli.runs.requests import CheckRobotRequest, ImportRequest, ShowRobotRequest
from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import check_target
from omnisim.core.files.toml_file import toml_text, with_absolute_files
from omnisim.core.short_repr import number_text, point_text
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots import (
    Kinematics,
    OdometryErrors,
    builtin_robots,
    find_robot,
    load_robot,
    read_robot,
)
from omnisim.robots.importers import usarsim
from omnisim.robots.importers.importers import SUFFIXES, import_model
from omnisim.robots.robot_file import robot_tables
from omnisim.robots.vehicle import BodyBoxes, Vehicle


def list_robots() -> None:
    """Print a line per built-in robot."""
    robots = [load_robot(name) for name in builtin_robots()]
    width = max((len(robot.name) for robot in robots), default=0)
    for robot in robots:
        sensors = ", ".join(robot.sensor_names) or "no sensors"
        drive = _format_drive(robot.kinematics)
        out.print(f"{robot.name:<{width}}  {robot.title}: {drive}; {sensors}")


def show_robot(request: ShowRobotRequest) -> None:
    """Print the robot file with absolute paths; with its comments, unless it extends another."""
    path = find_robot(request.robot)
    read_robot(path)  # reports faults
    tables = with_absolute_files(robot_tables(path), path.parent.absolute())
    text = path.read_text(encoding="utf-8-sig")
    for name in set(re.findall(r'"([^"\n]+)"', text)):
        if (file := with_absolute_files(name, path.parent)) != name:
            text = text.replace(f'"{name}"', toml_text({"": file})[5:-1])
    out.print(text if tomllib.loads(text) == tables else toml_text(tables), end="")


def check_robot(request: CheckRobotRequest) -> None:
    """Load a robot with its body and sensors, and summarize it."""
    robot = read_robot(find_robot(request.robot))
    vehicle = Vehicle.from_robot(robot)
    if vehicle.body is not None:
        for notice in vehicle.body.notices:
            print_note(notice)
    out.print(f"{request.robot}: valid")
    for line in _lines(vehicle, robot.body):
        out.print(f"  {line}")


def import_robot(request: ImportRequest) -> None:
    """Convert a USARSim robot or a simulator's model, and list supported and omitted parts."""
    output = request.output
    if output.suffix.lower() != ".toml":
        raise OutputError(f"--output: expected a .toml file, got {output}")
    check_target(output)
    if request.configuration.suffix.lower() in SUFFIXES:
        _import_model(request)
        return
    if request.configuration.suffix.lower() != ".ini":
        models = f"a model ({' '.join(SUFFIXES)})"
        expected = f"expected a configuration of USARSim (.ini) or {models}"
        raise OutputError(f"{request.configuration}: {expected}")
    if request.resources:
        raise OutputError("--resources: requires a Gazebo, URDF or MuJoCo model")
    imported = usarsim.import_robot(
        request.configuration, request.robot_class, request.unreal_units, request.origin_height_m
    )
    if output.exists() and output.samefile(request.configuration):
        raise OutputError(f"--output: expected a name other than the configuration's, got {output}")
    robot = imported.robot(output)
    vehicle = Vehicle.from_robot(robot)
    imported.write(output)
    for notice in imported.notices:
        print_note(notice)
    out.print(f"{output}: {robot.name} of {imported.section}, {_sensors(vehicle)}")


def _sensors(vehicle: Vehicle) -> str:
    named = (f"{sensor.name} ({sensor.type})" for sensor in vehicle.sensors)
    return ", ".join(named) or "no sensors"


def _import_model(request: ImportRequest) -> None:
    output = request.output
    reason = "requires a configuration of USARSim (.ini)"
    refuse_given(request, reason, "unreal_units", "origin_height_m")
    imported = import_model(request.configuration, request.robot_class, request.resources or ())
    robot = imported.robot(output)
    vehicle = Vehicle.from_robot(robot, imported.cameras)
    imported.write(output)
    drawn = () if vehicle.body is None else vehicle.body.notices
    for notice in dict.fromkeys((*imported.notices, *drawn)):
        print_note(notice)
    out.print(f"{output}: {robot.name}, {_sensors(vehicle)}")


def _format_drive(kinematics: Kinematics | None) -> str:
    if kinematics is None:
        return "no kinematics"
    drive = {"differential": "differential drive", "skid_steer": "skid steering"}[kinematics.drive]
    turn_rate_degps = math.degrees(kinematics.max_turn_rate_radps)
    return f"{drive}, {kinematics.max_speed_mps:g} m/s, {turn_rate_degps:g} °/s"


def _lines(vehicle: Vehicle, body: str | None) -> list[str]:
    lines = [f"robot    {vehicle.name}, {vehicle.title}"]
    if vehicle.body is None:
        lines.append("body     none")
    else:
        nodes = len({instance.name for instance in vehicle.body.instances})
        lines.append(f"body     {body}, {vehicle.body.triangle_count} triangles, {nodes} nodes")
    lines.append(f"drive    {_format_drive(vehicle.kinematics)}")
    is_ideal = vehicle.odometry == OdometryErrors()
    lines.append(f"odometry {'ideal' if is_ideal else 'with errors'}")
    if (box := BodyBoxes.of(vehicle)) is None:
        lines.append("size     unknown: no collision checking")
    else:
        sides = " × ".join(map(number_text, box.high_m - box.low_m))
        lines.append(f"size     {sides} m, ground clearance {number_text(box.clearance_m)} m")
    for mount in vehicle.sensors:
        sensor, summary = mount.sensor, mount.summary()
        mesh = f"{sensor.mesh_summary}, " if isinstance(sensor, OmniCamera) else ""
        hz = "" if mount.rate is None else f"{mount.rate.rate_hz:g} Hz"  # some summaries have it
        rate = f"measures at {hz}, " if hz and hz not in summary else ""
        hidden = f", does not see {', '.join(mount.hides)}" if mount.hides else ""
        lines.append(
            f"{sensor.noun:<8} {mount.name}, {summary}, {mesh}{rate}"
            f"{sensor.origin_noun} {point_text(mount.origin_m)} m{hidden}"
        )
    return lines
