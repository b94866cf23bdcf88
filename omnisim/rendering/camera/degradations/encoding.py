"""Tone curve, gamma and quantization: from linear light to file values.

Source: IEC 61966-2-1, for sRGB; Khronos Group, "PBR Neutral Tone Mapper Specification", 2024.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.files.parameters import Fraction, IntOrFloat, Number, described
from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.rendering.camera.degradations.effect import Effect
from omnisim.rendering.camera.degradations.image_geometry import EffectStep, LinearImage

Gamma = Annotated[
    Literal["srgb"] | Annotated[IntOrFloat, Field(ge=0.1, le=10.0)],
    described("a number from 0.1 to 10 or 'srgb'"),
]

MAX_POINTS = 64
_BY_CURVE = -1.0  # exponent of the shader that means the curve
Point = tuple[Annotated[Number, Field(ge=0.0, le=16.0)], Fraction]
# Neutral curve: luminance where compression starts, and desaturation rate of highlights.
_START, _DESATURATION, _TOE, _F90 = 0.76, 0.15, 0.08, 0.04


def neutral(linear: Floats) -> Floats:
    """Colors (..., 3) on Khronos's PBR Neutral curve; the twin of shaders/common/neutral.glsl."""
    least = np.maximum(linear.min(axis=-1, keepdims=True), 0.0)
    offset = np.where(least < _TOE, least - 6.25 * least * least, _F90)
    colors = linear - offset
    peak = colors.max(axis=-1, keepdims=True)
    room = 1.0 - _START
    lowered = 1.0 - room * room / np.maximum(peak + room - _START, room)
    gray = 1.0 - 1.0 / (_DESATURATION * np.maximum(peak - lowered, 0.0) + 1.0)
    scaled = colors * lowered / np.maximum(peak, _START)
    compressed: Floats = scaled + gray * (lowered - scaled)
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
    curve: Annotated[tuple[Point, ...], Field(min_length=2, max_length=MAX_POINTS)] | None = None
    """Measured response in place of gamma: points of light, and the level that a camera gives it,
    from 0 to 1; linear between the points, constant beyond them."""

    def _check(self) -> None:
        points = self.curve or ()
        if any(after[0] <= before[0] or after[1] < before[1] for before, after in pairwise(points)):
            raise self._error("curve", "points in order of their light, with rising levels")

    def encoded(self, light: Floats) -> Floats:
        """Levels (...) from 0 to 1 of light (...), before rounding."""
        if self.curve is not None:
            lights, levels = zip(*self.curve, strict=True)
            return np.interp(light, lights, levels)
        values = np.clip(light, 0.0, 1.0)
        return srgb_from_linear(values) if self.gamma == "srgb" else values ** (1.0 / self.gamma)

    def linearized(self, levels: Floats) -> Floats:
        """Light (...) of levels (...) from 0 to 1."""
        if self.curve is not None:
            lights, values = zip(*self.curve, strict=True)
            return np.interp(levels, values, lights)
        return linear_from_srgb(levels) if self.gamma == "srgb" else levels**self.gamma

    def step(self) -> EffectStep:
        """GPU pass into 8 bits."""
        power = 0.0 if self.gamma == "srgb" else 1.0 / self.gamma
        points = self.curve or ((0.0, 0.0), (1.0, 1.0))
        curve = np.zeros((1, MAX_POINTS, 4), dtype=np.float32)
        curve[0, : len(points), :2] = points
        uniforms = {
            "u_exponent": power if self.curve is None else _BY_CURVE,
            "u_last_point": float(len(points) - 1),
            "u_largest": float(2**self.bit_depth - 1),
            "u_neutral": float(self.tone_curve == "neutral"),
        }
        return EffectStep("encoding", uniforms, {"u_curve": curve})

    def apply(self, image: LinearImage) -> LinearImage:
        """Reference in NumPy, with values in [0, 1]."""
        light = image[..., :3].astype(np.float64)
        encoded = self.encoded(neutral(light) if self.tone_curve == "neutral" else light)
        largest = 2**self.bit_depth - 1
        result = image.copy()
        result[..., :3] = np.floor(encoded * largest + 0.5) / largest
        return result


def eight_bits(image: LinearImage, encoding: Encoding | None) -> Bytes:
    """File values (height, width, 4) of a linear image; encoding None: an ideal camera's."""
    encoded = (encoding or Encoding()).apply(image)
    rgba: Bytes = np.rint(255.0 * encoded).astype(np.uint8)
    rgba[image[..., 3] < 0.5] = 0
    return rgba
