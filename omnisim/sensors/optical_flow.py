"""Optical flow of a camera between two poses, by exact reprojection; and what gets hidden."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    CentralCamera,
    CylindricalCamera,
    EquirectangularCamera,
    Pixels,
    pixel_grid,
)
from omnisim.gpu.capture.ray_table import RayTable
from omnisim.gpu.ground_truth.occlusion_pass import OcclusionPass
from omnisim.gpu.ground_truth.ray_hit_pass import Surfaces
from omnisim.gpu.scene.scene_buffers import SceneBuffers

# Texels to a pixel along a side. A triangle is found where a texel near the ray shows it, or one
# beside it: measured in the warehouse, 0.1 % of the rays miss one at 1 texel a pixel, 0.05 % at
# 1.5, and most of those are at silhouettes, where things get hidden.
FINENESS = 1.5
# Points projected at a time: what is in between stays in the cache, and BLAS, which puts larger
# products on threads that then keep the cores from whatever comes next, on one.
BLOCK = 1 << 14
VISIBLE, HIDDEN, OUTSIDE, NOTHING_SEEN = 0, 1, 2, 255


class View(NamedTuple):
    """Where everything is at one time.

    Attributes:
        world_from_rig: (4, 4) of the camera's rig.
        world_from_objects: (4, 4) each, in the order of the buffers' dynamic objects.
    """

    world_from_rig: NDArray[np.float64]
    world_from_objects: tuple[NDArray[np.float64], ...] = ()


class OpticalFlow:
    """Flow of one camera; everything on the GPU is made once.

    The point that a pixel sees goes with the surface that it is on, also on what moves, and is
    projected from the next viewpoint in float64. Where nothing is hit, what is seen is infinitely
    far: only the camera's turn moves it.

    The point is hidden where the ray from the next viewpoint to it hits something nearer.

    Flow through a mirror's mesh is that of the exact model, from where the exact camera would see
    the pixel's point to where it would see it next: the mesh's own error, the same now and next but
    for a fraction, is not motion.

    Where a picture goes all around, flow across its seam takes the short way and leads outside of
    the picture by as much.

    Args:
        buffers: the scene and its dynamic objects.
        camera: whose picture.
        rays: of its pixels.
        is_mesh: whether the rays are those of a mirror's mesh.
        next_view: looks the points up from the next viewpoint.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        camera: CentralCamera,
        rays: RayTable,
        is_mesh: bool,
        next_view: OcclusionPass,
    ):
        self._camera, self._next_view = camera, next_view
        self._shape = rays.valid.shape
        self._seen = np.flatnonzero(rays.valid)
        # where the exact camera sees what each pixel sees: at the pixel itself, but for a mesh
        self._now_px = (
            camera.pixel_from_ray(rays.directions()).positions_px
            if is_mesh
            else pixel_grid(camera.width_px, camera.height_px)[rays.valid]
        )
        paths = [
            0 if draw.object_index is None else draw.object_index + 1 for draw in buffers.draw_items
        ]
        self._path_of_draw = np.array([0, *paths], dtype=np.intp)  # from the draw −1 on
        self._period_px = _period_px(camera)

    def start(self, now: View, after: View) -> None:
        """Start to look at the next view."""
        self._then_from_now = _ways(now, after)
        self._optical_from_world = (after.world_from_rig[:3, :3] @ self._camera.rig_from_optical).T
        self._next_view.render(after.world_from_rig, after.world_from_objects, self._then_from_now)

    def finish(self, surfaces: Surfaces) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Flow (height, width, 2) in pixels, NaN where the lens cannot see the point next; and what
        becomes of the point: `VISIBLE`, `HIDDEN`, `OUTSIDE`, `NOTHING_SEEN`.

        Args:
            surfaces: what is seen now, where it was started.
        """  # fmt: skip
        there = self._pixels_next(surfaces)
        motion = there.positions_px - self._now_px
        if self._period_px is not None:
            motion[:, 0] -= self._period_px * np.round(motion[:, 0] / self._period_px)
        motion[np.flatnonzero(~there.valid)] = np.nan
        flow = np.full((self._shape[0] * self._shape[1], 2), np.nan, dtype=np.float32)
        # both numbers of a pixel at once
        flow.view(np.uint64)[self._seen] = motion.astype(np.float32).view(np.uint64)
        fate = np.full(len(flow), NOTHING_SEEN, dtype=np.uint8)
        inside = self._inside(there)
        hidden = self._next_view.read().ravel()[self._seen]
        fate[self._seen] = np.where(inside, hidden * np.uint8(HIDDEN), np.uint8(OUTSIDE))
        return flow.reshape(*self._shape, 2), fate.reshape(self._shape)

    def _pixels_next(self, surfaces: Surfaces) -> Pixels:
        """Where the points (n,) of the valid pixels are in the next picture."""
        points_m = np.take(surfaces.hits.reshape(-1, 4), self._seen, axis=0).astype(np.float64)
        draws_plus_one = surfaces.draws_plus_one.ravel()[self._seen]
        points_m[:, 3] = draws_plus_one > 0  # 0: a direction, which no step moves
        ways = self._optical_from_world @ self._then_from_now[:, :3]
        paths = self._path_of_draw[draws_plus_one] if len(ways) > 1 else None
        positions_px, valid = np.empty((len(points_m), 2)), np.empty(len(points_m), dtype=np.bool_)
        for first in range(0, len(points_m), BLOCK):
            block = slice(first, first + BLOCK)
            optical_m = points_m[block] @ ways[0].T
            if paths is not None:
                for path in np.unique(paths[block]):
                    on_it = np.flatnonzero(paths[block] == path)
                    optical_m[on_it] = points_m[block][on_it] @ ways[path].T
            positions_px[block], valid[block] = self._camera.pixel_from_ray(optical_m)
        return Pixels(positions_px, valid)

    def _inside(self, there: Pixels) -> NDArray[np.bool_]:
        """Which points (n,) are in the next picture."""
        u, v = there.positions_px.T
        inside = there.valid & (u >= -0.5) & (u < self._camera.width_px - 0.5)
        return inside & (v >= -0.5) & (v < self._camera.height_px - 0.5)


def _ways(now: View, after: View) -> NDArray[np.float64]:
    """From now's viewpoint to the next one (1 + objects, 4, 4), in the axes of the world: how what
    stands goes, and what is on each dynamic object."""  # fmt: skip
    viewpoint_m, next_m = now.world_from_rig[:3, 3], after.world_from_rig[:3, 3]
    ways = np.tile(np.eye(4), (1 + len(now.world_from_objects), 1, 1))
    for number, (before, then) in enumerate(
        zip(now.world_from_objects, after.world_from_objects, strict=True), start=1
    ):
        moved = then @ np.linalg.inv(before)
        ways[number, :3, :3] = moved[:3, :3]
        # what is at the viewpoint now, less that viewpoint
        ways[number, :3, 3] = moved[:3, :3] @ viewpoint_m + (moved[:3, 3] - viewpoint_m)
    ways[:, :3, 3] += viewpoint_m - next_m
    return ways


def _period_px(camera: CentralCamera) -> float | None:
    """Pixels after which a picture that goes all around begins again, or None: it does not."""
    if isinstance(camera, EquirectangularCamera):
        return float(camera.width_px)
    if isinstance(camera, CylindricalCamera):
        turn_px = 2.0 * math.pi * camera.focal_length_px
        return turn_px if camera.width_px >= turn_px - 1.0 else None
    return None
