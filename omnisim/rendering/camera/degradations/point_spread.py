"""Point spread of optics: normal distributions whose widths depend on the image radius.

Radial and tangential widths differ with astigmatism, field curvature and coma. The widths are those
of the optics: the pixels of the ideal image are square already.

Source: Goodman, "Introduction to Fourier Optics", chapter 6: the transfer of a normal distribution
is exp(−2π²σ²f²).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Floats, Floats32, Ints
from omnisim.core.files.parameters import NotNegative, Number
from omnisim.rendering.camera.degradations.effect import OpticalEffect, weighted_mean
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

MAX_WIDTH_PX = 8.0  # 4225 samples per pixel
MAX_ROWS = 64
STEPS, ANGLES = 128, 9  # of the table of widths: by radius, and by its angle to the pixels
REACH = 4.0  # widths to the end of the kernel: 6e-5 of the light is beyond
_SMALL_PX = 1.2  # width from which samples at whole pixels equal the distribution
_MIN_SAMPLED_PX = 0.1  # one pixel alone
_LATTICE_PX, _ROUNDS, _HALVINGS = 4, 8, 14
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

    @cached_property  # the reference reads it for each image
    def table(self) -> tuple[float, Floats32]:
        """Largest radius, and the widths (ANGLES, STEPS, 2) of sampled kernels up to it.

        Rows: angle between radius and the nearer of rows and columns, by its tangent from 0 to 1.
        """
        radii, *widths = np.array(self.widths_px, dtype=np.float64).T
        largest = max(float(radii[-1]), 1.0)
        at = np.linspace(0.0, largest, STEPS)
        pairs = np.stack([np.interp(at, radii, width) for width in widths], axis=-1)
        angles = np.arctan(np.linspace(0.0, 1.0, ANGLES))
        table = np.stack([sampled_widths_px(pairs, float(angle)) for angle in angles])
        return largest, table.astype(np.float32)

    def steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """One GPU pass."""
        largest_px, table = self.table
        scale = {"u_radius_scale": (STEPS - 1) / largest_px, "u_reach": REACH}
        textures = {"u_widths_px": np.pad(table, ((0, 0), (0, 0), (0, 2)))}
        return [EffectStep("point_spread", {"u_center_px": geometry.center_px, **scale}, textures)]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        largest_px, table = self.table
        offsets = geometry.offsets_px()
        radii = np.sqrt(offsets[..., 0] * offsets[..., 0] + offsets[..., 1] * offsets[..., 1])
        outward = np.where(
            radii[..., None] > 1e-3, offsets / np.maximum(radii, np.float32(1e-3))[..., None],
            np.array((1.0, 0.0), dtype=np.float32),
        )  # fmt: skip
        tangent = np.abs(outward).min(axis=-1) / np.abs(outward).max(axis=-1)
        column, across = _entry(radii * np.float32((STEPS - 1) / largest_px), STEPS)
        row, down = _entry(tangent * np.float32(ANGLES - 1), ANGLES)
        one = np.float32(1.0)
        above, below = (
            table[entry, column] * (one - across) + table[entry, column + 1] * across
            for entry in (row, row + 1)
        )
        widths = above * (one - down) + below * down
        reach = np.ceil(np.float32(REACH) * widths.max(axis=-1)).astype(np.int64)

        def weight(right_px: int, down_px: int) -> Floats32:
            """Density of each pixel's own normal distribution at an offset, to a factor."""
            x, y = np.moveaxis(outward, -1, 0)
            radial = (right_px * x + down_px * y) / widths[..., 0]
            tangential = (down_px * x - right_px * y) / widths[..., 1]
            density = np.exp(np.float32(-0.5) * (radial * radial + tangential * tangential))
            return density * (max(abs(right_px), abs(down_px)) <= reach)

        return weighted_mean(image, int(reach.max()), weight)


def _entry(at: Floats32, count: int) -> tuple[Ints, Floats32]:
    """Indices (...) of the table entries below positions, and weights (..., 1) of the next."""
    within = np.minimum(at, np.float32(count - 1))
    entry = np.minimum(within.astype(np.int64), count - 2)
    return entry, (within - entry)[..., None].astype(np.float32)


def sampled_widths_px(widths_px: Floats, angle_rad: float) -> Floats:
    """Widened widths (n, 2) of normal distributions, so that samples at pixels keep the blur.

    Samples of a narrow distribution miss most of it. The widened one halves the modulation of an
    edge on square pixels at the same frequency.

    Args:
        widths_px: (n, 2) along two perpendicular axes.
        angle_rad: angle between these axes and rows and columns.
    """
    offsets = np.stack(np.meshgrid(*(np.arange(-_LATTICE_PX, _LATTICE_PX + 1),) * 2), axis=-1)
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    axes = (offsets.reshape(-1, 2) @ ((cosine, -sine), (sine, cosine))).T
    frequencies = _half_modulation(widths_px, angle_rad)
    modulation = np.exp(-2.0 * (np.pi * widths_px * frequencies) ** 2)
    sampled = np.maximum(widths_px, _MIN_SAMPLED_PX)
    for _ in range(_ROUNDS):
        solved = [
            _solve(modulation[:, axis], frequencies[:, axis], axes[axis], axes[1 - axis], other)
            for axis, other in ((0, sampled[:, 1]), (1, sampled[:, 0]))
        ]
        # the mean with the round before: at 45°, both axes depend on each other alike
        mean = 0.5 * (sampled + np.stack(solved, axis=-1))
        sampled = np.where(widths_px < _SMALL_PX, mean, widths_px)
    return sampled


def _solve(
    modulation: Floats, frequencies: Floats, along_px: Floats, across_px: Floats, other_px: Floats
) -> Floats:
    """Widths (n,) along an axis with the modulation (n,) at frequencies (n,) for samples (m,)."""
    low, high = np.full(len(modulation), _MIN_SAMPLED_PX), np.full(len(modulation), _SMALL_PX)
    waves = np.cos(2.0 * np.pi * frequencies[:, None] * along_px)
    other = np.exp(-0.5 * (across_px / other_px[:, None]) ** 2)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        weights = other * np.exp(-0.5 * (along_px / middle[:, None]) ** 2)
        is_sharp = (weights * waves).sum(axis=1) > modulation * weights.sum(axis=1)
        low, high = np.where(is_sharp, middle, low), np.where(is_sharp, high, middle)
    return 0.5 * (low + high)


def _half_modulation(widths_px: Floats, angle_rad: float) -> Floats:
    """Frequencies (n, 2), cycles per px, at which spread and square pixel halve the modulation."""
    low, high = np.zeros_like(widths_px), np.ones_like(widths_px)
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        pixel = np.sinc(middle * cosine) * np.sinc(middle * sine)
        is_above = pixel * np.exp(-2.0 * (np.pi * widths_px * middle) ** 2) > 0.5
        low, high = np.where(is_above, middle, low), np.where(is_above, high, middle)
    return 0.5 * (low + high)
