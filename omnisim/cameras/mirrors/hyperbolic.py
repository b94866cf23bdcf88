"""Hyperbolic mirror with the pinhole camera at its outer focus: the paper's camera.

    tan(θ/2) = K tan(β/2),  K = k − 1 + √(k(k−2)),  r = f tan β

θ is measured at the mirror's inner focus, the effective viewpoint, from its axis: 0 looks down at
the camera, and 90° is the horizon, with the radius f/√(k(k−2)) in the image. β is the corresponding
angle at the pinhole. The ray of a pixel is (sin θ cos φ, sin θ sin φ, −cos θ). With z reflected,
this is the unified model with ξ = √(k(k−2))/(k−1) and γ = f/(k−1).

Domain: 0 ≤ θ ≤ θ_max, the rim, which is below the mirror's asymptote acos(−√((k−2)/k)).

GLSL twin: `shaders/camera/hyperbolic.glsl`. Source: Baker & Nayar 1999, section 2.2; Schmits &
Visser 2008, Eq. 1.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras.camera import (
    CameraParameters,
    Pixels,
    Rays,
    Uniforms,
    as_directions,
    as_pixels,
)
from omnisim.cameras.mirrors import HyperbolicMirror, MirrorMesh
from omnisim.cameras.parametric_camera import FocalCamera
from omnisim.core.arrays import Bools, Floats, Indices
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL, RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import parse_table


class ImageRadii(NamedTuple):
    """Distances from the principal point; invalid entries hold the nearest edge of the domain."""

    radii_px: Floats  # (...,)
    valid: Bools  # (...,)


class Incidences(NamedTuple):
    """Angles of incidence at the effective viewpoint."""

    theta_rad: Floats  # (...,)
    valid: Bools  # (...,)


@dataclass(frozen=True)
class HyperbolicCamera(FocalCamera):
    """Camera that looks at a hyperbolic mirror: maps pixels to scene rays and back."""

    mirror: HyperbolicMirror
    """Shape of the mirror; its rim bounds the domain, θ ≤ θ_max."""
    model_name = "hyperbolic"
    _rig_from_optical: ClassVar[Floats] = RIG_FROM_OPTICAL_LOOKING_UP

    @classmethod
    def framed_on_rim(
        cls, mirror: HyperbolicMirror, width_px: int, height_px: int
    ) -> HyperbolicCamera:
        """Camera whose image is framed so that the rim touches the nearest edges.

        Raises:
            OpticsError: a size is below 1.
        """
        rim_tangent = float(mirror.tangent_from_theta(mirror.theta_max_rad))
        focal_length_px = 0.5 * min(width_px, height_px) / rim_tangent
        middle = (0.5 * (width_px - 1), 0.5 * (height_px - 1))
        return cls(width_px, height_px, focal_length_px, middle, mirror)

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any]) -> HyperbolicCamera:
        """Build the camera from its `parameters()`.

        Raises:
            OpticsError: a parameter is invalid; names the key, the actual and the expected value.
        """
        keys = ("k", "c", "meters_per_unit", "theta_max_deg")
        given = {key: parameters[key] for key in keys if key in parameters}
        for key in keys:
            if key not in given:
                raise OpticsError(f"camera.{key}: missing")
        mirror = parse_table(given, HyperbolicMirror, OpticsError, at="camera")
        return super().from_parameters({**parameters, "mirror": mirror})

    @property
    def domain_limit_rad(self) -> float:
        """Angle of incidence of the rim."""
        return self.mirror.theta_max_rad

    @property
    def unified_focal_length_px(self) -> float:
        """γ of the unified (Geyer, Mei) model with the mirror's ξ; its frame has z reflected."""
        return self.focal_length_px / (self.mirror.k - 1.0)

    @property
    def horizon_radius_px(self) -> float:
        """Radius h of the 90° circle, f/√(k(k−2)); infinite for the plane mirror."""
        k = self.mirror.k
        return math.inf if k == 2.0 else self.focal_length_px / math.sqrt(k * (k - 2.0))

    @property
    def rim_radius_px(self) -> float:
        """Radius of the rim in the image."""
        tangent = self.mirror.tangent_from_theta(self.mirror.theta_max_rad)
        return self.focal_length_px * float(tangent)

    def image_radius(self, theta_rad: ArrayLike) -> ImageRadii:
        """Exact image radius f tan β at incidence θ (...,); valid for 0 ≤ θ ≤ θ_max."""
        theta = np.asarray(theta_rad, dtype=np.float64)
        valid = (theta >= 0.0) & (theta <= self.mirror.theta_max_rad)
        inside = np.clip(theta, 0.0, self.mirror.theta_max_rad)
        return ImageRadii(self.focal_length_px * self.mirror.tangent_from_theta(inside), valid)

    def incidence(self, radius_px: ArrayLike) -> Incidences:
        """Exact incidence θ at an image radius (...,); valid from 0 to the rim's radius."""
        radius = np.asarray(radius_px, dtype=np.float64)
        theta = self.mirror.theta_from_tangent(np.abs(radius) / self.focal_length_px)
        return Incidences(theta, (radius >= 0.0) & (theta <= self.mirror.theta_max_rad))

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2): unit directions in the optical frame; valid where θ ≤ θ_max.

        Source: `HyperbolicMirror.tangent_from_theta`, written as a stereographic lift.
        """
        pixels = as_pixels(pixels_px)
        tangent = (pixels - self.principal_point_px) / self.focal_length_px
        squared = np.sum(tangent * tangent, axis=-1, keepdims=True)
        half = tangent * (self.mirror.half_angle_ratio / (1.0 + np.sqrt(1.0 + squared)))
        half_squared = np.sum(half * half, axis=-1, keepdims=True)
        directions = np.concatenate((2.0 * half, half_squared - 1.0), axis=-1)
        directions /= 1.0 + half_squared
        valid = half_squared[..., 0] <= math.tan(0.5 * self.mirror.theta_max_rad) ** 2
        return Rays(directions, valid)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) in the optical frame; valid where θ ≤ θ_max."""
        rays = as_directions(directions)
        across = np.hypot(rays[..., 0], rays[..., 1])
        theta = np.arctan2(across, -rays[..., 2])
        valid = theta <= self.mirror.theta_max_rad
        radius = self.image_radius(theta).radii_px
        scale = np.divide(radius, across, out=np.zeros_like(radius), where=across > 0.0)
        positions = rays[..., :2] * scale[..., None] + self.principal_point_px
        return Pixels(positions, valid)

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/hyperbolic.glsl`."""
        return {
            **super().uniforms(),
            "u_half_angle_ratio": self.mirror.half_angle_ratio,
            "u_rim_half_tangent": math.tan(0.5 * self.mirror.theta_max_rad),
        }

    def parameters(self) -> CameraParameters:
        """Model name and parameters, plus ξ and γ of the unified model."""
        mirror = self.mirror
        return {
            "model": self.model_name, "width_px": self.width_px, "height_px": self.height_px,
            "focal_length_px": self.focal_length_px,
            "principal_point_px": list(self.principal_point_px),
            "k": mirror.k, "c": mirror.c, "meters_per_unit": mirror.meters_per_unit,
            "theta_max_deg": math.degrees(mirror.theta_max_rad),
            "xi": mirror.xi, "unified_focal_length_px": self.unified_focal_length_px,
        }  # fmt: skip


def image_radius_eq2_px(theta_rad: ArrayLike, horizon_radius_px: float) -> Floats:
    """Image radius (...,) by the paper's Eq. 2, r = h sin θ/(1 + cos θ).

    Eq. 2 is exact only for a paraboloid (ξ = 1); the error for the paper's mirror is −0.24 % at
    110°. `horizon_radius_px`: radius h of the 90° circle.

    Source: Schmits & Visser 2008, Eq. 2. Domain: 0 ≤ θ < π.
    """
    return horizon_radius_px * np.tan(0.5 * np.asarray(theta_rad, dtype=np.float64))


def theta_from_image_radius_eq2_rad(radius_px: ArrayLike, horizon_radius_px: float) -> Floats:
    """Incidence θ (...,) of image radii (...,) by the inverse of Eq. 2; h is the horizon's."""
    return 2.0 * np.arctan(np.asarray(radius_px, dtype=np.float64) / horizon_radius_px)


# Rays of pixels that see a mirror's mesh: its polygons, and their rim in the image.


def mesh_rays(camera: HyperbolicCamera, mesh: MirrorMesh, pixels_px: Floats) -> Rays:
    """Rays of pixels (..., 2) of a camera through the points of the flat polygons that they see.

    Beyond the rim of the mirror's mesh, pixels see the planes of its outermost polygons, and are
    invalid. Directions (..., 3) are unit vectors in the optical frame.

    Source: section 2.3 of the paper.
    """
    offsets = (pixels_px - camera.principal_point_px) / camera.focal_length_px
    seen = np.concatenate((offsets, np.ones((*offsets.shape[:-1], 1))), axis=-1)
    seen *= np.diag(MIRROR_FROM_OPTICAL)
    vertices, pinhole = mesh.vertices_m / camera.mirror.c_m, np.array([0.0, 0.0, 1.0])
    sector, radius_px = _sectors(camera, mesh.sectors, pixels_px)
    in_image = vertices[:, :2] / (1.0 - vertices[:, 2:])
    rings = np.hypot(*in_image[1 :: mesh.sectors].T) * camera.focal_length_px
    ring = np.minimum(np.searchsorted(rings, radius_px), mesh.rings - 1)
    # the diagonal of a cell, from its inner first corner to its outer second one
    inner = in_image[1 + np.maximum(ring - 1, 0) * mesh.sectors + sector]
    diagonal = in_image[1 + ring * mesh.sectors + (sector + 1) % mesh.sectors] - inner
    ahead = seen[..., :2] - inner
    is_upper = diagonal[..., 0] * ahead[..., 1] > diagonal[..., 1] * ahead[..., 0]
    cell = mesh.sectors * (2 * ring - 1) + 2 * sector + is_upper
    corners = vertices[mesh.triangles[np.where(ring > 0, cell, sector)]]
    first, second, third = np.moveaxis(corners, -2, 0)
    planes = np.cross(second - first, third - first)
    along = np.einsum("...c,...c->...", planes, seen)
    share = np.einsum("...c,...c->...", planes, first - pinhole)
    share = np.divide(share, along, out=np.ones_like(share), where=along != 0.0)
    points = pinhole + share[..., None] * seen
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    return Rays(points * np.diag(MIRROR_FROM_OPTICAL), inside_rim(camera, mesh.sectors, pixels_px))


def inside_rim(camera: HyperbolicCamera, sectors: int, pixels_px: Floats) -> Bools:
    """Mask (...,) of the pixels (..., 2) that see a mesh of so many sectors."""
    return _sectors(camera, sectors, pixels_px)[1] <= camera.rim_radius_px


def _sectors(camera: HyperbolicCamera, sectors: int, pixels_px: Floats) -> tuple[Indices, Floats]:
    """Sector (...,) of pixels (..., 2), and the radius of the ring's polygon through each."""
    x, y = np.moveaxis(pixels_px - camera.principal_point_px, -1, 0)
    half = math.pi / sectors
    azimuth = np.arctan2(-y, x)  # in the mirror frame
    sector = np.floor(azimuth / (2.0 * half))
    beside = azimuth - (2.0 * sector + 1.0) * half
    radius_px = np.hypot(x, y) * np.cos(beside) / math.cos(half)
    return sector.astype(np.intp) % sectors, radius_px
