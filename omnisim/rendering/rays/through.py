"""Surfaces that rays reach through panes and by mirrors.

Rays pass panes, and continue after surfaces that reflect more than half of the light: the picture
shows what is behind them. Others end there, such as a polished floor that is not grazed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Uints32
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import Hits, ThroughHits
from omnisim.rendering.contract import CameraSetup, ScenePoses
from omnisim.rendering.rays.caster import NO_TRIANGLE, DepthLimits, Rays
from omnisim.rendering.rays.pixel_rays import PixelRays
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene
from omnisim.rendering.rays.shading.reflections import MAX_BOUNCES
from omnisim.rendering.rays.shading.shading import View
from omnisim.rendering.rays.shading.surface_light import mirrored_rays, surface_light

MAX_PANES = 32  # along a path, with its mirrors
MIN_REFLECTED = 0.5  # reflected share of the light, mean of linear RGB, of a mirror


class Arrivals(NamedTuple):
    """Surfaces (n,) at the ends of rays, as in `ThroughHits`."""

    ranges_m: Floats
    surfaces_plus_one: Uints32
    cosines: Floats
    shares: Floats


class ThroughCaster:
    """Casts the rays of pixels that show glass or mirrors first, at the current scene."""

    def __init__(self, scene: Callable[[], RayScene], setup: CameraSetup):
        self._scene, self._setup = scene, setup
        self._limits = DepthLimits(setup.sensor.near_m, setup.sensor.far_m)

    @cached_property
    def _pixels(self) -> PixelRays:
        return PixelRays(self._setup.sensor.model, self._setup.sensor.mesh_polygons)

    def cast(
        self, poses: ScenePoses, hits: Hits, is_specular: Bools, draws: Sequence[ObjectPart]
    ) -> ThroughHits:
        """Surfaces of all pixels.

        Args:
            is_specular: (draws,) mask of the instances that are glass or mirrors.
            draws: dynamic object and name of each instance.
        """
        through = ThroughHits.of_first(hits)
        wanted = np.concatenate(([False], is_specular))[hits.draw_ids]
        if not wanted.any():
            return through
        scene, pixels = self._scene(), self._pixels
        numbers = {part: 1 + number for number, part in enumerate(draws)}
        parts = scene.caster.geometry.draws
        draw_of_surface = np.array([0, *(numbers.get(part, 0) for part in parts)], dtype=np.uint32)
        objects = ObjectState(poses.world_from_objects, self._setup.hidden)
        rig_from_optical = pixels.camera.rig_from_optical
        world_from_optical = poses.world_from_rig[:3, :3] @ rig_from_optical

        def cast_band(number: int) -> None:
            rows = pixels.bands[number]
            if not wanted[rows].any():
                return
            band = pixels.band(number)
            some = np.flatnonzero(wanted[rows][band.valid])
            rays = band.aim(self._limits, rig_from_optical, poses.world_from_rig)
            footprints = band.world_footprints(world_from_optical)
            ends = cast_through(scene, rays.take(some), objects, footprints[some])
            rows_hit, columns = (axis[some] for axis in np.nonzero(band.valid))
            places = rows.start + rows_hit, columns
            through.ranges_m[places] = ends.ranges_m
            through.draw_ids[places] = draw_of_surface[ends.surfaces_plus_one]
            through.cosines[places], through.shares[places] = ends.cosines, ends.shares

        scene.in_threads(cast_band, range(len(pixels.bands)))
        return through


def cast_through(
    scene: RayScene, rays: Rays, objects: ObjectState, footprints: Floats32
) -> Arrivals:
    """Surfaces at the ends of rays (n,) with footprints (n, 2, 3), see `RayScene.first_hits`."""
    poses, shading, count = objects.world_from_objects, scene.shading, len(rays.near_m)
    ends = Arrivals(
        np.full(count, np.inf),
        np.zeros(count, dtype=np.uint32),
        np.full(count, np.nan),
        np.ones(count),
    )
    active, behind = np.arange(count), np.full(count, NO_TRIANGLE, dtype=np.int32)
    bounces = np.zeros(count, dtype=np.intp)
    for number in range(MAX_PANES):
        hits = scene.first_hits(rays, objects, behind, footprints)
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        active, rays, footprints = active[hit], rays.take(hit), footprints[hit]
        if len(active) == 0:
            break
        hits = scene.caster.exact(rays, hits.take(hit), poses)
        light = surface_light(shading, View(rays, hits, poses, footprints))
        passed, reflected = light.passed.mean(axis=1), light.reflected.mean(axis=1)
        passes = passed > 0.0
        mirrors = ~passes & (reflected > MIN_REFLECTED) & (bounces[active] < MAX_BOUNCES)
        if number == MAX_PANES - 1:
            passes = mirrors = np.zeros_like(passes)
        here = ~(passes | mirrors)
        ends.ranges_m[active[here]] = hits.ranges_m[here]
        ends.surfaces_plus_one[active[here]] = shading.surfaces(hits)[here] + 1
        ends.cosines[active[here]] = light.cosines[here]
        bounces[active[mirrors]] += 1
        ends.shares[active[passes]] *= passed[passes]
        ends.shares[active[mirrors]] *= reflected[mirrors]
        some = np.flatnonzero(mirrors)
        mirrored = mirrored_rays(scene.caster, rays.take(some), hits.take(some), light.take(some))
        rays = Rays(*(values.copy() for values in scene.caster.behind(rays, hits.ranges_m)))
        for values, new in zip(rays, mirrored, strict=True):
            values[some] = new
        normals, footprints = light.normals[some], footprints.copy()
        heights = np.einsum("nsc,nc->ns", footprints[some], normals)
        footprints[some] -= (2.0 * heights[..., None] * normals[:, None]).astype(np.float32)
        on = np.flatnonzero(~here)
        active, behind = active[on], hits.triangles[on]
        rays, footprints = rays.take(on), footprints[on]
    return ends
