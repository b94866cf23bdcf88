"""Parts of a robot in USARBot.ini: class, name and pose, in omnisim's axes and units.

USARSim uses meters and radians, x forward, y right and z down. Direction is roll (X), pitch (Y)
and yaw (Z) in that frame. omnisim has the same x axis, but y and z are reversed: roll is kept,
pitch and yaw change sign.
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
    """Units of the numbers in a file.

    Attributes:
        meters: unit of length, in meters.
        radians: unit of angle, in radians.
        are_unreal: True for the engine's own units, with z up.
    """

    meters: float
    radians: float
    are_unreal: bool


SI_UNITS = Units(1.0, 1.0, are_unreal=False)
# The engine's units: z up, 65536 per turn, and 250 per meter, as USARSim's map names state.
UNREAL_UNITS = Units(1.0 / 250.0, 2.0 * math.pi / 65536.0, are_unreal=True)


@dataclass(frozen=True)
class Part:
    """Part mounted on a robot.

    Attributes:
        entry: entry that describes the part.
        class_name: class with its package, as in USARBot.SICKLMS.
        name: name of the part.
        position_m: position from USARSim's origin of the robot; x forward, y left, z up.
        angles_deg: roll, pitch and yaw in the same frame.
        parent: part on which it is mounted; None: the chassis.
        unread: names of unsupported values.
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
        """Class name without its package, in lower case."""
        return self.class_name.rpartition(".")[2].lower()

    @property
    def forward(self) -> NDArray[np.float64]:
        """Viewing direction (3,), unit vector."""
        roll_deg, pitch_deg, yaw_deg = self.angles_deg
        return poses.pose(roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)[:3, 0]

    def sensor(self, kind: str, values: Mapping[str, float]) -> ImportedSensor:
        """Sensor of the given type at the part's pose."""
        comment = f"line {self.entry.line}: {self}"
        return ImportedSensor(
            self.name, kind, self.position_m, self.angles_deg, values, comments=(comment,)
        )

    def __str__(self) -> str:
        return f"{self.entry.key} {self.name!r} ({self.class_name})"


def read_part(entry: Entry, units: Units) -> Part:
    """Read the part of an entry.

    Raises:
        RobotFileError: invalid syntax or value; names file, line, actual and expected text.
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


def check(entry: Entry, is_possible: bool, expected: str) -> None:
    """Raise an error if a value of an entry is impossible.

    Raises:
        RobotFileError: the value is impossible; names file, line and the expected value.
    """
    if not is_possible:
        raise entry.fault(f"{entry.key} = {quote(entry.value)}: expected {expected}")


def number(entry: Entry, name: str, value: Value) -> float:
    """Parse a finite number.

    Raises:
        RobotFileError: the value is not a number; names file, line and the actual text.
    """
    try:
        # a semicolon may follow, as in beamAngle=0.349;
        parsed = float(_bare(value.partition(";")[0])) if isinstance(value, str) else math.nan
    except ValueError:
        parsed = math.nan
    if not math.isfinite(parsed):
        quoted = quote(value) if isinstance(value, str) else "(...)"
        raise entry.fault(f"{name} = {quoted}: expected a finite number")
    return parsed


def length_m(entry: Entry, name: str, value: Value, units: Units) -> float:
    """Parse a length and convert it to meters.

    Raises:
        RobotFileError: the value is not a number; names file, line and the actual text.
    """
    return number(entry, name, value) * units.meters


def angle_rad(entry: Entry, name: str, value: Value, units: Units) -> float:
    """Parse an angle and convert it to radians.

    Raises:
        RobotFileError: not a number, or the value implies the other unit.
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
    components: dict[str, tuple[str, Value]] = {axis: (axis, "0") for axis in "xyz"}
    for key, (label, value) in inner.items():
        axis = named.get(key, key)
        if axis not in components:
            raise entry.fault(f"{written}: {label}: expected X, Y and Z")
        components[axis] = (f"{written} {label}", value)
    return list(components.values())


def _word(entry: Entry, struct: Struct, name: str) -> str:
    value = struct.get(name.lower(), (name, ""))[1]
    word = _bare(value) if isinstance(value, str) else ""
    if not word:
        raise entry.fault(f"{entry.key}: no {name}: expected {name}=...")
    return word


def _bare(value: str) -> str:
    """Strip the quotes: "a" and class'a' become a."""
    quoted = re.fullmatch(r"(?:\w*'([^']*)'|\"([^\"]*)\")", value)
    word = (quoted[1] or quoted[2] or "") if quoted else value
    return printable(word).strip()


def _clean(value: float) -> float:
    """Round off conversion errors and turn −0 into 0."""
    return round(value, 9) + 0.0
