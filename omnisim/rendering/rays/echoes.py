"""Echoes of laser beams that pass panes and are reflected by planar mirrors.

A receiver sees along its own beam only. Light therefore returns by the way on which it went out:
each pane and each mirror takes its share twice, and the range is half of the path's length.
A beam is reflected by planes only: at curved mirrors it spreads, and nothing is returned from
behind them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices, Ints32, Uints32
from omnisim.core.world import Poses
from omnisim.ground_truth.lidar_beams import EchoLimits
from omnisim.rendering.rays.caster import NO_TRIANGLE, RayHits, Rays
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.shading.shading import Shading, View
from omnisim.rendering.rays.shading.surface_light import mirrored_rays, surface_light

MAX_SURFACES = 16  # panes and mirrors along a path
# Dynamic range of a receiver, an assumption: fainter paths are not followed, and fainter echoes are
# no returns at any range.
MIN_SHARE = 1e-3
LASER = 0  # color whose reflectance is taken for the laser's infrared: red


class Echoes(NamedTuple):
    """Echoes (m,) of beams."""

    beams: Indices  # (m,) indices of the beams
    ranges_m: Floats  # (m,) half of the lengths of the paths
    # (m,) relative to a white Lambertian surface that is met perpendicularly at the same range
    # without panes and mirrors
    intensities: Floats
    surfaces: Ints32  # (m,) indices into the geometry's surfaces
    is_certain: Bools  # (m,) mask of echoes of surfaces that are not specular and directly hit

    def take(self, indices: Indices) -> Echoes:
        """The selected echoes."""
        return Echoes._make(values[indices] for values in self)


class Returns(NamedTuple):
    """Measured returns of beams (returns, n), the strongest first."""

    ranges_m: Floats  # +inf: no return
    intensities: Floats  # see `Echoes`; 0: no return
    surfaces_plus_one: Uints32  # 1 + index into the geometry's surfaces; 0: no return


def no_returns(returns: int, beams: int) -> Returns:
    """Returns of beams that hit nothing."""
    return Returns(
        np.full((returns, beams), np.inf),
        np.zeros((returns, beams)),
        np.zeros((returns, beams), dtype=np.uint32),
    )


def direct_intensities(
    shading: Shading, rays: Rays, hits: RayHits, world_from_objects: Poses
) -> Floats:
    """Intensities (n,) of the surfaces that beams hit first; all must hit."""
    return surface_light(shading, View(rays, hits, world_from_objects, None)).returned[:, LASER]


def replace_specular(
    returns: Returns, scene: RayScene, rays: Rays, objects: ObjectState, limits: EchoLimits
) -> None:
    """Replace the returns of beams (n,) that hit specular surfaces first by those behind them."""
    is_specular = np.concatenate(([False], scene.shading.is_specular))
    specular = np.flatnonzero(is_specular[returns.surfaces_plus_one[0]])
    if len(specular):
        echoes = cast_echoes(scene, rays.take(specular), objects)
        followed = select_returns(echoes, len(specular), limits)
        returns.ranges_m[:, specular] = followed.ranges_m
        returns.intensities[:, specular] = followed.intensities
        returns.surfaces_plus_one[:, specular] = followed.surfaces_plus_one


def select_returns(echoes: Echoes, beams: int, limits: EchoLimits) -> Returns:
    """Returns of beams (n,): the strongest, and the last.

    The received power decides, which falls with the squared range. If the strongest echo is the
    last, the second return is the second strongest.
    Source: Velodyne, VLP-16 User Manual, 63-9243 Rev. D, section 9, dual return mode.
    """
    share_of_range = echoes.ranges_m / limits.range_max_m
    faintest = np.maximum(limits.min_intensity * share_of_range**2, MIN_SHARE)
    is_detected = echoes.intensities >= faintest
    echoes = echoes.take(np.flatnonzero(is_detected | echoes.is_certain))
    returns = no_returns(limits.returns, beams)
    powers = echoes.intensities / np.maximum(echoes.ranges_m, 1e-6) ** 2
    order = np.lexsort((-powers, echoes.beams))
    ordered = echoes.take(order)
    firsts = np.flatnonzero(np.diff(ordered.beams, prepend=-1))
    _put(returns, 0, ordered, firsts)
    if limits.returns > 1:
        others = np.delete(np.arange(len(order)), firsts)
        strongest_m = returns.ranges_m[0, ordered.beams[others]]
        # farther echoes by range, the farthest first; then nearer ones by power
        is_nearer = ordered.ranges_m[others] <= strongest_m
        ranks = np.where(is_nearer, others, -ordered.ranges_m[others])
        others = others[np.lexsort((ranks, is_nearer, ordered.beams[others]))]
        seconds = others[np.flatnonzero(np.diff(ordered.beams[others], prepend=-1))]
        _put(returns, 1, ordered, seconds)
    return returns


def _put(returns: Returns, number: int, echoes: Echoes, indices: Indices) -> None:
    some = echoes.take(indices)
    returns.ranges_m[number, some.beams] = some.ranges_m
    returns.intensities[number, some.beams] = some.intensities
    returns.surfaces_plus_one[number, some.beams] = some.surfaces + 1


class _Front(NamedTuple):
    """Beams (n,) on their way."""

    beams: Indices  # (n,) indices of the beams
    rays: Rays  # rays from the mirrored origins
    behind: Ints32  # (n,) triangles at which they start
    shares: Floats  # (n,) light left, out and back

    def take(self, indices: Indices) -> _Front:
        """The selected beams."""
        return _Front(
            self.beams[indices], self.rays.take(indices), self.behind[indices], self.shares[indices]
        )


def cast_echoes(scene: RayScene, rays: Rays, objects: ObjectState) -> Echoes:
    """Echoes of beams (n,) from all surfaces along their paths, on either side of them."""
    poses, shading = objects.world_from_objects, scene.shading
    count = len(rays.near_m)
    nowhere = np.full(count, NO_TRIANGLE, dtype=np.int32)
    front = _Front(np.arange(count), rays, nowhere, np.ones(count))
    found: list[Echoes] = []
    for number in range(MAX_SURFACES):
        hits = scene.first_hits(front.rays, objects, front.behind, both_sides=True)
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        if len(hit) == 0:
            break
        front = front.take(hit)
        hits = scene.caster.exact(front.rays, hits.take(hit), poses)
        surfaces = shading.surfaces(hits)
        light = surface_light(shading, View(front.rays, hits, poses, None))
        is_specular = shading.is_specular[surfaces]
        found.append(
            Echoes(
                front.beams,
                hits.ranges_m,
                front.shares * light.returned[:, LASER],
                surfaces,
                ~is_specular & (number == 0),
            )
        )
        # behind panes, and reflected by planes, with enough light left
        passed = front.shares * light.passed[:, LASER] ** 2
        reflected = front.shares * light.reflected[:, LASER] ** 2 * light.is_flat
        on, back = np.flatnonzero(passed >= MIN_SHARE), np.flatnonzero(reflected >= MIN_SHARE)
        behind = scene.caster.behind(front.rays.take(on), hits.ranges_m[on])
        mirrored = mirrored_rays(
            scene.caster, front.rays.take(back), hits.take(back), light.take(back)
        )
        both = np.concatenate((on, back))
        front = _Front(
            front.beams[both],
            Rays._make(np.concatenate(parts) for parts in zip(behind, mirrored, strict=True)),
            hits.triangles[both],
            np.concatenate((passed[on], reflected[back])),
        )
        if len(front.beams) == 0:
            break
    if not found:
        none = np.zeros(0)
        return Echoes(np.zeros(0, np.intp), none, none, np.zeros(0, np.int32), none > 0.0)
    return Echoes._make(np.concatenate(parts) for parts in zip(*found, strict=True))
