"""Light of emissive and other bright surfaces: rays aimed at points on them.

Aimed rays are weighted against gathering rays that hit the same emitter.
Source of the weights: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo
rendering", 1995, the balance heuristic.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.atlas.patches import BACK, Patches
from omnisim.rendering.baking.sampling import spread_points, turned
from omnisim.rendering.baking.transport import INSIDE, PatchHits, Transport
from omnisim.rendering.rays.caster import RayHits
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.rays.shading.lights import LampLight, lamps_at
from omnisim.rendering.rays.shading.shadows import Shadows
from omnisim.scene.model import LAMP_NEAR_M, Light, Lighting, LightKind

LUMINANCE = np.array((0.2126, 0.7152, 0.0722), dtype=np.float32)
_MIN_M2 = 1e-8
_TRIED = 64  # rays per place that find the emitters that light it
_MIN_SHARE = 0.2  # share of rays spread over all emitters

Floats = NDArray[np.float32]


class _AimedRays(NamedTuple):
    """Rays that reach emitters.

    Attributes:
        numbers: (r,) ray numbers, place after place.
        picked: (r,) chosen emitters.
        light: (r, 3) along the rays, on white surfaces, weighted against gathering rays.
    """

    numbers: NDArray[np.intp]
    picked: NDArray[np.intp]
    light: Floats


class Emitters:
    """Bright patches, chosen by power, and equally often from each emitting side.

    Args:
        patches: patches of the scene.
        points: points of all entries in `Patches.of_sample`.
        emission: (p, 3) light of the patches to aim at; 0 elsewhere.
        aimed: rays to emitters per place.
        gathered: cosine-distributed rays per place.
    """

    def __init__(
        self, patches: Patches, points: Points, emission: Floats, aimed: int, gathered: int
    ):
        power = (emission @ LUMINANCE) * patches.areas_m2
        power[np.diff(patches.first) == 0] = 0.0
        total = float(power.sum(dtype=np.float64))
        self.aimed = aimed if total > 0.0 else 0
        self._gathered = gathered
        self._emission, self._areas_m2 = emission, patches.areas_m2
        bright = np.flatnonzero(power > 0.0)
        # sorted by emitting side, so that rays are divided among them evenly
        triangles = patches.samples.triangles[patches.of_sample[patches.first[bright]]]
        order = np.lexsort((bright, triangles, patches.sides[bright]))
        self._by_power = bright[order]
        sides = 2 * triangles[order].astype(np.intp) + patches.sides[self._by_power]
        self._side_of = np.unique(sides, return_inverse=True)[1].ravel()
        self._first, self._counts = patches.first, np.diff(patches.first)
        self._points = points
        powers = power[self._by_power].astype(np.float64)
        of_sides = np.bincount(self._side_of, weights=powers)
        evenly = powers / of_sides[self._side_of] / max(len(of_sides), 1)
        self._choose_by(0.5 * (powers / max(total, 1e-300) + evenly))

    def _choose_by(self, shares: NDArray[np.float64]) -> None:
        """Set the shares of rays that the emitters get."""
        self._shares, self._ends = shares, np.cumsum(shares)
        density = np.zeros(len(self._emission))
        density[self._by_power] = shares / np.maximum(self._areas_m2[self._by_power], 1e-12)
        self._density = density.astype(np.float32)  # per square meter

    def focused(self, transport: Transport, at: Points, shifts: Floats) -> Emitters:
        """Emitters chosen by the light that reaches places (n,), with shifts (n, 2)."""
        if not self.aimed:
            return self
        rays = self._aim(transport, at, spread_points(_TRIED), shifts)
        light, places = rays.light @ LUMINANCE, rays.numbers // _TRIED
        shares = light / np.maximum(np.bincount(places, weights=light), 1e-30)[places]
        sides = self._side_of[rays.picked]
        received = np.bincount(sides, weights=shares, minlength=int(self._side_of.max()) + 1)
        if not received.any():
            return self
        powers = np.bincount(self._side_of, weights=self._shares)
        factors = received / received.sum() / np.maximum(powers, 1e-300)
        focused = copy.copy(self)
        focused._choose_by(
            self._shares * (_MIN_SHARE + (1.0 - _MIN_SHARE) * factors[self._side_of])
        )
        return focused

    def light(self, transport: Transport, at: Points, points: Floats, shifts: Floats) -> Floats:
        """Light (n, 3) on white surfaces, by rays to emitters.

        Args:
            transport: ray casting in the scene.
            at: (n,) places.
            points: (k, 2) in the unit square, one per ray.
            shifts: (n, 2) shifts of the points, one per place.
        """
        count = len(at.origins_m)
        total = np.zeros((count, 3), dtype=np.float32)
        if not self.aimed:
            return total
        rays = self._aim(transport, at, points, shifts)
        for channel in range(3):
            total[:, channel] = np.bincount(
                rays.numbers // len(points), weights=rays.light[:, channel], minlength=count
            )
        return total

    def _aim(self, transport: Transport, at: Points, points: Floats, shifts: Floats) -> _AimedRays:
        chosen, rays = turned(points, shifts), len(points)
        picked = np.searchsorted(self._ends, chosen[..., 0].ravel() * self._ends[-1], side="right")
        picked = np.minimum(picked, len(self._by_power) - 1)
        patches = self._by_power[picked]
        within = (chosen[..., 1].ravel() * self._counts[patches]).astype(np.intp)
        entries = self._first[patches] + np.minimum(within, self._counts[patches] - 1)
        origins = np.repeat(at.origins_m, rays, axis=0)
        away = self._points.origins_m[entries] - origins
        squared = np.maximum(np.einsum("nc,nc->n", away, away), np.float32(_MIN_M2))
        away /= np.sqrt(squared)[:, None]
        cosines = np.einsum("nc,nc->n", np.repeat(at.normals, rays, axis=0), away)
        above = np.einsum("nc,nc->n", np.repeat(at.planes, rays, axis=0), away)
        theirs = -np.einsum("nc,nc->n", self._points.planes[entries], away)
        some = np.flatnonzero((cosines > 0.0) & (theirs > 0.0) & (above > 0.0))
        far = np.sqrt(squared[some]) * np.float32(1.0 - 1e-4)
        passed = transport.passing(origins[some], away[some], far)
        arrives = np.flatnonzero(passed.any(axis=1))
        some, passed = some[arrives], passed[arrives]
        density = self._density[patches[some]] * squared[some] / theirs[some]
        weights = cosines[some] / np.pi
        weights /= self.aimed * density + self._gathered * weights
        light = self._emission[patches[some]] * weights[:, None] * passed
        return _AimedRays(some, picked[some], light)

    def seen(self, hits: PatchHits, cosines: Floats) -> Floats:
        """Emission (n, 3) of patches hit by gathering rays, weighted against `light`.

        Rays aimed at emitters pass glass, but do not find them by mirrors.

        Args:
            hits: (n,) hits on patches.
            cosines: (n,) between the rays and the normals at their origins.
        """
        emission = self._emission[hits.patches]
        shining = np.flatnonzero((self._density[hits.patches] > 0.0) & hits.is_straight)
        if self.aimed and len(shining):
            density = self._density[hits.patches[shining]] * hits.ranges_m[shining] ** 2
            density /= np.maximum(hits.cosines[shining], np.float32(1e-6))
            gathered = self._gathered * cosines[shining] / np.pi
            emission[shining] *= (gathered / (gathered + self.aimed * density))[:, None]
        return emission


# Light of a scene's lamps on patches, with their shadows.


def lamps_on(
    lighting: Lighting, transport: Transport, origins_m: Floats, at: Points | None = None
) -> list[LampLight]:
    """Light of each lamp, straight or through glass, at points (n, 3).

    Args:
        lighting: lighting with the lamps.
        transport: ray casting in the scene.
        origins_m: (n, 3) points, relative to the transport's center.
        at: surface points, which receive no light from behind; None: points in free space.
    """
    points_m = origins_m + transport.center_m
    lamps = lamps_at(lighting.without_shadows(), points_m, origins_m, _no_shadows())
    return [
        _shadowed(light, lamp, transport, origins_m, at) if light.casts_shadow else lamp
        for light, lamp in zip(lighting.lights, lamps, strict=True)
    ]


def lamp_light(lamps: list[LampLight], points: Points) -> Floats:
    """Light (n, 3) of lamps on white surfaces at points."""
    total = np.zeros_like(points.origins_m)
    for lamp in lamps:
        cosines = np.maximum(np.einsum("nc,nc->n", points.normals, _all(lamp, total)), 0.0)
        total += (cosines * lamp.levels)[:, None] * lamp.color
    return total


def _all(lamp: LampLight, points: Floats) -> Floats:
    return np.broadcast_to(lamp.directions, points.shape)


def _shadowed(
    light: Light,
    lamp: LampLight,
    transport: Transport,
    origins_m: Floats,
    at: Points | None,
) -> LampLight:
    directions, levels = _all(lamp, origins_m), lamp.levels.copy()
    for sides in () if at is None else (at.normals, at.planes):
        levels[np.einsum("nc,nc->n", sides, directions) <= 0.0] = 0.0
    some = np.flatnonzero(levels > 0.0)
    if len(some):
        aims = np.ascontiguousarray(directions[some])
        far = None
        if light.kind is not LightKind.DIRECTIONAL:
            away_m = light.position_m - transport.center_m - origins_m[some]
            far_m = np.linalg.norm(away_m, axis=1) - LAMP_NEAR_M
            far = np.maximum(far_m, 0.0).astype(np.float32)
        passed = transport.passing(origins_m[some], aims, far)
        if passed.shape[1] == 1:
            levels[some] *= passed[:, 0]
        else:
            color = np.tile(lamp.color, (len(levels), 1))
            color[some] *= passed
            lamp = lamp._replace(color=color)
    return lamp._replace(levels=levels)


def _no_shadows() -> Shadows:
    """Shadows for lamps that cast none."""
    none = np.zeros((0, 3))
    hits = RayHits(
        np.zeros(0, np.int32), np.zeros(0), none.astype(np.float32), none.astype(np.float32)
    )
    return Shadows(hits, lambda rays, triangles: np.ones((0, 1), np.float32))


# Points on patches: positions where light is gathered, with surface orientation.


_BATCH = 1 << 17
# Directions of probing rays, along the normal and two axes of the plane.
_PROBING = np.array(
    [[1.0, 0.0, 0.0], [0.5, 0.866, 0.0], [0.5, -0.433, 0.75], [0.5, -0.433, -0.75]], np.float32
)
_MAX_INSIDE = 1  # maximum number of probing rays inside of a solid


class Points(NamedTuple):
    """Points on patches.

    Attributes:
        origins_m: (n, 3) relative to `Transport.center_m`, beside the surface, on the patch's side.
        normals: (n, 3) unit, interpolated, on the patch's side.
        planes: (n, 3) unit, triangle normals, on the patch's side.
    """

    origins_m: Floats
    normals: Floats
    planes: Floats


def points_at(
    rays: RayScene, transport: Transport, patches: Patches, first: int, last: int
) -> Points:
    """Points of the entries first to last of `Patches.of_sample`."""
    geometry = rays.caster.geometry
    samples = patches.samples.take(patches.of_sample[first:last])
    bounds = np.clip(patches.first, first, last)
    counts = bounds[1:] - bounds[:-1]
    is_back = np.repeat(patches.sides == BACK, counts)
    corners_m = geometry.corners_m(samples.triangles)
    planes = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    planes /= np.maximum(np.linalg.norm(planes, axis=1, keepdims=True), 1e-30)
    planes[is_back] *= -1.0
    placed_m = np.einsum("nk,nkc->nc", samples.weights, corners_m)
    hits = RayHits(
        samples.triangles, np.zeros(len(planes)), samples.weights, planes.astype(np.float32)
    )
    origins_m = placed_m - transport.center_m + transport.start_m * planes
    return Points(origins_m.astype(np.float32), rays.shading.normals(hits), hits.planes)


def usable(rays: RayScene, transport: Transport, patches: Patches) -> Patches:
    """Patches without the samples that are inside a solid or close below a surface.

    Light of such samples, as at the foot of a wall or below a rug, would darken the texel's edge.
    """
    kept = [np.empty(0, np.bool_)]
    spacing_m = np.repeat(patches.spacing_m, np.diff(patches.first))
    for first in range(0, len(patches.of_sample), _BATCH):
        last = min(first + _BATCH, len(patches.of_sample))
        points = points_at(rays, transport, patches, first, last)
        near_m = 0.5 * spacing_m[first:last]
        across = np.cross(points.planes, np.roll(points.planes, 1, axis=1) + (0.3, 0.1, -0.2))
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        axes = np.stack((points.planes, across, np.cross(points.planes, across)), axis=1)
        inside = np.zeros(last - first, dtype=np.intp)
        for shares in _PROBING:
            directions = np.einsum("k,nkc->nc", shares, axes).astype(np.float32)
            hits = transport.cast(points.origins_m, directions)
            is_back = transport.is_back(hits) & ~transport.is_frosted(hits)
            inside += (hits.patches == INSIDE) | (is_back & (hits.ranges_m < near_m))
        kept.append(inside <= _MAX_INSIDE)
    return patches.kept(np.concatenate(kept))
