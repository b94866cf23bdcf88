"""Unified model of Geyer and Mei with distortion: OpenCV's `omnidir`, Kalibr's `omni`.

    (x_n, y_n) = (x, y)/(z + ξ d),  d = √(x² + y² + z²)
    (x_d, y_d) = distorted by k1, k2, p1, p2, k3, see `lens_polynomials`
    (u, v) = (γu x_d + s y_d + u0, γv y_d + v0)

Domain: z > −w d, with w = ξ for ξ ≤ 1 and w = 1/ξ above, where the image would fold over; and
x_n² + y_n² ≤ r_max², the disc on which the distortion does not fold. For ξ > 1 the first condition
is x_n² + y_n² ≤ 1/(ξ² − 1). Unless something else limits it, r_max is 1000: almost the limit of the
first condition.

GLSL twin: `shaders/camera/unified.glsl`. Source: Mei & Rives, "Single view point omnidirectional
camera calibration from planar grids", 2007; OpenCV's module ccalib.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.lens_polynomials import RadialTangential
from omnisim.cameras.parametric_camera import (
    EDGE_RAD,
    Coefficients,
    PlanePoints,
    SkewedCamera,
)
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Level, Number

MAX_RADIUS = 1000.0


@dataclass(frozen=True)
class UnifiedCamera(SkewedCamera):
    """Mirror or fisheye lens as a projection from a point ξ above a unit sphere's center."""

    xi: Level
    """Distance ξ above the sphere's center: 0 perspective, 1 paraboloid, 1.5 to 2.5 a fisheye."""
    distortion: Coefficients = (0.0, 0.0, 0.0, 0.0)
    """k1, k2, p1, p2, and optionally k3, as pinhole cameras (ξ = 0) have it."""
    skew_px: Number = 0.0
    """Skew s."""
    model_name = "unified"

    def _check(self) -> None:
        super()._check()
        if len(self.distortion) not in (4, 5):
            raise self._error("distortion", "k1, k2, p1, p2 and optionally k3")

    @property
    def k3(self) -> float:
        """Fifth coefficient, or 0 if there are only four."""
        return (*self.distortion, 0.0)[4]

    @cached_property
    def radius_limit(self) -> float:
        """Radius of the domain on the plane before distortion."""
        fold = 1.0 / math.sqrt(self.xi * self.xi - 1.0) if self.xi > 1.0 else MAX_RADIUS
        return RadialTangential(*self.distortion).radius_limit(min(fold, MAX_RADIUS))

    def _rays_from_plane(self, plane: Floats) -> Rays:
        points = RadialTangential(*self.distortion).undistort(plane, self.radius_limit)
        squared = np.sum(points.positions**2, axis=-1, keepdims=True)
        root = np.sqrt(np.maximum(1.0 + (1.0 - self.xi * self.xi) * squared, 0.0))
        height = (self.xi + root) / (1.0 + squared)
        directions = np.concatenate((points.positions * height, height - self.xi), axis=-1)
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return Rays(directions, points.valid)

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        distance = np.linalg.norm(directions, axis=-1)
        w = self.xi if self.xi <= 1.0 else 1.0 / self.xi
        valid = directions[..., 2] > (-w - EDGE_RAD) * distance
        depth = directions[..., 2] + self.xi * distance
        valid &= depth > 1e-12 * distance
        plane = directions[..., :2] / np.where(valid, depth, 1.0)[..., None]
        radius = np.hypot(plane[..., 0], plane[..., 1])
        valid &= radius <= self.radius_limit * (1.0 + EDGE_RAD)
        plane = np.where(valid[..., None], plane, 0.0)
        return PlanePoints(RadialTangential(*self.distortion).distort(plane), valid)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/unified.glsl`."""
        return {
            **super().uniforms(), "u_xi": self.xi, "u_distortion": self.distortion[:4],
            "u_k3": self.k3, "u_radius_max": self.radius_limit,
        }  # fmt: skip
