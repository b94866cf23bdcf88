"""Point spread of optics: normal distributions whose widths depend on the image radius.

Radial and tangential widths differ with astigmatism, field curvature and coma. The widths are those
of the optics: the pixels of the ideal image are square already.

Source: Goodman, "Introduction to Fourier Optics", chapter 6: the transfer of a normal distribution
is exp(−2π²σ²f²).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.files.parameters import NotNegative, Number
from omnisim.rendering.camera.degradations.effect import OpticalEffect
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry, LinearImage
from omnisim.rendering.opengl.degradation.step import Step

MAX_WIDTH_PX = 8.0  # 4225 samples per pixel
MAX_ROWS = 64
STEPS = 256  # of the widths' table on the GPU, between center and largest radius
REACH = 4.0  # widths to the end of the kernel: 6e-5 of the light is beyond
_MIN_WEIGHT_PX = 0.1  # narrower kernels have one pixel
_SMALL_PX, _PHASES = 1.2, 64  # width from which samples equal the distribution
Width = Annotated[Number, Field(ge=0.0, le=MAX_WIDTH_PX)]
Row = tuple[NotNegative, Width, Width]


@dataclass(frozen=True)
class PointSpread(OpticalEffect, name="degradation.point_spread"):
    """Weighted mean of the valid pixels around each pixel.

    Pixels outside of the image or its mask are ignored, so no black bleeds in.
    """

    widths_px: Annotated[tuple[Row, ...], Field(min_length=1, max_length=MAX_ROWS)] = (
        (0.0, 0.5, 0.5),
    )
    """Rows of image radius, and the standard deviations along the radius and across it, in pixels;
    linear between the rows, constant before the first and after the last; typically 0.3 to 2."""

    def _check(self) -> None:
        radii = [row[0] for row in self.widths_px]
        if any(after <= before for before, after in pairwise(radii)):
            raise self._error("widths_px", "rows in order of their radii")

    def table(self) -> tuple[float, NDArray[np.float32]]:
        """Largest radius, and the widths (STEPS, 2) of sampled kernels from radius 0 up to it."""
        radii, *widths = np.array(self.widths_px, dtype=np.float64).T
        largest = max(float(radii[-1]), 1.0)
        at = np.linspace(0.0, largest, STEPS)
        sampled = [sampled_widths_px(np.interp(at, radii, width)) for width in widths]
        return largest, np.stack(sampled, axis=-1).astype(np.float32)

    def steps(self, geometry: ImageGeometry) -> list[Step]:
        """One GPU pass."""
        largest_px, table = self.table()
        uniforms = {
            "u_center_px": geometry.center_px,
            "u_radius_scale": (STEPS - 1) / largest_px,
            "u_reach": REACH,
        }
        textures = {"u_widths_px": np.pad(table, ((0, 0), (0, 2)))[None]}
        return [Step("point_spread", uniforms, textures)]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        largest_px, table = self.table()
        offsets = geometry.offsets_px()
        radii = np.sqrt(offsets[..., 0] * offsets[..., 0] + offsets[..., 1] * offsets[..., 1])
        at = np.minimum(radii * np.float32((STEPS - 1) / largest_px), np.float32(STEPS - 1))
        row = np.minimum(at.astype(np.int64), STEPS - 2)
        share = (at - row)[..., None].astype(np.float32)
        widths = table[row] * (np.float32(1.0) - share) + table[row + 1] * share
        outward = np.where(
            radii[..., None] > 1e-3, offsets / np.maximum(radii, np.float32(1e-3))[..., None],
            np.array((1.0, 0.0), dtype=np.float32),
        )  # fmt: skip
        reach = np.ceil(np.float32(REACH) * widths.max(axis=-1)).astype(np.int64)
        return _weighted_mean(image, outward, widths, reach)


def _weighted_mean(
    image: LinearImage,
    outward: NDArray[np.float32],
    widths_px: NDArray[np.float32],
    reach_px: NDArray[np.int64],
) -> LinearImage:
    """Mean of the valid pixels, weighted by each pixel's own normal distribution."""
    height, width = image.shape[:2]
    far = int(reach_px.max())
    valid = image[..., 3] > 0.5
    light = np.concatenate((image[..., :3], np.ones((height, width, 1))), axis=-1)
    padded = np.pad(light * valid[..., None], ((far, far), (far, far), (0, 0)))
    total = np.zeros((height, width, 4))
    for down in range(-far, far + 1):
        for right in range(-far, far + 1):
            radial = (right * outward[..., 0] + down * outward[..., 1]) / widths_px[..., 0]
            across = (down * outward[..., 0] - right * outward[..., 1]) / widths_px[..., 1]
            weight = np.exp(np.float32(-0.5) * (radial * radial + across * across))
            weight *= max(abs(right), abs(down)) <= reach_px
            total += weight[..., None] * padded[far + down :, far + right :][:height, :width]
    result = image.copy()
    result[valid, :3] = total[valid, :3] / total[valid, 3:]
    return result


def sampled_widths_px(widths_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Widths of the distributions whose values at whole pixels blur as the given ones do.

    Samples of a narrow distribution miss most of it. The widened one halves the modulation of an
    edge on square pixels at the same frequency, as a mean over edges along rows and diagonals.
    """
    wide, sampled = _width_table()
    result = np.interp(widths_px, wide, sampled)
    return np.where(widths_px >= _SMALL_PX, widths_px, result)


@cache
def _width_table() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Widths of distributions, and those of samples that blur as they do."""
    widths = np.linspace(0.0, _SMALL_PX, _PHASES)
    candidates = np.linspace(_MIN_WEIGHT_PX, _SMALL_PX, 4 * _PHASES)
    frequencies = np.linspace(0.05, 0.62, 500)
    pixel = np.sinc(frequencies)
    normal = np.exp(-2.0 * (np.pi * widths[:, None] * frequencies) ** 2)
    half = np.array([np.interp(-0.5, -row, frequencies) for row in pixel * normal])
    wanted = np.exp(-2.0 * (np.pi * widths * half) ** 2)
    offset = np.arange(-6, 7)
    weights = np.exp(-0.5 * (offset / candidates[:, None]) ** 2)
    weights /= weights.sum(axis=1, keepdims=True)

    def transfer(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        waves = np.cos(2.0 * np.pi * np.outer(offset, frequency))
        return np.asarray(weights @ waves, dtype=np.float64)

    blurs = 0.5 * (transfer(half) + transfer(half / np.sqrt(2.0)) ** 2)
    sampled = [
        np.interp(-value, -blur, candidates) for value, blur in zip(wanted, blurs.T, strict=True)
    ]
    return widths, np.array(sampled)
