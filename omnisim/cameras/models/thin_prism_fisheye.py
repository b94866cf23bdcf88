"""Fisheye polynomial with tangential distortion and a thin prism: FISHEYE624 of Project Aria.

    θ = atan2(√(x² + y²), z)
    ρ = θ (1 + k0 θ² + k1 θ⁴ + k2 θ⁶ + k3 θ⁸ + k4 θ¹⁰ + k5 θ¹²)
    q = ρ (cos φ, sin φ), p = (p0, p1)
    q' = q + 2 (p · q) q + |q|² p + |q|² (s0, s2) + |q|⁴ (s1, s3)
    (u, v) = (fx q'_x + cx, fy q'_y + cy)

Domain: 0 ≤ θ ≤ min(θ_max, θ_fold), where θ_fold is the first θ > 0 at which ρ(θ) folds, or the map
q → q' might: on the disc of q where 1 > (6 |p| + 2 |(s0, s2)|) |q| + 4 |(s1, s3)| |q|³, the
Jacobian's symmetric part is positive definite, so that the map is one to one.

GLSL twin: `shaders/camera/thin_prism_fisheye.glsl`. Source: Project Aria's documentation, "Camera
Intrinsic Models"; COLMAP's RAD_TAN_THIN_PRISM_FISHEYE; Foxglove's `fisheye62` without a prism.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.polynomial import polynomial
from pydantic import Field

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.lens_polynomials import first_root, polyval, solve_polynomial, undistort
from omnisim.cameras.parametric_camera import (
    EDGE_RAD,
    Coefficients,
    PlaneCamera,
    PlanePoints,
    TwoFocalCamera,
    WideTheta,
    unit_vectors,
)
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import described

MAX_RADIUS = 1e6  # of q, if neither fold bounds it
ROUNDING = 1e-13  # tolerance between a distorted point and the distortion of its inverse


@dataclass(frozen=True)
class ThinPrismFisheyeCamera(TwoFocalCamera, PlaneCamera):
    """Fisheye lens with an odd polynomial of θ, tangential distortion and a thin prism."""

    coefficients: Annotated[
        Coefficients, Field(min_length=6, max_length=6), described("k0, k1, k2, k3, k4, k5")
    ]
    """k0 … k5 of θ³, θ⁵, …; typically below 0.1."""
    tangential: Annotated[Coefficients, Field(min_length=2, max_length=2), described("p0, p1")] = (
        0.0,
        0.0,
    )
    """p0, p1: along u and along v."""
    prism: Annotated[
        Coefficients, Field(min_length=4, max_length=4), described("s0, s1, s2, s3")
    ] = (0.0, 0.0, 0.0, 0.0)
    """s0, s1 along u and s2, s3 along v."""
    theta_max_rad: WideTheta = math.pi
    """Angle from the axis where the domain ends, unless the fold comes first."""
    model_name = "thin_prism_fisheye"

    @property
    def theta_polynomial(self) -> tuple[float, ...]:
        """Coefficients of ρ(θ), from θ⁰ to θ¹³."""
        terms = (term for coefficient in self.coefficients for term in (coefficient, 0.0))
        return (0.0, 1.0, 0.0, *terms)

    @cached_property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends: θ_max, or the fold before it."""
        (s0, s1), (s2, s3) = self.prism[:2], self.prism[2:]
        near = 6.0 * math.hypot(*self.tangential) + 2.0 * math.hypot(s0, s2)
        bend = first_root([1.0, -near, 0.0, -4.0 * math.hypot(s1, s3)], MAX_RADIUS)
        ending = min(
            self.theta_max_rad, first_root(polynomial.polyder(self.theta_polynomial), math.tau)
        )
        if float(polyval(self.theta_polynomial, np.array(ending))) <= bend:
            return ending
        radius = np.array(bend)
        return float(solve_polynomial(self.theta_polynomial, radius, 0.0, ending))

    @cached_property
    def radius_edge(self) -> float:
        """ρ at the end of the domain."""
        return float(polyval(self.theta_polynomial, np.array(self.theta_edge_rad)))

    def distort(self, plane: Floats) -> Floats:
        """Points q' (..., 2) of points q (..., 2)."""
        p = np.array(self.tangential)
        near, far = np.array(self.prism).reshape(2, 2).T
        squared = np.sum(plane * plane, axis=-1, keepdims=True)
        along = 2.0 * (plane @ p)[..., None]
        return np.asarray(plane * (1.0 + along) + squared * (p + near + squared * far))

    def _newton_step(self, plane: Floats, error: Floats) -> Floats:
        """Inverse Jacobian at points (n, 2) times errors (n, 2)."""
        p = np.array(self.tangential)
        near, far = np.array(self.prism).reshape(2, 2).T
        squared = np.sum(plane * plane, axis=-1)[:, None]
        outer = 2.0 * (p + near + 2.0 * squared * far)  # (n, 2), times q as a row
        jacobian = outer[:, :, None] * plane[:, None, :] + 2.0 * plane[:, :, None] * p
        diagonal = 1.0 + 2.0 * (plane @ p)
        jacobian += diagonal[:, None, None] * np.eye(2)
        return np.asarray(np.linalg.solve(jacobian, error[..., None])[..., 0])

    def _rays_from_plane(self, plane: Floats) -> Rays:
        limit, bent = self.radius_edge, plane
        radius = np.hypot(plane[..., 0], plane[..., 1])
        if any(self.tangential) or any(self.prism):
            start = plane * (limit / np.maximum(radius, limit))[..., None]
            bent = undistort(self.distort, self._newton_step, start, plane, limit)
            miss = np.abs(self.distort(bent) - plane).max(axis=-1)
            valid = miss <= ROUNDING * np.maximum(1.0, radius)
            radius = np.hypot(bent[..., 0], bent[..., 1])
        else:
            valid = radius <= limit
        inside = np.minimum(radius, limit)
        theta = solve_polynomial(self.theta_polynomial, inside, 0.0, self.theta_edge_rad)
        across = unit_vectors(bent, radius) * np.sin(theta)[..., None]
        directions = np.concatenate((across, np.cos(theta)[..., None]), axis=-1)
        return Rays(directions, valid)

    def _plane_from_rays(self, directions: Floats) -> PlanePoints:
        across = np.hypot(directions[..., 0], directions[..., 1])
        theta = np.arctan2(across, directions[..., 2])
        radius = polyval(self.theta_polynomial, np.minimum(theta, self.theta_edge_rad))
        plane = unit_vectors(directions[..., :2], across) * radius[..., None]
        return PlanePoints(self.distort(plane), theta <= self.theta_edge_rad + EDGE_RAD)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/thin_prism_fisheye.glsl`."""
        s0, s1, s2, s3 = self.prism
        return {
            **super().uniforms(),
            "u_inner_terms": self.coefficients[:3],
            "u_outer_terms": self.coefficients[3:],
            "u_tangential": self.tangential,
            "u_prism": (s0, s2, s1, s3),
            "u_theta_edge_rad": self.theta_edge_rad,
            "u_radius_max": self.radius_edge,
        }
