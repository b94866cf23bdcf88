"""USARBot.ini: its sections and entries, and the parts of a robot that they describe."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Union

from omnisim.core import poses
from omnisim.core.arrays import Floats
from omnisim.core.errors import RobotFileError
from omnisim.core.trajectories.formats.parsed_trajectory import quote
from omnisim.robots.importers.imported_robot import ImportedSensor

COMMENTS = (";", "#", "//")
MAX_DEPTH = 8
# The engine's lists may have an index, Sensors(3)=, and extend inherited lists, +Sensors=.
_ENTRY = re.compile(r"([-+.!]?[A-Za-z_]\w*)(?:[(\[]\d+[)\]])?\s*=\s*(.*)")
_SECTION = re.compile(r"\[([^\[\]]+)\]\s*(.*)")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0e-\x1f]")

Value = Union[str, "Struct"]
# Name in lower case, mapped to the name as written and its value.
Struct = dict[str, tuple[str, Value]]
Notice = tuple[int, str]  # line number and text


@dataclass(frozen=True)
class IniEntry:
    """Line of a section: key, value, file and line number."""

    key: str
    value: str
    source: Path
    line: int

    def fault(self, message: str) -> RobotFileError:
        """Error that names file and line."""
        return RobotFileError(f"{self.source}:{self.line}: {message}")


@dataclass(frozen=True)
class IniSection:
    """Section with all its lines; sections of the same name are merged."""

    name: str
    line: int
    entries: tuple[IniEntry, ...]

    def values_of(self, key: str) -> list[IniEntry]:
        """Entries with a key, regardless of case."""
        return [entry for entry in self.entries if entry.key.lower() == key.lower()]


def read_ini(path: Path) -> dict[str, IniSection]:
    """Read the sections of a file, keyed by lower-case name."""
    sections: dict[str, tuple[str, int, list[IniEntry]]] = {}
    entries: list[IniEntry] | None = None
    for number, line in enumerate(_text(path).split("\n"), start=1):
        content = line.strip()
        if not content or content.startswith(COMMENTS):
            continue
        heading, entry = _SECTION.fullmatch(content), _ENTRY.fullmatch(content)
        if heading and (not heading[2] or heading[2].startswith(COMMENTS)):
            name = heading[1].strip()
            entries = sections.setdefault(name.lower(), (name, number, []))[2]
        elif entry and entries is not None:
            entries.append(IniEntry(entry[1].lstrip("+."), entry[2], path, number))
        else:
            expected = "[section]" if entries is None else "[section] or key=value"
            raise RobotFileError(f"{path}:{number}: {quote(content)!r}: expected {expected}")
    if not sections:
        raise RobotFileError(f"{path}:1: empty: expected a USARBot.ini with [sections]")
    return {
        key: IniSection(name, line, tuple(entries))
        for key, (name, line, entries) in sections.items()
    }


def parse_struct(entry: IniEntry) -> Struct:
    """Parse the parenthesized value of an entry."""
    return _Reader(entry).whole()


def printable(text: str) -> str:
    """Replace unprintable characters with spaces."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise RobotFileError(f"{path}: cannot be read: {reason.strerror}") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252", errors="replace")  # Windows' encoding in USARSim's time
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    odd = _CONTROL.search(text)
    if odd:
        number = text.count("\n", 0, odd.start()) + 1
        raise RobotFileError(f"{path}:{number}: not a text file: expected a USARBot.ini")
    return text


class _Reader:
    """Parser of a single value, from left to right."""

    def __init__(self, entry: IniEntry) -> None:
        self._entry, self._text, self._at = entry, entry.value, 0

    def _fault(self, message: str) -> RobotFileError:
        return self._entry.fault(f"{self._entry.key}: {message}")

    def whole(self) -> Struct:
        if self._next() != "(":
            raise self._entry.fault(f"{self._entry.key}={quote(self._text)}: expected (...)")
        struct = self._struct(1)
        rest = self._text[self._at :].strip()
        if rest and not rest.startswith(COMMENTS):
            raise self._fault(f"{quote(rest)!r} after the last parenthesis: unbalanced parentheses")
        return struct

    def _next(self) -> str:
        """Skip whitespace and return the next character, or "" at the end."""
        while self._at < len(self._text) and self._text[self._at].isspace():
            self._at += 1
        return self._text[self._at : self._at + 1]

    def _struct(self, depth: int) -> Struct:
        if depth > MAX_DEPTH:
            raise self._fault(f"more than {MAX_DEPTH} parentheses deep")
        self._at += 1
        struct: Struct = {}
        while True:
            if self._next() == ",":
                self._at += 1
            elif self._next() == ")":
                self._at += 1
                return struct
            elif not self._next():
                raise self._fault("a parenthesis is not closed")
            else:
                name, value = self._pair(depth)
                if name.lower() in struct:
                    raise self._fault(f"{name} twice: expected it once")
                struct[name.lower()] = (name, value)

    def _pair(self, depth: int) -> tuple[str, Value]:
        match = re.compile(r"([A-Za-z_][\w()\[\]]*)\s*=").match(self._text, self._at)
        if match is None:
            rest = quote(self._text[self._at :])
            raise self._fault(f"{rest!r}: expected name=value")
        self._at = match.end()
        if self._next() == "(":
            return match[1], self._struct(depth + 1)
        return match[1], "".join(self._pieces(match[1])).strip()

    def _pieces(self, name: str) -> Iterator[str]:
        """Yield the pieces of a plain value; quoted pieces may contain commas and parentheses."""
        while self._at < len(self._text) and self._text[self._at] not in ",()":
            letter = self._text[self._at]
            end = self._at + 1
            if letter in "\"'":
                end = self._text.find(letter, self._at + 1) + 1
                if not end:
                    raise self._fault(f"{name}: a quote is not closed")
            yield self._text[self._at : end]
            self._at = end
        if self._text[self._at : self._at + 1] == "(":
            raise self._fault(f"{name}: a parenthesis within a word")


# Parts of a robot in USARBot.ini: class, name and pose, in omnisim's axes and units.
#
# USARSim uses meters and radians, x forward, y right and z down. Direction is roll (X), pitch (Y)
# and yaw (Z) in that frame. omnisim has the same x axis, but y and z are reversed: roll is kept,
# pitch and yaw change sign.

# No sensor is farther from its robot: larger numbers are in another unit.
FARTHEST_M = 10.0
ON_CHASSIS = {"", "hard", "none"}


@dataclass(frozen=True)
class Units:
    """Units of the numbers in a file."""

    meters: float  # unit of length, in meters
    radians: float  # unit of angle, in radians
    are_unreal: bool  # True for the engine's own units, with z up


SI_UNITS = Units(1.0, 1.0, are_unreal=False)
# The engine's units: z up, 65536 per turn, and 250 per meter, as USARSim's map names state.
UNREAL_UNITS = Units(1.0 / 250.0, 2.0 * math.pi / 65536.0, are_unreal=True)


@dataclass(frozen=True)
class UsarsimPart:
    """Part mounted on a robot."""

    entry: IniEntry  # entry that describes the part
    class_name: str  # class with its package, as in USARBot.SICKLMS
    name: str  # name of the part
    # position from USARSim's origin of the robot; x forward, y left, z up
    position_m: tuple[float, float, float]
    angles_deg: tuple[float, float, float]  # roll, pitch and yaw in the same frame
    parent: str | None  # part on which it is mounted; None: the chassis
    unread: tuple[str, ...]  # names of unsupported values

    @property
    def short_class(self) -> str:
        """Class name without its package, in lower case."""
        return self.class_name.rpartition(".")[2].lower()

    @property
    def forward(self) -> Floats:
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


def read_part(entry: IniEntry, units: Units) -> UsarsimPart:
    """Read the part of an entry."""
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
    return UsarsimPart(
        entry=entry,
        class_name=class_name,
        name=name,
        position_m=(_clean(x), _clean(-y), _clean(z if units.are_unreal else -z)),
        angles_deg=(_clean(roll), _clean(-pitch), _clean(-yaw)),
        parent=None if parent.lower() in ON_CHASSIS else parent,
        unread=tuple(written for key, (written, _) in struct.items() if key not in known),
    )


def check(entry: IniEntry, is_possible: bool, expected: str) -> None:
    """Raise an error if a value of an entry is impossible."""
    if not is_possible:
        raise entry.fault(f"{entry.key} = {quote(entry.value)}: expected {expected}")


def number(entry: IniEntry, name: str, value: Value) -> float:
    """Parse a finite number."""
    try:
        # a semicolon may follow, as in beamAngle=0.349;
        parsed = float(_bare(value.partition(";")[0])) if isinstance(value, str) else math.nan
    except ValueError:
        parsed = math.nan
    if not math.isfinite(parsed):
        quoted = quote(value) if isinstance(value, str) else "(...)"
        raise entry.fault(f"{name} = {quoted}: expected a finite number")
    return parsed


def length_m(entry: IniEntry, name: str, value: Value, units: Units) -> float:
    """Parse a length and convert it to meters."""
    return number(entry, name, value) * units.meters


def angle_rad(entry: IniEntry, name: str, value: Value, units: Units) -> float:
    """Parse an angle and convert it to radians."""
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


def _position_m(entry: IniEntry, struct: Struct, units: Units) -> list[float]:
    position = []
    for label, value in _axes(entry, struct, "Position"):
        meters = length_m(entry, label, value, units)
        if abs(meters) > FARTHEST_M:
            hint = "" if units.are_unreal else "; 250 to a meter are read with --unreal-units"
            raise entry.fault(f"{label} = {meters:g} m: expected at most {FARTHEST_M:g} m{hint}")
        position.append(meters)
    return position


def _axes(entry: IniEntry, struct: Struct, name: str) -> list[tuple[str, Value]]:
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


def _word(entry: IniEntry, struct: Struct, name: str) -> str:
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
