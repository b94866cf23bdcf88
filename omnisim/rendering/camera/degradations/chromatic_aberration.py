"""Lateral chromatic aberration: an individual scale per color.

A value of 0.002 shifts by 0.4 px at a radius of 180 px: an assumption.

Source: Kang, "Automatic removal of chromatic aberration from a single image", CVPR 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.bilinear import corner_and_weights, interpolate
from omnisim.core.files.parameters import Number
from omnisim.rendering.camera.degradations.effect import OpticalEffect
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry, LinearImage
from omnisim.rendering.opengl.degradation.step import Step

Scale = Annotated[Number, Field(ge=0.9, le=1.1)]


@dataclass(frozen=True)
class ChromaticAberration(OpticalEffect, name="degradation.chromatic_aberration"):
    """Red and blue images, scaled about the optical axis by bilinear interpolation.

    Only valid neighbors of a sampled position count. Without any, at the border of the image,
    the pixel keeps its own color.
    """

    red_scale: Scale = 1.0
    """Scale of the red image relative to green; typically 1 ± 0.0005 to 0.002."""
    blue_scale: Scale = 1.0
    """Scale of the blue image relative to green; typically 1 ± 0.0005 to 0.002."""

    def steps(self, geometry: ImageGeometry) -> list[Step]:
        """One GPU pass."""
        inverse = (1.0 / self.red_scale, 1.0, 1.0 / self.blue_scale)
        uniforms = {"u_center_px": geometry.center_px, "u_inverse_scales": inverse}
        return [Step("chromatic_aberration", uniforms)]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        result = image.copy()
        for channel, scale in ((0, self.red_scale), (2, self.blue_scale)):
            positions = geometry.offsets_px() * np.float32(1.0 / scale)
            positions += np.array(geometry.center_px, dtype=np.float32)
            sampled = _sample_valid(image[..., channel], image[..., 3], positions)
            result[..., channel] = np.where(
                np.isnan(sampled) | (image[..., 3] < 0.5), image[..., channel], sampled
            )
        return result


def _sample_valid(
    values: NDArray[np.float32], valid: NDArray[np.float32], positions_px: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Values (height, width) interpolated between valid neighbors of positions; NaN: none."""
    weight = np.pad((valid > 0.5).astype(np.float32), 1)  # pixels beyond the border are invalid
    corner, weights, _ = corner_and_weights(positions_px + np.float32(1.0), weight.shape)
    total = interpolate(weight * np.pad(values, 1), corner, weights)
    share = interpolate(weight, corner, weights)
    return np.where(share > 0.0, total / np.where(share > 0.0, share, 1.0), np.nan)
