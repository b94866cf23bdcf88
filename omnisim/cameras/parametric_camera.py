"""Cameras whose parameters are their fields."""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from omnisim.cameras.camera import CameraParameters, Pixels, Rays, Uniforms
from omnisim.core.arrays import Floats
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import Number, Parameters, Typical, mapped, parse_table
from omnisim.core.short_repr import short_repr

# Far beyond any camera; squares of derived values still fit into a float.
MAX_PX, MAX_COEFFICIENT = 1e15, 1e60
PixelCount = Annotated[int, Field(strict=True, ge=1)]
Pixel = Annotated[Number, Field(ge=-MAX_PX, le=MAX_PX)]
PrincipalPoint = tuple[Pixel, Pixel]
Coefficient = Annotated[Number, Field(ge=-MAX_COEFFICIENT, le=MAX_COEFFICIENT)]
Coefficients = tuple[Coefficient, ...]
ThetaMax = Annotated[Number, Field(gt=0.0)]  # a model has its own upper limit
WideTheta = Annotated[ThetaMax, Typical(math.radians(90.0), math.radians(110.0))]


@dataclass(frozen=True)
class ParametricCamera(Parameters, ABC, name="camera"):
    """Base of camera models: derives all but the projection from the subclass's fields.

    A field whose name ends in `_px` is a length in the image.

    Attributes:
        model_name: stem of the model's files.
        largest_theta_rad: upper limit of the parameter θ_max, for models that have it.
        added_later: parameters that the metadata of older images lack; their defaults apply.

    Raises:
        OpticsError: a parameter has another type or is outside its limits.
    """

    width_px: PixelCount
    """Width of the image in pixels."""
    height_px: PixelCount
    """Height of the image in pixels."""
    model_name: ClassVar[str]
    _rig_from_optical: ClassVar[Floats] = BASE_FROM_OPTICAL_LOOKING_AHEAD
    largest_theta_rad: ClassVar[float] = math.pi
    added_later: ClassVar[frozenset[str]] = frozenset()

    if TYPE_CHECKING:  # a field of nearly all models; at run time it would be the field's default

        @property
        def principal_point_px(self) -> tuple[float, float]: ...  # noqa: D102

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        setattr(cls, "__repr__", ParametricCamera.__repr__)  # noqa: B010  not the dataclass's own

    def __repr__(self) -> str:
        size, *others = f"{self.width_px} × {self.height_px} px", *dataclasses.fields(self)[2:]
        values = [f"{field.name}={_short(getattr(self, field.name))}" for field in others]
        return short_repr(self, size, *values)

    def _check(self) -> None:
        super()._check()
        largest = self.largest_theta_rad
        if not 1e-6 <= getattr(self, "theta_max_rad", largest) <= largest:
            limits = f"more than 0 and at most {largest:g} ({math.degrees(largest):g}°)"
            raise self._error("theta_max_rad", limits)

    @property
    def rig_from_optical(self) -> Floats:
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
                changes[field.name] = mapped(lambda one: one * scale, value)
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
        keys = {cls.file_key(field.name): field.name for field in dataclasses.fields(cls)}
        given = {key: parameters[key] for key in keys if key in parameters}
        for key, value in given.items():
            if isinstance(value, np.generic | np.ndarray):
                given[key] = value.tolist()
        camera = parse_table(given, cls, OpticsError, at="camera")
        for key, name in keys.items():  # metadata has the defaults, too
            if key not in given and name not in cls.added_later:
                raise OpticsError(f"camera.{key}: missing")
        return camera

    def parameters(self) -> CameraParameters:
        """Model name and parameters, for image metadata."""
        named: CameraParameters = {"model": self.model_name}
        for field in dataclasses.fields(self):
            value, key = getattr(self, field.name), self.file_key(field.name)
            value = mapped(math.degrees, value) if key != field.name else value
            named[key] = list(value) if isinstance(value, tuple) else value
        return named


def _short(value: Any) -> str:
    """Text of a parameter in 6 digits; a long list becomes its count."""
    if isinstance(value, tuple):
        return f"{len(value)} values" if len(value) > 4 else f"({', '.join(map(_short, value))})"
    return f"{value:z.6g}" if isinstance(value, float) else str(value)
