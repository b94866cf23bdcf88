"""Scene to cast rays at: radiance along them, and what they hit first."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.world import ObjectPart
from omnisim.rendering.rays.caster import RayCaster, RayHits, Rays
from omnisim.rendering.rays.embree import NO_TRIANGLE
from omnisim.rendering.rays.geometry import Poses
from omnisim.rendering.rays.shading.fog import fogged
from omnisim.rendering.rays.shading.shading import Shading
from omnisim.rendering.rays.shading.shadows import CastShadow
from omnisim.scene.light.environment import Environment
from omnisim.scene.model import Scene

# Maximum number of surfaces that a ray passes; it ends at the next one.
MAX_LAYERS = 256
_MIN_SHARE = 1e-4  # of light that still comes through: less than a step of 8 bits, in the dark too

Item = TypeVar("Item")
Result = TypeVar("Result")


class ObjectState(NamedTuple):
    """Dynamic objects at one time, to one sensor.

    Attributes:
        world_from_objects: (4, 4) each.
        hidden: instances that are not there.
    """

    world_from_objects: Poses = ()
    hidden: frozenset[ObjectPart] = frozenset()


_NO_OBJECTS = ObjectState()


class RayScene:
    """Casts rays at a scene and its dynamic objects; everything is built once.

    Surfaces are those of the virtual cameras: single-sided ones are not there from behind, masked
    ones not in their holes, and light comes through blended ones in the order in which they stand.

    Args:
        scene: with its lights and background.
        dynamic_objects: each in a frame of its own.
        threads: to cast rays in; None: one for each core.

    Attributes:
        scene: static scene.
        caster, shading: its triangles, and their appearance.

    Raises:
        OmnisimError: embreex is not installed.
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
        rays: Rays,
        footprints: NDArray[np.float32] | None = None,
        objects: ObjectState = _NO_OBJECTS,
        unlit: bool = False,
    ) -> NDArray[np.float32]:
        """Linear RGB (n, 3) along rays (n,).

        Args:
            rays: (n,).
            footprints: (n, 2, 3) changes of the direction to the next samples, world, which
                textures are filtered over; None: a ray has no width.
            objects: the dynamic objects.
            unlit: show plain base colors.
        """
        poses, shading = objects.world_from_objects, self.shading
        fog = None if unlit else self._fog
        background = self._background if fog is None else np.array(fog.color, dtype=np.float32)
        environment = self.scene.lighting.environment if fog is None else None
        total = np.zeros((len(rays.near_m), 3), dtype=np.float32)
        share = np.ones(len(total), dtype=np.float32)
        active, behind = np.arange(len(total)), None
        for layer in range(MAX_LAYERS):
            hits = self.caster.cast(rays, poses, objects.hidden, behind)
            is_hit = hits.triangles != NO_TRIANGLE
            missed = active[~is_hit]
            seen = background
            if environment is not None:
                seen = _sky(environment, rays.directions[~is_hit], footprints, missed)
            total[missed] += share[missed, None] * seen
            kept = np.flatnonzero(is_hit)
            active, rays, hits = active[kept], rays.take(kept), hits.take(kept)
            if len(active) == 0:
                break
            widths = None if footprints is None else footprints[active]
            colors = shading.base_colors(rays, hits, poses, widths)
            opacity = self._opacity(hits, colors[:, 3], layer)
            shown = np.flatnonzero(opacity > 0.0)
            light = colors[shown, :3]
            if not unlit:
                some = None if widths is None else widths[shown]
                cast = self._shadow_caster(poses)
                light = shading.lit(light, rays.take(shown), hits.take(shown), cast, poses, some)
            if fog is not None:
                light = fogged(fog, light, hits.ranges_m[shown])
            weights = share[active[shown]] * opacity[shown]
            total[active[shown]] += weights[:, None] * light
            share[active] *= 1.0 - opacity
            on = np.flatnonzero(share[active] > _MIN_SHARE)
            if len(on) == 0:
                break
            active, behind = active[on], hits.triangles[on]
            rays = self.caster.behind(rays.take(on), hits.ranges_m[on])
        return total

    def first_hits(
        self,
        rays: Rays,
        objects: ObjectState = _NO_OBJECTS,
        behind: NDArray[np.int32] | None = None,
        footprints: NDArray[np.float32] | None = None,
        both_sides: bool = False,
        of_shadows: bool = False,
    ) -> RayHits:
        """Nearest surfaces along rays (n,) that are no holes, and not clearer than half.

        Args:
            rays: (n,).
            objects: the dynamic objects.
            behind: (n,) triangles that are not hit.
            footprints: (n, 2, 3), see `radiance`, of the textures' holes.
            both_sides: all surfaces are double-sided.
            of_shadows: surfaces that cast none are not hit.
        """
        geometry, shading = self.caster.geometry, self.shading
        limits = shading.shadow_cutoff if of_shadows else shading.hit_cutoff

        def cast(rays: Rays, behind: NDArray[np.int32] | None) -> RayHits:
            return self.caster.cast(
                rays, objects.world_from_objects, objects.hidden, behind, both_sides
            )

        found = cast(rays, behind)
        active = np.flatnonzero(found.triangles != NO_TRIANGLE)
        for _ in range(MAX_LAYERS):
            cutoffs = limits[geometry.surface_of_triangle[found.triangles[active]]]
            active = active[cutoffs > 0.0]
            if len(active) == 0:
                break
            hits, some = found.take(active), rays.take(active)
            widths = None if footprints is None else footprints[active]
            alphas = shading.base_colors(some, hits, objects.world_from_objects, widths)[:, 3]
            clear = np.flatnonzero(alphas < limits[shading.surfaces(hits)])
            active = active[clear]
            some = self.caster.behind(some.take(clear), hits.ranges_m[clear])
            hits = hits.take(clear)
            further = cast(some, hits.triangles)
            found.put(active, further)
            active = active[further.triangles != NO_TRIANGLE]
        return found

    def _shadow_caster(self, poses: Poses) -> CastShadow:
        """Caster of shadow rays, whose hits are on either side, and hidden instances too."""
        everything = ObjectState(poses)

        def cast(rays: Rays, triangles: NDArray[np.int32]) -> RayHits:
            return self.first_hits(rays, everything, triangles, both_sides=True, of_shadows=True)

        return cast

    def in_threads(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        """Results of a function of each item, in order; Embree and NumPy free the GIL."""
        with ThreadPoolExecutor(self._threads) as pool:
            return list(pool.map(function, items))

    def _opacity(
        self, hits: RayHits, alphas: NDArray[np.float32], layer: int
    ) -> NDArray[np.float32]:
        """Share (n,) of light that surfaces hide: 0 in holes, alpha where blended, else all."""
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
    environment: Environment,
    directions: NDArray[np.float64],
    footprints: NDArray[np.float32] | None,
    missed: NDArray[np.intp],
) -> NDArray[np.float32]:
    """Radiance (n, 3) of the sky along directions (n, 3) of some of the rays."""
    if footprints is None:
        return environment.seen(directions)
    return environment.seen(directions, np.linalg.norm(footprints[missed], axis=-1).max(axis=-1))
