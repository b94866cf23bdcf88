"""Lateral chromatic aberration: each colour's picture has its own size.

| key | unit | typical |
| --- | --- | --- |
| red_scale | size of the red picture, the green one's being 1 | 1 ± 0.0005 to 0.002 |
| blue_scale | size of the blue picture | the same |

0.002 are 0.4 px at a radius of 180 px: an assumption.

Source: Kang, "Automatic removal of chromatic aberration from a single image", CVPR 2007.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.gpu.degradation.degradation_pass import Step
from omnisim.parameters import Number
from omnisim.sensors.degradations.effect import OpticalEffect
from omnisim.sensors.degradations.picture_geometry import LinearPicture, PictureGeometry

Scale = Annotated[Number, Field(ge=0.9, le=1.1)]


@dataclass(frozen=True)
class ChromaticAberration(OpticalEffect, name="degradation.chromatic_aberration"):
    """The red and the blue picture are scaled about the optical axis, and looked up bilinearly.

    Where no neighbour of the place looked up is valid, at the border of the picture, the pixel
    keeps its own colour; where only some are, those count.
    """

    red_scale: Scale = 1.0
    blue_scale: Scale = 1.0

    def steps(self, geometry: PictureGeometry) -> list[Step]:
        """One pass on the GPU."""
        inverse = (1.0 / self.red_scale, 1.0, 1.0 / self.blue_scale)
        uniforms = {"u_centre_px": geometry.centre_px, "u_inverse_scales": inverse}
        return [Step("chromatic_aberration", uniforms)]

    def apply(self, picture: LinearPicture, geometry: PictureGeometry) -> LinearPicture:
        """The reference in NumPy."""
        result = picture.copy()
        for channel, scale in ((0, self.red_scale), (2, self.blue_scale)):
            places = geometry.offsets_px() * np.float32(1.0 / scale)
            places += np.array(geometry.centre_px, dtype=np.float32)
            looked_up = _bilinear(picture[..., channel], picture[..., 3], places)
            result[..., channel] = np.where(
                np.isnan(looked_up) | (picture[..., 3] < 0.5), picture[..., channel], looked_up
            )
        return result


def _bilinear(
    values: NDArray[np.float32], valid: NDArray[np.float32], places_px: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Values (height, width) at places (height, width, 2); NaN where nothing valid is near."""
    height, width = values.shape
    corner = np.floor(places_px)
    share = places_px - corner
    column, row = corner[..., 0].astype(int), corner[..., 1].astype(int)
    total = np.zeros(values.shape, dtype=np.float32)
    weights = np.zeros(values.shape, dtype=np.float32)
    for down in (0, 1):
        for right in (0, 1):
            u, v = column + right, row + down
            inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
            u, v = np.clip(u, 0, width - 1), np.clip(v, 0, height - 1)
            weight = share[..., 0] if right else np.float32(1.0) - share[..., 0]
            weight = weight * (share[..., 1] if down else np.float32(1.0) - share[..., 1])
            weight = np.where(inside & (valid[v, u] > 0.5), weight, np.float32(0.0))
            total += weight * values[v, u]
            weights += weight
    found = weights > 0.0
    return np.where(found, total / np.where(found, weights, np.float32(1.0)), np.float32(np.nan))
