"""Optical flow from a camera's image to another one, by exact reprojection, and occlusion.

The other image is the next one; for backward flow, the previous one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    CentralCamera,
    NonCentralCamera,
    Pixels,
    period_px,
    pixel_grid,
    pixels_of_points,
)
from omnisim.ground_truth.hits import Hits
from omnisim.rendering.contract import HitSource, ScenePoses
from omnisim.rendering.truth.deformed_points import deformed_hits
from omnisim.rendering.truth.scene_flow import (
    POINTS_PER_BATCH,
    other_from_current,
    transform_points,
)

VISIBLE, OCCLUDED, OUTSIDE, INVALID = 0, 1, 2, 255


class OpticalFlow:
    """Optical flow of one camera; constant data is computed once.

    The point seen by a pixel moves with its surface, also on dynamic objects and deforming meshes.
    It is projected from the other viewpoint in float64. Without a hit the point is infinitely far:
    only the camera's rotation moves it.

    The point is occluded if the ray from the other viewpoint to it hits something nearer. An
    optical system projects it by its exact inverse; that ray starts at the system's ray origin.

    Flow through a mirror mesh follows the exact model, from the pixel where the exact camera sees
    the point to the pixel where it sees it at the other time. The error of the mesh is nearly the
    same in both images, and is not motion.

    In an image that covers all directions, flow across the seam takes the short way and leaves the
    image by that distance.

    Args:
        source: source of the hits.
    """

    def __init__(self, source: HitSource):
        self._camera, self._source = source.camera, source
        self._shape = source.has_ray.shape
        self._valid = np.flatnonzero(source.has_ray)
        # pixels where the exact camera sees the points: the pixels themselves, except with a mesh
        self._by_points = source.polygons is not None and isinstance(self._camera, NonCentralCamera)
        self._positions_px = (
            pixel_grid(*self._shape[::-1])[source.has_ray]
            if source.polygons is None or self._by_points
            else self._camera.pixel_from_ray(source.rays()[source.has_ray]).positions_px
        )
        self.refresh()
        self._period_px = period_px(self._camera)

    def refresh(self) -> None:
        """Update the draw items from the source."""
        self._object_of_draw = self._source.objects_of_draws()

    def begin(self, hits: Hits, current: ScenePoses, other: ScenePoses) -> NDArray[np.float64]:
        """Start to render the occlusion of the latest hits; return the argument of `end`.

        Returns:
            (1 + objects, 3, 4), from the current viewpoint frame to the other optical frame: for
            static points, and for points on each dynamic object.
        """
        transforms = other_from_current(current, other)
        self._deformed = deformed_hits(self._source, hits, current, other)
        moves = transforms[self._object_of_draw[1:], :3]
        self._occluded = self._source.begin_occlusion(other, moves, self._deformed)
        self._optical_from_current = _optical_from_world(current, self._camera)
        return _optical_from_world(other, self._camera) @ transforms[:, :3]

    def end(
        self, hits: Hits, other_optical_from_current: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Compute the flow.

        Args:
            hits: hits from the current viewpoint.
            other_optical_from_current: result of `begin`.

        Returns:
            Flow (height, width, 2) in pixels, NaN where the lens cannot see the point at the other
            time; and (height, width) of `VISIBLE`, `OCCLUDED`, `OUTSIDE`, `INVALID`: the pixel has
            no ray.
        """
        projected = self._pixels_of(self._deformed or hits, other_optical_from_current)
        positions_px = self._positions_px
        if self._by_points:
            still = np.zeros_like(other_optical_from_current)
            still[:, :, :3] = self._optical_from_current
            positions_px = self._pixels_of(hits, still).positions_px
        motion_px = projected.positions_px - positions_px
        if self._period_px is not None:
            motion_px[:, 0] -= self._period_px * np.round(motion_px[:, 0] / self._period_px)
        motion_px[np.flatnonzero(~projected.valid)] = np.nan
        flow = np.full((self._shape[0] * self._shape[1], 2), np.nan, dtype=np.float32)
        # both components of a pixel at once
        flow.view(np.uint64)[self._valid] = motion_px.astype(np.float32).view(np.uint64)
        status = np.full(len(flow), INVALID, dtype=np.uint8)
        occluded = self._occluded.result().ravel()[self._valid]
        status[self._valid] = np.where(
            self._is_inside(projected), occluded * np.uint8(OCCLUDED), np.uint8(OUTSIDE)
        )
        return flow.reshape(*self._shape, 2), status.reshape(self._shape)

    def _pixels_of(self, hits: Hits, optical_from_current: NDArray[np.float64]) -> Pixels:
        """Project the points (n,) of the valid pixels into an image."""
        points_m = np.take(hits.points_and_ranges_m.reshape(-1, 4), self._valid, axis=0).astype(
            np.float64
        )
        draw_ids = hits.draw_ids.ravel()[self._valid]
        points_m[:, 3] = draw_ids > 0  # 0: a direction, unaffected by translation
        has_objects = len(optical_from_current) > 1
        objects = self._object_of_draw[draw_ids] if has_objects else None
        positions_px, valid = np.empty((len(points_m), 2)), np.empty(len(points_m), dtype=np.bool_)
        for first in range(0, len(points_m), POINTS_PER_BATCH):
            batch = slice(first, first + POINTS_PER_BATCH)
            optical_m = transform_points(
                points_m[batch],
                None if objects is None else objects[batch],
                optical_from_current,
            )
            positions_px[batch], valid[batch] = pixels_of_points(
                self._camera, optical_m, points_m[batch, 3] > 0.0
            )
        return Pixels(positions_px, valid)

    def _is_inside(self, pixels: Pixels) -> NDArray[np.bool_]:
        """Mask (n,) of positions in the image."""
        u, v = pixels.positions_px.T
        camera = self._camera
        inside: NDArray[np.bool_] = pixels.valid & (u >= -0.5) & (u < camera.width_px - 0.5)
        inside &= (v >= -0.5) & (v < camera.height_px - 0.5)
        return inside


def _optical_from_world(poses: ScenePoses, camera: CentralCamera) -> NDArray[np.float64]:
    """Rotation (3, 3) from the world to the optical frame of a camera."""
    return (poses.world_from_rig[:3, :3] @ camera.rig_from_optical).T
