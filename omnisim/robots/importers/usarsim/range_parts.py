"""Sonars and infrared sensors in USARBot.ini: a part, with settings in its class's section."""

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

_SONAR, _INFRARED = re.compile(r"sonar(?!array)"), re.compile(r"^ir\d*(sensor)?$|infrared")
_LENGTHS = {"maxrange": "range_max_m", "minrange": "range_min_m"}
_COUNTS = {"numberofcones": "cones", "tracespercone": "rays_per_cone"}
MAX_COUNT = 360


def find_range_sensor(
    part: Part, section: Section | None, units: Units, notices: list[Notice]
) -> ImportedSensor | None:
    """Read a sonar or an infrared sensor; None for any other part.

    Args:
        part: part of the robot.
        section: section with the settings of the part's class; None: not in the file.
        units: units of the file.
        notices: list to which notices are appended.
    """
    is_sonar = _SONAR.search(part.short_class)
    if not (is_sonar or _INFRARED.search(part.short_class)):
        return None
    entries = {} if section is None else {entry.key.lower(): entry for entry in section.entries}
    values: dict[str, float] = {}
    for key, name in _LENGTHS.items():
        if key in entries:
            entry = entries[key]
            values[name] = length_m(entry, entry.key, entry.value, units)
            check(entry, values[name] >= 0.0, "0 or more")
    if "noise" in entries:
        values["noise_share"] = _number(entries["noise"])
        check(entries["noise"], values["noise_share"] >= 0.0, "0 or more")
    if is_sonar:
        values |= _cone(entries, units)
    _check_limits(entries, values, (0.1, 5.0) if is_sonar else (0.2, 1.5))
    used = {*_LENGTHS, "noise", *({"beamangle", *_COUNTS} if is_sonar else ())}
    unread = [entry.key for key, entry in entries.items() if key not in used]
    kind = "sonar" if is_sonar else "infrared sensor"
    if section is None:
        notice = f"{part}: no [{part.class_name}]: assumed to be USARSim's {kind}"
        notices.append((part.entry.line, notice))
    elif unread:
        notices.append((section.line, f"[{section.name}] {', '.join(unread)}: left out"))
    return part.sensor("usarsim_sonar" if is_sonar else "usarsim_ir_sensor", values)


def _cone(entries: dict[str, Entry], units: Units) -> dict[str, float]:
    """Read the beam angle and the ray counts of a sonar."""
    values: dict[str, float] = {}
    if "beamangle" in entries:
        entry = entries["beamangle"]
        values["beam_angle_rad"] = angle_rad(entry, entry.key, entry.value, units)
        check(
            entry, 0.0 < values["beam_angle_rad"] < math.pi, "more than 0 and less than half a turn"
        )
    for key, name in _COUNTS.items():
        if key in entries:
            count = _number(entries[key])
            is_count = count == round(count) and 1.0 <= count <= MAX_COUNT
            check(entries[key], is_count, f"a whole number from 1 to {MAX_COUNT}")
            values[name] = round(count)
    return values


def _number(entry: Entry) -> float:
    return number(entry, entry.key, entry.value)


def _check_limits(
    entries: dict[str, Entry], values: dict[str, float], defaults: tuple[float, float]
) -> None:
    """Raise an error that names the line if the minimum range is not below the maximum."""
    least, most = values.get("range_min_m", defaults[0]), values.get("range_max_m", defaults[1])
    if not least < most:
        entry = entries.get("minrange") or entries["maxrange"]
        raise entry.fault(
            f"{entry.key} = {quote(entry.value)}: expected MinRange, {least:g} m, less than "
            f"MaxRange, {most:g} m"
        )
