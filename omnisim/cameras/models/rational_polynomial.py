"""OpenCV's pinhole lens with all coefficients: rational radial, thin prism, tilted sensor.

    x = X/Z, y = Y/Z, r² = x² + y², g = (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶)
    x' = g x + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴
    y' = g y + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴
    (x'', y'', 1) ~ T(τx, τy) (x', y', 1)
    (u, v) = (fx x'' + u0, fy y'' + v0)

T is the perspective map onto a sensor that is tilted by τx about x, then by τy about y.

Domain: Z > 0, x² + y² ≤ r_max², and x' and y' in front of the tilted sensor; r_max ≤ tan θ_max,
which is Basalt's `rpmax`. On the disc of r_max the map is one to one: the Jacobian's symmetric part
is positive definite, since g and d(g r)/dr exceed 6 |p| r + 2 |(s1, s3)| r + 4 |(s2, s4)| r³, which
bounds the other terms. Unless something else limits it, r_max is 50 (88.9°).

GLSL twin: `shaders/camera/rational_polynomial.glsl`. Source: OpenCV's module calib3d; ROS's
distortion model of the same name; Azure Kinect's and OAK-D's calibrations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.polynomial import polynomial

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.lens_polynomials import first_root, solve_increasing, undistort
from omnisim.cameras.parametric_camera import (
    Coefficients,
    PlaneCamera,
    PlanePoints,
    ThetaMax,
    TwoFocalCamera,
    unit_vectors,
)
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import Typical

MAX_RADIUS = 50.0
MAX_TILT_RAD = math.radians(80.0)
COEFFICIENT_COUNTS = (8, 12, 14)
ROUNDING = 1e-13  # tolerance between a distorted point and the distortion of its inverse


@dataclass(frozen=True)
class RationalPolynomialCamera(TwoFocalCamera, PlaneCamera):
    """Pinhole camera with OpenCV's rational distortion, thin prism and sensor tilt."""

    distortion: Coefficients
    """k1, k2, p1, p2, k3, k4, k5, k6, optionally s1, s2, s3, s4, then τx, τy."""
    theta_max_rad: Annotated[ThetaMax, Typical(math.radians(40.0), math.radians(80.0))] = math.pi
    """Angle from the axis where the domain ends, unless r_max comes first."""
    model_name = "rational_polynomial"
    added_later = frozenset({"theta_max_rad"})

    def _check(self) -> None:
        super()._check()
        if len(self.distortion) not in COEFFICIENT_COUNTS:
            expected = "k1, k2, p1, p2, k3, k4, k5, k6, optionally s1, s2, s3, s4, and then τx, τy"
            raise self._error("distortion", expected)
        for name, tilt in zip(("τx", "τy"), self.tilt_rad, strict=True):
            if not abs(tilt) <= MAX_TILT_RAD:
                limits = f"−{MAX_TILT_RAD:.3g} to {MAX_TILT_RAD:.3g}"
                raise OpticsError(f"camera: distortion: {name}: expected {limits}, got {tilt:g}")

    @property
    def prism(self) -> Floats:
        """Thin prism (2, 2): s1, s2 along x and s3, s4 along y."""
        return np.array((*self.distortion[8:12], 0.0, 0.0, 0.0, 0.0)[:4]).reshape(2, 2)

    @property
    def tilt_rad(self) -> tuple[float, float]:
        """Sensor tilt angles τx and τy."""
        x, y = (*self.distortion[12:], 0.0, 0.0)[:2]
        return x, y

    @cached_property
    def sensor_from_plane(self) -> Floats:
        """Homography (3, 3) T onto the tilted sensor."""
        (cx, cy), (sx, sy) = np.cos(self.tilt_rad), np.sin(self.tilt_rad)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, sx], [0.0, -sx, cx]])
        about_y = np.array([[cy, 0.0, -sy], [0.0, 1.0, 0.0], [sy, 0.0, cy]])
        turned = about_y @ about_x
        x, y, z = turned[:, 2]
        projection = np.array([[z, 0.0, -x], [0.0, z, -y], [0.0, 0.0, 1.0]])
        return np.asarray(projection @ turned)

    @cached_property
    def plane_from_sensor(self) -> Floats:
        """Inverse (3, 3) of `sensor_from_plane`."""
        return np.asarray(np.linalg.inv(self.sensor_from_plane), dtype=np.float64)

    @cached_property
    def _ratio(self) -> tuple[Floats, Floats]:
        """Coefficients (7,) of the numerator and the denominator of g, by powers of r from 0."""
        k1, k2, _, _, k3, k4, k5, k6 = self.distortion[:8]
        above = np.array([1.0, 0.0, k1, 0.0, k2, 0.0, k3])
        return above, np.array([1.0, 0.0, k4, 0.0, k5, 0.0, k6])

    @cached_property
    def radius_limit(self) -> float:
        """Radius of the domain on the plane before distortion."""
        above, below = self._ratio
        sides = np.linalg.norm(self.prism, axis=0)
        bend = np.array([0.0, 6.0 * math.hypot(*self.distortion[2:4]) + 2.0 * sides[0]])
        bend = polynomial.polyadd(bend, [0.0, 0.0, 0.0, 4.0 * sides[1]])
        pole = first_root(below, MAX_RADIUS)
        across = polynomial.polysub(above, polynomial.polymul(bend, below))
        # d(g r)/dr of the ratio, times its squared denominator
        along = polynomial.polysub(
            polynomial.polymul(polynomial.polyder(polynomial.polymulx(above)), below),
            polynomial.polymul(polynomial.polymulx(above), polynomial.polyder(below)),
        )
        bends = polynomial.polymul(bend, polynomial.polymul(below, below))
        along = polynomial.polysub(along, bends)
        stated = math.tan(self.theta_max_rad) if self.theta_max_rad < 0.5 * math.pi else MAX_RADIUS
        return min(pole * (1.0 - 1e-9), first_root(across, pole), first_root(along, pole), stated)

    def _growth(self, radius: Floats) -> tuple[Floats, ...]:
        """Ratio g (...,) at a radius (...,) and dg/dr (...,)."""
        k1, k2, _, _, k3, k4, k5, k6 = self.distortion[:8]
        squared = radius * radius
        n, slope_n = _even_polynomial(k1, k2, k3, squared)
        d, slope_d = _even_polynomial(k4, k5, k6, squared)
        d = np.maximum(d, 1e-12)  # beyond the pole, outside the domain
        return n / d, 2.0 * radius * (slope_n * d - n * slope_d) / (d * d)

    def distort(self, plane: Floats) -> Floats:
        """Distorted points (..., 2) of points (..., 2) within the domain, before the tilt."""
        x, y = plane[..., :1], plane[..., 1:]
        squared = x * x + y * y
        growth, _ = self._growth(np.sqrt(squared))
        tangential = np.array(self.distortion[3:1:-1])
        along = tangential[0] * x + tangential[1] * y
        first, second = self.prism.T
        offset = squared * (tangential + first + squared * second)
        return np.asarray(plane * (growth + 2.0 * along) + offset)

    def _undistort(self, distorted: Floats) -> PlanePoints:
        """Points (..., 2) of the domain that `distort` maps to `distorted` (..., 2)."""
        radius = np.hypot(distorted[..., 0], distorted[..., 1])

        def grown(radii: Floats) -> Floats:
            return np.asarray(radii * self._growth(radii)[0])

        def slope(radii: Floats) -> Floats:
            growth, rise = self._growth(radii)
            return np.asarray(growth + radii * rise)

        start = solve_increasing(grown, slope, radius, 0.0, self.radius_limit)
        plane = unit_vectors(distorted, radius) * start[..., None]
        if any(self.distortion[2:4]) or self.prism.any():
            limit = self.radius_limit
            plane = undistort(self.distort, self._newton_step, plane, distorted, limit)
        miss = np.abs(self.distort(plane) - distorted).max(axis=-1)
        return PlanePoints(plane, miss <= ROUNDING * np.maximum(1.0, radius))

    def _newton_step(self, plane: Floats, error: Floats) -> Floats:
        """Inverse Jacobian times an error (n, 2)."""
        x, y = plane.T
        squared = x * x + y * y
        radius = np.sqrt(squared)
        growth, rise = self._growth(radius)
        px, py = self.distortion[3], self.distortion[2]
        (sx, sxx), (sy, syy) = self.prism.tolist()
        radial = np.divide(rise, radius, out=np.zeros_like(radius), where=radius > 0.0)
        across = radial * x + 2.0 * (sx + 2.0 * squared * sxx + px)
        down = radial * y + 2.0 * (sy + 2.0 * squared * syy + py)
        diagonal = growth + 2.0 * (px * x + py * y)
        xx, xy = across * x + 2.0 * px * x + diagonal, across * y + 2.0 * py * x
        yx, yy = down * x + 2.0 * px * y, down * y + 2.0 * py * y + diagonal
        ex, ey = error.T
        step = np.stack((yy * ex - xy * ey, xx * ey - yx * ex), axis=-1)
        return np.asarray(step / (xx * yy - xy * yx)[:, None])

    def _rays_from_plane(self, plane: Floats) -> Rays:
        distorted = _mapped(self.plane_from_sensor, plane)
        points = self._undistort(distorted.positions)
        depth = np.ones_like(points.positions[..., :1])
        directions = np.concatenate((points.positions, depth), axis=-1)
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        return Rays(directions, points.valid & distorted.valid)

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        across = np.hypot(directions[..., 0], directions[..., 1])
        valid = across <= self.radius_limit * (1.0 + 1e-12) * directions[..., 2]
        valid &= directions[..., 2] > 0.0
        plane = directions[..., :2] / np.where(valid, directions[..., 2], 1.0)[..., None]
        distorted = self.distort(np.where(valid[..., None], plane, 0.0))
        sensor = _mapped(self.sensor_from_plane, distorted)
        return PlanePoints(sensor.positions, valid & sensor.valid)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/rational_polynomial.glsl`."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion[:8]
        (s1, s2), (s3, s4) = self.prism.tolist()
        rows = self.plane_from_sensor.tolist()
        return {
            **super().uniforms(), "u_numerator": (k1, k2, k3), "u_denominator": (k4, k5, k6),
            "u_tangential": (p2, p1), "u_prism": (s1, s3, s2, s4),
            "u_plane_from_sensor_x": tuple(rows[0]), "u_plane_from_sensor_y": tuple(rows[1]),
            "u_plane_from_sensor_w": tuple(rows[2]), "u_radius_max": self.radius_limit,
        }  # fmt: skip


def _even_polynomial(
    first: float, second: float, third: float, squared: Floats
) -> tuple[Floats, Floats]:
    """Values 1 + k1 s + k2 s² + k3 s³ and slopes with respect to s, at s (...,)."""
    value = 1.0 + squared * (first + squared * (second + squared * third))
    return value, first + squared * (2.0 * second + squared * (3.0 * third))


def _mapped(matrix: Floats, plane: Floats) -> PlanePoints:
    """Map points (..., 2) by a homography (3, 3); valid where the third coordinate is positive."""
    homogeneous = plane @ matrix[:, :2].T + matrix[:, 2]
    valid = homogeneous[..., 2] > 1e-9
    depth = np.where(valid, homogeneous[..., 2], 1.0)[..., None]
    return PlanePoints(homogeneous[..., :2] / depth, valid)
