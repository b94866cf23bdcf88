"""Enhanced unified camera model (EUCM).

    d = √(β (x² + y²) + z²)
    (u, v) = (fx x/q + cx, fy y/q + cy),  q = α d + (1 − α) z

Domain, with w = α/(1 − α) for α ≤ 0.5 and w = (1 − α)/α above: z > −w d. Up to α = 0.5 this is
q > 0. Above, the image would fold over; it ends at m_x² + m_y² = 1/(β (2α − 1)) on the normalized
plane. The limits are exact, because (√β x, √β y, z) turns the model into the unified model.

GLSL twin: `shaders/camera/eucm.glsl`. Source: Khomutenko, Garcia & Martinet, "An enhanced unified
camera model", 2016, Eq. 12 and 17; names as in Kalibr and Basalt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.parametric_camera import AlphaCamera, PlanePoints
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import AboveZero, Fraction


@dataclass(frozen=True)
class EucmCamera(AlphaCamera):
    """Wide-angle lens with the shape parameters α and β."""

    alpha: Fraction
    """Shape α: 0 (perspective) to 1; 0.6 for a fisheye."""
    beta: AboveZero
    """Shape β; typically 1.1; 1 is the unified model."""
    model_name = "eucm"

    def _rays_from_plane(self, plane: Floats) -> Rays:
        lifted = self._lift(plane * np.sqrt(self.beta))
        directions = lifted.directions / (np.sqrt(self.beta), np.sqrt(self.beta), 1.0)
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return Rays(directions, lifted.valid)

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        x, y, z = np.moveaxis(directions, -1, 0)
        distance = np.sqrt(self.beta * (x * x + y * y) + z * z)
        return self._project(directions, z, distance, distance)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/eucm.glsl`."""
        return {**super().uniforms(), "u_root_beta": float(np.sqrt(self.beta))}
