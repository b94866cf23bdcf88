"""Cameras whose parameters are the fields of their dataclass."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.parameters import check_size, number, numbers, point, whole_number, word
from omnisim.frames import BASE_FROM_OPTICAL_LOOKING_AHEAD

Camera = TypeVar("Camera")
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
    model_name: ClassVar[str]
    rig_from_optical: ClassVar[NDArray[np.float64]] = BASE_FROM_OPTICAL_LOOKING_AHEAD

    def __post_init__(self) -> None:
        check_size(self)

    def scaled(self, scale: float) -> Self:
        """The same view in a picture `scale` times as large; sizes are rounded.

        Fields whose name ends in `_px` are lengths in the picture, or its principal point.
        """
        return scaled_lengths(self, scale)

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
        told = {"model": self.model_name}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            value = _map(math.degrees, value) if _is_angle(field.name) else value
            told[_key(field.name)] = list(value) if isinstance(value, tuple) else value
        return told


def scaled_lengths(camera: Camera, scale: float) -> Camera:
    """A dataclass with all lengths in pixels `scale` times as long, sizes rounded."""
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(camera):
        value = getattr(camera, field.name)
        if field.name in ("width_px", "height_px"):
            changes[field.name] = round(value * scale)
        elif field.name == "principal_point_px":  # pixels count from the middle of the first one
            changes[field.name] = tuple((one + 0.5) * scale - 0.5 for one in value)
        elif field.name.endswith("_px"):
            changes[field.name] = _map(lambda one: one * scale, value)
    return dataclasses.replace(camera, **changes)


def _is_angle(name: str) -> bool:
    return name.endswith("_rad")


def _key(name: str) -> str:
    return name.removesuffix("_rad") + "_deg" if _is_angle(name) else name


def _map(convert: Any, value: Any) -> Any:
    return tuple(map(convert, value)) if isinstance(value, tuple) else convert(value)
