"""Reflections of the scene in smooth surfaces, by rays: mirrors, and GGX facets by random numbers.

A reflected ray starts at the mirrored viewpoint, behind its surface, so that ranges and footprints
of what it meets are those along the whole path.

Source: Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018, whose estimator
is Fresnel's term times G2 / G1; glTF 2.0, appendix B, for the facets; Roberts, "The Unreasonable
Effectiveness of Quasirandom Sequences", 2018, for the numbers of a pixel's rays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.camera.degradations.random_numbers import pcg4d, uniform
from omnisim.rendering.rays.caster import RayHits, Rays
from omnisim.scene.surface_reflectance import (
    MAX_TRACED_ROUGHNESS,
    MIN_ROUGHNESS,
    smith_visibility,
)

Floats = NDArray[np.floating]

MAX_BOUNCES = 6  # reflections along a path; the last surface is shaded as a rougher one
RAYS_PER_SAMPLE = 8  # of a glossy surface that the camera sees; further bounces take one
_MIN_WEIGHT = 1.0 / 512.0  # of a reflection in its pixel: half an 8-bit step of a white one
# Offset of reflected rays from their surface: a constant, and a share of the path's length.
_START_M, _START_SHARE = 1e-5, 1e-5
_ABOVE = 1e-3  # minimum cosine between a reflected ray and the triangle's plane
# Steps of the additive recurrence R2, in units of 2⁻³²
_R2_STEPS = tuple(round(2.0**32 * 1.32471795724474602596**-power) for power in (1, 2))


class Paths(NamedTuple):
    """Identity and weight of rays (n,), from which their reflections follow.

    Attributes:
        pixels: (n,) uint32 numbers of the rays' pixels.
        numbers: (n,) uint32 numbers of the rays in their pixel.
        weights: (n,) shares of the rays' light in that of their sample.
        key: key of the camera's random numbers.
        bounce: number of reflections so far.
    """

    pixels: NDArray[np.uint32]
    numbers: NDArray[np.uint32]
    weights: NDArray[np.float32]
    key: int
    bounce: int = 0

    def take(self, some: NDArray[np.intp]) -> Paths:
        """Some of the rays."""
        return self._replace(
            pixels=self.pixels[some], numbers=self.numbers[some], weights=self.weights[some]
        )


# Radiance (n, 3) along rays (n,) with footprints that start at triangles (n,).
Trace = Callable[[Rays, NDArray[np.float32] | None, NDArray[np.int32], Paths], NDArray[np.float32]]


class Tracing(NamedTuple):
    """Paths (n,) to surfaces, and the function that continues them."""

    paths: Paths
    trace: Trace

    def take(self, some: NDArray[np.intp]) -> Tracing:
        """Tracing of some of the paths."""
        return Tracing(self.paths.take(some), self.trace)


class Arrivals(NamedTuple):
    """Rays (n,) at their surfaces, see `omnisim.rendering.rays.shading.shading.View`."""

    rays: Rays
    hits: RayHits
    footprints: NDArray[np.float32] | None

    def take(self, some: NDArray[np.intp]) -> Arrivals:
        """Some of the rays."""
        footprints = None if self.footprints is None else self.footprints[some]
        return Arrivals(self.rays.take(some), self.hits.take(some), footprints)


class Lobe(NamedTuple):
    """Gloss of surfaces (n,).

    Attributes:
        normals: (n, 3) unit.
        roughness: (n,).
        f0: (n, 3) reflectance at normal incidence.
        f90: (n,) reflectance at grazing incidence.
        strength: (n,) factor of the reflected light, for its weight only.
    """

    normals: Floats
    roughness: Floats
    f0: Floats
    f90: Floats
    strength: Floats

    def take(self, some: NDArray[np.intp]) -> Lobe:
        """Some of the surfaces."""
        return Lobe._make(values[some] for values in self)


class TracedGloss(NamedTuple):
    """Reflected light (m, 3) of some (m,) of the surfaces."""

    some: NDArray[np.intp]
    light: Floats


def traced_gloss(lobe: Lobe, arrivals: Arrivals, tracing: Tracing) -> TracedGloss | None:
    """Light that the lobes (n,) reflect toward the rays; None: no surface is smooth enough.

    Surfaces that are left out are too rough, or reflect too little to be seen.
    """
    paths = tracing.paths
    if paths.bounce >= MAX_BOUNCES:
        return None
    grazing = (1.0 - _cosines(lobe.normals, -arrivals.rays.directions)) ** 5
    fresnel = lobe.f0.max(axis=1) + (lobe.f90 - lobe.f0.max(axis=1)) * grazing
    weights = paths.weights * lobe.strength * fresnel
    some = np.flatnonzero((lobe.roughness <= MAX_TRACED_ROUGHNESS) & (weights >= _MIN_WEIGHT))
    if len(some) == 0:
        return None
    lobe, arrivals = lobe.take(some), arrivals.take(some)
    paths = paths.take(some)._replace(weights=weights[some].astype(np.float32))
    is_glossy = lobe.roughness > MIN_ROUGHNESS
    counts = np.where(is_glossy & (paths.bounce == 0), RAYS_PER_SAMPLE, 1)
    firsts = np.cumsum(counts) - counts
    each = np.repeat(np.arange(len(some)), counts)
    following = paths.take(each)
    turn = (np.arange(len(each)) - firsts[each]).astype(np.uint32)
    following = following._replace(numbers=following.numbers * np.uint32(RAYS_PER_SAMPLE) + turn)
    rays, footprints, factors = _reflected(lobe.take(each), arrivals.take(each), following)
    following = following._replace(bounce=paths.bounce + 1)
    light = tracing.trace(rays, footprints, arrivals.hits.triangles[each], following)
    total = np.add.reduceat(factors * light, firsts, axis=0) / counts[:, None]
    return TracedGloss(some, total)


def _reflected(
    lobe: Lobe, arrivals: Arrivals, paths: Paths
) -> tuple[Rays, NDArray[np.float32] | None, Floats]:
    """Reflected rays (n,), their footprints, and the factors (n, 3) of their light."""
    rays, hits, footprints = arrivals
    views = -rays.directions
    facets = lobe.normals.astype(np.float64)
    squared = lobe.roughness.astype(np.float64) ** 4
    glossy = np.flatnonzero(lobe.roughness > MIN_ROUGHNESS)
    if len(glossy):
        numbers = _numbers(paths.take(glossy))
        facets[glossy] = _visible_facets(facets[glossy], views[glossy], squared[glossy], numbers)
    along = np.einsum("nc,nc->n", views, facets)
    directions = 2.0 * along[:, None] * facets - views
    factors = lobe.f0 + (lobe.f90[:, None] - lobe.f0) * _grazing(along)[:, None]
    if len(glossy):
        shadowed = _shadowing(lobe.normals, views, directions, squared)
        factors[glossy] *= shadowed[glossy, None]
    planes = hits.planes / np.maximum(np.linalg.norm(hits.planes, axis=1), 1e-30)[:, None]
    below = np.maximum(_ABOVE - np.einsum("nc,nc->n", directions, planes), 0.0)
    directions += below[:, None] * planes  # interpolated normals may reflect into the surface
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    starts_m = _START_M + _START_SHARE * hits.ranges_m
    points_m = rays.origins_m + hits.ranges_m[:, None] * rays.directions
    points_m += starts_m[:, None] * planes
    mirrored = Rays(
        points_m - hits.ranges_m[:, None] * directions, directions, hits.ranges_m, rays.far_m
    )
    if footprints is not None:
        heights = np.einsum("nsc,nc->ns", footprints, facets)
        footprints = (footprints - 2.0 * heights[..., None] * facets[:, None]).astype(np.float32)
    return mirrored, footprints, factors


def _numbers(paths: Paths) -> tuple[Floats, Floats]:
    """Two random numbers (n,) in [0, 1) for each path.

    The first reflections of all rays of a pixel are one well spread sequence, from a random start.
    """
    if paths.bounce:
        hashes = pcg4d(paths.pixels, paths.numbers, paths.bounce, paths.key)
        first, second = uniform(hashes[0]), uniform(hashes[1])
        return first.astype(np.float64), second.astype(np.float64)
    hashes = pcg4d(paths.pixels, 0, 0, paths.key)
    one, other = (
        (hashes[axis] + paths.numbers * np.uint32(step)) * 2.0**-32
        for axis, step in enumerate(_R2_STEPS)
    )
    return one, other


def _visible_facets(
    normals: Floats, views: Floats, squared: Floats, numbers: tuple[Floats, Floats]
) -> Floats:
    """Normals (n, 3) of facets that the views see, in proportion to their visible area.

    Args:
        normals, views: (n, 3) unit.
        squared: (n,) alpha², the fourth power of the roughness.
        numbers: (n,) each, in [0, 1).
    """
    alpha = np.sqrt(squared)[:, None]
    heights = _cosines(normals, views)[:, None]
    # along the normal the distribution is stretched by alpha: so is the view
    flat = views - np.einsum("nc,nc->n", views, normals)[:, None] * normals
    stretched = alpha * flat + heights * normals
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    helper = np.where(np.abs(normals[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    side = np.cross(stretched, normals)
    is_steep = np.linalg.norm(side, axis=1, keepdims=True) < 1e-6
    side = np.where(is_steep, np.cross(helper, normals), side)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(stretched, side)
    # a point of the disc that the view sees of the hemisphere of stretched normals
    radius, azimuth = np.sqrt(numbers[0]), 2.0 * np.pi * numbers[1]
    x, y = radius * np.cos(azimuth), radius * np.sin(azimuth)
    share = 0.5 * (1.0 + np.einsum("nc,nc->n", stretched, normals))
    sign = np.where(np.einsum("nc,nc->n", up, normals) < 0.0, -1.0, 1.0)
    up = up * sign[:, None]
    y = (1.0 - share) * np.sqrt(np.maximum(1.0 - x * x, 0.0)) + share * y
    depth = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    found = x[:, None] * side + y[:, None] * up + depth[:, None] * stretched
    height = np.maximum(np.einsum("nc,nc->n", found, normals), 0.0)[:, None]
    found = alpha * (found - np.einsum("nc,nc->n", found, normals)[:, None] * normals)
    found += height * normals
    facets: Floats = found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-30)
    return facets


def _shadowing(normals: Floats, views: Floats, directions: Floats, squared: Floats) -> Floats:
    """G2 / G1 (n,) of height-correlated facets: 0 for directions below the surface."""
    view = _cosines(normals, views)
    light = np.einsum("nc,nc->n", normals, directions)
    seen = 2.0 * view / (view + np.sqrt(view * view * (1.0 - squared) + squared))
    both = 4.0 * light * view * smith_visibility(np.maximum(light, 0.0), view, squared)
    share: Floats = np.where(light > 0.0, both / seen, 0.0)
    return share


def _grazing(cosines: Floats) -> Floats:
    grazing: Floats = (1.0 - np.clip(cosines, 0.0, 1.0)) ** 5
    return grazing


def _cosines(normals: Floats, views: Floats) -> Floats:
    cosines: Floats = np.clip(np.abs(np.einsum("nc,nc->n", normals, views)), 1e-3, 1.0)
    return cosines
