"""Factors of materials within the ranges that glTF gives them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from omnisim.scene.formats.gltf.json_object import JsonObject

_MAX_NAMED = 5
_ROUNDING = 1e-6  # of exporters, which write float32
Color = tuple[float, float, float]


class Factors:
    """Limits factors of one material, and records the values outside their ranges.

    Attributes:
        material: name of the material.
        changed: one text per value outside its range, with material, key, value and substitute.
    """

    def __init__(self, material: str):
        self.changed: list[str] = []
        self.material = material

    def number(
        self, entry: JsonObject, key: str, default: float, low: float, high: float = math.inf
    ) -> float:
        """Number of a property, limited to [low, high]."""
        value = entry.number(key, default)
        return self.replaced(_name(entry, key), value, min(max(value, low), high))

    def share(self, entry: JsonObject, key: str, default: float) -> float:
        """Number of a property, limited to [0, 1]."""
        return self.number(entry, key, default, 0.0, 1.0)

    def color(self, entry: JsonObject, key: str, default: float, high: float = math.inf) -> Color:
        """Linear RGB of a property, each channel limited to [0, high]."""
        values = entry.numbers(key, 3) or (default, default, default)
        red, green, blue = (
            self.replaced(f"{_name(entry, key)}[{index}]", value, min(max(value, 0.0), high))
            for index, value in enumerate(values)
        )
        return red, green, blue

    def replaced(self, name: str, value: float, used: float) -> float:
        """Record a value that is replaced by another, and return the substitute."""
        if not math.isclose(used, value, rel_tol=_ROUNDING):
            self.changed.append(f"{self.material!r} {name} {value:g} (used: {used:g})")
        return used


def factor_notices(changed: Sequence[str]) -> list[str]:
    """At most one line, which names the first values of a file that are outside their ranges."""
    if not changed:
        return []
    more = len(changed) - _MAX_NAMED
    rest = f", and {more} more" if more > 0 else ""
    return [f"factors of materials out of range: {', '.join(changed[:_MAX_NAMED])}{rest}"]


def _name(entry: JsonObject, key: str) -> str:
    """Key, with the texture that it belongs to."""
    parent = entry.place.rpartition(".")[2]
    return f"{parent}.{key}" if parent.endswith("Texture") else key
