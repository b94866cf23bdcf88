"""Reflectance and tint of a mirror.

Source: makers' data of coated mirrors for the ranges; for any one mirror an assumption.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.core.files.parameters import Number
from omnisim.rendering.camera.degradations.effect import OpticalEffect, Rgb
from omnisim.rendering.camera.degradations.picture_geometry import LinearPicture, PictureGeometry
from omnisim.rendering.opengl.degradation.step import Step


@dataclass(frozen=True)
class Reflectance(OpticalEffect, name="degradation.reflectance"):
    """Mirror reflectance: the light is multiplied by `reflectance` and by the colour's `tint`."""

    reflectance: Annotated[Number, Field(gt=0.0, le=1.0)] = 0.9
    """Fraction of the light reflected; typically 0.9 bare aluminium, 0.95 or more silver."""
    tint: Rgb = (1.0, 1.0, 1.0)
    """Factors of R, G, B; a shade warmer for nickel and chrome."""

    @property
    def factors(self) -> tuple[float, float, float]:
        """Factors of red, green and blue."""
        red, green, blue = (self.reflectance * part for part in self.tint)
        return red, green, blue

    def steps(self, geometry: PictureGeometry) -> list[Step]:
        """One pass on the GPU."""
        return [Step("colour_factors", {"u_factors": self.factors})]

    def apply(self, picture: LinearPicture, geometry: PictureGeometry) -> LinearPicture:
        """The reference in NumPy."""
        return multiplied(picture, self.factors)


def multiplied(picture: LinearPicture, factors: tuple[float, float, float]) -> LinearPicture:
    """Picture with its colours multiplied: the reference of `colour_factors.frag`."""
    return picture * np.array([*factors, 1.0], dtype=np.float32)
