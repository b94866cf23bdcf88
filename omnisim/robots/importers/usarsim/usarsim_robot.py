"""Import of a robot from a section of USARBot.ini.

Laser scanners become `usarsim_range_scanner`, sonars `usarsim_sonar`, infrared sensors
`usarsim_ir_sensor`. The parts of an omnidirectional camera become one `omnicamera`. Notices list
all unsupported parts.
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from pathlib import Path

import numpy as np

from omnisim.core.errors import RobotFileError, did_you_mean
from omnisim.core.trajectories.formats.parsed_trajectory import quote
from omnisim.robots.importers.imported_robot import ImportedRobot, ImportedSensor
from omnisim.robots.importers.usarsim import usarsim_parts as ini
from omnisim.sensors.sensor_table import folder_name

Sections = dict[str, ini.IniSection]
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
    """
    if origin_height_m is not None and not abs(origin_height_m) <= 10.0:
        raise RobotFileError(f"origin height {origin_height_m:g} m: expected a number up to 10")
    sections = ini.read_ini(path)
    section = _robot_section(path, sections, robot_class)
    units = ini.UNREAL_UNITS if unreal_units else ini.SI_UNITS
    notices: list[ini.Notice] = []
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
    unique = dict.fromkeys((line, ini.printable(text)) for line, text in notices)
    unique_notices = sorted(unique, key=lambda notice: notice[0])
    raised_m = origin_height_m or 0.0
    heights = (f"Heights are {raised_m!r} m more than there.",) if raised_m else ()
    rest = [f"line {line}: {text}" for line, text in unique_notices]
    return ImportedRobot(
        name=ini.printable(section.name).rpartition(".")[2],
        source=path,
        section=f"[{ini.printable(section.name)}]",
        sensors=sensors,
        notices=tuple(f"{path}:{line}: {text}" for line, text in unique_notices),
        comments=(*_HEAD, *heights, *(("Notices:", *rest) if rest else ())),
        base_m=np.array((0.0, 0.0, -raised_m)),
    )


def _robot_section(path: Path, sections: Sections, robot_class: str | None) -> ini.IniSection:
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


def _parts(
    section: ini.IniSection, units: ini.Units, notices: list[ini.Notice]
) -> list[ini.UsarsimPart]:
    """Read all parts with a class and a position; the other entries become notices."""
    parts, plain = [], []
    for entry in section.entries:
        if entry.key.lower() in SENSOR_KEYS:
            parts.append(ini.read_part(entry, units))
        elif not entry.value.startswith("("):
            plain.append(entry)
        else:
            is_removed = entry.key.startswith(("-", "!"))
            is_part = "itemclass" in ini.parse_struct(entry) and not is_removed
            with suppress(RobotFileError):  # lamps and grippers, whose values do not matter
                if is_part:
                    parts.append(ini.read_part(entry, units))
                    continue
            named = _NAME.search(entry.value)
            name = f" {named[1]!r}" if named else ""
            notices.append((entry.line, f"{entry.key}{name}: left out"))
    if plain:
        keys = ", ".join(dict.fromkeys(entry.key for entry in plain))
        notices.append((plain[0].line, f"[{section.name}] {keys}: left out"))
    return parts


def _sensors(
    parts: list[ini.UsarsimPart], sections: Sections, units: ini.Units, notices: list[ini.Notice]
) -> list[tuple[ini.IniEntry, ImportedSensor]]:
    """Sensors and the entries that describe them, in the order of the file."""
    cameras = find_cameras(parts)
    camera_parts = {id(part) for _, members in cameras for part in members}
    sensors = [(members[0].entry, camera) for camera, members in cameras]
    for part in parts:
        if id(part) not in camera_parts:
            found = part, sections.get(part.class_name.lower()), units, notices
            sensor = find_range_sensor(*found) or find_scanner(*found)
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
    sensors: list[tuple[ini.IniEntry, ImportedSensor]], notices: list[ini.Notice]
) -> list[ImportedSensor]:
    """Rename sensors to names that are valid in a robot file."""
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


# Omnidirectional cameras in USARBot.ini: one part, or the paper's three groups (section 2.4).
#
# The groups are the mirror, the virtual cameras at the effective viewpoint, and the camera that
# looks up at the mirror from below. The Position of a whole camera or a mirror is assumed to be the
# effective viewpoint as well.

_MIRROR = re.compile(r"mirror")
_VIRTUAL = re.compile(r"cameratexture|virtualcam")
_OMNI = re.compile(r"omni.*cam|omnidirectional|catadioptric")
# The parts of a camera coincide; the lens is below, within the length of any mirror's mount.
SAME_PLACE_M = 1e-3
BESIDE_AXIS_M = 0.01
LENS_BELOW_M = 0.5
_FILE = 'file = "omnicam.toml"  # a sensor file; without one: the paper\'s camera'
LOOKS_UP = 0.9998  # cosine of 1°


def find_cameras(
    parts: list[ini.UsarsimPart],
) -> list[tuple[ImportedSensor, list[ini.UsarsimPart]]]:
    """Find the omnidirectional cameras of a robot, and the parts of each camera."""
    groups: list[list[ini.UsarsimPart]] = []
    for part in parts:
        if _rank(part) is None:
            continue
        near = (g for g in groups if math.dist(g[0].position_m, part.position_m) <= SAME_PLACE_M)
        group = next(near, None)
        if group is None:
            groups.append([part])
        else:
            group.append(part)
    cameras = []
    for group in groups:
        lead, *others = sorted(group, key=lambda part: _rank(part) or 0)
        lens = _find_lens(lead, parts)
        members = [lead, *others, *([lens] if lens else [])]
        camera = ImportedSensor(
            name=lead.name,
            type="omnicamera",
            position_m=lead.position_m,
            # virtual cameras look in all directions
            angles_deg=(0.0, 0.0, 0.0) if _rank(lead) == 2 else lead.angles_deg,
            comments=(*(f"line {part.entry.line}: {part}" for part in members), _FILE),
        )
        cameras.append((camera, members))
    return cameras


def _rank(part: ini.UsarsimPart) -> int | None:
    """Rank of a part: 0 whole camera, 1 mirror, 2 virtual camera, None any other part."""
    ranks = ((1, _MIRROR), (2, _VIRTUAL), (0, _OMNI))
    return next((rank for rank, pattern in ranks if pattern.search(part.short_class)), None)


def _find_lens(lead: ini.UsarsimPart, parts: list[ini.UsarsimPart]) -> ini.UsarsimPart | None:
    """Camera that looks up at the lead part, a mirror, from below."""
    x, y, z = lead.position_m
    for part in parts:
        px, py, pz = part.position_m
        if (
            _rank(part) is None
            and "camera" in part.short_class
            and math.hypot(px - x, py - y) <= BESIDE_AXIS_M
            and 0.0 <= z - pz <= LENS_BELOW_M
            and part.forward[2] >= LOOKS_UP
        ):
            return part
    return None


# Sonars and infrared sensors in USARBot.ini: a part, with settings in its class's section.


_SONAR, _INFRARED = re.compile(r"sonar(?!array)"), re.compile(r"^ir\d*(sensor)?$|infrared")
_LENGTHS = {"maxrange": "range_max_m", "minrange": "range_min_m"}
_LIMITS = ("range_min_m", "range_max_m")
_COUNTS = {"numberofcones": "cones", "tracespercone": "rays_per_cone"}
MAX_COUNT = 360


def find_range_sensor(
    part: ini.UsarsimPart,
    section: ini.IniSection | None,
    units: ini.Units,
    notices: list[ini.Notice],
) -> ImportedSensor | None:
    """Read a sonar or an infrared sensor, with the section of its class; None: another part."""
    is_sonar = _SONAR.search(part.short_class)
    if not (is_sonar or _INFRARED.search(part.short_class)):
        return None
    entries = {} if section is None else {entry.key.lower(): entry for entry in section.entries}
    values: dict[str, float] = {}
    for key, name in _LENGTHS.items():
        if key in entries:
            entry = entries[key]
            values[name] = ini.length_m(entry, entry.key, entry.value, units)
            ini.check(entry, values[name] >= 0.0, "0 or more")
    if "noise" in entries:
        values["noise_share"] = _noise_share(entries["noise"])
    if is_sonar and "beamangle" in entries:
        entry = entries["beamangle"]
        values["beam_angle_rad"] = ini.angle_rad(entry, entry.key, entry.value, units)
        is_cone = 0.0 < values["beam_angle_rad"] < math.pi
        ini.check(entry, is_cone, "more than 0 and less than half a turn")
    for key, name in _COUNTS.items() if is_sonar else ():
        if key in entries:
            entry = entries[key]
            count = ini.number(entry, entry.key, entry.value)
            is_count = count == round(count) and 1.0 <= count <= MAX_COUNT
            ini.check(entry, is_count, f"a whole number from 1 to {MAX_COUNT}")
            values[name] = round(count)
    defaults_m = (0.1, 5.0) if is_sonar else (0.2, 1.5)
    least, most = (values.get(key, m) for key, m in zip(_LIMITS, defaults_m, strict=True))
    if not least < most:
        entry = entries.get("minrange") or entries["maxrange"]
        raise entry.fault(
            f"{entry.key} = {quote(entry.value)}: expected MinRange, {least:g} m, less than "
            f"MaxRange, {most:g} m"
        )
    used = {*_LENGTHS, "noise", *({"beamangle", *_COUNTS} if is_sonar else ())}
    _note_section(part, section, used, "sonar" if is_sonar else "infrared sensor", notices)
    return part.sensor("usarsim_sonar" if is_sonar else "usarsim_ir_sensor", values)


def _noise_share(entry: ini.IniEntry) -> float:
    share = ini.number(entry, entry.key, entry.value)
    ini.check(entry, share >= 0.0, "0 or more")
    return share


# Laser scanners in USARBot.ini: a part, with settings in its class's section.

_SICK = re.compile(r"sick|lms\d|lms$")
_SCANNER = re.compile(r"rangescanner|hokuyo|urg")
_USED = {"scanfov", "resolution", "maxrange", "minrange", "noise"}
TURN_RAD = 6.2832  # full turn as USARBot.ini rounds it


def find_scanner(
    part: ini.UsarsimPart,
    section: ini.IniSection | None,
    units: ini.Units,
    notices: list[ini.Notice],
) -> ImportedSensor | None:
    """Read a laser scanner, with the section of its class; None, with a notice: another part."""
    settings = {} if section is None else {entry.key.lower(): entry for entry in section.entries}
    says_how = {"scanfov", "resolution", "maxrange"} <= settings.keys()
    is_sick = _SICK.search(part.short_class)
    known = _SCANNER.search(part.short_class)
    if not (says_how or is_sick):
        why = f"no [{part.class_name}] with ScanFov, Resolution and MaxRange: " if known else ""
        notices.append((part.entry.line, f"{part}: {why}left out"))
        return None
    values: dict[str, float] = {}
    for key, name, read in (
        ("scanfov", "scan_fov_rad", ini.angle_rad),
        ("resolution", "resolution_rad", ini.angle_rad),
        ("maxrange", "max_range_m", ini.length_m),
        ("minrange", "min_range_m", ini.length_m),
    ):
        if key in settings:
            entry = settings[key]
            values[name] = read(entry, entry.key, entry.value, units)
            if key == "minrange":
                ini.check(entry, values[name] >= 0.0, "0 or more")
            else:
                ini.check(entry, values[name] > 0.0, "more than 0")
    if "noise" in settings:
        values["noise_share"] = _noise_share(settings["noise"])
    elif not is_sick:
        values["noise_share"] = 0.0
    fov, resolution = values.get("scan_fov_rad", math.pi), values.get("resolution_rad", 0.01745)
    if fov > TURN_RAD or fov / resolution >= 100_000.0:
        entry = settings["scanfov" if fov > TURN_RAD else "resolution"]
        ini.check(entry, False, "at most a turn and fewer than 100000 beams")
    least, most = values.get("min_range_m", 0.0), values.get("max_range_m", 20.0)
    if not least < most:
        entry = settings["minrange"]
        raise entry.fault(f"{entry.key} = {least:g} m: expected less than MaxRange, {most:g} m")
    _note_section(part, section, _USED, "SICK LMS200", notices)
    return part.sensor("usarsim_range_scanner", values)


def _note_section(
    part: ini.UsarsimPart,
    section: ini.IniSection | None,
    used: set[str],
    assumed: str,
    notices: list[ini.Notice],
) -> None:
    """Note the keys of a class's section that are not used, or what a part without one is."""
    if section is None:
        notice = f"{part}: no [{part.class_name}]: assumed to be USARSim's {assumed}"
        notices.append((part.entry.line, notice))
        return
    settings = {entry.key.lower(): entry.key for entry in section.entries}
    unread = [written for key, written in settings.items() if key not in used]
    if unread:
        notices.append((section.line, f"[{section.name}] {', '.join(unread)}: left out"))
