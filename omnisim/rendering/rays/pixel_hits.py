"""Hits of a camera's pixel rays by ray casting, and occlusion from another viewpoint."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.ground_truth.hits import HitDetails, Hits
from omnisim.rendering.rays.cast_hits import (
    CastHits,
    SeenPoints,
    cast_hits,
    cast_occlusion,
    moved_points,
    starts_of_rays,
)
from omnisim.rendering.rays.depth_limits import DepthLimits
from omnisim.rendering.rays.pixel_rays import PixelRays
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene

_POINTS_PER_BATCH = 1 << 14

T = TypeVar("T", bound=np.generic)


class PixelHits:
    """Hits of the rays of all pixels; constant data is computed once.

    Args:
        scene: scene to cast at.
        pixels: pixel rays of the camera.
        limits: depth limits of the rays.

    Attributes:
        has_ray: (height, width) mask of pixels with a ray.
    """

    def __init__(self, scene: RayScene, pixels: PixelRays, limits: DepthLimits):
        self._scene, self._pixels, self._limits = scene, pixels, limits
        self._bands = range(len(pixels.bands))
        self.has_ray = np.concatenate([pixels.band(number).valid for number in self._bands])
        # last hits of the pixels that have a ray
        self._points_m = np.empty((0, 3))  # viewpoint frame; directions where nothing is hit
        self._draws_plus_one = np.empty(0, dtype=np.uint32)
        self._triangles = np.empty(0, dtype=np.int32)

    def rays(self) -> NDArray[np.float64]:
        """Unit rays (height, width, 3), optical frame."""
        return self._placed([self._pixels.band(number).directions for number in self._bands], 0.0)

    def cast(
        self,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        details: HitDetails,
    ) -> Hits:
        """Cast all rays from a pose (4, 4)."""

        def of_band(number: int) -> CastHits:
            return self._cast_band(number, world_from_rig, objects, details)

        bands = self._scene.in_threads(of_band, self._bands)
        hits = [band.hits for band in bands]
        self._triangles = np.concatenate([band.triangles for band in bands])
        self._draws_plus_one = np.concatenate([one.draw_ids for one in hits])
        self._points_m = np.concatenate([one.points_m for one in hits]).astype(np.float64)
        none = np.empty((0, self.has_ray.shape[1], 3), dtype=np.float32)
        arrays = dict.fromkeys(details._fields, none)
        for name in details.components:
            arrays[name] = self._placed([getattr(one, name) for one in hits], 0.0)
        return Hits(
            self._placed([one.points_and_ranges_m for one in hits], (0.0, 0.0, 0.0, np.inf)),
            self._placed([one.draw_ids for one in hits], 0),
            self._placed([one.triangles for one in hits], 0),
            **arrays,
        )

    def put_points(self, hits: Hits) -> None:
        """Replace the points of the last hits, from which occlusion is computed."""
        self._points_m = hits.points_m[self.has_ray].astype(np.float64)

    def occluded(
        self,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        other_from_current: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Mask (height, width) of the last hits' points that are occluded from another pose.

        Args:
            world_from_rig: (4, 4) the other pose.
            objects: state of the dynamic objects at the other time.
            other_from_current: (surfaces, 3, 4), moves points on each surface from the viewpoint
                frame of the last hits to the other one.
        """

        def of_batch(first: int) -> NDArray[np.bool_]:
            batch = slice(first, first + _POINTS_PER_BATCH)
            return self._occluded(batch, world_from_rig, objects, other_from_current)

        firsts = range(0, len(self._triangles), _POINTS_PER_BATCH)
        none = np.empty(0, dtype=np.bool_)
        return self._placed([none, *self._scene.in_threads(of_batch, firsts)], False)

    def _cast_band(
        self,
        number: int,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        details: HitDetails,
    ) -> CastHits:
        band, camera = self._pixels.band(number), self._pixels.camera
        world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
        return cast_hits(
            self._scene,
            band.aim(self._limits, camera.rig_from_optical, world_from_rig),
            band.world_footprints(world_from_optical),
            world_from_rig[:3, 3],
            objects,
            details,
        )

    def _occluded(
        self,
        batch: slice,
        world_from_rig: NDArray[np.float64],
        objects: ObjectState,
        other_from_current: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        seen = SeenPoints(
            self._points_m[batch], self._draws_plus_one[batch], self._triangles[batch]
        )
        moved = seen._replace(points_m=moved_points(seen, other_from_current))
        starts_m = starts_of_rays(
            self._pixels.camera, moved.points_m, moved.surfaces_plus_one > 0, world_from_rig
        )
        return cast_occlusion(self._scene, self._limits, moved, starts_m, world_from_rig, objects)

    def _placed(self, parts: list[NDArray[T]], otherwise: object) -> NDArray[T]:
        """Image (height, width, …) from values (n, …) of the pixels that have a ray."""
        values = np.concatenate(parts)
        image = np.empty((*self.has_ray.shape, *values.shape[1:]), dtype=values.dtype)
        image[:] = otherwise
        image[self.has_ray] = values
        return image
