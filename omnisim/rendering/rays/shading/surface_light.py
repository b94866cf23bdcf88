"""Light at specular surfaces: what passes, what is reflected, and what returns to its source.

A surface returns light to where it came from by two ways. The body below the gloss is Lambertian,
and the light crosses the gloss twice. Facets of the gloss return light where they face it: half
vector, view and light are one direction. A polished surface returns nothing unless it is met
perpendicularly, to within the beam's divergence, for which 3.2 mrad are assumed: the VLS-128 has 3
(Velodyne, VLS-128 User Manual, table F-1).

Sources: glTF 2.0, appendix B, for facets and Schlick's Fresnel; Walter et al., "Microfacet Models
for Refraction through Rough Surfaces", 2007, for Beckmann's; `panes` for thin panes; Höfle and
Pfeifer, "Correction of laser scanning intensity data", ISPRS Journal 62 (2007), for the returned
share, which is relative to a white Lambertian surface met perpendicularly at the same range.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.shading.panes import pane_reflectance
from omnisim.rendering.rays.shading.ray_reflectance import Reflectance, microfacets
from omnisim.rendering.rays.shading.shading import Shading, View
from omnisim.scene.surface_reflectance import COAT_F0, MIN_ROUGHNESS

Shares = NDArray[np.float64]
# Interpolated normals within 0.1° of the triangle's are those of a planar mirror.
_MIN_FLAT_COSINE = float(np.cos(np.radians(0.1)))
_SMOOTH = MIN_ROUGHNESS + 1e-6
_MIN_COSINE = 1e-4
# Squared slope at which a plane returns 1/e of the light: it turns the beam by 3.2 mrad.
_BEAM_SQUARED = MIN_ROUGHNESS**4


class SurfaceLight(NamedTuple):
    """Shares of the light that arrives at surfaces (n,), linear RGB.

    Attributes:
        passed: (n, 3) share that passes straight through panes; 0 elsewhere.
        reflected: (n, 3) share that is reflected in the mirror's direction; 0 unless smooth.
        returned: (n, 3) intensity that returns to the source, see the module.
        normals: (n, 3) unit normals of the visible side.
        is_flat: (n,) mask of surfaces that reflect like a plane.
        cosines: (n,) cosines of the angles of incidence.
    """

    passed: Shares
    reflected: Shares
    returned: Shares
    normals: Shares
    is_flat: NDArray[np.bool_]
    cosines: Shares

    def take(self, indices: NDArray[np.intp]) -> SurfaceLight:
        """The selected surfaces."""
        return SurfaceLight._make(values[indices] for values in self)


def surface_light(shading: Shading, view: View) -> SurfaceLight:
    """Light at the hits (n,) of a view; all rays must hit."""
    rays, hits, poses, footprints = view
    surfaces = shading.surfaces(hits)
    planes = hits.planes / np.maximum(np.linalg.norm(hits.planes, axis=1), 1e-30)[:, None]
    normals = shading.normals(hits, poses).astype(np.float64)
    is_flat = np.einsum("nc,nc->n", normals, planes) >= _MIN_FLAT_COSINE
    normals[is_flat] = planes[is_flat]
    cosines = np.abs(np.einsum("nc,nc->n", normals, rays.directions)).clip(_MIN_COSINE, 1.0)
    colors = shading.base_colors(rays, hits, poses, footprints)[:, :3].astype(np.float64)
    passed, reflected = np.zeros_like(colors), np.zeros_like(colors)
    returned = colors * cosines[:, None]
    glossy = np.flatnonzero(~shading.table.is_matte[surfaces])
    if len(glossy):
        some = view.take(glossy)
        surface = shading.table.reflectance(surfaces[glossy], colors[glossy], shading.sampler(some))
        mirrored, sent_back = _of_gloss(surface, cosines[glossy])
        is_specular = shading.is_specular[surfaces[glossy]]
        reflected[glossy] = np.where(is_specular[:, None], mirrored, 0.0)
        returned[glossy] = sent_back
    is_clear = shading.is_pane | shading.is_slab
    panes = np.flatnonzero(is_clear[surfaces] & shading.is_specular[surfaces])
    if len(panes):
        transmission = shading.panes.transmission[surfaces[panes], None]
        ior = shading.panes.ior[surfaces[panes]]
        once = pane_reflectance(cosines[panes], ior)[:, None]
        slabs = panes[shading.is_slab[surfaces[panes]]]
        tints = colors.copy()
        tints[slabs] = shading.panes.slab_colors(surfaces[slabs], colors[slabs], cosines[slabs])
        passed[panes] = (1.0 - once) * transmission * tints[panes]
        reflected[panes] = once
        facets = _facets(np.full(len(panes), MIN_ROUGHNESS), cosines[panes])
        perpendicular = pane_reflectance(np.ones(len(panes)), ior)
        body = (1.0 - once) ** 2 * (1.0 - transmission) * colors[panes] * cosines[panes, None]
        returned[panes] = body + (facets * perpendicular)[:, None]
        backs = slabs[~shading.is_front(hits.take(slabs), poses)]  # the front counts for both
        passed[backs], reflected[backs], returned[backs] = 1.0, 0.0, 0.0
    return SurfaceLight(passed, reflected, returned, normals, is_flat, cosines)


def mirrored_shares(surface: Reflectance, cosines: Shares) -> Shares:
    """Shares (n, 3) that smooth gloss and smooth clear coats reflect like mirrors.

    Args:
        surface: reflectance of the surfaces (n,).
        cosines: (n,) cosines of the angles of incidence.
    """
    grazing = (1.0 - cosines) ** 5
    coat = surface.coat * (COAT_F0 + (1.0 - COAT_F0) * grazing)
    gloss = surface.f0 + (surface.f90[:, None] - surface.f0) * grazing[:, None]
    below = (1.0 - coat)[:, None]
    mirrored: Shares = np.where((surface.roughness <= _SMOOTH)[:, None], below * gloss, 0.0)
    mirrored += np.where(surface.coat_roughness <= _SMOOTH, coat, 0.0)[:, None]
    return mirrored


def _of_gloss(surface: Reflectance, cosines: Shares) -> tuple[Shares, Shares]:
    """Mirrored and returned shares (n, 3) of surfaces with gloss and clear coat."""
    grazing = (1.0 - cosines) ** 5
    below = (1.0 - surface.coat * (COAT_F0 + (1.0 - COAT_F0) * grazing))[:, None]
    lost = (
        surface.dielectric_f0
        + (surface.dielectric_f90[:, None] - surface.dielectric_f0) * grazing[:, None]
    )
    body = surface.body * cosines[:, None] * (1.0 - lost.max(axis=1, keepdims=True)) ** 2
    facets = _facets(surface.roughness, cosines)[:, None] * surface.f0
    of_coat = COAT_F0 * surface.coat * _facets(surface.coat_roughness, cosines)
    return mirrored_shares(surface, cosines), below**2 * (body + facets) + of_coat[:, None]


def _facets(roughness: NDArray[np.floating], cosines: Shares) -> Shares:
    """Light (n,) that facets of reflectance 1 return, by the cosines (n,) of incidence.

    Smooth surfaces are flat. The beam's divergence takes the place of their facets: a Gaussian, as
    Beckmann's facets of the smallest roughness.
    """
    squares = 1.0 - cosines**2
    is_smooth = roughness <= _SMOOTH
    normals = np.broadcast_to((0.0, 0.0, 1.0), (len(cosines), 3))
    halfway = np.stack((np.sqrt(squares), np.zeros_like(cosines), cosines), axis=1)
    rough = cosines * microfacets(roughness, normals, halfway, cosines, cosines)
    tangents = squares / cosines**2
    flat = np.exp(-tangents / _BEAM_SQUARED) / (4.0 * _BEAM_SQUARED * cosines**5)
    return np.where(is_smooth, flat, rough)
