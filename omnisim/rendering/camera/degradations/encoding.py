"""Tone curve, gamma and quantization: from linear light to file values.

Source: IEC 61966-2-1, for sRGB; Khronos Group, "PBR Neutral Tone Mapper Specification", 2024.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.files.parameters import IntOrFloat, described
from omnisim.core.srgb import srgb_from_linear
from omnisim.rendering.camera.degradations.effect import Effect
from omnisim.rendering.camera.degradations.image_geometry import LinearImage
from omnisim.rendering.opengl.degradation.step import Step

Gamma = Annotated[
    Literal["srgb"] | Annotated[IntOrFloat, Field(ge=0.1, le=10.0)],
    described("a number from 0.1 to 10 or 'srgb'"),
]


# Neutral curve: luminance where compression starts, and desaturation rate of highlights.
_START, _DESATURATION, _TOE, _F90 = 0.76, 0.15, 0.08, 0.04


def neutral(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colors (..., 3) on Khronos's PBR Neutral curve; the twin of shaders/common/neutral.glsl."""
    least = np.maximum(linear.min(axis=-1, keepdims=True), 0.0)
    offset = np.where(least < _TOE, least - 6.25 * least * least, _F90)
    colors = linear - offset
    peak = colors.max(axis=-1, keepdims=True)
    room = 1.0 - _START
    lowered = 1.0 - room * room / np.maximum(peak + room - _START, room)
    gray = 1.0 - 1.0 / (_DESATURATION * np.maximum(peak - lowered, 0.0) + 1.0)
    scaled = colors * lowered / np.maximum(peak, _START)
    compressed: NDArray[np.float64] = scaled + gray * (lowered - scaled)
    return np.where(peak < _START, colors, compressed)


@dataclass(frozen=True)
class Encoding(Effect, name="degradation.encoding"):
    """Tone curve, clipping to [0, 1], the transfer function, and rounding to whole steps."""

    gamma: Gamma = "srgb"
    """Transfer function: "srgb", or values to the power of 1/gamma; 1 for machine vision."""
    bit_depth: Annotated[int, Field(strict=True, ge=1, le=8)] = 8
    """Bits per channel."""
    tone_curve: Literal["clip", "neutral"] = "clip"
    """Tone curve, before the transfer function. "clip": none, light above 1 is white; "neutral":
    Khronos's PBR Neutral, which keeps base colors and compresses highlights."""

    def step(self) -> Step:
        """GPU pass into 8 bits."""
        exponent = 0.0 if self.gamma == "srgb" else 1.0 / self.gamma
        uniforms = {
            "u_exponent": exponent,
            "u_largest": float(2**self.bit_depth - 1),
            "u_neutral": float(self.tone_curve == "neutral"),
        }
        return Step("encoding", uniforms)

    def apply(self, image: LinearImage) -> LinearImage:
        """Reference in NumPy, with values in [0, 1]."""
        light = image[..., :3].astype(np.float64)
        values = np.clip(neutral(light) if self.tone_curve == "neutral" else light, 0.0, 1.0)
        encoded = srgb_from_linear(values) if self.gamma == "srgb" else values ** (1 / self.gamma)
        largest = 2**self.bit_depth - 1
        result = image.copy()
        result[..., :3] = np.floor(encoded * largest + 0.5) / largest
        return result
