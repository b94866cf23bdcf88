"""Reflectance and tint of a mirror.

Source: manufacturers' ranges for coated mirrors; the value of a particular mirror is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.core.files.parameters import Number
from omnisim.rendering.camera.degradations.effect import OpticalEffect, Rgb
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)


@dataclass(frozen=True)
class Reflectance(OpticalEffect, name="degradation.reflectance"):
    """Mirror reflectance: light is multiplied by `reflectance` and by the `tint` of each color."""

    reflectance: Annotated[Number, Field(gt=0.0, le=1.0)] = 0.9
    """Share of light reflected; typically 0.9 for bare aluminum, 0.95 or more for silver."""
    tint: Rgb = (1.0, 1.0, 1.0)
    """Factors of R, G, B; slightly warm for nickel and chrome."""

    @property
    def factors(self) -> tuple[float, float, float]:
        """Factors of red, green and blue."""
        red, green, blue = (self.reflectance * part for part in self.tint)
        return red, green, blue

    def steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """One GPU pass."""
        return [EffectStep("color_factors", {"u_factors": self.factors})]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        return multiplied(image, self.factors)


def multiplied(image: LinearImage, factors: tuple[float, float, float]) -> LinearImage:
    """Image with its colors multiplied: the reference of `color_factors.frag`."""
    return image * np.array([*factors, 1.0], dtype=np.float32)
