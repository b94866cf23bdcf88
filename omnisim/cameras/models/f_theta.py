"""F-theta lens: the radius in pixels is a polynomial of the angle.

    r = k1 θ + k2 θ² + … + kn θⁿ, in pixels along u; along v times the aspect ratio

Domain: 0 ≤ θ ≤ min(θ_max, θ_fold), θ_fold the first θ > 0 with dr/dθ = 0. `f_theta_inverse` is the
opposite model, with θ as a polynomial of r.

| parameter | unit | typical |
| --- | --- | --- |
| principal_point_px | px | image center |
| coefficients_px | px/radⁿ | k1 … kn, at most 8; k1 > 0 is the focal length |
| theta_max_deg | degrees | 95 to 110 |
| aspect_ratio | – | 1: square pixels |

GLSL twin: `shaders/camera/f_theta.glsl`. Source: NVIDIA's f-theta lens with k0 = 0; WoodScape's
calibration files (Yogamani et al., 2019), four coefficients.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.model_parameters import check_limits
from omnisim.cameras.models.polynomial_lens import PolynomialLens
from omnisim.core.errors import OpticsError

ASPECT_RATIOS = (0.1, 10.0)
MAX_COEFFICIENTS = 8  # u_coefficients of the GLSL twin


@dataclass(frozen=True)
class FThetaCamera(PolynomialLens):
    """Fisheye lens whose radius is a polynomial of the angle.

    Attributes:
        width_px, height_px: image size.
        principal_point_px: (u, v) of the optical axis in the image.
        coefficients_px: k1 … kn.
        theta_max_rad: angle from the axis where the domain ends, unless the fold comes first.
        aspect_ratio: pixels along v per pixel along u at the same radius.

    Raises:
        OpticsError: a size is not positive, a number is not finite, the coefficients are missing or
            too many, k1 ≤ 0, θ_max is outside 0 to 180°, or the aspect ratio is outside 0.1 to 10.
    """

    principal_point_px: tuple[float, float]
    coefficients_px: tuple[float, ...]
    theta_max_rad: float = math.pi
    aspect_ratio: float = 1.0
    model_name = "f_theta"
    added_later = frozenset({"aspect_ratio"})

    def __post_init__(self) -> None:
        super().__post_init__()
        check_limits(self, "aspect_ratio", *ASPECT_RATIOS)
        count = len(self.coefficients_px)
        if not 1 <= count <= MAX_COEFFICIENTS or self.coefficients_px[0] <= 0.0:
            raise OpticsError(
                f"camera: coefficients_px: expected 1 to {MAX_COEFFICIENTS} numbers, the first "
                f"more than 0, got {self.coefficients_px}"
            )

    @property
    def pixels_per_plane(self) -> tuple[float, float]:
        """Pixels per unit of the plane, which is measured in pixels along u."""
        return 1.0, self.aspect_ratio

    @property
    def theta_polynomial(self) -> tuple[float, ...]:
        """Coefficients of r(θ), θ⁰ first."""
        return (0.0, *self.coefficients_px)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/f_theta.glsl`."""
        missing = MAX_COEFFICIENTS - len(self.coefficients_px)
        return {
            "u_principal_point_px": self.principal_point_px,
            "u_aspect_ratio": self.aspect_ratio,
            "u_coefficients_px": self.coefficients_px + (0.0,) * missing,
            "u_theta_edge_rad": self.theta_edge_rad,
            "u_radius_max_px": self.radius_limits[1],
        }
