"""Light at points of a scene: of lamps, of bright surfaces that rays are aimed at, and gathered.

Aimed rays are weighted against gathering rays that hit the same emitter.
Sources: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering",
1995, the balance heuristic; Roberts, "The unreasonable effectiveness of quasirandom sequences",
2018, for evenly spread points, with the random shifts of Cranley and Patterson, "Randomization of
number theoretic methods", 1976.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.rendering.baking.patches import BACK, Patches
from omnisim.rendering.baking.transport import INSIDE, SKY, PatchHits, Transport
from omnisim.rendering.rays.caster import RayHits
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.rays.shading.lit_surfaces import LampLight, Shadows, lamps_at
from omnisim.scene.model import LAMP_NEAR_M, Light, Lighting, LightKind

_STEPS = np.array((0.7548776662466927, 0.5698402909980532))


def generator(seed: int, stage: int, tile: int) -> np.random.Generator:
    """Random number generator of one tile of one stage, independent of the others."""
    return np.random.Generator(np.random.Philox(key=seed, counter=(0, 0, stage, tile)))


def spread_points(count: int) -> Floats32:
    """Points (n, 2) of the R2 sequence in the unit square."""
    return ((0.5 + np.arange(1, count + 1)[:, None] * _STEPS) % 1.0).astype(np.float32)


def turned(points: Floats32, shifts: Floats32) -> Floats32:
    """Points (n, k, 2) in the unit square: points (k, 2) with wrap-around shifts (n, 2)."""
    places = shifts[:, None] + points
    places -= np.floor(places)
    return places


def cosine_directions(points: Floats32, normals: Floats32) -> tuple[Floats32, Floats32]:
    """Directions (n, k, 3) about unit normals (n, 3) from points (n, k, 2); cosines (n, k).

    Their probability density is the cosine over pi.
    Source of the axes: Duff et al., "Building an orthonormal basis, revisited", 2017.
    """
    x, y, z = (normals[:, axis, None] for axis in range(3))
    sign = np.where(z >= 0.0, np.float32(1.0), np.float32(-1.0))
    a = -1.0 / (sign + z)
    b = x * y * a
    radius = np.sqrt(points[..., 0])
    angle = np.float32(2.0 * np.pi) * points[..., 1]
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    cosines = np.sqrt(np.maximum(1.0 - points[..., 0], np.float32(1e-6)))
    directions = np.empty((*cosines.shape, 3), dtype=np.float32)
    directions[..., 0] = u * (1.0 + sign * x * x * a) + v * b + cosines * x
    directions[..., 1] = u * (sign * b) + v * (sign + y * y * a) + cosines * y
    directions[..., 2] = -u * (sign * x) - v * y + cosines * z
    return directions, cosines


def sphere_directions(points: Floats32) -> Floats32:
    """Unit directions (n, 3), uniform over the sphere, from points (n, 2)."""
    z = 1.0 - 2.0 * points[:, 0]
    side = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    angle = np.float32(2.0 * np.pi) * points[:, 1]
    return np.stack((side * np.cos(angle), side * np.sin(angle), z), axis=1).astype(np.float32)


# Light of emissive and other bright surfaces: rays aimed at points on them.
LUMINANCE = np.array((0.2126, 0.7152, 0.0722), dtype=np.float32)
_MIN_M2 = 1e-8
_TRIED = 64  # rays per place that find the emitters that light it
_MIN_SHARE = 0.2  # share of rays spread over all emitters


class _AimedRays(NamedTuple):
    """Rays that reach emitters."""

    numbers: Indices  # (r,) ray numbers, place after place
    picked: Indices  # (r,) chosen emitters
    light: Floats32  # (r, 3) along the rays, on white surfaces, weighted against gathering rays


class Emitters:
    """Bright patches, chosen by power, and equally often from each emitting side.

    Args:
        points: points of all entries in `Patches.of_sample`.
        emission: (p, 3) light of the patches to aim at; 0 elsewhere.
        aimed: rays to emitters per place.
        gathered: cosine-distributed rays per place.
    """

    def __init__(
        self, patches: Patches, points: Points, emission: Floats32, aimed: int, gathered: int
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

    def _choose_by(self, shares: Floats) -> None:
        """Set the shares of rays that the emitters get."""
        self._shares, self._ends = shares, np.cumsum(shares)
        density = np.zeros(len(self._emission))
        density[self._by_power] = shares / np.maximum(self._areas_m2[self._by_power], 1e-12)
        self._density = density.astype(np.float32)  # per square meter

    def focused(self, transport: Transport, at: Points, shifts: Floats32) -> Emitters:
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

    def light(
        self, transport: Transport, at: Points, points: Floats32, shifts: Floats32
    ) -> Floats32:
        """Light (n, 3) on white surfaces, by rays to emitters.

        Args:
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

    def _aim(
        self, transport: Transport, at: Points, points: Floats32, shifts: Floats32
    ) -> _AimedRays:
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

    def seen(self, hits: PatchHits, cosines: Floats32) -> Floats32:
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


def lamps_on(
    lighting: Lighting, transport: Transport, origins_m: Floats32, at: Points | None = None
) -> list[LampLight]:
    """Light of each lamp, straight or through glass, at points (n, 3).

    Args:
        origins_m: (n, 3) points, relative to the transport's center.
        at: surface points, which receive no light from behind; None: points in free space.
    """
    points_m, none = origins_m + transport.center_m, np.zeros((0, 3), np.float32)
    nowhere = RayHits(np.zeros(0, np.int32), np.zeros(0), none, none)
    no_shadows = Shadows(nowhere, lambda rays, triangles: np.ones((0, 1), np.float32))
    lamps = lamps_at(lighting.with_shadows(False), points_m, origins_m, no_shadows)
    return [
        _shadowed(light, lamp, transport, origins_m, at) if light.casts_shadow else lamp
        for light, lamp in zip(lighting.lights, lamps, strict=True)
    ]


def lamp_light(lamps: list[LampLight], points: Points) -> Floats32:
    """Light (n, 3) of lamps on white surfaces at points."""
    total = np.zeros_like(points.origins_m)
    for lamp in lamps:
        cosines = np.maximum(np.einsum("nc,nc->n", points.normals, _all(lamp, total)), 0.0)
        total += (cosines * lamp.levels)[:, None] * lamp.color
    return total


def _all(lamp: LampLight, points: Floats32) -> Floats32:
    return np.broadcast_to(lamp.directions, points.shape)


def _shadowed(
    light: Light, lamp: LampLight, transport: Transport, origins_m: Floats32, at: Points | None
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


# Points on patches: positions where light is gathered, with surface orientation.
_BATCH = 1 << 17
# Directions of probing rays, along the normal and two axes of the plane.
_PROBING = np.array(
    [[1.0, 0.0, 0.0], [0.5, 0.866, 0.0], [0.5, -0.433, 0.75], [0.5, -0.433, -0.75]], np.float32
)
_MAX_INSIDE = 1  # maximum number of probing rays inside of a solid


class Points(NamedTuple):
    """Points on patches."""

    # (n, 3) relative to `Transport.center_m`, beside the surface, on the patch's side
    origins_m: Floats32
    normals: Floats32  # (n, 3) unit, interpolated, on the patch's side
    planes: Floats32  # (n, 3) unit, triangle normals, on the patch's side


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


# Light gathered at points from patches, emissive surfaces and the sky.
_RAYS_AT_ONCE = 1 << 17


class GatheredLight(NamedTuple):
    """Gathered light at points, on white surfaces."""

    light: Floats32  # (n, 3) mean of rays: light of emissive patches and sky, and `radiosity`
    halves: Floats32  # (n, 2, 3) the same from the even and the odd rays, separately
    is_valid: Bools  # (n,) at least one ray did not hit the inside of a solid


class Gatherer:
    """Gathers light with a number of cosine-distributed rays per place."""

    def __init__(self, lighting: Lighting, transport: Transport, samples: int):
        self._transport, self._samples = transport, samples
        self._ambient = np.array(lighting.ambient, dtype=np.float32)
        self._environment = lighting.environment
        self._points = spread_points(samples)

    def sky(self, directions: Floats32) -> Floats32:
        """Sky light (n, 3) along directions (n, 3)."""
        if self._environment is None:
            return np.broadcast_to(self._ambient, directions.shape)
        return self._ambient + self._environment.seen(directions)

    def hits(
        self, places: list[Points], shifts: Floats32, first: int, last: int
    ) -> tuple[PatchHits, Floats32]:
        """Hits and cosines of rays `first` to `last` of places (n,), shifted by (n, 2)."""
        count = last - first
        origins = np.empty((len(shifts), count, 3), dtype=np.float32)
        directions = np.empty_like(origins)
        cosines = np.empty((len(shifts), count), dtype=np.float32)
        points = turned(self._points[first:last], shifts)
        for number, at in enumerate(places):
            part = slice((number - first) % len(places), None, len(places))
            origins[:, part] = at.origins_m[:, None]
            toward, cosines[:, part] = cosine_directions(points[:, part], at.normals)
            below = np.einsum("nkc,nc->nk", toward, at.planes)
            toward -= 2.0 * np.minimum(below, 0.0)[..., None] * at.planes[:, None]
            directions[:, part] = toward
        aims = directions.reshape(-1, 3)
        return self._transport.cast(origins.reshape(-1, 3), aims), cosines.ravel()

    def gather(
        self, places: list[Points], shifts: Floats32, radiosity: Floats32, emitters: Emitters
    ) -> GatheredLight:
        """Light at places (n,) from patches of radiosity (p, 3), emitters and sky."""
        count = len(shifts)
        halves = np.zeros((count, 2, 3), dtype=np.float32)
        numbers = np.zeros((count, 2), dtype=np.float32)
        step = max(2, _RAYS_AT_ONCE // max(count, 1) // 2 * 2)
        for first in range(0, self._samples, step):
            last = min(first + step, self._samples)
            hits, cosines = self.hits(places, shifts, first, last)
            light = self.seen(hits, cosines, radiosity, emitters)
            light = light.reshape(count, -1, 3)
            valid = (hits.patches != INSIDE).reshape(count, -1)
            for half in (0, 1):
                halves[:, half] += light[:, half::2].sum(axis=1)
                numbers[:, half] += valid[:, half::2].sum(axis=1)
        light = halves.sum(axis=1) / np.maximum(numbers.sum(axis=1), 1.0)[:, None]
        halves /= np.maximum(numbers, 1.0)[..., None]
        return GatheredLight(light, halves, numbers.sum(axis=1) > 0.0)

    def seen(
        self, hits: PatchHits, cosines: Floats32, radiosity: Floats32, emitters: Emitters
    ) -> Floats32:
        """Light (n, 3) along rays."""
        light = np.zeros((len(cosines), 3), dtype=np.float32)
        free = np.flatnonzero(hits.patches == SKY)
        light[free] = self.sky(hits.directions[free])
        some = np.flatnonzero(hits.patches >= 0)
        on_patches = hits.take(some)
        light[some] = radiosity[on_patches.patches] + emitters.seen(on_patches, cosines[some])
        return light * hits.shares
