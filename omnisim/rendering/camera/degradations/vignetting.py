"""Vignetting: light falloff of a lens away from its axis.

Source: Goldman, "Vignette and exposure calibration and compensation", PAMI 2010, for the even
polynomial; the cos⁴ law is textbook radiometry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import Signed
from omnisim.rendering.camera.degradations.effect import OpticalEffect
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry, LinearImage
from omnisim.rendering.opengl.degradation.step import Step


@dataclass(frozen=True)
class Vignetting(OpticalEffect, name="degradation.vignetting"):
    """Vignetting factor of the light: 1 + c₂r² + c₄r⁴ + c₆r⁶, at least 0."""

    coefficients: tuple[Signed, Signed, Signed] = (-0.3, 0.0, 0.0)
    """Coefficients of r², r⁴, r⁶; r = 1 at half of the image's shorter side; typically −2t², 3t⁴,
    −4t⁶: cos⁴ of the field angle, with tangent t at r = 1."""

    @classmethod
    def cos4(cls, tangent: float) -> Vignetting:
        """Expansion of cos⁴ of the field angle, from its tangent at r = 1.

        Raises:
            OpticsError: the field is too wide for three terms, and the polynomial would rise again.
        """
        if not 0.0 <= tangent <= 0.6:
            raise OpticsError(
                f"vignetting by cos⁴: expected a tangent of 0 to 0.6, got {tangent:g}"
            )
        return cls((-2.0 * tangent**2, 3.0 * tangent**4, -4.0 * tangent**6))

    def steps(self, geometry: ImageGeometry) -> list[Step]:
        """One GPU pass."""
        uniforms = {"u_coefficients": self.coefficients, **geometry.uniforms()}
        return [Step("vignetting", uniforms)]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        squared = geometry.squared_radii()
        c2, c4, c6 = (np.float32(value) for value in self.coefficients)
        factor = np.float32(1.0) + squared * (c2 + squared * (c4 + squared * c6))
        result = image.copy()
        result[..., :3] *= np.maximum(factor, np.float32(0.0))[..., None]
        return result
