"""Refraction by bodies of glass, which are closed meshes with KHR_materials_volume; and panes.

A ray enters glass at the front of a triangle and leaves it at the back, always from or to a medium
of index 1. Light that is not reflected is multiplied by `transmission` and the base color at each
surface, and by the attenuation along the way inside. Radiance is not scaled by the square of the
index: what stands in glass is as bright as before it.

Sources: Snell's law and Fresnel's equations for unpolarized light; KHR_materials_volume, for
Beer and Lambert's law; KHR_materials_dispersion, for the indices of red and blue.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Ints32
from omnisim.rendering.rays.caster import RayHits, Rays
from omnisim.scene.model import Material
from omnisim.scene.surface_kind import NO_KIND, SurfaceKind, pane_transmission, transmitted

NO_MEDIUM = -1  # air, among the indices of surfaces
_GREEN = 1  # channel whose index is the material's
# Difference of the indices of red and green per dispersion and ior − 1: half of 1/20
_SPREAD = 0.025
_BELOW = 1e-3  # minimum cosine between a refracted ray and the triangle's plane


class Refracted(NamedTuple):
    """Rays (m,) that pass surfaces of glass."""

    rays: Rays  # (m,) with virtual origins: ranges are those of the whole path
    shares: Floats32  # (m, 3) transmitted share of the light, linear RGB; 0: total reflection
    media: Ints32  # (m,) surfaces whose glass the rays are in, or `NO_MEDIUM`


class Glass(NamedTuple):
    """Glass parameters of a scene's surfaces."""

    # (surfaces,) transmitted share of the light that is not reflected; 0: no glass
    transmission: Floats
    indices: Floats  # (3, surfaces) refractive indices, for each channel
    absorption: Floats  # (surfaces, 3) absorption coefficients of Beer and Lambert's law, 1/m
    is_dispersive: bool  # True if indices differ among the channels

    @classmethod
    def of(cls, materials: list[Material], is_matte: bool) -> Glass:
        """Glass parameters of materials, one per surface; none if all are shown as matte."""
        asked = NO_KIND if is_matte else SurfaceKind.REFRACTING
        shares = np.array([transmitted(one, asked) for one in materials])
        ior = np.array([one.ior for one in materials])
        spreads = np.array([_SPREAD * one.dispersion for one in materials]) * (ior - 1.0)
        absorption = np.array([one.absorption_per_m for one in materials]).reshape(-1, 3)
        indices = np.maximum(np.stack((ior - spreads, ior, ior + spreads)), 1.0)
        return cls(shares, indices, absorption, bool(spreads[shares > 0.0].any()))

    def attenuation(self, media: Ints32, lengths_m: AnyFloats) -> Floats32:
        """Shares (n, 3) of light that remain after lengths (n,), up to infinity, in media (n,)."""
        shares = np.ones((len(media), 3), dtype=np.float32)
        inside = np.flatnonzero(media != NO_MEDIUM)
        absorption = self.absorption[media[inside]]
        lengths_m = np.minimum(np.maximum(lengths_m[inside, None], 0.0), 1e30)
        shares[inside] = np.exp(-absorption * lengths_m)
        return shares

    def ratios(self, surfaces: Ints32, is_front: Bools, channel: int | None) -> Floats:
        """Refractive indices (n,) behind surfaces (n,), relative to before them, for a channel."""
        indices = self.indices[_GREEN if channel is None else channel, surfaces]
        return np.where(is_front, indices, 1.0 / indices)


def interface_reflectance(cosines: AnyFloats, ratios: AnyFloats) -> AnyFloats:
    """Fresnel's reflectance (n,) of interfaces; 1: total reflection.

    Args:
        cosines: (n,) cosines of the angles of incidence.
        ratios: (n,) refractive indices behind the interfaces, relative to before them.
    """
    cosines = np.clip(cosines, 1e-4, 1.0).astype(np.float64)
    beyond = np.sqrt(np.maximum(1.0 - (1.0 - cosines**2) / ratios**2, 0.0))
    across = ((cosines - ratios * beyond) / (cosines + ratios * beyond)) ** 2
    along = ((beyond - ratios * cosines) / (beyond + ratios * cosines)) ** 2
    return 0.5 * (across + along)


def refracted_rays(rays: Rays, hits: RayHits, normals: AnyFloats, ratios: AnyFloats) -> Rays:
    """Rays (n,) behind hits with unit normals (n, 3), by `ratios` (n,) of refractive indices."""
    normals = normals.astype(np.float64)
    along = np.clip(-np.einsum("nc,nc->n", normals, rays.directions), 0.0, 1.0)
    beyond = np.sqrt(np.maximum(1.0 - (1.0 - along**2) / ratios**2, 0.0))
    directions = rays.directions / ratios[:, None]
    directions += (along / ratios - beyond)[:, None] * normals
    planes = hits.planes / np.maximum(np.linalg.norm(hits.planes, axis=1), 1e-30)[:, None]
    above = np.maximum(_BELOW + np.einsum("nc,nc->n", directions, planes), 0.0)
    directions -= above[:, None] * planes  # interpolated normals may refract out of the surface
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_m = hits.ranges_m[:, None]
    origins_m = rays.origins_m + ranges_m * (rays.directions - directions)
    return rays._replace(origins_m=origins_m, directions=directions)


# Reflectance and transmittance of thin panes of glass.
#
# One surface represents both interfaces of a pane. They are parallel and close together, so rays
# pass straight through.
#
# Sources: Fresnel's equations for unpolarized light, at each interface, with reflectance r; all
# reflections between the two sum to 2 r / (1 + r) (Pharr, Jakob and Humphreys, "Physically Based
# Rendering", 4th edition, section 11.5.4, "thin dielectrics"); KHR_materials_transmission, for
# the tint.


class Panes(NamedTuple):
    """Pane parameters of a scene's surfaces."""

    # (surfaces,) transmitted share of the light that is not reflected; 0: no pane
    transmission: Floats
    ior: Floats  # (surfaces,) refractive index
    depths: Floats  # (surfaces, 3) optical depths of slabs, see `SlabMaterial`

    @classmethod
    def of(cls, materials: list[Material]) -> Panes:
        """Pane parameters of materials, one per surface; metal transmits nothing."""
        shares = [pane_transmission(material) for material in materials]
        depths = np.array([material.optical_depths for material in materials]).reshape(-1, 3)
        return cls(np.array(shares), np.array([material.ior for material in materials]), depths)

    def transmitted(self, surfaces: Ints32, colors: AnyFloats, cosines: AnyFloats) -> Floats32:
        """Transmittance (n, 3), linear RGB, by base colors (n, 3) and cosines of incidence (n,)."""
        passing = 1.0 - pane_reflectance(cosines, self.ior[surfaces])
        passing = passing * self.transmission[surfaces]
        return (passing[:, None] * colors).astype(np.float32)

    def slab_colors(self, surfaces: Ints32, colors: AnyFloats, cosines: AnyFloats) -> Floats:
        """Tint (n, 3) of both faces of slabs and of the glass between, see `transmitted`."""
        inside = np.sqrt(1.0 - (1.0 - cosines**2) / self.ior[surfaces] ** 2)
        left = np.exp(-self.depths[surfaces] / np.maximum(inside, 1e-4)[:, None])
        return colors.astype(np.float64) ** 2 * left


def pane_reflectance(cosines: AnyFloats, ior: AnyFloats) -> AnyFloats:
    """Reflectance (n,) of panes by the cosines (n,) of the angles of incidence."""
    once = interface_reflectance(cosines, ior)
    return 2.0 * once / (1.0 + once)
