"""Double sphere model of Usenko, Demmel and Cremers.

    d1 = √(x² + y² + z²),  d2 = √(x² + y² + (ξ d1 + z)²)
    (u, v) = (fx x/q + cx, fy y/q + cy),  q = α d2 + (1 − α)(ξ d1 + z)

Domain, with w = α/(1 − α) for α ≤ 0.5 and w = (1 − α)/α above: ξ d1 + z > −w d2, which is
z > −w' d1 with w' = w t + ξ, t = √(1 − ξ²(1 − w²)) − w ξ. For α > 0.5 the image ends at
m_x² + m_y² = 1/(2α − 1) on the normalized plane. For |ξ| < 1 the shift of the first sphere maps
directions one to one, so nothing else can fold. The paper and Basalt use t = 1. This ends the
projection, but not its inverse, about a degree too early: at 125.2° instead of 126.1° for TUM-VI's
camera.

GLSL twin: `shaders/camera/double_sphere.glsl`. Source: "The double sphere camera model", 2018,
Eq. 40 to 51; names as in Basalt and Kalibr.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.parametric_camera import AlphaCamera, PlanePoints
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Fraction, Number


@dataclass(frozen=True)
class DoubleSphereCamera(AlphaCamera):
    """Wide-angle lens as two projections onto unit spheres whose centers are ξ apart."""

    xi: Annotated[Number, Field(gt=-1.0, lt=1.0)]
    """Distance ξ between the spheres' centers; −0.2 for a fisheye."""
    alpha: Fraction
    """Shape α; 0.6 for a fisheye."""
    model_name = "double_sphere"

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends, acos(−w')."""
        w, xi = -self.cosine_limit, self.xi
        t = math.sqrt(1.0 - xi * xi * (1.0 - w * w)) - w * xi
        return math.acos(max(-1.0, -(w * t + xi)))

    def _rays_from_plane(self, plane: Floats) -> Rays:
        second = self._lift(plane)
        across = np.sum(second.directions[..., :2] ** 2, axis=-1)
        z = second.directions[..., 2]
        length = z * self.xi + np.sqrt(1.0 - self.xi * self.xi * across)
        directions = second.directions * length[..., None]
        directions[..., 2] -= self.xi
        return Rays(directions, second.valid)

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        d1 = np.linalg.norm(directions, axis=-1)
        z = self.xi * d1 + directions[..., 2]
        d2 = np.sqrt(directions[..., 0] ** 2 + directions[..., 1] ** 2 + z * z)
        return self._project(directions, z, d2, d1)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/double_sphere.glsl`."""
        return {**super().uniforms(), "u_xi": self.xi}
