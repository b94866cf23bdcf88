"""Optical flow of a camera between two poses, by exact reprojection; and what gets hidden."""

from __future__ import annotations

import math
from collections.abc import Collection
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
from omnisim.gpu.capture_pass import Emit
from omnisim.gpu.face_plan import plan_faces
from omnisim.gpu.pipeline import capture_rays
from omnisim.gpu.surface_pass import GivenRays, SurfacePass, Surfaces
from omnisim.gpu.visibility_pass import VisibilityPass
from omnisim.sensors.capturing import capture_of
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.stage import Stage

# Texels to a pixel along a side. A triangle is found where a texel near the ray shows it, or one
# beside it: measured in the warehouse, 0.1 % of the rays miss one at 1 texel a pixel, 0.05 % at
# 1.5, and most of those are at silhouettes, where things get hidden.
FINENESS = 1.5
VISIBLE, HIDDEN, OUTSIDE, NOTHING_SEEN = 0, 1, 2, 255
# What is nearer than the point by more than this share hides it. Ranges of the same point are equal
# to 1e-6; the rest is for rays that meet a triangle too small to show in any texel.
_NEARER = 1e-3


class View(NamedTuple):
    """Where everything is at one time.

    Attributes:
        world_from_rig: (4, 4) of the camera's rig.
        world_from_movers: (4, 4) each, in the order of the buffers' movers.
    """

    world_from_rig: NDArray[np.float64]
    world_from_movers: tuple[NDArray[np.float64], ...] = ()


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
    """

    def __init__(
        self,
        stage: Stage,
        sensor: OmniCamera,
        hidden: Collection[str] = (),
    ):
        context, buffers, camera = stage.context, stage.buffers, sensor.camera
        self._camera = camera
        size = (camera.width_px, camera.height_px)
        visibility = VisibilityPass(
            context,
            buffers,
            plan_faces(camera, camera.rig_from_optical, FINENESS),
            sensor.near_m,
            sensor.far_m,
            hidden,
        )
        self._rays = GivenRays(context, size)
        self._surfaces = SurfacePass(context, visibility, self._rays, size, np.eye(3))
        self._now_px = _exact_pixels(stage, sensor)
        self._mover_of_draw = np.array(
            [-1 if draw.mover is None else draw.mover for draw in buffers.draws]
        )
        self._period_px = _period_px(camera)

    def between(
        self, surfaces: Surfaces, now: View, after: View
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Flow (height, width, 2) in pixels, NaN where the lens cannot see the point next; and what
        becomes of the point: `VISIBLE`, `HIDDEN`, `OUTSIDE`, `NOTHING_SEEN`."""  # fmt: skip
        seen = surfaces.valid
        points_rig = self._points_after(surfaces, now, after)
        there = self._camera.pixel_from_ray(points_rig @ self._camera.rig_from_optical)
        motion = there.positions_px - self._now_px[seen]
        if self._period_px is not None:
            motion[:, 0] -= self._period_px * np.round(motion[:, 0] / self._period_px)
        motion[~there.valid] = np.nan
        flow = np.full((*seen.shape, 2), np.nan, dtype=np.float32)
        flow[seen] = motion
        fate = np.full(seen.shape, NOTHING_SEEN, dtype=np.uint8)
        fate[seen] = self._fate(surfaces, after, points_rig, there)
        return flow, fate

    def _points_after(self, surfaces: Surfaces, now: View, after: View) -> NDArray[np.float64]:
        """Points (n, 3) of the valid pixels in the next rig's frame; directions where nothing is
        hit."""  # fmt: skip
        viewpoint_m = now.world_from_rig[:3, 3]
        points_m = surfaces.points_m[surfaces.valid].astype(np.float64)
        draws = surfaces.draws[surfaces.valid]
        is_hit = draws >= 0
        if after.world_from_movers:
            mover = np.where(is_hit, self._mover_of_draw[draws], -1)
            for number in np.unique(mover[mover >= 0]):
                now_from_mover = now.world_from_movers[number]
                world_then = after.world_from_movers[number] @ np.linalg.inv(now_from_mover)
                on_it = mover == number
                moved_m = (points_m[on_it] + viewpoint_m) @ world_then[:3, :3].T
                points_m[on_it] = moved_m + (world_then[:3, 3] - viewpoint_m)
        step_m = viewpoint_m - after.world_from_rig[:3, 3]
        points_m += is_hit[:, None] * step_m
        return points_m @ after.world_from_rig[:3, :3]

    def _fate(
        self,
        surfaces: Surfaces,
        after: View,
        points_rig: NDArray[np.float64],
        there: Pixels,
    ) -> NDArray[np.uint8]:
        """What becomes of each point (n,), from the next viewpoint."""
        camera, valid = self._camera, surfaces.valid
        u, v = there.positions_px.T
        inside = there.valid & (u >= -0.5) & (u < camera.width_px - 0.5)
        inside &= (v >= -0.5) & (v < camera.height_px - 0.5)
        rays = np.zeros((*valid.shape, 4), dtype=np.float32)
        rays[valid, :3], rays[valid, 3] = points_rig, inside
        self._rays.write(rays)
        seen = self._surfaces.render(after.world_from_rig, after.world_from_movers)
        draws = surfaces.draws[valid]
        squared_m2 = np.where(draws < 0, np.inf, np.einsum("ni,ni->n", points_rig, points_rig))
        same = (seen.draws == surfaces.draws) & (seen.triangles == surfaces.triangles)
        nearer = seen.ranges_m[valid] < (1.0 - _NEARER) * np.sqrt(squared_m2)
        fate = np.where(inside, VISIBLE, OUTSIDE)
        fate[inside & nearer & ~same[valid]] = HIDDEN
        return fate


def _exact_pixels(stage: Stage, sensor: OmniCamera) -> NDArray[np.float64]:
    """Where the exact camera sees what each pixel sees (height, width, 2): at the pixel itself, but
    for a mirror's mesh."""  # fmt: skip
    camera = sensor.camera
    if sensor.polygons is None:
        return pixel_grid(camera.width_px, camera.height_px)
    capture = capture_of(stage, sensor, camera, Emit.RAY)
    rays, valid = capture_rays(stage.context, camera, capture)
    return camera.pixel_from_ray(np.where(valid[..., None], rays, [0.0, 0.0, -1.0])).positions_px


def _period_px(camera: CentralCamera) -> float | None:
    """Pixels after which a picture that goes all around begins again, or None: it does not."""
    if isinstance(camera, EquirectangularCamera):
        return float(camera.width_px)
    if isinstance(camera, CylindricalCamera):
        turn_px = 2.0 * math.pi * camera.focal_length_px
        return turn_px if camera.width_px >= turn_px - 1.0 else None
    return None
