"""Elements of an SDF file, whose errors name their place and value."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.poses import (
    pose_from_rotation,
    rotation_from_quaternion,
    rotation_from_roll_pitch_yaw,
)
from omnisim.core.short_repr import counted

_FLAGS = {"true": True, "1": True, "false": False, "0": False}
_LARGEST = 1e12  # sums and products of them stay finite
_LONGEST = 80  # letters of a value in a message


class SdfElement(NamedTuple):
    """Element with its place.

    Attributes:
        element: of the XML tree.
        place: path to it, for messages; of an included file with that file's name.
        file: that it is in; paths are relative to its folder.
    """

    element: Element
    place: str
    file: Path

    @property
    def name(self) -> str:
        """Name attribute, or empty."""
        return (self.element.get("name") or "").strip()

    def attribute(self, name: str) -> str:
        """Value of an attribute, or empty."""
        return (self.element.get(name) or "").strip()

    def children(self, *tags: str) -> Iterator[SdfElement]:
        """Child elements with one of some tags, in order."""
        for child in self.element:
            if child.tag in tags:
                yield self._inner(child)

    def find(self, path: str) -> SdfElement | None:
        """Descendant by tags with slashes between them, or None."""
        found: SdfElement | None = self
        for tag in path.split("/"):
            found = None if found is None else next(found.children(tag), None)
        return found

    def text(self, path: str, default: str = "") -> str:
        """Text of a descendant, or the default where it is missing or empty."""
        found = self.find(path)
        return (found.own_text if found is not None else "") or default

    @property
    def own_text(self) -> str:
        """Text of the element itself."""
        return (self.element.text or "").strip()

    def error(self, expected: str, got: object = None) -> SceneError:
        """Error about the element's value."""
        text = repr(self.own_text if got is None else got)
        text = text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
        return SceneError(f"{self.place}: expected {expected}, got {text}")

    def number(self, path: str, default: float) -> float:
        """Finite number in a descendant."""
        found = self.find(path)
        return default if found is None or not found.own_text else found.numbers(1)[0]

    def positive(self, path: str, default: float) -> float:
        """Number > 0 in a descendant."""
        value = self.number(path, default)
        found = self.find(path)
        if not value > 0.0 and found is not None:
            raise found.error("a number > 0")
        return value

    def vector(self, path: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """Finite numbers in a descendant, as many as the default has."""
        found = self.find(path)
        return default if found is None else found.numbers(len(default))

    def flag(self, path: str, default: bool = False) -> bool:
        """Truth value in a descendant."""
        found = self.find(path)
        if found is None or not found.own_text:
            return default
        value = _FLAGS.get(found.own_text.lower())
        if value is None:
            raise found.error("true or false")
        return value

    def color(self, path: str) -> tuple[float, float, float] | None:
        """Red, green and blue of a descendant, from 0, or None."""
        found = self.find(path)
        if found is None:
            return None
        values = found.numbers(3, 4)
        if min(values[:3]) < 0.0:
            raise found.error("three or four numbers ≥ 0")
        return values[0], values[1], values[2]

    def numbers(self, *counts: int) -> tuple[float, ...]:
        """Finite numbers of the element's text, of one of some counts."""
        words = self.own_text.split()
        try:
            values = tuple(map(float, words))
        except ValueError:
            values = (math.nan,)
        if len(values) not in counts or not all(abs(value) < _LARGEST for value in values):
            expected = " or ".join(map(str, counts))
            raise self.error("a number" if counts == (1,) else f"{expected} numbers")
        return values

    def pose(self) -> NDArray[np.float64]:
        """Pose (4, 4) of its `<pose>`, in the frame that this names; else the identity."""
        found = self.find("pose")
        if found is None or not found.own_text:
            return np.eye(4)
        kind = found.attribute("rotation_format") or "euler_rpy"
        if kind == "quat_xyzw":
            x, y, z, *quaternion = found.numbers(7)
            if math.hypot(*quaternion) < 1e-9:
                raise found.error("a quaternion other than 0")
            return pose_from_rotation(rotation_from_quaternion(quaternion), (x, y, z))
        if kind != "euler_rpy":
            raise found.error("rotation_format euler_rpy or quat_xyzw", kind)
        x, y, z, *angles = found.numbers(6)
        is_degrees = _FLAGS.get(found.attribute("degrees").lower(), False)
        rotation = rotation_from_roll_pitch_yaw(*(np.radians(angles) if is_degrees else angles))
        return pose_from_rotation(rotation, (x, y, z))

    @property
    def relative_to(self) -> str:
        """Frame of its pose, or empty; `frame` in versions before 1.7."""
        found = self.find("pose")
        if found is None:
            return ""
        return found.attribute("relative_to") or found.attribute("frame")

    def _inner(self, child: Element) -> SdfElement:
        name = child.get("name")
        step = child.tag if name is None else f"{child.tag}[{name}]"
        return SdfElement(child, f"{self.place}/{step}" if self.place else step, self.file)


class Omissions:
    """Counts of what is left out or drawn otherwise, for notices."""

    def __init__(self) -> None:
        self._counts: dict[tuple[str, str], int] = {}

    def add(self, effect: str, noun: str) -> None:
        """Count one more of a kind.

        Args:
            effect: the notice.
            noun: what is counted, in the singular.
        """
        key = effect, noun
        self._counts[key] = self._counts.get(key, 0) + 1

    @property
    def notices(self) -> list[str]:
        """One line for each kind."""
        return [
            f"{effect} ({counted(count, noun)})" for (effect, noun), count in self._counts.items()
        ]
