"""Reflection and refraction of paths at smooth surfaces."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.core.random_numbers import pcg4d, uniform
from omnisim.rendering.rays.caster import EmbreeHits, RayHits, WorldRays
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.rays.shading.ray_optics import pane_reflectance
from omnisim.rendering.rays.shading.shading import RayView
from omnisim.rendering.rays.shading.surface_light import mirrored_shares, straight_shares
from omnisim.scene.surface_kind import NO_KIND, SurfaceKind, transmitted
from omnisim.scene.surface_reflectance import COAT_F0, MIN_ROUGHNESS

_ABOVE = 1e-3  # minimum cosine between a mirrored ray and the triangle's plane


class Way(IntEnum):
    """Continuation of a ray at a specular surface."""

    END = 0
    MIRRORED = 1
    PASSED = 2


class Ways(NamedTuple):
    """Continuations of rays (n,) at specular surfaces."""

    # (n, 3) shares of the light from each way, linear RGB
    reflected: Floats32
    passed: Floats32
    is_invisible: Bools  # (n,) mask of the backs of single-sided panes, which only pass light
    # (n, 3) unit normals, interpolated and of the triangle, facing the rays
    normals: Floats32
    planes: Floats32

    def take(self, indices: Indices) -> Ways:
        """The selected rays."""
        return Ways._make(values[indices] for values in self)


def chosen(ways: Ways, own: Floats32, numbers: Floats32) -> tuple[NDArray[np.int8], Floats32]:
    """Ways (n,) by numbers in (0, 1), `own` shares that end, and factors (n, 3) of their light."""
    own = np.where(ways.is_invisible, np.float32(0.0), own)
    mirrored, passed = ways.reflected.mean(axis=1), ways.passed.mean(axis=1)
    total = own + mirrored + passed
    points = numbers * total
    way = np.full(len(total), Way.END, dtype=np.int8)
    way[points >= own] = Way.MIRRORED
    way[points >= own + mirrored] = Way.PASSED
    way[(way == Way.PASSED) & (passed <= 0.0)] = Way.MIRRORED  # rounding, or a black surface
    way[(way == Way.MIRRORED) & (mirrored <= 0.0)] = Way.END
    factors = np.ones((len(total), 3), dtype=np.float32)
    for which, shares, means in (
        (Way.MIRRORED, ways.reflected, mirrored),
        (Way.PASSED, ways.passed, passed),
    ):
        some = np.flatnonzero(way == which)
        factors[some] = shares[some] * (total[some] / means[some])[:, None]
    some = np.flatnonzero((way == Way.END) & (own > 0.0))
    factors[some] = (total[some] / own[some])[:, None]
    return way, factors


def onward(
    points_m: Floats32, directions: Floats32, ways: Ways, is_mirrored: Bools, start_m: float
) -> tuple[Floats32, Floats32]:
    """Origins and directions (n, 3) of rays from surfaces hit at points (n, 3): mirrored, or on."""
    along = np.einsum("nc,nc->n", directions, ways.normals)
    turned = directions - 2.0 * along[:, None] * ways.normals
    below = np.maximum(_ABOVE - np.einsum("nc,nc->n", turned, ways.planes), 0.0)
    turned += below[:, None] * ways.planes  # interpolated normals may reflect into the surface
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    away_m = np.where(is_mirrored, np.float32(start_m), np.float32(-start_m))
    origins_m = points_m + away_m[:, None] * ways.planes
    aims = np.where(is_mirrored[:, None], turned, directions)
    return origins_m.astype(np.float32), aims.astype(np.float32)


def random_numbers(origins_m: Floats32, directions: Floats32, number: int) -> Floats32:
    """Random numbers (n,) in (0, 1) for rays (n, 3), hashes of their bits and a number."""
    (x, y, z), (u, v, w) = (
        np.ascontiguousarray(values, dtype=np.float32).view(np.uint32).reshape(-1, 3).T
        for values in (origins_m, directions)
    )
    one, two, three, four = pcg4d(x, y, z, number)
    return uniform(pcg4d(one ^ u, two ^ v, three ^ w, four)[0])


# Specular surfaces of a bake: mirrors, panes, bodies of glass and frosted glass.
#
# Mirrors are smooth gloss, metal and clear coats, as the ray back end reflects them. Light passes
# panes and bodies of glass straight. Frosted glass scatters what it transmits by Lambert's law.
#
# Sources: `omnisim.rendering.rays.shading.surface_light` for mirrors and glass; the mean of
# Schlick's Fresnel over Lambertian light is f0 + (f90 − f0) / 21.
_SCHLICK_MEAN = 1.0 / 21.0
_SMOOTH = MIN_ROUGHNESS + 1e-6
_MIN_COSINE = 1e-4
_ANGLES = 64  # at which a pane's reflectance is averaged


class DiffuseShares(NamedTuple):
    """Shares (n, 3) of Lambertian light that surfaces scatter, linear RGB."""

    reflected: Floats32
    transmitted: Floats32


class SpecularSurfaces:
    """Specular surfaces of a scene.

    Attributes:
        of_triangles: (m,) mask of triangles where rays continue.
        see_through: (m,) mask of those of panes and bodies of glass.
        any, any_see_through: True if there are such triangles.
        frosted: (surfaces,) transmitted share of the light that frosted glass does not reflect.
    """

    def __init__(self, rays: RayScene):
        geometry, self._shading = rays.caster.geometry, rays.shading
        materials = [surface.material for surface in geometry.surfaces]
        is_matte = rays.scene.lighting.is_matte
        see_through = self._shading.is_pane | self._shading.is_glass
        continues = self._shading.is_mirror | see_through
        self.of_triangles = continues[geometry.surface_of_triangle]
        self.see_through = see_through[geometry.surface_of_triangle]
        self.any, self.any_see_through = self.of_triangles.any(), self.see_through.any()
        asked = NO_KIND if is_matte else SurfaceKind.FROSTED
        frosted = [transmitted(material, asked) for material in materials]
        self.frosted = np.array(frosted, dtype=np.float32)
        self._continues = continues

    def ways(self, hits: EmbreeHits, directions: Floats32) -> Ways:
        """Continuations at specular surfaces hit by rays (n,) with unit directions (n, 3)."""
        is_back = np.einsum("nc,nc->n", hits.normals, directions) > 0.0
        planes = hits.normals / np.maximum(np.linalg.norm(hits.normals, axis=1), 1e-30)[:, None]
        planes[is_back] *= np.float32(-1.0)
        ranges_m = hits.ranges_m.astype(np.float64)
        placed = RayHits(hits.triangles, ranges_m, hits.weights, planes)
        none, origins_m = np.zeros(len(ranges_m)), np.zeros((len(ranges_m), 3))
        rays = WorldRays(origins_m, directions.astype(np.float64), none, ranges_m)
        view = RayView(rays, placed)
        shading, surfaces = self._shading, self._shading.surfaces(placed)
        normals = shading.normals(placed)
        cosines = np.abs(np.einsum("nc,nc->n", normals, directions)).clip(_MIN_COSINE, 1.0)
        colors = shading.base_colors(view)[:, :3]
        surface = shading.table.reflectance(surfaces, colors, shading.sampler(view))
        reflected = mirrored_shares(surface, cosines.astype(np.float64))
        is_pane, is_glass = shading.is_pane[surfaces], shading.is_glass[surfaces]
        some = np.flatnonzero(is_pane | is_glass)
        reflected[some] = pane_reflectance(cosines[some], shading.panes.ior[surfaces[some]])[
            :, None
        ]
        is_invisible = is_pane & is_back & ~shading.is_double_sided[surfaces]
        reflected[is_invisible | (is_glass & is_back)] = 0.0
        passed = straight_shares(shading, view, colors)
        return Ways(reflected.astype(np.float32), passed, is_invisible, normals, planes)

    def diffuse(self, hits: RayHits, colors: Floats32) -> DiffuseShares:
        """Diffuse shares of surfaces (n,) with base colors (n, 3), besides the specular ones."""
        shading, surfaces = self._shading, self._shading.surfaces(hits)
        reflected, transmitted = colors.copy(), np.zeros_like(colors)
        some = np.flatnonzero(self._continues[surfaces] | (self.frosted[surfaces] > 0.0))
        if len(some) == 0:
            return DiffuseShares(reflected, transmitted)
        hits, surfaces, colors = hits.take(some), surfaces[some], colors[some]
        surface = shading.table.reflectance(surfaces, colors, shading.sampler(RayView.of(hits)))
        lost = surface.dielectric_f0.max(axis=1)
        lost = lost + (surface.dielectric_f90 - lost) * _SCHLICK_MEAN
        body = np.where(
            (surface.roughness <= _SMOOTH)[:, None], (1.0 - lost)[:, None] * surface.body, colors
        )
        passing = 1.0 - _mean_reflectance(shading.panes.ior)[surfaces, None]
        transmission = np.maximum(shading.panes.transmission, shading.glass.transmission)
        clear = transmission[surfaces, None]
        frosted = self.frosted[surfaces, None]
        glass = passing * (1.0 - clear - frosted) * colors + (frosted > 0.0) * (1.0 - passing)
        body = np.where(clear + frosted > 0.0, glass, body)
        coat = surface.coat * (COAT_F0 + (1.0 - COAT_F0) * _SCHLICK_MEAN)
        below = 1.0 - np.where(surface.coat_roughness <= _SMOOTH, coat, 0.0)[:, None]
        reflected[some] = below * body
        transmitted[some] = below * passing * frosted * colors
        return DiffuseShares(reflected, transmitted)


def _mean_reflectance(ior: Floats) -> Floats:
    """Reflectance (n,) of panes for Lambertian light."""
    squares = (np.arange(_ANGLES) + 0.5) / _ANGLES
    means = {
        index: float(pane_reflectance(np.sqrt(squares), np.full(_ANGLES, index)).mean())
        for index in np.unique(ior).tolist()
    }
    return np.array([means[index] for index in ior.tolist()])
