"""Cameras whose parameters are the fields of their dataclass."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from omnisim.cameras.parameters import check_size, number, numbers, point, whole_number, word

_READERS = {
    "int": whole_number,
    "float": number,
    "str": word,
    "tuple[float, float]": point,
    "tuple[float, ...]": numbers,
}


@dataclass(frozen=True)
class ParametricCamera:
    """Size of a picture, and parameters from and to JSON for all fields of the subclass.

    Fields are of the types that `_READERS` lists. A field whose name ends in `_rad` is given in
    degrees, under a key that ends in `_deg`.

    Attributes:
        width_px, height_px: size of the picture.

    Raises:
        OpticsError: a size that is not positive.
    """

    width_px: int
    height_px: int
    model: ClassVar[str]

    def __post_init__(self) -> None:
        check_size(self)

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> Self:
        """Make the camera that `parameters()` describes.

        Raises:
            OpticsError: naming the key and what was wanted.
        """
        values = {}
        for field in dataclasses.fields(cls):
            value = _READERS[str(field.type)](parameters, _key(field.name))
            values[field.name] = _map(math.radians, value) if _is_angle(field.name) else value
        return cls(**values)

    def parameters(self) -> dict[str, float | int | str | list[float]]:
        """The camera for the picture's metadata."""
        told = {"model": self.model}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            value = _map(math.degrees, value) if _is_angle(field.name) else value
            told[_key(field.name)] = list(value) if isinstance(value, tuple) else value
        return told


def _is_angle(name: str) -> bool:
    return name.endswith("_rad")


def _key(name: str) -> str:
    return name.removesuffix("_rad") + "_deg" if _is_angle(name) else name


def _map(convert: Any, value: Any) -> Any:
    return tuple(map(convert, value)) if isinstance(value, tuple) else convert(value)
