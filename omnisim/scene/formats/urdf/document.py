"""Elements of a URDF file, whose values are attributes; errors name their place and value."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, ParseError, iterparse

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.poses import pose_from_rotation, rotation_from_roll_pitch_yaw

_LARGEST = 1e12  # sums and products of them stay finite
_LONGEST = 80  # letters of a value in a message


def is_urdf(path: Path) -> bool:
    """True for a file whose root is a robot."""
    with path.open("rb") as file, suppress(ParseError, StopIteration, ValueError, LookupError):
        _, root = next(iterparse(file, ("start",)))
        return bool(root.tag == "robot")
    return False


class UrdfElement(NamedTuple):
    """Element with its place.

    Attributes:
        element: of the XML tree.
        place: path to it, for messages.
    """

    element: Element
    place: str

    @property
    def tag(self) -> str:
        """Kind of the element."""
        return self.element.tag

    @property
    def name(self) -> str:
        """Name attribute, or empty."""
        return self.attribute("name")

    def attribute(self, name: str) -> str:
        """Value of an attribute, or empty."""
        return (self.element.get(name) or "").strip()

    def children(self, tag: str) -> Iterator[UrdfElement]:
        """Child elements of a kind, in order."""
        for child in self.element:
            if child.tag == tag:
                name = child.get("name")
                step = tag if name is None else f"{tag}[{name}]"
                yield UrdfElement(child, f"{self.place}/{step}" if self.place else step)

    def find(self, tag: str) -> UrdfElement | None:
        """First child of a kind, or None."""
        return next(self.children(tag), None)

    def error(self, attribute: str, expected: str) -> SceneError:
        """Error about the value of an attribute."""
        got = repr(self.attribute(attribute))
        got = got if len(got) <= _LONGEST else got[: _LONGEST - 1] + "…"
        return SceneError(f"{self.place}: {attribute}: expected {expected}, got {got}")

    def numbers(
        self, attribute: str, default: tuple[float, ...] | None, count: int
    ) -> tuple[float, ...]:
        """Finite numbers of an attribute; by default None it is required."""
        words = self.attribute(attribute).split()
        if not words and default is not None:
            return default
        try:
            values = tuple(map(float, words))
        except ValueError:
            values = (math.nan,)
        if len(values) != count or not all(abs(value) < _LARGEST for value in values):
            raise self.error(attribute, "a number" if count == 1 else f"{count} numbers")
        return values

    def sizes(self, attribute: str, count: int = 1) -> tuple[float, ...]:
        """Numbers > 0 of an attribute."""
        values = self.numbers(attribute, None, count)
        if min(values) <= 0.0:
            raise self.error(attribute, "a number > 0" if count == 1 else f"{count} numbers > 0")
        return values

    def origin(self) -> NDArray[np.float64]:
        """Pose (4, 4) of its `<origin>`; without, the identity."""
        found = self.find("origin")
        if found is None:
            return np.eye(4)
        angles = found.numbers("rpy", (0.0, 0.0, 0.0), 3)
        return pose_from_rotation(
            rotation_from_roll_pitch_yaw(*angles), found.numbers("xyz", (0.0, 0.0, 0.0), 3)
        )
