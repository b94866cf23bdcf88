"""OCamCalib's inverse polynomial: the radius of a ray, which the toolbox's users project with.

    ρ = b0 + b1 t + b2 t² + …,  t = atan2(z, √(x² + y²)), z of the toolbox's frame, along −z of ours

so that t is −90° on the axis and grows with θ: t = θ − 90°.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from omnisim.cameras import OcamcalibCamera
from omnisim.errors import CalibrationError

WANTED_PX = 1e-3  # a tenth of what the toolbox itself asks for
HIGHEST_DEGREE = 16
NODES = 400
TURNED_RAD = 0.5 * math.pi


class InversePolynomial(NamedTuple):
    """An approximation of the radius."""

    coefficients_px: tuple[float, ...]  # b0, b1, …
    max_px: float  # largest distance from the exact radius, between the nodes of the fit


def inverse_polynomial(camera: OcamcalibCamera, theta_max_rad: float) -> InversePolynomial:
    """The polynomial of the lowest degree that is good to a thousandth of a pixel, or the best.

    Args:
        camera: the camera.
        theta_max_rad: largest angle from the axis that matters, as the picture shows.

    Raises:
        CalibrationError: an angle that is not above 0 and within the camera's domain.
    """
    if not 0.0 < theta_max_rad <= camera.theta_edge_rad + 1e-9:
        raise CalibrationError(
            f"camera: theta_max {math.degrees(theta_max_rad):g}°: want more than 0° and at most "
            f"the camera's {math.degrees(camera.theta_edge_rad):g}°"
        )
    theta = _chebyshev(NODES, theta_max_rad)
    between = 0.5 * (theta[1:] + theta[:-1])
    radii, wanted = (_radii_px(camera, one) for one in (theta, between))
    best = InversePolynomial((), math.inf)
    for degree in range(1, HIGHEST_DEGREE + 1):
        fitted = Polynomial.fit(theta - TURNED_RAD, radii, degree).convert()
        off = float(np.abs(fitted(between - TURNED_RAD) - wanted).max())
        if off < best.max_px:
            best = InversePolynomial(tuple(fitted.coef.tolist()), off)
        if off <= WANTED_PX:
            break
    return best


def _chebyshev(count: int, highest: float) -> np.ndarray:
    """Angles from 0 to the highest, denser at both ends, where polynomials stray."""
    return 0.5 * highest * (1.0 - np.cos(np.linspace(0.0, math.pi, count)))


def _radii_px(camera: OcamcalibCamera, theta: np.ndarray) -> np.ndarray:
    """Exact ρ (n,) of angles (n,); ρ is counted before the affine map."""
    rays = np.stack((np.sin(theta), np.zeros_like(theta), np.cos(theta)), axis=-1)
    offset = camera.pixel_from_ray(rays).positions_px - camera.principal_point_px
    c, d, e = camera.affine
    return np.linalg.norm(offset @ np.linalg.inv(np.array([[1.0, e], [d, c]])).T, axis=-1)
