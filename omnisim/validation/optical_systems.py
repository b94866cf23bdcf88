"""Optical systems of the checks, and their rays and caustics in closed form.

In closed form, systems are on the axis of a pinhole at the origin. Rays and caustics are functions
of β, the angle between a pixel's ray and the axis. Points lie in the plane of this ray and the
axis: r is the distance from the axis, and z the coordinate along the axis, positive in front of the
pinhole.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from omnisim.cameras.optics import OpticalSystem
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError

SIZE_PX = 360
_FOLDED = (
    {"name": "upper", "shape": "sphere", "radius_m": 0.15, "position_m": [0.0, 0.0, 0.12],
     "rim_radius_m": 0.02},
    {"name": "lower", "shape": "conic", "radius_m": -0.1, "conic": -1.0,
     "position_m": [0.0, 0.0, 0.02], "rim_radius_m": 0.07, "hole_radius_m": 0.012},
)  # fmt: skip
_TILTED = {"shape": "hyperbolic", "rim_radius_m": 0.0119, "decenter_m": [0.002, 0.0, 0.0],
           "tilt_deg": [2.0, 0.0, 0.0]}  # fmt: skip
_SPHERE = {"shape": "sphere", "radius_m": 0.03, "position_m": [0.0, 0.0, 0.15],
           "rim_radius_m": 0.029}  # fmt: skip
_CONE = {"shape": "cone", "half_angle_deg": 50.0, "position_m": [0.0, 0.0, 0.12],
         "rim_radius_m": 0.08}  # fmt: skip
_FLAT = {"shape": "port", "position_m": [0.0, 0.0, 0.02], "thickness_m": 0.01, "wall": "acrylic",
         "medium": "water"}  # fmt: skip
_DOME = {"shape": "dome", "position_m": [0.0, 0.0, 0.0], "decenter_m": [0.003, 0.0, 0.004],
         "radius_m": 0.055, "thickness_m": 0.005, "wall": "acrylic", "medium": "water"}  # fmt: skip
SYSTEMS: Mapping[str, tuple[float, tuple[Mapping[str, Any], ...]]] = {
    "tilted mirror": (1330.0, (_TILTED,)),
    "sphere": (1000.0, (_SPHERE,)),
    "cone": (340.0, (_CONE,)),
    "folded": (1000.0, _FOLDED),
    "flat port": (180.0, (_FLAT,)),
    "dome port": (180.0, (_DOME,)),
}  # by name: focal length in pixels, and surfaces as in an optics file


def validation_systems() -> dict[str, OpticalSystem]:
    """Optical systems by name: the surfaces of `examples/optics` in front of a pinhole."""
    pinhole = {"model": "perspective", "width_px": SIZE_PX, "height_px": SIZE_PX}
    systems = {}
    for name, (focal_length_px, surfaces) in SYSTEMS.items():
        camera = pinhole | {"focal_length_px": focal_length_px}
        systems[name] = parse_optics({"camera": camera, "surfaces": list(surfaces)}, name)
    return systems


class AxialRays(NamedTuple):
    """Rays (n,) in a plane through the axis."""

    radii_m: Floats  # of the origins
    heights_m: Floats
    angles_rad: Floats  # from +z, outward


class AxialPoints(NamedTuple):
    """Points (n,) in a plane through the axis."""

    radii_m: Floats
    heights_m: Floats


class TracedAxialRays(NamedTuple):
    """Traced rays of a system's pixels, each with the direction of its plane through the axis."""

    pixels_px: Floats  # (n, 2)
    outward: Floats  # (n, 2): unit, away from the axis
    beta_rad: Floats  # (n,)
    origins_m: Floats  # (n, 3)
    directions: Floats  # (n, 3)

    def misses(self, expected: AxialRays) -> tuple[float, float]:
        """Maximum angle in rad to the expected rays, and maximum offset of an origin in m."""
        sines, cosines = np.sin(expected.angles_rad), np.cos(expected.angles_rad)
        directions = np.column_stack((self.outward * sines[:, None], cosines))
        origins_m = self.place(AxialPoints(*expected[:2]))
        angles = np.linalg.norm(self.directions - directions, axis=1)
        return float(angles.max()), float(np.abs(self.origins_m - origins_m).max())

    def place(self, points: AxialPoints) -> Floats:
        """Points (n, 3) from (r, z), each in the plane of its ray."""
        return np.column_stack((self.outward * points.radii_m[:, None], points.heights_m))


def traced_rays(system: OpticalSystem, count: int = 97) -> TracedAxialRays:
    """Valid rays of a grid of count × count pixels, without a pixel on the axis.

    Raises:
        OpticsError: there is no valid ray.
    """
    sides = [np.linspace(0.0, n - 1.0, count) for n in (system.width_px, system.height_px)]
    pixels = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    rays, into = system.rays(pixels), system.camera.ray_from_pixel(pixels).directions
    across = np.hypot(into[:, 0], into[:, 1])
    kept = rays.valid & (across > 1e-9)
    if not kept.any():
        raise OpticsError("optics: expected a pixel that sees something, got none")
    into, across = into[kept], across[kept]
    outward, beta_rad = into[:, :2] / across[:, None], np.arctan2(across, into[:, 2])
    origins_m, directions = rays.origins_m[kept], rays.directions[kept]
    return TracedAxialRays(pixels[kept], outward, beta_rad, origins_m, directions)


def sphere(beta: Floats, vertex_m: float, radius_m: float) -> AxialRays:
    """Rays reflected by a ball with its nearest point at z = `vertex_m`, by the law of sines."""
    center_m = vertex_m + radius_m
    incidence = np.arcsin(center_m * np.sin(beta) / radius_m)
    polar = incidence - beta
    angles_rad = math.pi - (2.0 * incidence - beta)
    return AxialRays(radius_m * np.sin(polar), center_m - radius_m * np.cos(polar), angles_rad)


def cone(beta: Floats, tip_m: float, half_angle_rad: float) -> AxialRays:
    """Rays reflected by a cone with its tip, at z = `tip_m`, toward the pinhole."""
    slope = math.tan(half_angle_rad)
    z = tip_m * slope / (slope - np.tan(beta))
    return AxialRays(z * np.tan(beta), z, 2.0 * half_angle_rad - beta)


def hyperboloid(beta: Floats, focus_m: float, semi_axis_m: float) -> AxialRays:
    """Rays reflected by a hyperboloid with foci at the pinhole and at z = 2 `focus_m`."""
    length = (focus_m**2 - semi_axis_m**2) / (focus_m * np.cos(beta) - semi_axis_m)
    r, z = length * np.sin(beta), length * np.cos(beta)
    return AxialRays(r, z, np.arctan2(r, z - 2.0 * focus_m))


def paraboloid(beta: Floats, vertex_m: float, radius_m: float) -> AxialRays:
    """Rays reflected by a paraboloid z = v + r²/2R, with v = `vertex_m` and R = `radius_m`."""
    tangent = np.tan(beta)
    root = np.sqrt(1.0 - 2.0 * vertex_m * tangent**2 / radius_m)
    r = 2.0 * vertex_m * tangent / (1.0 + root)
    return AxialRays(r, r / tangent, math.pi - (2.0 * np.arctan(r / radius_m) + beta))


def flat_port(
    beta: Floats, distance_m: float, thicknesses_m: Sequence[float], indices: Sequence[float]
) -> AxialRays:
    """Rays through parallel windows, by Snell's law.

    Args:
        beta: (n,) β in rad.
        distance_m: distance from the pinhole to the first boundary.
        thicknesses_m: thicknesses of the layers between boundaries.
        indices: refractive indices in front of, between and behind the boundaries.
    """
    sines = indices[0] * np.sin(beta)
    r = distance_m * np.tan(beta)
    for thickness_m, index in zip(thicknesses_m, indices[1:-1], strict=True):
        r = r + thickness_m * np.tan(np.arcsin(sines / index))
    depth_m = np.full(len(beta), distance_m + sum(thicknesses_m))
    return AxialRays(r, depth_m, np.arcsin(sines / indices[-1]))


def mirror_caustic(
    beta: Floats, rays: AxialRays, curvature: Floats, curvature_across: Floats
) -> tuple[AxialPoints, AxialPoints]:
    """Tangential and sagittal sheet of a convex mirror's caustic.

    Args:
        beta: (n,) β in rad.
        rays: rays reflected by the mirror.
        curvature, curvature_across: (n,) curvatures of the mirror in 1/m, in the plane of the axis
            and perpendicular to it.
    Source: Coddington's equations, which include the closed forms of Swaminathan, Grossberg & Nayar
        (2001) for conics of revolution.
    """
    length_m = np.hypot(rays.radii_m, rays.heights_m)
    cosine = np.cos(0.5 * (math.pi + beta - rays.angles_rad))  # of the incidence

    def sheet(bent: Floats) -> AxialPoints:
        behind_m = 1.0 / (1.0 / length_m + 2.0 * bent)
        radii_m = rays.radii_m - behind_m * np.sin(rays.angles_rad)
        return AxialPoints(radii_m, rays.heights_m - behind_m * np.cos(rays.angles_rad))

    return sheet(curvature / cosine), sheet(curvature_across * cosine)


def flat_port_caustic(
    beta: Floats, distance_m: float, index: float
) -> tuple[AxialPoints, AxialPoints]:
    """Tangential and sagittal sheet of a flat boundary's caustic; the sagittal one is on the axis.

    `index` is the refractive index behind the boundary, relative to the pinhole's side.

    Source: Treibitz, Schechner, Kunz & Singh, Flat refractive geometry (2012).
    """
    tangent, inside = np.tan(beta), 1.0 - index**-2
    z = -index * distance_m * (1.0 + inside * tangent**2) ** 1.5
    axis = -index * distance_m * np.sqrt(1.0 + inside * tangent**2)
    tangential = AxialPoints(-distance_m * inside * tangent**3, distance_m + z)
    return tangential, AxialPoints(np.zeros(len(beta)), distance_m + axis)


def flat_port_radius(
    radius_m: float, depth_m: float, distance_m: float, index: float
) -> tuple[float, ...]:
    """Radii at which rays from a pinhole to a point cross a flat boundary: roots of a quartic.

    Args:
        radius_m: distance of the point from the axis.
        depth_m: depth of the point behind the boundary.
        distance_m: distance of the pinhole from the boundary.
        index: refractive index behind the boundary, relative to that in front of it.
    Source: Agrawal, Ramalingam, Taguchi & Chari, A theory of multi-layer flat refractive geometry
        (2012): the analytical forward projection.
    """
    square, more = index * index, index * index - 1.0
    coefficients = (
        more,
        -2.0 * more * radius_m,
        more * radius_m**2 + square * distance_m**2 - depth_m**2,
        -2.0 * square * distance_m**2 * radius_m,
        square * (distance_m * radius_m) ** 2,
    )
    roots = np.roots(coefficients)
    real = roots.real[np.abs(roots.imag) < 1e-9 * abs(radius_m)]
    return tuple(real[(real >= 0.0) & (real <= radius_m)].tolist())
