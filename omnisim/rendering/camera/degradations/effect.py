"""Effects of a camera on light: parameters, GPU passes and a NumPy reference."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats32
from omnisim.core.files.parameters import NotNegative, Number, Parameters
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

MAX_EV = 30.0
Ev = Annotated[Number, Field(ge=-MAX_EV, le=MAX_EV)]
Count = Annotated[int, Field(strict=True, ge=0, le=10_000)]
Rgb = tuple[NotNegative, NotNegative, NotNegative]


class Effect(Parameters):
    """Base of the tables in `[degradation]`; `files`: keys that name files beside its file."""

    files: ClassVar[tuple[str, ...]] = ()

    def scaled(self, scale: float) -> Self:
        """Effect on an image `scale` times as large: lengths in pixels grow."""

        def times(lengths: Any) -> Any:
            if isinstance(lengths, tuple):
                return tuple(times(length) for length in lengths)
            return scale * lengths

        names = [key.name for key in dataclasses.fields(self) if key.name.endswith("_px")]
        lengths: dict[str, Any] = {name: times(getattr(self, name)) for name in names}
        return dataclasses.replace(self, **lengths) if lengths else self


@dataclass(frozen=True)
class Shot:
    """Conditions of one image."""

    exposure_factors: tuple[float, float, float] = (1.0, 1.0, 1.0)  # of red, green and blue light
    exposure_s: float = 0.0  # exposure time of a row; 0: instantaneous
    noise_key: int = 0  # key of the camera's random numbers
    frame_number: int = 0  # number of the image, for its noise


DEFAULT_SHOT = Shot()


class OpticalEffect(Effect, ABC):
    """Effect of mirror or lens on linear light, before the shutter."""

    @abstractmethod
    def steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """GPU passes."""

    @abstractmethod
    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""


class SensorEffect(Effect, ABC):
    """Effect of sensor and processor on a linear image, after the shutter."""

    @abstractmethod
    def steps(self, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT) -> list[EffectStep]:
        """GPU passes; exposure factors and frame number are set as uniforms for each frame."""

    @abstractmethod
    def apply(
        self, image: LinearImage, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT
    ) -> LinearImage:
        """Reference in NumPy."""


def weighted_mean(
    image: LinearImage, reach: int, weight: Callable[[int, int], Floats32]
) -> LinearImage:
    """Weighted mean of the valid pixels around each valid pixel, which others do not darken.

    Args:
        image: image.
        reach: largest offset along rows and columns.
        weight: weights (height, width) of the pixels at an offset, right and down.
    """
    height, width = image.shape[:2]
    valid = image[..., 3] > 0.5
    light = np.concatenate((image[..., :3], np.ones((height, width, 1))), axis=-1)
    padded = np.pad(light * valid[..., None], ((reach, reach), (reach, reach), (0, 0)))
    total = np.zeros((height, width, 4))
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            near = padded[reach + down :, reach + right :][:height, :width]
            total += weight(right, down)[..., None] * near
    result = image.copy()
    result[valid, :3] = total[valid, :3] / total[valid, 3:]
    return result
