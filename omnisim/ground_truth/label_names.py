"""Labels: names and colors of class and instance IDs."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from omnisim.core.short_repr import counted, short_repr

if TYPE_CHECKING:  # channel and class names alone do not require NumPy
    import numpy as np
    from numpy.typing import NDArray

    from omnisim.core.arrays import Bytes

NOTHING = 0  # class and instance ID of pixels without a hit
_GOLDEN = 0.61803398875  # hue step that keeps all hues well apart
_MAX_ID = 2**32 - 1  # maximum of uint32, the channels' type


@dataclass(frozen=True)
class ClassLabel:
    """Semantic class: value in the channel, name, and 8-bit sRGB color for images."""

    id: int
    name: str
    color: tuple[int, int, int]


@dataclass(frozen=True)
class InstanceLabel:
    """Instance: all parts with the same name, of a class, in a dynamic object; None: static."""

    id: int
    name: str
    class_id: int
    object_name: str | None = None


@dataclass(frozen=True)
class Labels:
    """Classes and instances of a scene."""

    classes: tuple[ClassLabel, ...]  # classes in order of ID, without `NOTHING`
    instances: tuple[InstanceLabel, ...]  # instances with IDs from 1 in order, without `NOTHING`
    source: str  # origin of the classes: "table", or "names" of the instances
    unlabeled: tuple[str, ...] = ()  # names without a class in the table

    def __repr__(self) -> str:
        classes = counted(len(self.classes), "class", "classes")
        instances = counted(len(self.instances), "instance")
        return short_repr(self, classes, instances, f"source {self.source!r}")

    @cached_property
    def class_of_instance(self) -> NDArray[np.uint16]:
        """Class ID of each instance ID (n + 1,), starting with `NOTHING`."""
        import numpy as np

        return np.array([NOTHING, *(i.class_id for i in self.instances)], dtype=np.uint16)

    @cached_property
    def class_colors(self) -> Bytes:
        """Colors (largest ID + 1, 3) of the classes; black for unused IDs."""
        import numpy as np

        colors = np.zeros((max((c.id for c in self.classes), default=0) + 1, 3), dtype=np.uint8)
        for label in self.classes:
            colors[label.id] = label.color
        return colors

    def notices(self) -> tuple[str, ...]:
        """Notices about labels that a label table would improve."""
        if self.source == "names":
            return (
                "the scene has no labels: classes are the instances' names without numbers; "
                "a [[labels]] table in its TOML, or --labels FILE, is more accurate",
            )
        if self.unlabeled:
            count, first = len(self.unlabeled), self.unlabeled[0]
            return (f"no label for {count} instances, such as {first!r}: they are 'unlabeled'",)
        return ()

    @classmethod
    def from_json(cls, content: Any) -> Labels:
        """Labels from a table written by `to_json`.

        Raises:
            KeyError, TypeError, ValueError: an invalid table.
        """
        classes = [
            ClassLabel(_id(row["id"]), str(row["name"]), _color(row["color"]))
            for row in content["classes"]
            if row["id"] != NOTHING
        ]
        instances = [
            InstanceLabel(_id(row["id"]), str(row["name"]), _id(row["class"]), row.get("object"))
            for row in content["instances"]
        ]
        if [label.id for label in instances] != list(range(1, 1 + len(instances))):
            raise ValueError("expected instances 1, 2, and so on")
        return cls(tuple(classes), tuple(instances), str(content["classes_from"]))

    def to_json(self) -> dict[str, Any]:
        """Names and palette as JSON-compatible values."""
        return {
            "classes_from": self.source,
            "classes": [
                {"id": NOTHING, "name": "nothing", "color": [0, 0, 0]},
                *({"id": c.id, "name": c.name, "color": list(c.color)} for c in self.classes),
            ],
            "instances": [
                {"id": i.id, "name": i.name, "class": i.class_id}
                | ({} if i.object_name is None else {"object": i.object_name})
                for i in self.instances
            ],
        }


def _id(value: Any) -> int:
    if not isinstance(value, int) or not 0 <= value <= _MAX_ID:
        raise ValueError("expected a whole number")
    return value


def _color(values: Any) -> tuple[int, int, int]:
    red, green, blue = map(_id, values)
    return red, green, blue


def distinct_color(number: int) -> tuple[int, int, int]:
    """Deterministic 8-bit sRGB color, distinct from those of the neighboring numbers."""
    hue = (0.08 + number * _GOLDEN) % 1.0
    saturation, value = 0.55 + 0.15 * (number % 3), 0.95 - 0.18 * (number // 3 % 3)
    red, green, blue = colorsys.hsv_to_rgb(hue, saturation, value)
    return round(255 * red), round(255 * green), round(255 * blue)
