"""Defocus: discs in place of points, wider toward the rim of a curved mirror.

The radius grows with the square of the image radius, as the depth of a mirror's virtual image
does near its axis. Up to the rim of the mirror this is an assumption. A disc of less than 0.5 px
radius lies within one pixel.

Source: Swaminathan, "Focus in catadioptric imaging systems", ICCV 2007: virtual images behind a
curved mirror lie at different depths, so that not all of them can be in focus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats32
from omnisim.core.files.parameters import Number, Typical
from omnisim.rendering.camera.degradations.effect import OpticalEffect, weighted_mean
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

MAX_PX = 32.0  # 4225 samples per pixel
MIN_PX = 0.5  # a disc of this radius lies within one pixel
STRIPS = 8  # strips per pixel on the edge of a disc: accurate to a few thousandths of the pixel
Radius = Annotated[Number, Field(ge=0.0, le=MAX_PX)]


@dataclass(frozen=True)
class Defocus(OpticalEffect, name="degradation.defocus"):
    """Mean of the valid pixels in the disc around each pixel.

    A pixel on the disc's edge is weighted by its share inside. Pixels outside of the image or its
    mask are ignored, so no black bleeds in.
    """

    center_defocus_px: Annotated[Radius, Typical(0.0, 2.0, "in focus there")] = 0.0
    """Radius in pixels of the disc on the optical axis."""
    rim_defocus_px: Annotated[Radius, Typical(0.5, 3.0)] = 1.0
    """Radius in pixels of the disc at half of the image's shorter side."""

    def radii_px(self, geometry: ImageGeometry) -> Floats32:
        """Radius (height, width) of the disc at each pixel."""
        first, last = np.float32(self.center_defocus_px), np.float32(self.rim_defocus_px)
        radii = first + (last - first) * geometry.squared_radii()
        return radii.clip(np.float32(MIN_PX), np.float32(MAX_PX))

    def steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """One GPU pass."""
        uniforms = {
            "u_center_defocus_px": self.center_defocus_px,
            "u_rim_defocus_px": self.rim_defocus_px,
            "u_limits_px": (MIN_PX, MAX_PX),
            "u_strips": STRIPS,
            **geometry.uniforms(),
        }
        return [EffectStep("defocus", uniforms)]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        radii = self.radii_px(geometry)
        reach = int(np.ceil(radii.max() + 0.5))
        return weighted_mean(image, reach, lambda right, down: covered_share(right, down, radii))


def covered_share(right_px: int, down_px: int, radius_px: Floats32) -> Floats32:
    """Fraction (...) of a pixel that lies in a disc around another pixel.

    The pixel is cut into strips along its shorter offset; the chord across them is exact.

    Args:
        right_px, down_px: offset from the center of the disc to the pixel.
        radius_px: (...) radius of the disc.
    """
    far, near = max(abs(right_px), abs(down_px)), min(abs(right_px), abs(down_px))
    share = np.zeros_like(radius_px)
    for strip in range(STRIPS):
        across = np.float32(near + (strip + 0.5) / STRIPS - 0.5)
        chord = np.sqrt(np.maximum(radius_px * radius_px - across * across, np.float32(0.0)))
        low = np.maximum(np.float32(far - 0.5), -chord)
        share += np.maximum(np.minimum(np.float32(far + 0.5), chord) - low, np.float32(0.0))
    return share * np.float32(1.0 / STRIPS)
