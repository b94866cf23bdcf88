"""Cameras whose parameters are their dataclass fields."""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras.camera import CameraParameters, Pixels, Rays, Uniforms
from omnisim.cameras.model_parameters import (
    check_limits,
    number,
    numbers,
    point,
    text,
    whole_number,
)
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import OpticsError
from omnisim.core.short_repr import short_repr

_READERS: dict[str, Callable[[Mapping[str, Any], str], Any]] = {
    "int": whole_number,
    "float": number,
    "str": text,
    "tuple[float, float]": point,
    "tuple[float, ...]": numbers,
}


@dataclass(frozen=True)
class ParametricCamera(ABC):
    """Base of camera models: derives all but the projection from the subclass's fields.

    Fields have the types listed in `_READERS`. A field whose name ends in `_rad` is serialized in
    degrees, under a key that ends in `_deg`; one that ends in `_px` is a length in the image.

    Attributes:
        width_px, height_px: image size.
        model_name: stem of the model's files.
        largest_theta_rad: upper limit of the parameter θ_max, for models that have it.
        added_later: parameters that the metadata of older images lack; their defaults apply.

    Raises:
        OpticsError: a value has the wrong type, a size is not positive, a number is not finite, or
            θ_max is outside its limits.
    """

    width_px: int
    height_px: int
    model_name: ClassVar[str]
    _rig_from_optical: ClassVar[NDArray[np.float64]] = BASE_FROM_OPTICAL_LOOKING_AHEAD
    largest_theta_rad: ClassVar[float] = math.pi
    added_later: ClassVar[frozenset[str]] = frozenset()

    if TYPE_CHECKING:  # a field of nearly all models; at run time it would be the field's default

        @property
        def principal_point_px(self) -> tuple[float, float]: ...  # noqa: D102

    def __init_subclass__(cls) -> None:
        setattr(cls, "__repr__", ParametricCamera.__repr__)  # noqa: B010  not the dataclass's own

    def __repr__(self) -> str:
        size, *others = f"{self.width_px} × {self.height_px} px", *dataclasses.fields(self)[2:]
        values = [f"{field.name}={_short(getattr(self, field.name))}" for field in others]
        return short_repr(self, size, *values)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            if read := _READERS.get(str(field.type)):
                object.__setattr__(self, field.name, read(self.__dict__, field.name))
        if self.width_px < 1 or self.height_px < 1:
            raise OpticsError(
                f"camera: size: expected at least 1, got {self.width_px} × {self.height_px}"
            )
        if hasattr(self, "theta_max_rad"):
            largest = self.largest_theta_rad
            expected = f"more than 0 and at most {largest:g} ({math.degrees(largest):g}°)"
            check_limits(self, "theta_max_rad", 1e-6, largest, expected)

    @property
    def rig_from_optical(self) -> NDArray[np.float64]:
        """Orientation (3, 3) in a level rig: looking ahead, or up into a mirror."""
        return self._rig_from_optical

    @abstractmethod
    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2): unit directions in the optical frame; valid in the domain."""

    @abstractmethod
    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid in the domain."""

    @abstractmethod
    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""

    def scaled(self, scale: float) -> Self:
        """The same view in an image `scale` times as large; sizes are rounded."""
        changes: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in ("width_px", "height_px"):
                changes[field.name] = round(value * scale)
            elif field.name == "principal_point_px":  # measured from the center of the first pixel
                changes[field.name] = tuple((one + 0.5) * scale - 0.5 for one in value)
            elif field.name.endswith("_px"):
                changes[field.name] = _map(lambda one: one * scale, value)
        return dataclasses.replace(self, **changes)

    def ending_at(self, theta_max_rad: float) -> Self | None:
        """The same camera with another θ_max, or None if the model has no such parameter.

        Raises:
            OpticsError: θ_max is outside its limits.
        """
        if "theta_max_rad" not in {field.name for field in dataclasses.fields(self)}:
            return None
        changes: dict[str, Any] = {"theta_max_rad": theta_max_rad}
        return dataclasses.replace(self, **changes)

    @property
    def domain_limit_rad(self) -> float | None:
        """Angle from the axis at which a parameter ends the domain, or None."""
        limit = float(getattr(self, "theta_max_rad", math.pi))
        return None if limit == math.pi else limit

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> Self:
        """Build the camera from its `parameters()`.

        Raises:
            OpticsError: a parameter is invalid; names the key, the actual and the expected value.
        """
        values: dict[str, Any] = {}
        for field in dataclasses.fields(cls):
            if field.name in cls.added_later and field.name not in parameters:
                continue
            value = _READERS[str(field.type)](parameters, _key(field.name))
            values[field.name] = _map(math.radians, value) if _is_angle(field.name) else value
        return cls(**values)

    def parameters(self) -> CameraParameters:
        """Model name and parameters, for image metadata."""
        named: CameraParameters = {"model": self.model_name}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            value = _map(math.degrees, value) if _is_angle(field.name) else value
            named[_key(field.name)] = list(value) if isinstance(value, tuple) else value
        return named


def _short(value: Any) -> str:
    """Text of a parameter in 6 digits; a long list becomes its count."""
    if isinstance(value, tuple):
        return f"{len(value)} values" if len(value) > 4 else f"({', '.join(map(_short, value))})"
    return f"{value:z.6g}" if isinstance(value, float) else str(value)


def _is_angle(name: str) -> bool:
    return name.endswith("_rad")


def _key(name: str) -> str:
    return name.removesuffix("_rad") + "_deg" if _is_angle(name) else name


def _map(convert: Callable[[float], float], value: Any) -> Any:
    return tuple(map(convert, value)) if isinstance(value, tuple) else convert(value)
