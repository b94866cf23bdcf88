"""Ray-cast scene: radiance along rays, and their first hits."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, TypeVar

import numpy as np

from omnisim.core.arrays import Floats, Floats32, Indices, Ints32
from omnisim.core.world import ObjectPart, Poses
from omnisim.rendering.rays.caster import NO_TRIANGLE, RayCaster, RayHits, WorldRays
from omnisim.rendering.rays.shading.lit_surfaces import CastShadow
from omnisim.rendering.rays.shading.ray_optics import NO_MEDIUM, LightPaths, Tracing
from omnisim.rendering.rays.shading.shading import RayView, Shading
from omnisim.rendering.rays.shading.surface_light import straight_shares
from omnisim.scene.light.environment import Environment
from omnisim.scene.model import Fog, Scene

# Maximum number of surfaces that a ray passes through; it ends at the last one.
MAX_LAYERS = 256
_MIN_SHARE = 1e-4  # of light still transmitted: less than an 8-bit step, also in the dark

Item = TypeVar("Item")
Result = TypeVar("Result")


class ObjectState(NamedTuple):
    """Dynamic objects at one time, with the instances hidden from one sensor."""

    world_from_objects: Poses = ()  # (4, 4) each, poses of the objects
    hidden: frozenset[ObjectPart] = frozenset()  # instances to ignore


_NO_OBJECTS = ObjectState()


class RayScene:
    """Casts rays at a scene and its dynamic objects; constant data is built once.

    Surfaces count as for the virtual cameras: single-sided ones only from the front, masked ones
    except in their holes. Blended ones transmit light in order of distance.

    Args:
        threads: number of threads for casting; None: one per core.

    Attributes:
        caster, shading: triangles of the scene, and their appearance.
    """

    def __init__(
        self, scene: Scene, dynamic_objects: Sequence[Scene] = (), threads: int | None = None
    ):
        self.scene = scene
        self.caster = RayCaster(scene, dynamic_objects)
        self.shading = Shading(self.caster.geometry, scene.lighting)
        self._threads = threads or os.cpu_count() or 1
        self._background = np.array(scene.background, dtype=np.float32)
        self._fog = scene.lighting.fog

    def radiance(
        self,
        rays: WorldRays,
        footprints: Floats32 | None = None,
        objects: ObjectState = _NO_OBJECTS,
        unlit: bool = False,
        paths: LightPaths | None = None,
        behind: Ints32 | None = None,
    ) -> Floats32:
        """Linear RGB (n, 3) along rays (n,).

        Args:
            footprints: (n, 2, 3) changes of direction to the next samples, world, over which
                textures are filtered; None: rays without width.
            unlit: return plain base colors.
            paths: (n,) identities of the rays: smooth surfaces reflect the scene; None: they
                reflect its sky and lamps only.
            behind: (n,) triangles that the rays start at.
        """
        poses, shading, glass = objects.world_from_objects, self.shading, None
        if paths is not None and not unlit and shading.is_glass.any():
            if shading.glass.is_dispersive and paths.channel is None:
                channels = [  # which dispersive glass refracts differently
                    self.radiance(
                        rays,
                        footprints,
                        objects,
                        paths=paths._replace(channel=number),
                        behind=behind,
                    )[:, number]
                    for number in range(3)
                ]
                return np.stack(channels, axis=1)
            glass = GlassPassage(shading, paths, poses)
            paths = glass.paths
        sides = False if glass is None else glass.sides
        fog = None if unlit else self._fog
        background = self._background if fog is None else np.array(fog.color, dtype=np.float32)
        environment = self.scene.lighting.environment if fog is None else None
        total = np.zeros((len(rays.near_m), 3), dtype=np.float32)
        has_panes = paths is not None and not unlit and bool(shading.is_pane.any())
        # of each color behind tinted glass, else of all
        share = np.ones((len(total), 3 if has_panes or glass else 1), dtype=np.float32)
        active = np.arange(len(total))
        # fog in front of a mirror is that of the rays before
        starts_m = rays.near_m if paths is not None and paths.bounce else np.zeros(len(total))
        for layer in range(MAX_LAYERS):
            hits = self.caster.cast(rays, poses, objects.hidden, behind, sides)
            if glass is not None:
                share[active] *= glass.attenuation(active, rays, hits)
            is_hit = hits.triangles != NO_TRIANGLE
            missed = active[~is_hit]
            seen = background
            if environment is not None:
                seen = _sky(environment, rays.directions[~is_hit], footprints, missed)
            total[missed] += share[missed] * seen
            kept = np.flatnonzero(is_hit)
            active, rays, hits = active[kept], rays.take(kept), hits.take(kept)
            if len(active) == 0:
                break
            view = RayView(rays, hits, poses, None if footprints is None else footprints[active])
            colors = shading.base_colors(view)
            opacity = self._opacity(hits, colors[:, 3], layer)
            shown = np.flatnonzero(opacity > 0.0)
            light = colors[shown, :3]
            if not unlit:
                cast = self._shadow_caster(poses)
                tracing = (
                    None if paths is None else self._tracing(paths, active[shown], share, poses)
                )
                light = shading.lit(light, view.take(shown), cast, tracing)
            if fog is not None:
                light = fogged(fog, light, hits.ranges_m[shown] - starts_m[active[shown]])
            total[active[shown]] += share[active[shown]] * opacity[shown, None] * light
            through = 1.0 - opacity[:, None]
            if has_panes and layer < MAX_LAYERS - 1:
                passing = shading.transmitted(view, colors)
                through = through + opacity[:, None] * passing
            if glass is not None and layer < MAX_LAYERS - 1:
                rays, passing = glass.refract(active, view, colors, opacity)
                through = through + opacity[:, None] * passing
            share[active] *= through
            on = np.flatnonzero(share[active].max(axis=1) > _MIN_SHARE)
            if len(on) == 0:
                break
            active, behind = active[on], hits.triangles[on]
            rays = self.caster.behind(rays.take(on), hits.ranges_m[on])
        return total

    def first_hits(
        self,
        rays: WorldRays,
        objects: ObjectState = _NO_OBJECTS,
        behind: Ints32 | None = None,
        footprints: Floats32 | None = None,
        both_sides: bool = False,
        of_shadows: bool = False,
    ) -> RayHits:
        """Nearest surfaces along rays (n,), ignoring holes and blended surfaces below half opacity.

        Args:
            behind: (n,) triangles to ignore.
            footprints: (n, 2, 3) for filtering the textures' holes, see `radiance`.
            both_sides: treat all surfaces as double-sided.
            of_shadows: ignore surfaces that cast no shadow.
        """
        geometry, shading = self.caster.geometry, self.shading
        limits = shading.shadow_cutoff if of_shadows else shading.hit_cutoff

        def cast(rays: WorldRays, behind: Ints32 | None) -> RayHits:
            return self.caster.cast(
                rays, objects.world_from_objects, objects.hidden, behind, both_sides
            )

        first = cast(rays, behind)
        active = np.flatnonzero(first.triangles != NO_TRIANGLE)
        for _ in range(MAX_LAYERS):
            cutoffs = limits[geometry.surface_of_triangle[first.triangles[active]]]
            active = active[cutoffs > 0.0]
            if len(active) == 0:
                break
            hits, some = first.take(active), rays.take(active)
            widths = None if footprints is None else footprints[active]
            view = RayView(some, hits, objects.world_from_objects, widths)
            alphas = shading.base_colors(view)[:, 3]
            clear = np.flatnonzero(alphas < limits[shading.surfaces(hits)])
            active = active[clear]
            some = self.caster.behind(some.take(clear), hits.ranges_m[clear])
            hits = hits.take(clear)
            further = cast(some, hits.triangles)
            first.put(active, further)
            active = active[further.triangles != NO_TRIANGLE]
        return first

    def _tracing(self, paths: LightPaths, some: Indices, shares: Floats32, poses: Poses) -> Tracing:
        """Continuation of paths with shares (n, 1 or 3) of light left; hidden instances show."""
        everything = ObjectState(poses)

        def trace(
            rays: WorldRays, footprints: Floats32 | None, triangles: Ints32, following: LightPaths
        ) -> Floats32:
            return self.radiance(rays, footprints, everything, paths=following, behind=triangles)

        taken = paths.take(some)
        return Tracing(taken._replace(weights=taken.weights * shares[some].max(axis=1)), trace)

    def _shadow_caster(self, poses: Poses) -> CastShadow:
        """Caster of shadow rays: either side, hidden instances too, straight through glass."""
        everything, shading = ObjectState(poses), self.shading
        sees_through = shading.is_pane | shading.is_glass

        def first(rays: WorldRays, triangles: Ints32) -> RayHits:
            return self.first_hits(rays, everything, triangles, both_sides=True, of_shadows=True)

        def cast(rays: WorldRays, triangles: Ints32) -> Floats32:
            hits = first(rays, triangles)
            is_free = hits.triangles == NO_TRIANGLE
            if not sees_through.any():
                return is_free[:, None].astype(np.float32)
            shares = np.tile(is_free[:, None].astype(np.float32), 3)
            active, passed = np.arange(len(is_free)), np.ones((len(is_free), 3), np.float32)
            for _ in range(MAX_LAYERS):
                glass = ~is_free
                glass[glass] = sees_through[shading.surfaces(hits.take(np.flatnonzero(glass)))]
                on = np.flatnonzero(glass)
                if len(on) == 0:
                    break
                active, passed, rays, hits = active[on], passed[on], rays.take(on), hits.take(on)
                view = RayView(rays, hits, poses)
                passed *= straight_shares(shading, view, shading.base_colors(view))
                triangles = hits.triangles
                rays = self.caster.behind(rays, hits.ranges_m)
                hits = first(rays, triangles)
                is_free = hits.triangles == NO_TRIANGLE
                shares[active[is_free]] = passed[is_free]
            return shares

        return cast

    def in_threads(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """Results of a function for each item, in order; Embree and NumPy release the GIL."""
        self.caster.prepare()
        with ThreadPoolExecutor(self._threads) as pool:
            return list(pool.map(function, items))

    def _opacity(self, hits: RayHits, alphas: Floats32, layer: int) -> Floats32:
        """Share (n,) of light that surfaces block: 0 in holes, alpha if blended, otherwise 1."""
        shading = self.shading
        surfaces = shading.surfaces(hits)
        is_blended = shading.is_blended[surfaces]
        is_hole = ~is_blended & (alphas < shading.hit_cutoff[surfaces])
        if layer == MAX_LAYERS - 1:
            return np.ones(len(alphas), dtype=np.float32)
        opacity = np.where(is_blended, np.clip(alphas, 0.0, 1.0), 1.0).astype(np.float32)
        opacity[is_hole] = 0.0
        return opacity


def _sky(
    environment: Environment, directions: Floats, footprints: Floats32 | None, missed: Indices
) -> Floats32:
    """Radiance (n, 3) of the sky along the directions (n, 3) of the rays that missed."""
    if footprints is None:
        return environment.seen(directions)
    return environment.seen(directions, np.linalg.norm(footprints[missed], axis=-1).max(axis=-1))


class GlassPassage:
    """Follows rays (n,) through glass, surface by surface.

    Args:
        paths: (n,) paths of the rays.
        world_from_objects: poses of the dynamic objects.

    Attributes:
        sides: (surfaces,) mask of glass, whose back is hit from inside.
        paths: (n,) paths, in the media that their rays are in.
    """

    def __init__(self, shading: Shading, paths: LightPaths, world_from_objects: Poses):
        self._shading, self._poses = shading, world_from_objects
        air = np.full(len(paths.pixels), NO_MEDIUM, dtype=np.int32)
        self._media = air if paths.media is None else paths.media.copy()
        self.sides, self.paths = shading.is_glass, paths._replace(media=self._media)

    def attenuation(self, indices: Indices, rays: WorldRays, hits: RayHits) -> Floats32:
        """Attenuation (m, 3) of light by glass before the hits of rays at indices (m,)."""
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        media = self._media[indices]
        media[hit] = self._shading.media(hits.take(hit), media[hit], self._poses)
        self._media[indices] = media
        return self._shading.glass.attenuation(media, hits.ranges_m - rays.near_m)

    def refract(
        self, indices: Indices, view: RayView, colors: Floats32, opacity: Floats32
    ) -> tuple[WorldRays, Floats32]:
        """Rays behind hits (m,) of rays at indices (m,), and shares (m, 3) that glass transmits."""
        shares = np.zeros((len(indices), 3), dtype=np.float32)
        is_glass = self._shading.is_glass[self._shading.surfaces(view.hits)]
        some = np.flatnonzero(is_glass & (opacity > 0.0))
        passed = self._shading.refracted(view.take(some), colors[some], self.paths.channel)
        shares[some] = passed.shares
        self._media[indices[some]] = passed.media
        rays = WorldRays(*(values.copy() for values in view.rays))
        rays.origins_m[some], rays.directions[some] = passed.rays.origins_m, passed.rays.directions
        return rays, shares


# Fog along rays, in NumPy: the twin of shaders/scene/fog.glsl.


def fogged(fog: Fog, colors: Floats32, ranges_m: Floats) -> Floats32:
    """Linear colors (n, 3) seen through fog from distances (n,)."""
    left = np.exp(-np.array(fog.attenuation_per_m) * ranges_m[:, None])
    colored = np.array(fog.color)
    return (colored + (colors - colored) * left).astype(np.float32)
