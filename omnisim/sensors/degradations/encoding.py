"""Gamma and quantisation: linear light to the values of the file.

Source: IEC 61966-2-1, for sRGB.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from omnisim.gpu.degradation.step import Step
from omnisim.parameters import IntOrFloat, described
from omnisim.sensors.degradations.effect import Effect
from omnisim.sensors.degradations.picture_geometry import LinearPicture
from omnisim.srgb import srgb_from_linear

Gamma = Annotated[
    Literal["srgb"] | Annotated[IntOrFloat, Field(ge=0.1, le=10.0)],
    described("a number from 0.1 to 10 or 'srgb'"),
]


@dataclass(frozen=True)
class Encoding(Effect, name="degradation.encoding"):
    """Clipping to [0, 1], the transfer function, and rounding to whole steps."""

    gamma: Gamma = "srgb"
    """Transfer function: "srgb", or values to the power of 1/gamma, 1 for machine vision."""
    bit_depth: Annotated[int, Field(strict=True, ge=1, le=8)] = 8
    """Bits a channel."""

    def step(self) -> Step:
        """The pass on the GPU, into 8 bits."""
        exponent = 0.0 if self.gamma == "srgb" else 1.0 / self.gamma
        uniforms = {"u_exponent": exponent, "u_largest": float(2**self.bit_depth - 1)}
        return Step("encoding", uniforms)

    def apply(self, picture: LinearPicture) -> LinearPicture:
        """The reference in NumPy, as numbers in [0, 1]."""
        values = np.clip(picture[..., :3].astype(np.float64), 0.0, 1.0)
        encoded = srgb_from_linear(values) if self.gamma == "srgb" else values ** (1 / self.gamma)
        largest = 2**self.bit_depth - 1
        result = picture.copy()
        result[..., :3] = np.floor(encoded * largest + 0.5) / largest
        return result
