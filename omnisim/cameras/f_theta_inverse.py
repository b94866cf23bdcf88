"""Inverse f-theta lens: the angle is a polynomial of the radius in pixels.

    θ = k1 r + k2 r² + … + kn rⁿ, r in pixels around the principal point

Domain: 0 ≤ θ ≤ θ_max and r before the first radius where dθ/dr has fallen to a thousandth of k1.
Beyond it, many pixels share nearly the same ray, and the inverse is ill-conditioned. `f_theta` is
the opposite model, with r as a polynomial of θ.

| parameter | unit | typical |
| --- | --- | --- |
| principal_point_px | px | image center |
| coefficients | rad/pxⁿ | k1 … kn, at most 8; 1/k1 > 0 is the focal length |
| theta_max_deg | degrees | 95 to 110 |

GLSL twin: `shaders/camera/f_theta_inverse.glsl`. Source: NVIDIA's f-theta lens, pixel to angle,
with k0 = 0.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.monotone import MAX_RADIUS_PX, first_root, polyval, solve_polynomial
from omnisim.cameras.plane_camera import RadialCamera
from omnisim.core.errors import OpticsError

MAX_COEFFICIENTS = 8  # u_coefficients of the GLSL twin
MIN_SLOPE = 1e-3  # share of the slope at the axis


@dataclass(frozen=True)
class FThetaInverseCamera(RadialCamera):
    """Fisheye lens whose angle is a polynomial of the radius.

    Attributes:
        width_px, height_px: image size.
        principal_point_px: (u, v) of the optical axis in the image.
        coefficients: k1 … kn.
        theta_max_rad: upper limit of the angle from the axis at which the domain ends.

    Raises:
        OpticsError: a size is not positive, a number is not finite, the coefficients are missing or
            too many, k1 ≤ 0, or θ_max is outside 0 to 180°.
    """

    principal_point_px: tuple[float, float]
    coefficients: tuple[float, ...]
    theta_max_rad: float = math.pi
    model_name = "f_theta_inverse"
    pixels_per_plane = 1.0  # the plane is in pixels

    def scaled(self, scale: float) -> FThetaInverseCamera:
        """The same view in an image `scale` times as large; sizes are rounded."""
        powers = range(1, 1 + len(self.coefficients))
        shrunk = tuple(k / scale**n for k, n in zip(self.coefficients, powers, strict=True))
        return dataclasses.replace(super().scaled(scale), coefficients=shrunk)

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.coefficients)
        if not 1 <= count <= MAX_COEFFICIENTS or self.coefficients[0] <= 0.0:
            raise OpticsError(
                f"camera: coefficients: expected 1 to {MAX_COEFFICIENTS} numbers, the first "
                f"more than 0, got {self.coefficients}"
            )

    @cached_property
    def radius_max_px(self) -> float:
        """Radius where the domain ends."""
        thetas = np.array([0.0, *self.coefficients])
        slopes = polynomial.polyder(thetas)
        slopes[0] *= 1.0 - MIN_SLOPE
        thetas[0] = -self.theta_max_rad
        end = first_root(thetas, MAX_RADIUS_PX)
        return first_root(slopes, end)

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends."""
        return min(self.theta_max_rad, float(self._theta(np.array(self.radius_max_px))))

    def _theta(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return polyval((0.0, *self.coefficients), radius)

    def _theta_from_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(self._theta(radius), self.theta_edge_rad)

    def _radius_from_theta(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return solve_polynomial((0.0, *self.coefficients), theta, 0.0, self.radius_max_px)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/f_theta_inverse.glsl`, scaled to r/r_max for precision."""
        powers = range(1, MAX_COEFFICIENTS + 1)
        coefficients = self.coefficients + (0.0,) * (MAX_COEFFICIENTS - len(self.coefficients))
        return {
            "u_principal_point_px": self.principal_point_px,
            "u_coefficients": tuple(
                k * self.radius_max_px**n for k, n in zip(coefficients, powers, strict=True)
            ),
            "u_radius_max_px": self.radius_max_px,
        }
