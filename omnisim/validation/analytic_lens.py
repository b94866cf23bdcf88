"""Lenses of known sharpness over the field, and their images of a chart of edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.validation.analytic_edges import Floats, edge_levels, gaussian

PATCH_PX = 60
DARK, BRIGHT = 0.08, 0.75


@dataclass(frozen=True)
class AnalyticLens:
    """Lens with normal point spreads, in closed form.

    Polynomials are coefficients of the powers of the image radius, relative to half of the shorter
    side.

    Attributes:
        size_px: width and height of the image.
        radial_px, tangential_px: standard deviations, from the power 0 on; equal in the center.
        red_px, blue_px: radial offsets from green, from the power 1 on, by the radius at which the
            color lies.
    """

    size_px: tuple[int, int]
    radial_px: tuple[float, ...]
    tangential_px: tuple[float, ...]
    red_px: tuple[float, ...]
    blue_px: tuple[float, ...]

    @classmethod
    def drawn(cls, seed: int, size_px: tuple[int, int] = (960, 720)) -> AnalyticLens:
        """Lens whose numbers are drawn at random: sharp in the center, softer outside."""
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

    def width_px(self, offset_px: Floats, normal: Floats) -> float:
        """Standard deviation along a normal, at an offset (2,) from the center."""
        radius = float(np.hypot(*offset_px))
        share = float(offset_px @ normal / max(radius, 1e-9)) ** 2
        radial, tangential = (
            float(np.polynomial.polynomial.polyval(radius / self.unit_px, widths))
            for widths in (self.radial_px, self.tangential_px)
        )
        return float(np.sqrt(share * radial**2 + (1.0 - share) * tangential**2))

    def offset_px(self, coefficients: tuple[float, ...], radius_px: float) -> float:
        """Radial offset of a color whose green image is at a radius."""
        offset = 0.0
        for _ in range(20):
            at = (radius_px + offset) / self.unit_px
            offset = float(np.polynomial.polynomial.polyval(at, (0.0, *coefficients)))
        return offset

    def chart(self, noise: float = 0.0, seed: int = 0) -> NDArray[np.uint16]:
        """Image (height, width, 3) of patches with one edge each, in random directions.

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
        """Colors (PATCH_PX, PATCH_PX, 3) of an edge through a point of a patch."""
        offset = point_px + corner_px - self.center_px
        radius = float(np.hypot(*offset))
        angle = np.radians(angle_deg)
        normal = np.array((np.cos(angle), np.sin(angle)))
        spread = gaussian(self.width_px(offset, normal))
        levels = edge_levels(spread, angle_deg, 2.0 * PATCH_PX)
        u, v = np.meshgrid(*(np.arange(PATCH_PX),) * 2)
        distance = (u - point_px[0]) * normal[0] + (v - point_px[1]) * normal[1]
        across = float(offset @ normal) / max(radius, 1e-9)
        shifts = [self.offset_px(one, radius) * across for one in (self.red_px, (), self.blue_px)]
        colors = np.interp(distance[..., None] - np.array(shifts), *levels)
        patch: Floats = DARK + (BRIGHT - DARK) * colors
        return patch
