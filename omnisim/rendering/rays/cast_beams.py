"""Beams of laser scanners and spinning lidars, by ray casting, and their echoes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices, Ints32, Uints32
from omnisim.core.world import ObjectPart, Poses
from omnisim.ground_truth.hits import BeamHits, EchoLimits, LidarBeams, Revolution, ScanBeams, Slice
from omnisim.rendering.rays.caster import NO_TRIANGLE, RayHits, WorldRays
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.shading.shading import RayView, Shading
from omnisim.rendering.rays.shading.surface_light import mirrored_rays, surface_light


class Beams:
    """Casts the beams of a scanner into a scene.

    Surfaces reflect on both sides. A beam passes through the holes of masked materials and through
    blended surfaces that hide less than half of what is behind them.

    Args:
        scene: scene to cast at, in its current state; earlier states are not kept.
        beams: beams; surfaces farther away than their range are ignored.
        hidden: parts of dynamic objects that beams pass through.
    """

    def __init__(
        self, scene: Callable[[], RayScene], beams: ScanBeams, hidden: frozenset[ObjectPart]
    ):
        self._scene, self._beams, self._hidden = scene, beams, hidden
        angles_rad = beams.angles_rad
        flat = np.zeros_like(angles_rad)
        self._directions = np.stack((np.cos(angles_rad), np.sin(angles_rad), flat), axis=1)

    def refresh(self) -> None:
        """Do nothing: each cast uses the current scene."""

    def cast(self, world_from_scanner: Floats, world_from_objects: Poses = ()) -> Floats:
        """Ranges (n,) in meters from a pose (4, 4), with objects at their poses; +inf: no hit."""
        scene, count = self._scene(), len(self._directions)
        rays = WorldRays(
            np.tile(world_from_scanner[:3, 3], (count, 1)),
            np.einsum("nj,ij->ni", self._directions, world_from_scanner[:3, :3]),
            np.zeros(count),
            np.full(count, self._beams.max_range_m),
        )
        objects = ObjectState(world_from_objects, self._hidden)
        hits = scene.first_hits(rays, objects, both_sides=True)
        returns = no_returns(1, count)
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        exact = scene.caster.exact(rays.take(hit), hits.take(hit), world_from_objects)
        returns.ranges_m[0, hit] = exact.ranges_m
        returns.surfaces_plus_one[0, hit] = scene.shading.surfaces(exact) + 1
        limits = self._beams.echo_limits
        if limits is not None and scene.shading.is_specular.any():
            replace_specular(returns, scene, rays, objects, limits)
        return returns.ranges_m[0]


_FIRINGS_AT_ONCE, _POINTS_AT_ONCE = 128, 1 << 15
_MAX_PATH_M = 0.002  # of an object during the firings that are cast at once
_BESIDE = 0.01  # barycentric tolerance: a ray may just miss a triangle that deforms


class LidarCaster:
    """Casts the beams of a lidar into a scene.

    Surfaces reflect on both sides. The surface that a beam hits is found with the dynamic objects
    at their poses in the middle of a slice, or of a part of it in which they move by at most 2 mm;
    its range is computed with the object at its pose at the time of firing. Beams that hit glass or
    mirrors first are followed with the objects as in that middle, if the beams have `EchoLimits`.

    Args:
        scene: scene to cast at, in its current state; earlier states are not kept.
        hidden: parts of dynamic objects that beams pass through.
    """

    def __init__(
        self, scene: Callable[[], RayScene], beams: LidarBeams, hidden: frozenset[ObjectPart]
    ):
        self._scene, self._beams, self._hidden = scene, beams, hidden

    @property
    def draws(self) -> Sequence[ObjectPart]:
        """Dynamic object and name of each instance, indexed by `BeamHits.draw_ids` − 1."""
        return self._scene().caster.geometry.draws

    def refresh(self) -> None:
        """Do nothing: each cast uses the current scene."""

    def cast(self, revolution: Revolution) -> BeamHits:
        """Hits of all beams of a revolution."""
        scene, size = self._scene(), self._beams.directions.shape[:2]
        limits = self._beams.echo_limits if scene.shading.is_specular.any() else None
        hits = _no_hits(size)
        if limits is not None and limits.returns > 1:
            hits = hits._replace(second=_no_hits(size))
        targets = [hits] if hits.second is None else [hits, hits.second]
        parts = [part for span in revolution.slices for part in self._parts(scene, span)]

        def cast_part(part: tuple[Slice, int, int]) -> None:
            span, first, last = part
            firings = slice(first, last)
            rays, shares = _rays(self._beams, revolution, span, firings)
            returns = self._cast_slice(scene, span, rays, shares, limits)
            for number, target in enumerate(targets):
                target.ranges_m[:, firings] = returns.ranges_m[number].reshape(size[0], -1)
                target.draw_ids[:, firings] = returns.surfaces_plus_one[number].reshape(size[0], -1)
                assert target.intensities is not None
                values = returns.intensities[number].reshape(size[0], -1)
                target.intensities[:, firings] = values

        scene.in_threads(cast_part, parts)
        return hits

    def _parts(self, scene: RayScene, span: Slice) -> list[tuple[Slice, int, int]]:
        """Ranges of firings that are cast at once, each with its slice or part of a slice."""
        at_once = _FIRINGS_AT_ONCE
        path_m = scene.caster.longest_path_m(
            span.start.world_from_objects, span.end.world_from_objects, self._hidden
        )
        is_cut = path_m > _MAX_PATH_M
        if is_cut:
            at_once = max(1, min(at_once, int((span.last - span.first) * _MAX_PATH_M / path_m)))
        parts = []
        for first in range(span.first, span.last, at_once):
            last = min(first + at_once, span.last)
            parts.append((span.part(first, last) if is_cut else span, first, last))
        return parts

    def _cast_slice(
        self,
        scene: RayScene,
        span: Slice,
        rays: WorldRays,
        shares: Floats,
        limits: EchoLimits | None,
    ) -> Returns:
        """Returns of rays (n,) in a slice; without limits, rays end at the first surface."""
        poses = span.middle.world_from_objects
        objects = ObjectState(poses, self._hidden)
        beams = rays
        hits = scene.first_hits(rays, objects, both_sides=True)
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        hits, rays = hits.take(hit), rays.take(hit)
        geometry = scene.caster.geometry
        bent = [(moving, rays.take(moving)) for moving, _ in geometry.deformed(hits.triangles)]
        _follow_objects(rays, span, geometry.part_of_triangles(hits.triangles), shares[hit])
        returns = no_returns(1 if limits is None else limits.returns, len(shares))
        exact = scene.caster.exact(rays, hits, poses)
        ranges_m = exact.ranges_m
        for moving, some in bent:
            share = shares[hit[moving], None, None]
            start_m, end_m = (
                geometry.corners_m(hits.triangles[moving], pose.world_from_objects)
                for pose in (span.start, span.end)
            )
            corners_m = start_m + share * (end_m - start_m)
            moved = scene.caster.exact_at(corners_m, some, hits.take(moving))
            # a ray that misses the triangle at its own time keeps the hit of the slice's middle
            inside = np.flatnonzero(moved.weights.min(axis=1) > -_BESIDE)
            ranges_m[moving[inside]] = moved.ranges_m[inside]
        returns.ranges_m[0, hit] = ranges_m
        returns.surfaces_plus_one[0, hit] = geometry.surface_of_triangle[hits.triangles] + 1
        returns.intensities[0, hit] = direct_intensities(scene.shading, rays, exact, poses)
        if limits is not None:
            replace_specular(returns, scene, beams, objects, limits)
        return returns


def intensities_of(
    scene: RayScene, beams: LidarBeams, revolution: Revolution, draw_ids: Uints32, triangles: Ints32
) -> Floats:
    """Intensities (rings, firings) of the beams of a revolution that hit known triangles.

    Args:
        draw_ids: (rings, firings) 0 where a beam hits nothing.
        triangles: (rings, firings) indices into the scene's geometry.
    """
    intensities = np.zeros(draw_ids.shape)
    at_once = max(1, _POINTS_AT_ONCE // len(intensities))
    for part in revolution.slices:
        for first in range(part.first, part.last, at_once):
            firings = slice(first, min(first + at_once, part.last))
            rays, shares = _rays(beams, revolution, part, firings)
            hit = np.flatnonzero(draw_ids[:, firings].ravel())
            rays, own = rays.take(hit), triangles[:, firings].ravel()[hit].astype(np.int32)
            _follow_objects(rays, part, scene.caster.geometry.part_of_triangles(own), shares[hit])
            poses, unknown = part.middle.world_from_objects, np.zeros((len(hit), 3), np.float32)
            found = RayHits(own, np.zeros(len(hit)), unknown, unknown)
            with np.errstate(divide="ignore", invalid="ignore"):  # triangles seen edge-on
                exact = scene.caster.exact(rays, found, poses)
            weights = np.nan_to_num(exact.weights, nan=1.0 / 3.0, posinf=1.0, neginf=0.0)
            exact = exact._replace(weights=weights.clip(0.0, 1.0))
            values = np.zeros(len(shares))
            values[hit] = direct_intensities(scene.shading, rays, exact, poses)
            intensities[:, firings] = values.reshape(len(intensities), -1)
    return intensities


def _rays(
    beams: LidarBeams, revolution: Revolution, span: Slice, firings: slice
) -> tuple[WorldRays, Floats]:
    """Rays (n,) of some firings of a slice, ring by ring, and their times as shares of it."""
    rotations, directions = revolution.rotations[firings], beams.directions[:, firings]
    directions = np.einsum("fij,rfj->rfi", rotations, directions)
    elapsed = (np.arange(firings.start, firings.stop) - span.first) / (span.last - span.first)
    shares = np.broadcast_to(elapsed, directions.shape[:2]).ravel()
    origins_m = span.start.origin_m + shares[:, None] * span.path_m
    far_m = np.full(len(shares), beams.max_range_m)
    return WorldRays(origins_m, directions.reshape(-1, 3), np.zeros(len(shares)), far_m), shares


def _no_hits(size: tuple[int, int]) -> BeamHits:
    return BeamHits(np.full(size, np.inf), np.zeros(size, dtype=np.uint32), np.zeros(size))


def _follow_objects(rays: WorldRays, span: Slice, parts: Indices, shares: Floats) -> None:
    """Move rays (n,) at the moving ones of the parts (n,) into the frames of their middle poses."""
    poses = (state.world_from_objects for state in (span.start, span.middle, span.end))
    for part, (start, middle, end) in enumerate(zip(*poses, strict=True), start=1):
        if not np.array_equal(start, end):
            own = np.flatnonzero(parts == part)
            world_from_object = start + shares[own, None, None] * (end - start)
            moves = middle @ np.linalg.inv(world_from_object)
            rotations, origins_m = moves[:, :3, :3], rays.origins_m[own]
            rays.origins_m[own] = np.einsum("nij,nj->ni", rotations, origins_m) + moves[:, :3, 3]
            rays.directions[own] = np.einsum("nij,nj->ni", rotations, rays.directions[own])


# Echoes of laser beams that pass panes and are reflected by planar mirrors.
#
# A receiver sees along its own beam only. Light therefore returns by the way on which it went out:
# each pane and each mirror takes its share twice, and the range is half of the path's length.
# A beam is reflected by planes only: at curved mirrors it spreads, and nothing is returned from
# behind them.


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
    shading: Shading, rays: WorldRays, hits: RayHits, world_from_objects: Poses
) -> Floats:
    """Intensities (n,) of the surfaces that beams hit first; all must hit."""
    return surface_light(shading, RayView(rays, hits, world_from_objects, None)).returned[:, LASER]


def replace_specular(
    returns: Returns, scene: RayScene, rays: WorldRays, objects: ObjectState, limits: EchoLimits
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
    rays: WorldRays  # rays from the mirrored origins
    behind: Ints32  # (n,) triangles at which they start
    shares: Floats  # (n,) light left, out and back

    def take(self, indices: Indices) -> _Front:
        """The selected beams."""
        return _Front(
            self.beams[indices], self.rays.take(indices), self.behind[indices], self.shares[indices]
        )


def cast_echoes(scene: RayScene, rays: WorldRays, objects: ObjectState) -> Echoes:
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
        light = surface_light(shading, RayView(front.rays, hits, poses, None))
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
            WorldRays._make(np.concatenate(parts) for parts in zip(behind, mirrored, strict=True)),
            hits.triangles[both],
            np.concatenate((passed[on], reflected[back])),
        )
        if len(front.beams) == 0:
            break
    if not found:
        none = np.zeros(0)
        return Echoes(np.zeros(0, np.intp), none, none, np.zeros(0, np.int32), none > 0.0)
    return Echoes._make(np.concatenate(parts) for parts in zip(*found, strict=True))
