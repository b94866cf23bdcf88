"""Secondary rays: reflected by mirrors and gloss, passed by glass and frosted panes.

Rough surfaces are facets of GGX. The origin of a reflected ray is the mirrored viewpoint, behind
the surface. Ranges and footprints at its hit are therefore those of the whole path. A ray that
frosted glass transmits is a reflected one, mirrored to the other side. A ray from a rough facet
stands for its lobe's cone, which widens highlights of lamps where it ends.

Sources: Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018, with the
estimator Fresnel's term times G2 / G1; glTF 2.0, appendix B, for the facets; Roberts, "The
Unreasonable Effectiveness of Quasirandom Sequences", 2018, for the numbers of a pixel's rays;
KHR_materials_transmission, for the lobe of thin, rough glass; Kaplanyan and Dachsbacher, "Path
space regularization for holistic and robust light transport", 2013, for wider highlights.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Indices, Ints32, Uints32
from omnisim.core.random_numbers import pcg4d, uniform
from omnisim.rendering.rays.caster import RayHits, WorldRays
from omnisim.scene.model import Material
from omnisim.scene.surface_kind import (
    MAX_TRACED_ROUGHNESS,
    NO_KIND,
    SurfaceKind,
    pane_transmission,
    transmitted,
)
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS, smith_visibility

MAX_BOUNCES = 6  # reflections along a path; the next surface is shaded as if it were rough
RAYS_PER_SAMPLE = 8  # at the first rough surface of a path; further bounces take one
ABOVE = 1e-3  # minimum cosine between a reflected ray and the surface, whatever its normals
_MIN_WEIGHT = 1.0 / 512.0  # share of a reflection in its sample: half an 8-bit step of white
# Offset of reflected rays from their surface: a constant, and a factor of the path's length.
_START_M, _START_SHARE = 1e-5, 1e-5
# Steps of the additive recurrence R2, in units of 2⁻³²
_R2_STEPS = tuple(round(2.0**32 * 1.32471795724474602596**-power) for power in (1, 2))


class LightPaths(NamedTuple):
    """Paths (n,) of light: the seeds of their random numbers, and their weights."""

    pixels: Uints32  # (n,) uint32 indices of the paths' pixels
    numbers: Uints32  # (n,) uint32 indices of the paths within their pixel
    weights: Floats32  # (n,) shares of the paths' light in their samples
    key: int  # key of the camera's random numbers
    bounce: int = 0  # number of reflections so far
    # (n,) surfaces whose glass the paths are in, or `NO_MEDIUM`; None: all in air
    media: Ints32 | None = None
    channel: int | None = None  # channel for whose light glass refracts; None: see `Glass.ratios`
    # (n, 2) half angles in radians, and half widths in meters at range 0, of the lobes that rays
    # from rough facets stand for; angles of 0: no rough facet so far; None: all 0
    cones: AnyFloats | None = None

    @property
    def is_split(self) -> Bools:
        """Mask (n,) of the paths that have left a rough facet."""
        return np.zeros(len(self.pixels), np.bool_) if self.cones is None else self.cones[:, 0] > 0

    def take(self, indices: Indices) -> LightPaths:
        """Paths at indices (m,)."""
        return self._replace(
            pixels=self.pixels[indices],
            numbers=self.numbers[indices],
            weights=self.weights[indices],
            media=None if self.media is None else self.media[indices],
            cones=None if self.cones is None else self.cones[indices],
        )


# Function of rays (n,), footprints (n, 2, 3), starting triangles (n,) and paths (n,); it returns
# the radiance (n, 3) along the rays.
Trace = Callable[[WorldRays, Floats32 | None, Ints32, LightPaths], Floats32]


class Tracing(NamedTuple):
    """Paths (n,) to surfaces, and the function that continues them."""

    paths: LightPaths
    trace: Trace

    def take(self, indices: Indices) -> Tracing:
        """Tracing of the paths at indices (m,)."""
        return Tracing(self.paths.take(indices), self.trace)


class Arrivals(NamedTuple):
    """Rays (n,), their hits and footprints, as in `omnisim.rendering.rays.shading.shading.View`."""

    # see `View`
    rays: WorldRays
    hits: RayHits
    footprints: Floats32 | None
    spreads: AnyFloats  # (n,) slopes of the halfway vectors to the sides of the rays' cones

    def take(self, indices: Indices) -> Arrivals:
        """Arrivals of the rays at indices (m,)."""
        footprints = None if self.footprints is None else self.footprints[indices]
        rays, hits = self.rays.take(indices), self.hits.take(indices)
        return Arrivals(rays, hits, footprints, self.spreads[indices])


class Lobe(NamedTuple):
    """Specular lobes of surfaces (n,)."""

    normals: AnyFloats  # (n, 3) unit normals, world
    roughness: AnyFloats  # (n,) glTF roughness, 0 to 1
    f0: AnyFloats  # (n, 3) reflectance at normal incidence
    f90: AnyFloats  # (n,) reflectance at grazing incidence
    strength: AnyFloats  # (n,) factor of the reflected light; only the paths' weights use it

    def take(self, indices: Indices) -> Lobe:
        """Lobes at indices (m,)."""
        return Lobe._make(values[indices] for values in self)


class TracedGloss(NamedTuple):
    """Reflected light (m, 3), linear RGB, of the surfaces at indices (m,)."""

    indices: Indices
    light: AnyFloats


def traced_gloss(
    lobe: Lobe, arrivals: Arrivals, tracing: Tracing, transmits: bool = False
) -> TracedGloss | None:
    """Trace the light that lobes (n,) reflect toward the arriving rays, or transmit toward them.

    Surfaces with weights below `_MIN_WEIGHT` are omitted, and those rougher than
    `MAX_TRACED_ROUGHNESS` that reflect.

    Returns:
        Reflected light; None: all surfaces are omitted, or the paths have `MAX_BOUNCES`.
    """
    paths = tracing.paths
    if paths.bounce >= MAX_BOUNCES:
        return None
    grazing = (1.0 - clipped_cosines(lobe.normals, -arrivals.rays.directions)) ** 5
    fresnel = lobe.f0.max(axis=1) + (lobe.f90 - lobe.f0.max(axis=1)) * grazing
    weights = paths.weights * lobe.strength * fresnel
    is_traced = transmits | (lobe.roughness <= MAX_TRACED_ROUGHNESS)
    indices = np.flatnonzero(is_traced & (weights >= _MIN_WEIGHT))
    if len(indices) == 0:
        return None
    lobe, arrivals = lobe.take(indices), arrivals.take(indices)
    paths = paths.take(indices)._replace(weights=weights[indices].astype(np.float32))
    is_glossy = lobe.roughness > MIN_ROUGHNESS
    counts = np.where(is_glossy & ~paths.is_split, RAYS_PER_SAMPLE, 1)
    firsts = np.cumsum(counts) - counts
    each = np.repeat(np.arange(len(indices)), counts)
    following = paths.take(each)
    turn = (np.arange(len(each)) - firsts[each]).astype(np.uint32)
    following = following._replace(numbers=following.numbers * np.uint32(RAYS_PER_SAMPLE) + turn)
    rays, footprints, factors = _reflected(
        lobe.take(each), arrivals.take(each), following, transmits
    )
    cones = _cones(lobe, arrivals, paths)[each]
    following = following._replace(bounce=paths.bounce + 1, cones=cones)
    light = tracing.trace(rays, footprints, arrivals.hits.triangles[each], following)
    total = np.add.reduceat(factors * light, firsts, axis=0) / counts[:, None]
    return TracedGloss(indices, total)


def halfway_spreads(
    paths: LightPaths, ranges_m: AnyFloats, curvatures_per_m: AnyFloats
) -> AnyFloats:
    """Slopes (n,) of halfway vectors to the sides of the paths' cones, at hits of curvatures (n,).

    A mirror turns the halfway vector by half of the ray's angle, and by its normal's.
    """
    if paths.cones is None:
        return np.zeros(len(ranges_m))
    angles, widths_m = paths.cones.T
    return 0.5 * angles + curvatures_per_m * (widths_m + angles * ranges_m)


def _cones(lobe: Lobe, arrivals: Arrivals, paths: LightPaths) -> AnyFloats:
    """Cones (n, 2) of the paths behind their hits, see `LightPaths`."""
    ranges_m = arrivals.hits.ranges_m
    before = np.zeros((len(ranges_m), 2)) if paths.cones is None else paths.cones
    facets = np.where(lobe.roughness > MIN_ROUGHNESS, lobe.roughness**2, 0.0)
    angles = 2.0 * np.hypot(arrivals.spreads, facets)
    widths_m = before[:, 1] + (before[:, 0] - angles) * ranges_m
    return np.stack((angles, widths_m), axis=1)


def facing_views(normals: AnyFloats, views: AnyFloats) -> AnyFloats:
    """Unit directions (n, 3) toward the viewer, mirrored to the front of normals seen from behind.

    Normal maps and interpolated normals may face away from a viewer who sees the surface.
    """
    behind = np.minimum(np.einsum("nc,nc->n", normals, views), 0.0)
    return views - 2.0 * behind[:, None] * normals


def _reflected(
    lobe: Lobe, arrivals: Arrivals, paths: LightPaths, transmits: bool
) -> tuple[WorldRays, Floats32 | None, AnyFloats]:
    """Reflected or transmitted rays (n,), their footprints (n, 2, 3), and their factors (n, 3)."""
    rays, hits, footprints, _ = arrivals
    facets = lobe.normals.astype(np.float64)
    views = facing_views(facets, -rays.directions)
    squared = lobe.roughness.astype(np.float64) ** 4
    glossy = np.flatnonzero(lobe.roughness > MIN_ROUGHNESS)
    if len(glossy):
        numbers = _numbers(paths.take(glossy))
        facets[glossy] = _visible_facets(facets[glossy], views[glossy], squared[glossy], numbers)
    along = np.einsum("nc,nc->n", views, facets)
    directions = 2.0 * along[:, None] * facets - views
    grazing = (1.0 - np.clip(along, 0.0, 1.0)) ** 5
    factors = lobe.f0 + (lobe.f90[:, None] - lobe.f0) * grazing[:, None]
    if len(glossy):
        shadowed = _shadowing(lobe.normals, views, directions, squared)
        factors[glossy] *= shadowed[glossy, None]
    planes = hits.planes / np.maximum(np.linalg.norm(hits.planes, axis=1), 1e-30)[:, None]
    below = np.maximum(ABOVE - np.einsum("nc,nc->n", directions, planes), 0.0)
    directions += below[:, None] * planes  # interpolated normals may reflect into the surface
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    starts_m = _START_M + _START_SHARE * hits.ranges_m
    if transmits:  # to the other side of the surface
        heights = np.einsum("nc,nc->n", directions, planes)
        directions -= 2.0 * heights[:, None] * planes
        starts_m = -starts_m
    points_m = rays.origins_m + hits.ranges_m[:, None] * rays.directions
    points_m += starts_m[:, None] * planes
    mirrored = WorldRays(
        points_m - hits.ranges_m[:, None] * directions, directions, hits.ranges_m, rays.far_m
    )
    if footprints is not None and not transmits:
        heights = np.einsum("nsc,nc->ns", footprints, facets)
        footprints = (footprints - 2.0 * heights[..., None] * facets[:, None]).astype(np.float32)
    return mirrored, footprints, factors


def _numbers(paths: LightPaths) -> tuple[AnyFloats, AnyFloats]:
    """Two random numbers (n,) in [0, 1) for each path.

    At the first rough surface, the numbers of a pixel's rays form one low-discrepancy sequence with
    a random start.
    """
    is_split, turns = paths.is_split, np.uint32(RAYS_PER_SAMPLE)
    hashes = pcg4d(paths.pixels, np.where(is_split, paths.numbers, 0), paths.bounce, paths.key)
    # each mirror before the surface has multiplied the number of the path
    order = paths.numbers // turns ** np.uint32(paths.bounce + 1) * turns + paths.numbers % turns
    one, other = (
        np.where(is_split, uniform(hashed), (hashed + order * np.uint32(step)) * 2.0**-32)
        for hashed, step in zip(hashes, _R2_STEPS, strict=False)
    )
    return one, other


def _visible_facets(
    normals: AnyFloats, views: AnyFloats, squared: AnyFloats, numbers: tuple[AnyFloats, AnyFloats]
) -> AnyFloats:
    """Sample facet normals (n, 3) in proportion to their area visible from the view directions.

    Args:
        normals, views: (n, 3) unit normals, and unit directions toward the rays' origins.
        squared: (n,) alpha², the fourth power of the roughness.
        numbers: two random numbers (n,) in [0, 1).
    """
    alpha = np.sqrt(squared)[:, None]
    heights = clipped_cosines(normals, views)[:, None]
    # the distribution is stretched by alpha across the normal, and so are the views
    flat = views - np.einsum("nc,nc->n", views, normals)[:, None] * normals
    stretched = alpha * flat + heights * normals
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    helper = np.where(np.abs(normals[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    side = np.cross(stretched, normals)
    is_steep = np.linalg.norm(side, axis=1, keepdims=True) < 1e-6
    side = np.where(is_steep, np.cross(helper, normals), side)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(stretched, side)
    # point on the projection of the hemisphere of stretched normals along the view
    radius, azimuth = np.sqrt(numbers[0]), 2.0 * np.pi * numbers[1]
    x, y = radius * np.cos(azimuth), radius * np.sin(azimuth)
    share = 0.5 * (1.0 + np.einsum("nc,nc->n", stretched, normals))
    sign = np.where(np.einsum("nc,nc->n", up, normals) < 0.0, -1.0, 1.0)
    up = up * sign[:, None]
    y = (1.0 - share) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + share * y
    depth = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    sampled = x[:, None] * side + y[:, None] * up + depth[:, None] * stretched
    height = np.maximum(np.einsum("nc,nc->n", sampled, normals), 0.0)[:, None]
    sampled = alpha * (sampled - np.einsum("nc,nc->n", sampled, normals)[:, None] * normals)
    sampled += height * normals
    return sampled / np.maximum(np.linalg.norm(sampled, axis=1, keepdims=True), 1e-30)


def _shadowing(
    normals: AnyFloats, views: AnyFloats, directions: AnyFloats, squared: AnyFloats
) -> AnyFloats:
    """Shadowing G2 / G1 (n,) of height-correlated facets; 0 for directions below the surface."""
    view = clipped_cosines(normals, views)
    light = np.einsum("nc,nc->n", normals, directions)
    seen = 2.0 * view / (view + np.sqrt(view * view * (1.0 - squared) + squared))
    both = 4.0 * light * view * smith_visibility(np.maximum(light, 0.0), view, squared)
    return np.where(light > 0.0, both / seen, 0.0)


def clipped_cosines(normals: AnyFloats, views: AnyFloats) -> AnyFloats:
    """Cosines (n,) between normals and views (n, 3), of either side, at least 0.001."""
    return np.clip(np.abs(np.einsum("nc,nc->n", normals, views)), 1e-3, 1.0)


# Refraction by bodies of glass, which are closed meshes with KHR_materials_volume; and panes.
#
# A ray enters glass at the front of a triangle and leaves it at the back, always from or to a
# medium of index 1. Light that is not reflected is multiplied by `transmission` and the base
# color at each surface, and by the attenuation along the way inside. Radiance is not scaled by
# the square of the index: what stands in glass is as bright as before it.
#
# Sources: Snell's law and Fresnel's equations for unpolarized light; KHR_materials_volume, for
# Beer and Lambert's law; KHR_materials_dispersion, for the indices of red and blue.


NO_MEDIUM = -1  # air, among the indices of surfaces
_GREEN = 1  # channel whose index is the material's
# Difference of the indices of red and green per dispersion and ior − 1: half of 1/20
_SPREAD = 0.025
_BELOW = 1e-3  # minimum cosine between a refracted ray and the triangle's plane


class Refracted(NamedTuple):
    """Rays (m,) that pass surfaces of glass."""

    rays: WorldRays  # (m,) with virtual origins: ranges are those of the whole path
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
        shares = np.array([transmitted(material, asked) for material in materials])
        ior = np.array([material.ior for material in materials])
        spreads = np.array([_SPREAD * material.dispersion for material in materials]) * (ior - 1.0)
        absorption = np.array([material.absorption_per_m for material in materials]).reshape(-1, 3)
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


def refracted_rays(
    rays: WorldRays, hits: RayHits, normals: AnyFloats, ratios: AnyFloats
) -> WorldRays:
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
