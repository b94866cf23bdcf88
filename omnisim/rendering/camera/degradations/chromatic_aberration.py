"""Lateral chromatic aberration: an individual scale per color, and a polynomial of the radius.

A value of 0.002 shifts by 0.4 px at a radius of 180 px: an assumption.

Source: Kang, "Automatic removal of chromatic aberration from a single image", CVPR 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.bilinear import corner_and_weights, interpolate
from omnisim.core.files.parameters import Number
from omnisim.rendering.camera.degradations.effect import OpticalEffect
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

MAX_COEFFICIENTS, MAX_OFFSET_PX = 4, 64.0
Scale = Annotated[Number, Field(ge=0.9, le=1.1)]
Offset = Annotated[Number, Field(ge=-MAX_OFFSET_PX, le=MAX_OFFSET_PX)]
Offsets = Annotated[tuple[Offset, ...], Field(max_length=MAX_COEFFICIENTS)]


@dataclass(frozen=True)
class ChromaticAberration(OpticalEffect, name="degradation.chromatic_aberration"):
    """Red and blue images, moved along the radius by bilinear interpolation.

    The offsets are polynomials of the distorted image radius, in units of half of the image's
    shorter side. They are added to the scales. Only valid neighbors of a sampled position count.
    Without any, at the border of the image, the pixel keeps its own color.
    """

    red_scale: Scale = 1.0
    """Scale of the red image relative to green; typically 1 ± 0.0005 to 0.002."""
    blue_scale: Scale = 1.0
    """Scale of the blue image relative to green; typically 1 ± 0.0005 to 0.002."""
    red_offsets_px: Offsets = ()
    """Coefficients of the relative radius, its square and so on, up to the fourth power: pixels by
    which red is farther out than green; typically up to ±1 in sum."""
    blue_offsets_px: Offsets = ()
    """The same coefficients of blue."""

    def steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """One GPU pass."""
        uniforms = geometry.uniforms()
        for color, scale, offsets_px in self._colors():
            uniforms[f"u_{color}_inverse_scale"] = 1.0 / scale
            uniforms[f"u_{color}_offsets"] = _relative(offsets_px, geometry)
        return [EffectStep("chromatic_aberration", uniforms)]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        result = image.copy()
        offsets = geometry.offsets_px()
        radii = np.sqrt(geometry.squared_radii())[..., None]
        for channel, (_, scale, offsets_px) in zip((0, 2), self._colors(), strict=True):
            first, *others = np.array(_relative(offsets_px, geometry), dtype=np.float32)
            share = first + radii * (others[0] + radii * (others[1] + radii * others[2]))
            positions = offsets * (np.float32(1.0 / scale) - share)
            positions += np.array(geometry.center_px, dtype=np.float32)
            sampled = _sample_valid(image[..., channel], image[..., 3], positions)
            result[..., channel] = np.where(
                np.isnan(sampled) | (image[..., 3] < 0.5), image[..., channel], sampled
            )
        return result

    def _colors(self) -> tuple[tuple[str, float, tuple[float, ...]], ...]:
        """Name, scale and offsets of red and blue."""
        return (
            ("red", self.red_scale, self.red_offsets_px),
            ("blue", self.blue_scale, self.blue_offsets_px),
        )


def _relative(offsets_px: tuple[float, ...], geometry: ImageGeometry) -> tuple[float, ...]:
    """Coefficients (4,) of the outward offset of a color, divided by the radius."""
    missing = (0.0,) * (MAX_COEFFICIENTS - len(offsets_px))
    return tuple(offset / geometry.radius_unit_px for offset in (*offsets_px, *missing))


def _sample_valid(values: Floats32, valid: Floats32, positions_px: Floats32) -> Floats:
    """Values (height, width) interpolated between valid neighbors of positions; NaN: none."""
    weight = np.pad((valid > 0.5).astype(np.float32), 1)  # pixels beyond the border are invalid
    corner, weights, _ = corner_and_weights(positions_px + np.float32(1.0), weight.shape)
    total = interpolate(weight * np.pad(values, 1), corner, weights)
    share = interpolate(weight, corner, weights)
    return np.where(share > 0.0, total / np.where(share > 0.0, share, 1.0), np.nan)
