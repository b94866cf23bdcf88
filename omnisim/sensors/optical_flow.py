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
from omnisim.gpu.face_plan import plan_faces
from omnisim.gpu.scene_buffers import SceneBuffers
from omnisim.gpu.surface_pass import GivenRays, SurfacePass, Surfaces
from omnisim.gpu.visibility_pass import VisibilityPass
from omnisim.sensors.omnicamera import OmniCamera

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
        buffers: SceneBuffers,
        sensor: OmniCamera,
        hidden: Collection[str] = (),
    ):
        self._sensor, context = sensor, buffers.context
        camera = sensor.camera
        size = (camera.width_px, camera.height_px)
        visibility = VisibilityPass(
            context,
            buffers,
            plan_faces(camera, camera.rig_from_optical),
            sensor.near_m,
            sensor.far_m,
            hidden,
        )
        self._rays = GivenRays(context, size)
        self._surfaces = SurfacePass(context, visibility, self._rays, size, np.eye(3))
        self._pixels = pixel_grid(*size)
        self._mover_of_draw = np.array(
            [-1 if draw.mover is None else draw.mover for draw in buffers.draws]
        )
        self._period_px = _period_px(camera)

    def between(
        self, surfaces: Surfaces, now: View, after: View
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Flow (height, width, 2) in pixels, NaN where the lens cannot see the point next; and what
        becomes of the point: `VISIBLE`, `HIDDEN`, `OUTSIDE`, `NOTHING_SEEN`."""  # fmt: skip
        camera = self._sensor.camera
        points_rig = self._points_after(surfaces, now, after)
        there = camera.pixel_from_ray(points_rig @ camera.rig_from_optical)
        flow = there.positions_px - self._pixels_now(surfaces, now)
        if self._period_px is not None:
            flow[..., 0] -= self._period_px * np.round(flow[..., 0] / self._period_px)
        flow[~(there.valid & surfaces.valid)] = np.nan
        return flow.astype(np.float32), self._fate(surfaces, after, points_rig, there)

    def _points_after(self, surfaces: Surfaces, now: View, after: View) -> NDArray[np.float64]:
        """Points (height, width, 3) in the next rig's frame; directions where nothing is hit."""
        points_m = surfaces.points_m.astype(np.float64)
        is_hit = surfaces.draws >= 0
        moved_m = now.world_from_rig[:3, 3] - after.world_from_rig[:3, 3]
        movers = np.where(is_hit, self._mover_of_draw[surfaces.draws], -1)
        for mover in np.unique(movers[movers >= 0]):
            world_then = after.world_from_movers[mover] @ np.linalg.inv(
                now.world_from_movers[mover]
            )
            on_it = movers == mover
            world_m = points_m[on_it] + now.world_from_rig[:3, 3]
            points_m[on_it] = world_m @ world_then[:3, :3].T + (
                world_then[:3, 3] - now.world_from_rig[:3, 3]
            )
        points_m[is_hit] += moved_m
        return points_m @ after.world_from_rig[:3, :3]

    def _pixels_now(self, surfaces: Surfaces, now: View) -> NDArray[np.float64]:
        """Where the exact camera sees the points: at their pixels, but for a mirror's mesh."""
        if self._sensor.polygons is None:
            return self._pixels
        camera = self._sensor.camera
        optical_from_here = (now.world_from_rig[:3, :3] @ camera.rig_from_optical).T
        return camera.pixel_from_ray(surfaces.points_m @ optical_from_here.T).positions_px

    def _fate(
        self,
        surfaces: Surfaces,
        after: View,
        points_rig: NDArray[np.float64],
        there: Pixels,
    ) -> NDArray[np.uint8]:
        """What becomes of each point (height, width), from the next viewpoint."""
        camera = self._sensor.camera
        size_px = np.array([camera.width_px, camera.height_px])
        inside = np.all(
            (there.positions_px >= -0.5) & (there.positions_px < size_px - 0.5), axis=-1
        )
        given = surfaces.valid & there.valid & inside
        self._rays.write(points_rig, given)
        seen = self._surfaces.render(after.world_from_rig, after.world_from_movers)
        distances_m = np.where(
            surfaces.draws < 0, np.inf, np.sqrt(np.einsum("...i,...i", points_rig, points_rig))
        )
        same = (seen.draws == surfaces.draws) & (seen.triangles == surfaces.triangles)
        hidden = given & ~same & (seen.ranges_m < (1.0 - _NEARER) * distances_m)
        fate = np.full(given.shape, NOTHING_SEEN, dtype=np.uint8)
        fate[surfaces.valid] = OUTSIDE
        fate[given] = VISIBLE
        fate[hidden] = HIDDEN
        return fate


def _period_px(camera: CentralCamera) -> float | None:
    """Pixels after which a picture that goes all around begins again, or None: it does not."""
    if isinstance(camera, EquirectangularCamera):
        return float(camera.width_px)
    if isinstance(camera, CylindricalCamera):
        turn_px = 2.0 * math.pi * camera.focal_length_px
        return turn_px if camera.width_px >= turn_px - 1.0 else None
    return None
