"""Laser scanners in USARBot.ini: a part, with settings in its class's section."""

from __future__ import annotations

import math
import re

from omnisim.core.trajectories.formats.text_table import quote
from omnisim.robots.importers.imported_robot import ImportedSensor
from omnisim.robots.importers.usarsim.ini import Entry, Notice, Section
from omnisim.robots.importers.usarsim.usarsim_parts import (
    Part,
    Units,
    angle_rad,
    check,
    length_m,
    number,
)

_SICK = re.compile(r"sick|lms\d|lms$")
_SCANNER = re.compile(r"rangescanner|hokuyo|urg")
_USED = {"scanfov", "resolution", "maxrange", "minrange", "noise"}
TURN_RAD = 6.2832  # full turn as USARBot.ini rounds it


def find_scanner(
    part: Part, section: Section | None, units: Units, notices: list[Notice]
) -> ImportedSensor | None:
    """Read a laser scanner; for other parts or missing settings, add a notice and return None.

    Args:
        part: part of the robot.
        section: section with the settings of the part's class; None: not in the file.
        units: units of the file.
        notices: list to which notices are appended.
    """
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
        ("scanfov", "scan_fov_rad", angle_rad),
        ("resolution", "resolution_rad", angle_rad),
        ("maxrange", "max_range_m", length_m),
        ("minrange", "min_range_m", length_m),
    ):
        if key in settings:
            entry = settings[key]
            values[name] = read(entry, entry.key, entry.value, units)
            is_least = key == "minrange"
            check(
                entry,
                values[name] > 0.0 or (is_least and values[name] == 0.0),
                "0 or more" if is_least else "more than 0",
            )
    if "noise" in settings:
        entry = settings["noise"]
        values["noise_share"] = number(entry, entry.key, entry.value)
        check(entry, values["noise_share"] >= 0.0, "0 or more")
    elif not is_sick:
        values["noise_share"] = 0.0
    _check_scan(settings, values)
    if section is None:
        notice = f"{part}: no [{part.class_name}]: assumed to be USARSim's SICK LMS200"
        notices.append((part.entry.line, notice))
    else:
        unread = [entry.key for key, entry in settings.items() if key not in _USED]
        if unread:
            notices.append((section.line, f"[{section.name}] {', '.join(unread)}: left out"))
    return part.sensor("usarsim_range_scanner", values)


def _check_scan(settings: dict[str, Entry], values: dict[str, float]) -> None:
    """Raise an error that names the line if the scan settings are impossible."""
    fov, resolution = values.get("scan_fov_rad", math.pi), values.get("resolution_rad", 0.01745)
    if fov > TURN_RAD or fov / resolution >= 100_000.0:
        entry = settings["scanfov" if fov > TURN_RAD else "resolution"]
        raise entry.fault(
            f"{entry.key} = {quote(entry.value)}: expected at most a turn and "
            "fewer than 100000 beams"
        )
    least, most = values.get("min_range_m", 0.0), values.get("max_range_m", 20.0)
    if not least < most:
        entry = settings["minrange"]
        raise entry.fault(f"{entry.key} = {least:g} m: expected less than MaxRange, {most:g} m")
