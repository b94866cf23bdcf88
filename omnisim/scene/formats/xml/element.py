"""XML elements with errors that name their location and value.

SDF states values as element text, URDF as attributes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, ParseError, iterparse
from xml.parsers import expat

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError
from omnisim.core.poses import (
    pose_from_rotation,
    rotation_from_quaternion,
    rotation_from_roll_pitch_yaw,
)

_FLAGS = {"true": True, "1": True, "false": False, "0": False}
MAX_NUMBER = 1e12  # sums and products of such numbers stay finite
MAX_QUOTE = 80  # characters of a quoted value in a message


class XmlElement(NamedTuple):
    """Element with its location; its methods raise a SceneError for an invalid value."""

    element: Element  # element of the XML tree
    place: str  # path to the element, for messages; starts with the file name in an included file
    file: Path  # file with the element; paths are relative to its folder

    @property
    def tag(self) -> str:
        """Tag of the element."""
        return self.element.tag

    @property
    def name(self) -> str:
        """Value of the name attribute; empty if missing."""
        return self.attribute("name")

    def attribute(self, name: str) -> str:
        """Value of an attribute; empty if missing."""
        return (self.element.get(name) or "").strip()

    def children(self, *tags: str) -> Iterator[XmlElement]:
        """Child elements with one of the given tags, in order."""
        for child in self.element:
            if child.tag in tags:
                step = step_to(child)
                yield XmlElement(child, f"{self.place}/{step}" if self.place else step, self.file)

    def find(self, path: str) -> XmlElement | None:
        """Descendant by tags separated with slashes; None: missing."""
        element: XmlElement | None = self
        for tag in path.split("/"):
            element = None if element is None else next(element.children(tag), None)
        return element

    def text(self, path: str, default: str = "") -> str:
        """Text of a descendant; `default` if missing or empty."""
        element = self.find(path)
        return (element.own_text if element is not None else "") or default

    @property
    def own_text(self) -> str:
        """Text of the element itself."""
        return (self.element.text or "").strip()

    def error(self, expected: str, got: object = None) -> SceneError:
        """Error about the element's value."""
        quoted = _quote(self.own_text if got is None else got)
        return SceneError(f"{self.place}: expected {expected}, got {quoted}")

    def attribute_error(self, attribute: str, expected: str) -> SceneError:
        """Error about the value of an attribute."""
        quoted = _quote(self.attribute(attribute))
        return SceneError(f"{self.place}: {attribute}: expected {expected}, got {quoted}")

    def number(self, path: str, default: float) -> float:
        """Finite number in a descendant; `default` if missing."""
        element = self.find(path)
        return default if element is None or not element.own_text else element.numbers(1)[0]

    def positive(self, path: str, default: float) -> float:
        """Number > 0 in a descendant; `default` if missing."""
        value = self.number(path, default)
        element = self.find(path)
        if not value > 0.0 and element is not None:
            raise element.error("a number > 0")
        return value

    def vector(self, path: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """Finite numbers in a descendant, as many as in `default`."""
        element = self.find(path)
        return default if element is None else element.numbers(len(default))

    def flag(self, path: str, default: bool = False) -> bool:
        """Boolean in a descendant; `default` if missing."""
        element = self.find(path)
        if element is None or not element.own_text:
            return default
        value = _FLAGS.get(element.own_text.lower())
        if value is None:
            raise element.error("true or false")
        return value

    def color(self, path: str) -> tuple[float, float, float] | None:
        """Red, green and blue ≥ 0 in a descendant; None: missing."""
        element = self.find(path)
        if element is None:
            return None
        values = element.numbers(3, 4)
        if min(values[:3]) < 0.0:
            raise element.error("three or four numbers ≥ 0")
        return values[0], values[1], values[2]

    def numbers(self, *counts: int) -> tuple[float, ...]:
        """Finite numbers in the element's text; `counts` lists the valid lengths."""
        values = _finite_numbers(self.own_text)
        if len(values) not in counts:
            expected = " or ".join(map(str, counts))
            raise self.error("a number" if counts == (1,) else f"{expected} numbers")
        return values

    def attribute_numbers(
        self, attribute: str, default: tuple[float, ...] | None, count: int
    ) -> tuple[float, ...]:
        """Finite numbers in an attribute, which is required if the default is None."""
        text = self.attribute(attribute)
        if not text and default is not None:
            return default
        values = _finite_numbers(text)
        if len(values) != count:
            expected = "a number" if count == 1 else f"{count} numbers"
            raise self.attribute_error(attribute, expected)
        return values

    def attribute_sizes(self, attribute: str, count: int = 1) -> tuple[float, ...]:
        """Numbers > 0 in an attribute."""
        values = self.attribute_numbers(attribute, None, count)
        if min(values) <= 0.0:
            expected = "a number > 0" if count == 1 else f"{count} numbers > 0"
            raise self.attribute_error(attribute, expected)
        return values

    def origin(self) -> Floats:
        """Pose (4, 4) of URDF's `<origin>`; identity if missing."""
        element = self.find("origin")
        if element is None:
            return np.eye(4)
        angles = element.attribute_numbers("rpy", (0.0, 0.0, 0.0), 3)
        position = element.attribute_numbers("xyz", (0.0, 0.0, 0.0), 3)
        return pose_from_rotation(rotation_from_roll_pitch_yaw(*angles), position)

    def pose(self) -> Floats:
        """Pose (4, 4) of SDF's `<pose>`, in the frame that it names; identity if missing."""
        element = self.find("pose")
        if element is None or not element.own_text:
            return np.eye(4)
        kind = element.attribute("rotation_format") or "euler_rpy"
        if kind == "quat_xyzw":
            x, y, z, *quaternion = element.numbers(7)
            if math.hypot(*quaternion) < 1e-9:
                raise element.error("a quaternion other than 0")
            return pose_from_rotation(rotation_from_quaternion(quaternion), (x, y, z))
        if kind != "euler_rpy":
            raise element.error("rotation_format euler_rpy or quat_xyzw", kind)
        x, y, z, *angles = element.numbers(6)
        is_degrees = _FLAGS.get(element.attribute("degrees").lower(), False)
        rotation = rotation_from_roll_pitch_yaw(*(np.radians(angles) if is_degrees else angles))
        return pose_from_rotation(rotation, (x, y, z))

    @property
    def relative_to(self) -> str:
        """Frame of the element's pose; empty: the default frame. Before SDF 1.7: `frame`."""
        element = self.find("pose")
        if element is None:
            return ""
        return element.attribute("relative_to") or element.attribute("frame")


def step_to(child: Element) -> str:
    """Step of an element's place: its tag and its name, if it has one."""
    name = child.get("name")
    return child.tag if name is None else f"{child.tag}[{name}]"


def _finite_numbers(text: str) -> tuple[float, ...]:
    """Numbers of a text; empty if any is not a finite number."""
    try:
        values = tuple(map(float, text.split()))
    except ValueError:
        return ()
    return values if all(abs(value) < MAX_NUMBER for value in values) else ()


def _quote(value: object) -> str:
    text = repr(value)
    return text if len(text) <= MAX_QUOTE else text[: MAX_QUOTE - 1] + "…"


# Parsing of untrusted XML files: no entities, limited depth.
#
# Gazebo's parser is lenient, and Gazebo's own worlds depend on it: they contain comments with
# double hyphens, undeclared namespace prefixes and unescaped ampersands.

MAX_BYTES = 1 << 28
MAX_DEPTH = 128
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_LONE_AMPERSAND = re.compile(rb"&(?!(?:#\d{1,7}|#x[0-9a-fA-F]{1,6}|lt|gt|amp|quot|apos);)")


class _Builder:
    """Builder of an element tree; it rejects entities, which could grow without bound."""

    def __init__(self) -> None:
        self.root: Element | None = None
        self._open: list[Element] = []

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Open an element."""
        element = Element(tag, attributes)
        if self._open:
            self._open[-1].append(element)
        elif self.root is None:
            self.root = element
        if len(self._open) >= MAX_DEPTH:
            raise SceneError(f"expected at most {MAX_DEPTH} levels of nested elements, got more")
        self._open.append(element)

    def end(self, _: str) -> None:
        """Close the element."""
        self._open.pop()

    def text(self, text: str) -> None:
        """Append text that precedes all children, the only text in SDF."""
        if self._open and not len(self._open[-1]):
            self._open[-1].text = (self._open[-1].text or "") + text

    def refuse(self, *_: object) -> None:
        """Reject a declaration of entities."""
        raise SceneError("expected XML without entities of its own, got a DOCTYPE")


def parse_xml(data: bytes) -> Element:
    """Root of an XML file.

    Raises:
        SceneError: invalid XML, a file that is too large or too deep, or declared entities.
    """
    if len(data) > MAX_BYTES:
        raise SceneError(f"expected at most {MAX_BYTES >> 20} MiB, got {len(data) >> 20} MiB")
    plain = _COMMENT.sub(lambda comment: re.sub(rb"[^\n]", b" ", comment[0]), data).lstrip()
    builder, parser = _Builder(), expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.text
    parser.StartDoctypeDeclHandler = builder.refuse
    try:
        parser.Parse(_LONE_AMPERSAND.sub(b"&amp;", plain), True)
    except expat.ExpatError as reason:
        line = reason.lineno + data[: len(data) - len(plain)].count(b"\n")
        message = expat.ErrorString(reason.code)
        raise SceneError(f"not XML in line {line}, column {reason.offset + 1}: {message}") from None
    except (ValueError, LookupError) as reason:  # a damaged or unknown encoding
        raise SceneError(f"not XML: {reason}") from None
    if builder.root is None:
        raise SceneError("not XML: no element found")
    return builder.root


def is_urdf(path: Path) -> bool:
    """True for a file with a `<robot>` root."""
    with path.open("rb") as file, suppress(ParseError, StopIteration, ValueError, LookupError):
        return next(iterparse(file, ("start",)))[1].tag == "robot"
    return False
