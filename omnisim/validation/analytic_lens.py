"""Lenses of known sharpness over the field, and their images of a chart of edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from omnisim.validation.analytic_edges import Floats

PATCH_PX = 60
DARK, BRIGHT = 0.08, 0.75


@dataclass(frozen=True)
class AnalyticLens:
    """Lens whose point spread is a Gaussian, with standard deviations that depend on the radius.

    Each quantity is a polynomial in the image radius divided by half of the shorter side, given by
    its coefficients in ascending order.

    Attributes:
        size_px: width and height of the image.
        radial_px, tangential_px: standard deviations of the Gaussian, from the constant term on;
            the two constants are equal.
        red_px, blue_px: radial offsets of red and blue from green, from the linear term on.
    """

    size_px: tuple[int, int]
    radial_px: tuple[float, ...]
    tangential_px: tuple[float, ...]
    red_px: tuple[float, ...]
    blue_px: tuple[float, ...]

    @classmethod
    def drawn(cls, seed: int, size_px: tuple[int, int] = (960, 720)) -> AnalyticLens:
        """Lens with random coefficients: sharp in the center, softer outside."""
        random = np.random.default_rng(seed)
        center = random.uniform(0.35, 0.7)
        widths = [(center, random.uniform(0.0, 0.3), random.uniform(0.0, 0.5)) for _ in range(2)]
        colors = [tuple(random.uniform(-0.6, 0.6, 3).tolist()) for _ in range(2)]
        return cls(size_px, widths[0], widths[1], colors[0], colors[1])

    @property
    def center_px(self) -> Floats:
        """(u, v) of the optical axis."""
        return 0.5 * (np.array(self.size_px) - 1.0)

    @property
    def unit_px(self) -> float:
        """Half of the shorter side."""
        return 0.5 * min(self.size_px)

    def widths_px(self, offsets_px: Floats, normal: Floats) -> Floats:
        """Standard deviations (...) of the point spread along a unit vector (2,).

        Args:
            offsets_px: (..., 2) offsets from the center.
            normal: unit vector.
        """
        radii = np.hypot(offsets_px[..., 0], offsets_px[..., 1])
        share = (offsets_px @ normal / np.maximum(radii, 1e-9)) ** 2
        radial, tangential = (
            np.polynomial.polynomial.polyval(radii / self.unit_px, widths)
            for widths in (self.radial_px, self.tangential_px)
        )
        widths: Floats = np.sqrt(share * radial**2 + (1.0 - share) * tangential**2)
        return widths

    def chart(self, noise: float = 0.0, seed: int = 0) -> NDArray[np.uint16]:
        """Linear 16-bit image (height, width, 3) of patches with one edge each, randomly directed.

        Args:
            noise: standard deviation, as a share of white.
            seed: seed of directions, positions and noise.
        """
        random = np.random.default_rng(seed)
        width, height = self.size_px
        image = np.zeros((height, width, 3))
        for top in range(0, height, PATCH_PX):
            for left in range(0, width, PATCH_PX):
                patch = np.s_[top : top + PATCH_PX, left : left + PATCH_PX]
                angle_deg = 90.0 * random.integers(4) + random.uniform(4.0, 86.0)
                point = 0.5 * (PATCH_PX - 1) + random.uniform(-0.5, 0.5, 2)
                image[patch] = self._patch(angle_deg, point, np.array((left, top)))
        image += noise * random.normal(size=image.shape)
        return np.rint(65535.0 * image.clip(0.0, 1.0)).astype(np.uint16)

    def _patch(self, angle_deg: float, point_px: Floats, corner_px: NDArray[np.int64]) -> Floats:
        """Linear colors (PATCH_PX, PATCH_PX, 3) of one patch with an edge.

        Args:
            angle_deg: direction of the edge's normal, from +u to +v.
            point_px: (u, v) on the edge, relative to the patch's first pixel.
            corner_px: (u, v) of the patch's first pixel.
        """
        angle = np.radians(angle_deg)
        normal = np.array((np.cos(angle), np.sin(angle)))
        pixels = np.stack(np.meshgrid(*(np.arange(PATCH_PX),) * 2), axis=-1)
        offsets = pixels + corner_px - self.center_px
        distances = (pixels - point_px) @ normal
        radii = np.hypot(offsets[..., 0], offsets[..., 1])
        radial = offsets @ normal / np.maximum(radii, 1e-9)
        widths = self.widths_px(offsets, normal)
        colors = []
        for coefficients in (self.red_px, (), self.blue_px):
            moved = np.polynomial.polynomial.polyval(radii / self.unit_px, (0.0, *coefficients))
            colors.append(_level(distances - moved * radial, widths, normal))
        return DARK + (BRIGHT - DARK) * np.stack(colors, axis=-1)


def _level(distances_px: Floats, widths_px: Floats, normal: Floats) -> Floats:
    """Levels (...) from 0 to 1 of an edge blurred by a Gaussian, averaged over square pixels."""
    first, second = 0.5 * np.abs(normal)
    total = np.zeros_like(distances_px)
    for sign, offset in (
        (1.0, first + second), (-1.0, first - second), (-1.0, second - first),
        (1.0, -first - second),
    ):  # fmt: skip
        x = (distances_px + offset) / widths_px
        density = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi)
        total += sign * 0.5 * widths_px**2 * ((x**2 + 1.0) * ndtr(x) + x * density)
    levels: Floats = total / (4.0 * first * second)
    return levels
