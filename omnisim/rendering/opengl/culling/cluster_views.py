"""Views of cameras: tiles of an atlas each, and objects in their frames; the input of culling.

Per frame the CPU writes the poses of the cameras and objects. From these the GPU makes a matrix for
each object in each view. A view is one tile of one camera, counted camera by camera. Object 0 is
the static geometry, counted from its anchor; the dynamic ones follow.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.uniforms import columns_first


class Views:
    """Poses of cameras that share a plan of tiles, and of the objects, on the GPU.

    Args:
        context: where.
        clips_from_rig: (tiles, 4, 4) of each camera's tiles, see `tile_views.clips_from_rig`.
        rectangles_px: (tiles, 4) left, top, width and height of each in the atlas.
        anchor_m: (3,) origin of the static geometry, world.
        objects: number of objects, the static one included.
        cameras: most that there can be.

    Attributes:
        cameras: number of the last poses.
        tiles, objects: their numbers; tiles are of one camera.
        poses: buffer, float32 (cameras, 1 + objects, 3, 4): rows of rig_from_viewpoint, then of
            viewpoint_from_object of each object.
        clips_from_rig: buffer, (tiles, 4, 4), columns first.
        rectangles_px: buffer, (views, 4): left, top, width and height in the atlas.
    """

    def __init__(
        self,
        context: moderngl.Context,
        clips_from_rig: NDArray[np.float64],
        rectangles_px: NDArray[np.float64],
        anchor_m: NDArray[np.float64],
        objects: int,
        cameras: int = 1,
    ):
        self.cameras, self.tiles, self.objects = cameras, len(clips_from_rig), objects
        self._anchor_m = anchor_m
        self._poses = np.zeros((self.cameras, 1 + objects, 3, 4), dtype=np.float32)
        self._poses[:, 1, :, :3] = np.eye(3)
        self.poses = context.buffer(self._poses)
        self.clips_from_rig = context.buffer(columns_first(clips_from_rig))
        self.rectangles_px = context.buffer(np.tile(rectangles_px, (cameras, 1)).astype(np.float32))

    @property
    def count(self) -> int:
        """Number of views."""
        return self.cameras * self.tiles

    def write(
        self,
        worlds_from_rigs: NDArray[np.float64],
        worlds_from_objects: NDArray[np.float64] | Sequence[NDArray[np.float64]] = (),
    ) -> None:
        """Write the poses of one frame.

        Args:
            worlds_from_rigs: (cameras, 4, 4), at most as many as there can be; or (4, 4) of one.
            worlds_from_objects: (cameras, dynamic objects, 4, 4), or (dynamic objects, 4, 4) for
                all cameras.
        """
        rigs = worlds_from_rigs.reshape(-1, 4, 4)
        self.cameras = len(rigs)
        poses = self._poses[: self.cameras]
        viewpoints_m = rigs[:, :3, 3]
        poses[:, 0, :, :3] = rigs[:, :3, :3].transpose(0, 2, 1)
        # in float64: far from the origin counts too
        poses[:, 1, :, 3] = self._anchor_m - viewpoints_m
        if self.objects > 1:
            objects = np.asarray(worlds_from_objects)[..., :3, :]
            poses[:, 2:, :, :3] = objects[..., :3]
            poses[:, 2:, :, 3] = objects[..., 3] - viewpoints_m[:, None]
        self.poses.write(poses)
