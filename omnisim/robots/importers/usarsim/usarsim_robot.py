"""Import of a robot from a section of USARBot.ini.

Laser scanners become `usarsim_range_scanner`, sonars `usarsim_sonar`, infrared sensors
`usarsim_ir_sensor`. The parts of an omnidirectional camera become one `omnicamera`. Notices list
all unsupported parts.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from omnisim.core.errors import RobotFileError, did_you_mean
from omnisim.robots.importers.imported_robot import ImportedRobot, ImportedSensor
from omnisim.robots.importers.usarsim.camera_parts import find_cameras
from omnisim.robots.importers.usarsim.ini import (
    Entry,
    Notice,
    Section,
    parse_struct,
    printable,
    read_ini,
)
from omnisim.robots.importers.usarsim.range_parts import find_range_sensor
from omnisim.robots.importers.usarsim.scanner_parts import find_scanner
from omnisim.robots.importers.usarsim.usarsim_parts import (
    SI_UNITS,
    UNREAL_UNITS,
    Part,
    Units,
    read_part,
)
from omnisim.sensors.sensor_names import folder_name

SENSOR_KEYS = ("sensors", "cameras")
_NAME = re.compile(r"(?:Part|Pkg|Item)Name\s*=\s*[\"']?([^\"',()]*)", re.IGNORECASE)


_HEAD = (
    "Base frame: x forward, y left, z up, origin on the ground. Meters and degrees.",
    'body = "body.glb"  # its mesh, if there is one',
    "Not in USARBot.ini, and optional: [kinematics], [odometry], [footprint].",
    "`omnisim robot list` lists robots with these tables.",
)


def import_robot(
    path: Path,
    robot_class: str | None = None,
    unreal_units: bool = False,
    origin_height_m: float | None = None,
) -> ImportedRobot:
    """Import a robot from USARBot.ini.

    Args:
        path: configuration file.
        robot_class: class such as P2AT; None: the only robot of the file.
        unreal_units: lengths are 250 per meter with z up, and angles 65536 per turn.
        origin_height_m: height of USARSim's origin of the robot above the ground; None: 0, with a
            notice.

    Raises:
        RobotFileError: invalid syntax or value; names file, line, actual and expected text.
    """
    if origin_height_m is not None and not abs(origin_height_m) <= 10.0:
        raise RobotFileError(f"origin height {origin_height_m:g} m: expected a number up to 10")
    sections = read_ini(path)
    section = _robot_section(path, sections, robot_class)
    units = UNREAL_UNITS if unreal_units else SI_UNITS
    notices: list[Notice] = []
    parts = _parts(section, units, notices)
    sensors = _named(_sensors(parts, sections, units, notices), notices)
    if not sensors:
        notices.append((section.line, f"[{section.name}] has no sensor that omnisim knows"))
    if origin_height_m is None:
        notices.append(
            (
                section.line,
                "heights are relative to USARSim's robot origin, assumed to be on the ground: "
                "--origin-height sets its height",
            )
        )
    unique = dict.fromkeys((line, printable(text)) for line, text in notices)
    unique_notices = sorted(unique, key=lambda notice: notice[0])
    raised_m = origin_height_m or 0.0
    heights = (f"Heights are {raised_m!r} m more than there.",) if raised_m else ()
    rest = [f"line {line}: {text}" for line, text in unique_notices]
    return ImportedRobot(
        name=printable(section.name).rpartition(".")[2],
        source=path,
        section=f"[{printable(section.name)}]",
        sensors=sensors,
        notices=tuple(f"{path}:{line}: {text}" for line, text in unique_notices),
        comments=(*_HEAD, *heights, *(("Notices:", *rest) if rest else ())),
        base_m=np.array((0.0, 0.0, -raised_m)),
    )


def _robot_section(path: Path, sections: dict[str, Section], robot_class: str | None) -> Section:
    robots = {
        key: section
        for key, section in sections.items()
        if any(section.values_of(name) for name in SENSOR_KEYS)
    }
    short = {section.name.rpartition(".")[2]: section for section in robots.values()}
    if robot_class is not None:
        for key in (robot_class.lower(), f"usarbot.{robot_class.lower()}"):
            if key in robots:
                return robots[key]
            if key in sections:
                other = sections[key]
                raise RobotFileError(f"{path}:{other.line}: [{other.name}] has no Sensors= line")
        hint = did_you_mean(robot_class, short, "it has")
        raise RobotFileError(f"{path}:1: no robot of class {robot_class!r}; {hint}")
    if not robots:
        first = next(iter(sections.values()))
        raise RobotFileError(f"{path}:{first.line}: no section of it has a Sensors= line")
    if len(robots) > 1:
        line = list(robots.values())[1].line
        raise RobotFileError(
            f"{path}:{line}: a second robot: expected --class with one of {', '.join(short)}"
        )
    return next(iter(robots.values()))


def _parts(section: Section, units: Units, notices: list[Notice]) -> list[Part]:
    """Read all parts with a class and a position; the other entries become notices."""
    parts, plain = [], []
    for entry in section.entries:
        if entry.key.lower() in SENSOR_KEYS:
            parts.append(read_part(entry, units))
        elif not entry.value.startswith("("):
            plain.append(entry)
        else:
            part = _other_part(entry, units)
            if part is not None:
                parts.append(part)
                continue
            named = _NAME.search(entry.value)
            name = f" {named[1]!r}" if named else ""
            notices.append((entry.line, f"{entry.key}{name}: left out"))
    if plain:
        keys = ", ".join(dict.fromkeys(entry.key for entry in plain))
        notices.append((plain[0].line, f"[{section.name}] {keys}: left out"))
    return parts


def _other_part(entry: Entry, units: Units) -> Part | None:
    """Read a part that is not listed as a sensor; None without a class or a valid pose."""
    if "itemclass" not in parse_struct(entry) or entry.key.startswith(("-", "!")):
        return None
    try:
        return read_part(entry, units)
    except RobotFileError:  # such as lamps and grippers, whose values do not matter here
        return None


def _sensors(
    parts: list[Part], sections: dict[str, Section], units: Units, notices: list[Notice]
) -> list[tuple[Entry, ImportedSensor]]:
    """Sensors and the entries that describe them, in the order of the file."""
    cameras = find_cameras(parts)
    camera_parts = {id(part) for _, members in cameras for part in members}
    sensors = [(members[0].entry, camera) for camera, members in cameras]
    for part in parts:
        if id(part) not in camera_parts:
            class_section = sections.get(part.class_name.lower())
            sensor = find_range_sensor(part, class_section, units, notices)
            if sensor is None:
                sensor = find_scanner(part, class_section, units, notices)
            if sensor is None:
                continue
            sensors.append((part.entry, sensor))
        if part.unread:
            notices.append((part.entry.line, f"{part}: {', '.join(part.unread)}: left out"))
        if part.parent:
            notices.append(
                (part.entry.line, f"{part}: is mounted on {part.parent!r}: placed on the chassis")
            )
    return sorted(sensors, key=lambda item: item[0].line)


def _named(
    sensors: list[tuple[Entry, ImportedSensor]], notices: list[Notice]
) -> list[ImportedSensor]:
    """Rename sensors to names that are valid in a robot file.

    Raises:
        RobotFileError: two sensors have the same name.
    """
    named: dict[str, ImportedSensor] = {}
    lines: dict[str, int] = {}
    for entry, sensor in sensors:
        name = folder_name(sensor.name)
        if name != sensor.name:
            notices.append((entry.line, f"ItemName {sensor.name!r}: becomes {name!r}"))
        if name in named:
            raise entry.fault(
                f"ItemName {name!r} again, as in line {lines[name]}: expected each name once"
            )
        named[name], lines[name] = sensor._replace(name=name), entry.line
    return list(named.values())
