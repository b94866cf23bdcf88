"""Vignetting: light falloff of a lens away from its axis.

Source: Goldman, "Vignette and exposure calibration and compensation", PAMI 2010, for the even
polynomial; the cos⁴ law is textbook radiometry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import Signed
from omnisim.rendering.camera.degradations.effect import OpticalEffect
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

MAX_TERMS = 6
Coefficients = Annotated[tuple[Signed, ...], Field(min_length=3, max_length=MAX_TERMS)]


@dataclass(frozen=True)
class Vignetting(OpticalEffect, name="degradation.vignetting"):
    """Vignetting factor of the light: 1 + c₂r² + c₄r⁴ + c₆r⁶ + …, at least 0."""

    coefficients: Coefficients = (-0.3, 0.0, 0.0)
    """Coefficients of r², r⁴, r⁶ and, for wide fields, up to r¹²; r = 1 at half of the image's
    shorter side; typically −2t², 3t⁴, −4t⁶: cos⁴ of the field angle, with tangent t at r = 1."""

    @classmethod
    def cos4(cls, tangent: float) -> Vignetting:
        """Expansion of cos⁴ of the field angle, from its tangent at r = 1.

        Raises:
            OpticsError: the field is too wide for three terms, and the polynomial would rise again.
        """
        if not 0.0 <= tangent <= 0.6:
            expected = "expected a tangent of 0 to 0.6"
            raise OpticsError(f"vignetting by cos⁴: {expected}, got {tangent:g}")
        return cls((-2.0 * tangent**2, 3.0 * tangent**4, -4.0 * tangent**6))

    @property
    def _terms(self) -> tuple[float, ...]:
        """All coefficients, with zeros for those that are left out."""
        return (*self.coefficients, *(0.0,) * MAX_TERMS)[:MAX_TERMS]

    def steps(self, geometry: ImageGeometry) -> list[EffectStep]:
        """One GPU pass."""
        terms = self._terms
        uniforms = {"u_coefficients": terms[:3], "u_higher": terms[3:], **geometry.uniforms()}
        return [EffectStep("vignetting", uniforms)]

    def apply(self, image: LinearImage, geometry: ImageGeometry) -> LinearImage:
        """Reference in NumPy."""
        squared = geometry.squared_radii()
        factor = np.zeros_like(squared)
        for value in (*self._terms[::-1], 1.0):
            factor = np.float32(value) + squared * factor
        result = image.copy()
        result[..., :3] *= np.maximum(factor, np.float32(0.0))[..., None]
        return result
