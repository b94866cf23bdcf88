"""Effects of a camera on light: parameters, GPU passes and a NumPy reference."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field

from omnisim.core.files.parameters import NotNegative, Number, Parameters
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry, LinearImage, Step

MAX_EV = 30.0
Ev = Annotated[Number, Field(ge=-MAX_EV, le=MAX_EV)]
Count = Annotated[int, Field(strict=True, ge=0, le=10_000)]
Rgb = tuple[NotNegative, NotNegative, NotNegative]


class Effect(Parameters):
    """Base of the tables in `[degradation]`; `files`: keys that name files beside its file."""

    files: ClassVar[tuple[str, ...]] = ()

    def scaled(self, scale: float) -> Self:
        """Effect on an image `scale` times as large: lengths in pixels grow."""
        lengths: dict[str, Any] = {
            field.name: _scaled(getattr(self, field.name), scale)
            for field in dataclasses.fields(self)
            if field.name.endswith("_px")
        }
        return dataclasses.replace(self, **lengths) if lengths else self


def _scaled(lengths: Any, scale: float) -> Any:
    """Length, or rows of lengths, times a scale."""
    if isinstance(lengths, tuple):
        return tuple(_scaled(length, scale) for length in lengths)
    return scale * lengths


@dataclass(frozen=True)
class Shot:
    """Conditions of one image."""

    # factors of red, green and blue light
    exposure_factors: tuple[float, float, float] = (1.0, 1.0, 1.0)
    exposure_s: float = 0.0  # exposure time of a row; 0: instantaneous
    noise_key: int = 0  # key of the camera's random numbers
    frame_number: int = 0  # number of the image, for its noise


DEFAULT_SHOT = Shot()


class OpticalEffect(Effect, ABC):
    """Effect of mirror or lens on linear light, before the shutter."""

    @abstractmethod
    def steps(self, geometry: ImageGeometry) -> list[Step]:
        """GPU passes."""

    @abstractmethod
    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""


class SensorEffect(Effect, ABC):
    """Effect of sensor and processor on a linear image, after the shutter."""

    @abstractmethod
    def steps(self, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT) -> list[Step]:
        """GPU passes; exposure factors and frame number are set as uniforms for each frame."""

    @abstractmethod
    def apply(
        self, image: LinearImage, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT
    ) -> LinearImage:
        """Reference in NumPy."""
