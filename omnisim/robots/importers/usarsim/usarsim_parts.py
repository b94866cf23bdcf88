"""Parts of a robot in USARBot.ini: class, name, and pose, in our axes and units.

USARSim uses meters and radians, x forward, y right, z down; Direction is roll (X), pitch (Y) and
yaw (Z) in that frame. Our x is the same, y and z point the other way: roll stays, pitch and yaw
change sign.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core import poses
from omnisim.core.trajectories.formats.text_table import quote
from omnisim.robots.importers.imported_robot import ImportedSensor
from omnisim.robots.importers.usarsim.ini import Entry, Struct, Value, parse_struct, printable

# No sensor is farther from its robot: larger numbers are in another unit.
FARTHEST_M = 10.0
ON_CHASSIS = {"", "hard", "none"}


@dataclass(frozen=True)
class Units:
    """Units of a file's numbers.

    Attributes:
        meters: meters per unit of length.
        radians: radians per unit of angle.
        are_unreal: units of the Unreal engine, with z up.
    """

    meters: float
    radians: float
    are_unreal: bool


SI_UNITS = Units(1.0, 1.0, are_unreal=False)
# The Unreal engine: z up, 65536 units to a turn, and 250 to a meter, as USARSim's maps are named.
UNREAL_UNITS = Units(1.0 / 250.0, 2.0 * math.pi / 65536.0, are_unreal=True)


@dataclass(frozen=True)
class Part:
    """Part mounted on a robot.

    Attributes:
        entry: line of the part.
        class_name: class with its package, such as USARBot.SICKLMS.
        name: name of the part.
        position_m: (3,) from USARSim's origin of the robot; x forward, y left, z up.
        angles_deg: roll, pitch and yaw in the same frame.
        parent: part it is mounted on; None: the chassis.
        unread: names of values that were not understood.
    """

    entry: Entry
    class_name: str
    name: str
    position_m: tuple[float, float, float]
    angles_deg: tuple[float, float, float]
    parent: str | None
    unread: tuple[str, ...]

    @property
    def short_class(self) -> str:
        """Class without its package, in lower case."""
        return self.class_name.rpartition(".")[2].lower()

    @property
    def forward(self) -> NDArray[np.float64]:
        """Viewing direction (3,), unit."""
        return poses.pose((0, 0, 0), *self.angles_deg)[:3, 0]

    def sensor(self, kind: str, values: Mapping[str, float]) -> ImportedSensor:
        """Sensor of a kind at the part's pose."""
        comment = f"line {self.entry.line}: {self}"
        return ImportedSensor(
            self.name, kind, self.position_m, self.angles_deg, values, comments=(comment,)
        )

    def __str__(self) -> str:
        return f"{self.entry.key} {self.name!r} ({self.class_name})"


def read_part(entry: Entry, units: Units) -> Part:
    """Read the part of an entry.

    Raises:
        RobotFileError: the message names file, line, value and expected value.
    """
    struct = parse_struct(entry)
    class_name = _word(entry, struct, "ItemClass")
    name = _word(entry, struct, "ItemName")
    parent = struct.get("parent", ("", ""))[1]
    parent = _bare(parent) if isinstance(parent, str) else "(...)"
    known = {"itemclass", "itemname", "position", "direction", "parent"}
    x, y, z = _position_m(entry, struct, units)
    axes = _axes(entry, struct, "Direction")
    angles = (angle_rad(entry, label, value, units) for label, value in axes)
    roll, pitch, yaw = map(math.degrees, angles)
    return Part(
        entry=entry,
        class_name=class_name,
        name=name,
        position_m=(_clean(x), _clean(-y), _clean(z if units.are_unreal else -z)),
        angles_deg=(_clean(roll), _clean(-pitch), _clean(-yaw)),
        parent=None if parent.lower() in ON_CHASSIS else parent,
        unread=tuple(written for key, (written, _) in struct.items() if key not in known),
    )


def check(entry: Entry, is_possible: bool, wanted: str) -> None:
    """Refuse an impossible value of an entry.

    Raises:
        RobotFileError: the message names file, line and expected value.
    """
    if not is_possible:
        raise entry.fault(f"{entry.key} = {quote(entry.value)}: expected {wanted}")


def number(entry: Entry, name: str, value: Value) -> float:
    """Parse a finite number.

    Raises:
        RobotFileError: not a finite number; the message names file and line.
    """
    try:
        # a comment may follow, as in beamAngle=0.349;
        parsed = float(_bare(value.partition(";")[0])) if isinstance(value, str) else math.nan
    except ValueError:
        parsed = math.nan
    if not math.isfinite(parsed):
        shown = quote(value) if isinstance(value, str) else "(...)"
        raise entry.fault(f"{name} = {shown}: expected a finite number")
    return parsed


def length_m(entry: Entry, name: str, value: Value, units: Units) -> float:
    """Parse a length in meters.

    Raises:
        RobotFileError: not a length; the message names file and line.
    """
    return number(entry, name, value) * units.meters


def angle_rad(entry: Entry, name: str, value: Value, units: Units) -> float:
    """Parse an angle in radians.

    Raises:
        RobotFileError: not a number, or an angle in the other unit.
    """
    angle = number(entry, name, value)
    if units.are_unreal and angle != round(angle):
        raise entry.fault(
            f"{name} = {angle:g}: expected whole numbers, 65536 to a turn; "
            "radians are read without --unreal-units"
        )
    if not units.are_unreal and abs(angle) > 2.0 * math.pi + 0.01:
        raise entry.fault(
            f"{name} = {angle:g}: expected radians, at most a turn; "
            "65536 to a turn are read with --unreal-units"
        )
    return angle * units.radians


def _position_m(entry: Entry, struct: Struct, units: Units) -> list[float]:
    position = []
    for label, value in _axes(entry, struct, "Position"):
        meters = length_m(entry, label, value, units)
        if abs(meters) > FARTHEST_M:
            hint = "" if units.are_unreal else "; 250 to a meter are read with --unreal-units"
            raise entry.fault(f"{label} = {meters:g} m: expected at most {FARTHEST_M:g} m{hint}")
        position.append(meters)
    return position


def _axes(entry: Entry, struct: Struct, name: str) -> list[tuple[str, Value]]:
    """Names and values of X, Y and Z; a missing one is 0, as in the engine."""
    written, inner = struct.get(name.lower(), (name, {}))
    if isinstance(inner, str):
        raise entry.fault(f"{written}={quote(inner)}: expected {name}=(X=,Y=,Z=)")
    named = {"roll": "x", "pitch": "y", "yaw": "z"} if name == "Direction" else {}
    values: dict[str, tuple[str, Value]] = {axis: (axis, "0") for axis in "xyz"}
    for key, (label, value) in inner.items():
        axis = named.get(key, key)
        if axis not in values:
            raise entry.fault(f"{written}: {label}: expected X, Y and Z")
        values[axis] = (f"{written} {label}", value)
    return list(values.values())


def _word(entry: Entry, struct: Struct, name: str) -> str:
    value = struct.get(name.lower(), (name, ""))[1]
    word = _bare(value) if isinstance(value, str) else ""
    if not word:
        raise entry.fault(f"{entry.key}: no {name}: expected {name}=...")
    return word


def _bare(value: str) -> str:
    """Strip quotes: "a", class'a', a."""
    match = re.fullmatch(r"(?:\w*'([^']*)'|\"([^\"]*)\")", value)
    word = (match[1] or match[2] or "") if match else value
    return printable(word).strip()


def _clean(value: float) -> float:
    """Remove conversion errors by rounding, and −0."""
    return round(value, 9) + 0.0
