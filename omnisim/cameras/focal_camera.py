"""Bases of camera models with a principal point and one focal length, or one per axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import Rays, Uniforms
from omnisim.cameras.parametric_camera import ParametricCamera, PrincipalPoint, ThetaMax
from omnisim.cameras.plane_camera import EDGE_RAD, PlanePoints, RadialCamera
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number, Typical

# Far beyond any camera; squares of derived values still fit into a float.
FocalLength = Annotated[Number, Field(ge=1e-30, le=1e30), Typical(100.0, 1000.0)]


@dataclass(frozen=True)
class FocalCamera(ParametricCamera):
    """Image size, focal length and principal point; subclasses add the projection."""

    focal_length_px: FocalLength
    """Focal length in pixels; at the axis of a fisheye, pixels per radian."""
    principal_point_px: PrincipalPoint
    """(u, v) of the optical frame's z axis in the image; typically its center."""

    @property
    def pixels_per_plane(self) -> float:
        """Pixels per unit of the normalized plane."""
        return self.focal_length_px

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {
            "u_focal_length_px": self.focal_length_px,
            "u_principal_point_px": self.principal_point_px,
        }


@dataclass(frozen=True)
class TwoFocalCamera(ParametricCamera):
    """A `FocalCamera` with one focal length per image axis, as calibrations have."""

    focal_lengths_px: tuple[FocalLength, FocalLength]
    """(fx, fy), along u and along v, in pixels."""
    principal_point_px: PrincipalPoint
    """(u, v) of the optical frame's z axis in the image; typically its center."""

    @property
    def pixels_per_plane(self) -> tuple[float, float]:
        """Pixels per unit of the normalized plane, along u and along v."""
        return self.focal_lengths_px

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {
            "u_focal_lengths_px": self.focal_lengths_px,
            "u_principal_point_px": self.principal_point_px,
        }


# Base of the ideal fisheye lenses: one focal length, one limit, r(θ) in closed form.
#
# The subclasses are `equidistant`, `stereographic`, `equisolid` and `orthographic`.
# Source: Miyamoto, "Fish eye lens", 1964; Kannala & Brandt 2006, Eq. 1 to 5.


@dataclass(frozen=True)
class FisheyeCamera(FocalCamera, RadialCamera):
    """Fisheye lens whose r/f is a function of θ alone, up to θ_max."""

    theta_max_rad: ThetaMax
    """Angle from the axis where the domain ends."""

    def uniforms(self) -> Uniforms:
        """Uniforms for `shaders/camera/<model>.glsl`."""
        return {**super().uniforms(), "u_radius_max": self.radius_limits[1]}


# Sphere of the unified model in its α form, shared by EUCM and the double sphere.
#
# A point p on the unit sphere is projected to (x, y)/(α + (1 − α) z). With ξ = α/(1 − α), this is
# Geyer and Mei's projection from a point ξ above the sphere's center, in an image 1 + ξ times as
# large.


MAX_RADIUS = 1e6  # on the normalized plane, if nothing else bounds it: nearly at the limit angle


def cosine_limit(alpha: float) -> float:
    """Lower limit of z on the unit sphere: −w, with w = α/(1 − α) for α ≤ 0.5, else (1 − α)/α."""
    return -alpha / (1.0 - alpha) if alpha <= 0.5 else -(1.0 - alpha) / alpha


def plane_limit(alpha: float) -> float:
    """Largest radius on the normalized plane: 1/√(2α − 1), where the image folds, if α > 0.5."""
    return min(MAX_RADIUS, 1.0 / math.sqrt(2.0 * alpha - 1.0)) if alpha > 0.5 else MAX_RADIUS


def lift_alpha(plane: Floats, alpha: float) -> Rays:
    """Unit vectors (..., 3) of points (..., 2); points beyond `plane_limit` are moved onto it."""
    radius = np.hypot(plane[..., 0], plane[..., 1])
    limit = plane_limit(alpha)
    valid = radius <= limit
    shrink = limit / np.maximum(radius, limit)
    plane = plane * shrink[..., None]
    squared = np.sum(plane * plane, axis=-1)
    root = np.sqrt(np.maximum(1.0 - (2.0 * alpha - 1.0) * squared, 0.0))
    z = (1.0 - alpha * alpha * squared) / (alpha * root + 1.0 - alpha)
    directions = np.concatenate((plane, z[..., None]), axis=-1)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return Rays(directions, valid)


def project_alpha(
    directions: Floats, z: Floats, distance: Floats, alpha: float, length: Floats
) -> PlanePoints:
    """Project directions (..., 3) to the normalized plane: (x, y)/(α d + (1 − α) z).

    `z` and `distance` d (...,) are those of the model's last sphere. `length` (...,) is the length
    of the directions, used as the scale of rounding errors.
    """
    valid = z > (cosine_limit(alpha) - EDGE_RAD) * distance
    scale = alpha * distance + (1.0 - alpha) * z
    valid &= scale > 1e-12 * length
    scale = np.where(valid, scale, 1.0)
    return PlanePoints(directions[..., :2] / scale[..., None], valid)
