"""Radial and tangential distortion of the normalized plane, k1, k2, p1, p2, k3, and its inverse.

    a = 1 + k1 r² + k2 r⁴ + k3 r⁶
    x' = a x + 2 p1 x y + p2 (r² + 2 x²)
    y' = a y + p1 (r² + 2 y²) + 2 p2 x y

The map is the gradient of r²/2 + k1 r⁴/4 + k2 r⁶/6 + k3 r⁸/8 + (p2 x + p1 y) r². Its Jacobian is
therefore symmetric, and on a disc where it is positive definite the map is one to one. The radial
part has the eigenvalues a(r) and b(r) = 1 + 3 k1 r² + 5 k2 r⁴ + 7 k3 r⁶. The tangential part has no
eigenvalue below −6 |p| r with |p| = √(p1² + p2²). The domain is the disc up to the first r with
min(a, b) = 6 |p| r; without tangential distortion this r is exactly the fold.

Source: Brown, "Close-range camera calibration", 1971; OpenCV's module calib3d.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from omnisim.cameras.monotone import first_root, solve_polynomial, undistort
from omnisim.cameras.plane_camera import PlanePoints, unit_vectors
from omnisim.core.arrays import Floats

ROUNDING = 1e-14  # tolerance between a distorted point and the distortion of its inverse


class RadialTangential(NamedTuple):
    """Coefficients, in OpenCV's order."""

    k1: float
    k2: float
    p1: float
    p2: float
    k3: float = 0.0

    def radius_limit(self, highest: float) -> float:
        """Radius of the disc that is the domain, at most `highest`."""
        slant = -6.0 * math.hypot(self.p1, self.p2)
        across = first_root(np.array([1.0, slant, self.k1, 0.0, self.k2, 0.0, self.k3]), highest)
        slopes = [1.0, slant, 3.0 * self.k1, 0.0, 5.0 * self.k2, 0.0, 7.0 * self.k3]
        along = first_root(np.array(slopes), highest)
        return min(across, along)

    def distort(self, plane: Floats) -> Floats:
        """Distorted points (..., 2) of points (..., 2)."""
        x, y = plane[..., :1], plane[..., 1:]
        squared = x * x + y * y
        tangential = np.array([self.p2, self.p1])
        growth = 1.0 + squared * (self.k1 + squared * (self.k2 + squared * self.k3))
        slant = self.p2 * x + self.p1 * y
        return plane * (growth + 2.0 * slant) + squared * tangential

    def undistort(self, distorted: Floats, limit: float) -> PlanePoints:
        """Points (..., 2) within `limit` that `distort` maps to `distorted` (..., 2).

        Valid where such a point exists; elsewhere, the result is another point within `limit`.
        """
        radius = np.hypot(distorted[..., 0], distorted[..., 1])
        radial = np.array([0.0, 1.0, 0.0, self.k1, 0.0, self.k2, 0.0, self.k3])
        start = solve_polynomial(radial, radius, 0.0, limit)
        plane = unit_vectors(distorted, radius) * start[..., None]
        if self.p1 or self.p2:
            plane = undistort(self.distort, self._newton_step, plane, distorted, limit)
        miss = np.abs(self.distort(plane) - distorted).max(axis=-1)
        return PlanePoints(plane, miss <= ROUNDING * np.maximum(1.0, radius))

    def _newton_step(self, plane: Floats, error: Floats) -> Floats:
        """Inverse Jacobian times an error (..., 2)."""
        # with very large coefficients, far points are not finite: no pixel sees those
        with np.errstate(over="ignore", invalid="ignore"):
            x, y = plane[..., 0], plane[..., 1]
            squared = x * x + y * y
            growth = 1.0 + squared * (self.k1 + squared * (self.k2 + squared * self.k3))
            bend = 2.0 * self.k1 + squared * (4.0 * self.k2 + 6.0 * self.k3 * squared)
            xx = growth + bend * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
            yy = growth + bend * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
            xy = bend * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y
            determinant = np.maximum(xx * yy - xy * xy, 1e-12)
            ex, ey = error[..., 0], error[..., 1]
            step = np.stack((yy * ex - xy * ey, xx * ey - xy * ex), axis=-1)
            return np.asarray(step / determinant[..., None])
