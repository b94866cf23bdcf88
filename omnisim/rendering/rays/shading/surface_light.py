"""Light at specular surfaces: what passes, what is reflected, and what returns to its source.

A surface returns light to where it came from by two ways. The body below the gloss is Lambertian,
and the light crosses the gloss twice. Facets of the gloss return light where they face it: half
vector, view and light are one direction. A polished surface returns nothing unless it is met
perpendicularly, to within the beam's divergence, for which 3.2 mrad are assumed: the VLS-128 has 3
(Velodyne, VLS-128 User Manual, table F-1).

Sources: glTF 2.0, appendix B, for facets and Schlick's Fresnel; Walter et al., "Microfacet Models
for Refraction through Rough Surfaces", 2007, for Beckmann's; `glass` for thin panes; Höfle and
Pfeifer, "Correction of laser scanning intensity data", ISPRS Journal 62 (2007), for the returned
share, which is relative to a white Lambertian surface met perpendicularly at the same range.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Indices
from omnisim.rendering.rays.caster import RayCaster, RayHits, WorldRays
from omnisim.rendering.rays.shading.lit_surfaces import Reflectance, microfacets
from omnisim.rendering.rays.shading.ray_optics import pane_reflectance
from omnisim.rendering.rays.shading.shading import RayView, Shading
from omnisim.scene.surface_reflectance import COAT_F0, MIN_ROUGHNESS

# Interpolated normals within 0.1° of the triangle's are those of a planar mirror.
_MIN_FLAT_COSINE = float(np.cos(np.radians(0.1)))
_SMOOTH = MIN_ROUGHNESS + 1e-6
_MIN_COSINE = 1e-4
# Squared slope at which a plane returns 1/e of the light: it turns the beam by 3.2 mrad.
_BEAM_SQUARED = MIN_ROUGHNESS**4


class SurfaceLight(NamedTuple):
    """Shares of the light that arrives at surfaces (n,), linear RGB."""

    passed: Floats  # (n, 3) share that passes straight through panes; 0 elsewhere
    reflected: Floats  # (n, 3) share that is reflected in the mirror's direction; 0 unless smooth
    returned: Floats  # (n, 3) intensity that returns to the source, see the module
    normals: Floats  # (n, 3) unit normals of the visible side
    is_flat: Bools  # (n,) mask of surfaces that reflect like a plane
    cosines: Floats  # (n,) cosines of the angles of incidence

    def take(self, indices: Indices) -> SurfaceLight:
        """The selected surfaces."""
        return SurfaceLight._make(values[indices] for values in self)


def surface_light(shading: Shading, view: RayView) -> SurfaceLight:
    """Light at the hits (n,) of a view; all rays must hit."""
    rays, hits, poses, _ = view
    surfaces = shading.surfaces(hits)
    planes = hits.planes / np.maximum(np.linalg.norm(hits.planes, axis=1), 1e-30)[:, None]
    normals = shading.normals(hits, poses).astype(np.float64)
    is_flat = np.einsum("nc,nc->n", normals, planes) >= _MIN_FLAT_COSINE
    normals[is_flat] = planes[is_flat]
    cosines = np.abs(np.einsum("nc,nc->n", normals, rays.directions)).clip(_MIN_COSINE, 1.0)
    colors = shading.base_colors(view)[:, :3].astype(np.float64)
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


def mirrored_shares(surface: Reflectance, cosines: Floats) -> Floats:
    """Shares (n, 3) that smooth gloss and coats reflect like mirrors, by cosines (n,)."""
    grazing = (1.0 - cosines) ** 5
    coat = surface.coat * (COAT_F0 + (1.0 - COAT_F0) * grazing)
    gloss = surface.f0 + (surface.f90[:, None] - surface.f0) * grazing[:, None]
    below = (1.0 - coat)[:, None]
    mirrored: Floats = np.where((surface.roughness <= _SMOOTH)[:, None], below * gloss, 0.0)
    mirrored += np.where(surface.coat_roughness <= _SMOOTH, coat, 0.0)[:, None]
    return mirrored


def _of_gloss(surface: Reflectance, cosines: Floats) -> tuple[Floats, Floats]:
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


def _facets(roughness: AnyFloats, cosines: Floats) -> Floats:
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


# Light that passes glass straight: of shadow rays, and of the rays of bakes.
#
# A body of glass counts as a slab: its front reflects what both interfaces reflect, each surface
# tints the rest, and the way between them absorbs. The back of a single-sided pane does not
# count, as in images.


def straight_shares(shading: Shading, view: RayView, colors: Floats32) -> Floats32:
    """Shares (n, 3) of light that pass hits straight, linear RGB; 0 for all but panes and glass.

    Args:
        view: rays (n,) and their hits on either side; all rays must hit.
        colors: (n, 3 or more) base colors.
    """
    shares = np.zeros((len(colors), 3), dtype=np.float32)
    surfaces = shading.surfaces(view.hits)
    some = np.flatnonzero(shading.is_pane[surfaces] | shading.is_glass[surfaces])
    if len(some) == 0:
        return shares
    rays, hits, poses, _ = view.take(some)
    surfaces, colors = surfaces[some], colors[some, :3]
    is_back, is_glass = ~shading.is_front(hits, poses), shading.is_glass[surfaces]
    cosines = np.abs(np.einsum("nc,nc->n", shading.normals(hits, poses), rays.directions))
    reflected = pane_reflectance(cosines, shading.panes.ior[surfaces])
    reflected[is_back & is_glass] = 0.0
    transmission = np.maximum(shading.panes.transmission, shading.glass.transmission)[surfaces]
    passed = ((1.0 - reflected) * transmission)[:, None] * colors
    leaving = np.flatnonzero(is_back & is_glass)
    inside_m = (hits.ranges_m - rays.near_m)[leaving]
    passed[leaving] *= shading.glass.attenuation(surfaces[leaving], inside_m)
    passed[is_back & ~is_glass & ~shading.is_double_sided[surfaces]] = 1.0
    shares[some] = passed
    return shares


# Rays after mirrors, from the mirrored origin: ranges along them are those of the whole path.
_MIN_LEAVING_COSINE = 0.02  # a ray that grazes a mirror starts at most 50 steps behind its hit


def mirrored_rays(
    caster: RayCaster, rays: WorldRays, hits: RayHits, light: SurfaceLight
) -> WorldRays:
    """Rays (n,) reflected at their hits.

    A plane reflects the origin; a curved mirror reflects like its tangent plane. The first step
    leaves the plane by more than a triangle's rounding, also at grazing incidence.
    """
    normals, directions = light.normals, rays.directions
    along = np.einsum("nc,nc->n", directions, normals)
    directions = directions - 2.0 * along[:, None] * normals
    points_m = rays.origins_m + hits.ranges_m[:, None] * rays.directions
    origins_m = points_m - hits.ranges_m[:, None] * directions
    behind = caster.behind(rays, hits.ranges_m)
    steps_m = (behind.near_m - hits.ranges_m) / np.maximum(np.abs(along), _MIN_LEAVING_COSINE)
    return WorldRays(origins_m, directions, hits.ranges_m + steps_m, rays.far_m)
