"""Scaramuzza's polynomial model, as in OCamCalib's calib_results.txt.

With x' down the rows, y' along the columns, ρ = √(x'² + y'²) and F(ρ) = a0 + a1 ρ + … + aN ρᴺ:

    (row, column) = [[c, d], [e, 1]] (x', y') + (center's row, column)
    the toolbox's ray is (x', y', F(ρ)) and looks along −z, so omnisim's is (y', x', −F(ρ))
    θ = atan2(ρ, −F(ρ))

The principal point here is (column, row), counted from 0. Files count rows and columns from 1 if
MATLAB wrote them, and from 0 if the C version did.

Domain: 0 ≤ θ ≤ θ_max, and ρ before the first ρ where dθ/dρ = (ρ F' − F)/(ρ² + F²) has fallen to a
thousandth of the axis's −1/a0. Beyond it, many pixels share nearly the same ray. The inverse is
numerical.

| parameter | unit | typical |
| --- | --- | --- |
| principal_point_px | px | image center |
| polynomial | px^(1−n) | a0 < 0 (−200), a1 = 0, a2 (1e-3) … aN, N at most 7 |
| affine | – | c, d, e: 1, 0, 0 |
| theta_max_deg | degrees | 90 to 110 |

GLSL twin: `shaders/camera/ocamcalib.glsl`. Source: Scaramuzza, Martinelli & Siegwart, "A toolbox
for easily calibrating omnidirectional cameras", 2006.
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
from omnisim.cameras.monotone import MAX_RADIUS_PX, first_root, polyval, solve_increasing
from omnisim.cameras.plane_camera import RadialCamera
from omnisim.core.errors import OpticsError

MAX_COEFFICIENTS = 8  # u_polynomial of the GLSL twin
MAX_COEFFICIENT = 1e9  # far beyond any lens, and its products stay finite
MIN_SLOPE = 1e-3  # share of the slope at the axis


@dataclass(frozen=True)
class OcamcalibCamera(RadialCamera):
    """Mirror or fisheye lens with a polynomial along the axis.

    Attributes:
        width_px, height_px: image size.
        principal_point_px: (u, v), that is (column, row), of the axis.
        polynomial: a0 … aN.
        affine: c, d, e.
        theta_max_rad: upper limit of the angle from the axis at which the domain ends.

    Raises:
        OpticsError: a size is not positive, a number is not finite, the coefficients are missing or
            too many, a0 ≥ 0, the affine map is not invertible, or θ_max is outside 0 to 180°.
    """

    principal_point_px: tuple[float, float]
    polynomial: tuple[float, ...]
    affine: tuple[float, ...] = (1.0, 0.0, 0.0)
    theta_max_rad: float = math.pi
    model_name = "ocamcalib"
    pixels_per_plane = 1.0  # the plane is in pixels

    def scaled(self, scale: float) -> OcamcalibCamera:
        """The same view in an image `scale` times as large; sizes are rounded."""
        # z and ρ are both in pixels
        grown = tuple(a * scale ** (1 - n) for n, a in enumerate(self.polynomial))
        return dataclasses.replace(super().scaled(scale), polynomial=grown)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= len(self.polynomial) <= MAX_COEFFICIENTS or self.polynomial[0] >= 0.0:
            raise OpticsError(
                f"camera: polynomial: expected 1 to {MAX_COEFFICIENTS} coefficients with a0 < 0, "
                f"got {self.polynomial}"
            )
        if not max(map(abs, self.polynomial)) <= MAX_COEFFICIENT:
            raise OpticsError(
                f"camera: polynomial: expected numbers up to {MAX_COEFFICIENT:g}, got "
                f"{self.polynomial}"
            )
        if len(self.affine) != 3 or self.affine[0] - self.affine[1] * self.affine[2] <= 0.0:
            raise OpticsError(f"camera: affine: expected c, d, e with c > d e, got {self.affine}")

    @cached_property
    def radius_max_px(self) -> float:
        """Largest ρ of the domain."""
        heights = np.array(self.polynomial)
        rises = polynomial.polysub(polynomial.polymulx(polynomial.polyder(heights)), heights)
        squares = polynomial.polyadd([0.0, 0.0, 1.0], polynomial.polymul(heights, heights))
        least = MIN_SLOPE / -heights[0]
        end = first_root(polynomial.polysub(rises, least * squares), MAX_RADIUS_PX)
        # sin(θ_max) F(ρ) + cos(θ_max) ρ = 0 at θ_max
        sine, cosine = math.sin(self.theta_max_rad), math.cos(self.theta_max_rad)
        at_theta_max = polynomial.polyadd(sine * heights, [0.0, cosine])
        return end if self.theta_max_rad == math.pi else min(end, first_root(at_theta_max, end))

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends."""
        return min(self.theta_max_rad, float(self._theta(np.array(self.radius_max_px))))

    def _theta(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.arctan2(radius, -polyval(self.polynomial, radius))

    def _slope(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        height = polyval(self.polynomial, radius)
        rise = polyval(polynomial.polyder(self.polynomial), radius)
        return (radius * rise - height) / (radius * radius + height * height)

    def _theta_from_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(self._theta(radius), self.theta_edge_rad)

    def _radius_from_theta(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return solve_increasing(self._theta, self._slope, theta, 0.0, self.radius_max_px)

    @property
    def _pixels_from_axes(self) -> NDArray[np.float64]:
        """Matrix (2, 2) from (y', x') to (column, row)."""
        c, d, e = self.affine
        return np.array([[1.0, e], [d, c]])

    def _plane_from_pixels(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        return (pixels - self.principal_point_px) @ np.linalg.inv(self._pixels_from_axes).T

    def _pixels_from_plane(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        return plane @ self._pixels_from_axes.T + self.principal_point_px

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/ocamcalib.glsl`, scaled to ρ/ρ_max for precision."""
        scale = self.radius_max_px
        coefficients = self.polynomial + (0.0,) * (MAX_COEFFICIENTS - len(self.polynomial))
        axes_from_pixels = np.linalg.inv(self._pixels_from_axes)
        return {
            "u_principal_point_px": self.principal_point_px,
            "u_axes_from_pixels": tuple(axes_from_pixels.T.ravel().tolist()),
            "u_polynomial": tuple(a * scale ** (n - 1) for n, a in enumerate(coefficients)),
            "u_radius_max_px": scale,
        }
