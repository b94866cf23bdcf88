"""Pixel counts of instances as if nothing occluded them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.caster import Rays
from omnisim.rendering.rays.depth_limits import DepthLimits
from omnisim.rendering.rays.embree import NO_TRIANGLE
from omnisim.rendering.rays.pixel_rays import PixelRays
from omnisim.rendering.rays.ray_scene import MAX_LAYERS, ObjectState, RayScene


def whole_areas_px(
    scene: RayScene,
    pixels: PixelRays,
    limits: DepthLimits,
    world_from_rig: NDArray[np.float64],
    objects: ObjectState,
    instance_of_surface: NDArray[np.integer],
    instances: NDArray[np.integer],
) -> NDArray[np.int64]:
    """Number of pixels (n,) whose rays pass through each instance, by ID; 0 is no instance.

    Rays continue through all surfaces, up to the extent of the scene. Surfaces count as in
    `RayScene.first_hits`. A pixel that shows an instance always counts for it.

    Args:
        scene: scene to cast at.
        pixels: pixel rays of the camera.
        limits: depth limits of the rays.
        world_from_rig: (4, 4) pose of the camera's rig.
        objects: state of the dynamic objects.
        instance_of_surface: (surfaces,) ID of each surface of the geometry.
        instances: (height, width) ID shown in each pixel, the channel `instance`.
    """
    count = 1 + int(max(instance_of_surface.max(initial=0), instances.max(initial=0)))
    camera = pixels.camera
    world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical

    def of_band(number: int) -> NDArray[np.int64]:
        band = pixels.band(number)
        rays = band.aim(limits, camera.rig_from_optical, world_from_rig)
        layers = _surfaces_along(scene, rays, band.world_footprints(world_from_optical), objects)
        # one number per pair of pixel and instance
        pairs = [row * count + instance_of_surface[surface] for row, surface in layers]
        shown = instances[band.rows][band.valid]
        pairs.append(np.arange(len(shown)) * count + shown)
        return np.bincount(np.unique(np.concatenate(pairs)) % count, minlength=count)

    of_bands = scene.in_threads(of_band, range(len(pixels.bands)))
    areas: NDArray[np.int64] = np.stack(of_bands).sum(axis=0)
    areas[0] = 0
    return areas


def _surfaces_along(
    scene: RayScene, rays: Rays, footprints: NDArray[np.float32], objects: ObjectState
) -> list[tuple[NDArray[np.intp], NDArray[np.integer]]]:
    """Rays and the surfaces they meet, layer by layer, nearest first."""
    layers: list[tuple[NDArray[np.intp], NDArray[np.integer]]] = []
    active, behind = np.arange(len(rays.near_m)), None
    for _ in range(MAX_LAYERS):
        hits = scene.first_hits(rays, objects, behind, footprints[active])
        kept = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        if len(kept) == 0:
            break
        active, rays, hits = active[kept], rays.take(kept), hits.take(kept)
        layers.append((active, scene.shading.surfaces(hits)))
        behind = hits.triangles
        rays = scene.caster.behind(rays, hits.ranges_m)
    return layers
