"""Views of cameras for culling: one per atlas tile, with the objects in their frames.

Per frame the CPU writes the poses of cameras and objects; the GPU computes a matrix per object and
view. A view is one tile of one camera, numbered camera by camera. Object 0 is the static geometry,
relative to its anchor; the dynamic objects follow.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.uniforms import columns_first


class Views:
    """Poses on the GPU: cameras that share a tile plan, and the objects.

    Args:
        context: OpenGL context.
        clips_from_rig: (tiles, 4, 4) per tile of a camera, see `tile_views.clips_from_rig`.
        rectangles_px: (tiles, 4) left, top, width and height of each tile in the atlas.
        anchor_m: (3,) origin of the static geometry, world.
        objects: number of objects, static geometry included.
        cameras: maximum number of cameras.

    Attributes:
        cameras: number of cameras in the current poses.
        tiles, objects: number of tiles per camera, and of objects.
        poses: buffer, float32 (cameras, 1 + objects, 3, 4): rows of rig_from_viewpoint, then of
            viewpoint_from_object per object.
        clips_from_rig: buffer, (tiles, 4, 4), column-major.
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
        self.poses = written_buffer(context, self._poses)
        self.clips_from_rig = written_buffer(context, columns_first(clips_from_rig))
        rectangles = np.tile(rectangles_px, (cameras, 1)).astype(np.float32)
        self.rectangles_px = written_buffer(context, rectangles)

    def use_tiles(
        self, clips_from_rig: NDArray[np.float64], rectangles_px: NDArray[np.float64]
    ) -> None:
        """Replace the tiles of a single camera by others, at most as many as at first."""
        self.tiles = len(clips_from_rig)
        self.clips_from_rig.write(columns_first(clips_from_rig))
        self.rectangles_px.write(rectangles_px.astype(np.float32))

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
            worlds_from_rigs: (cameras, 4, 4), or (4, 4) of one camera.
            worlds_from_objects: (cameras, dynamic objects, 4, 4), or (dynamic objects, 4, 4) for
                all cameras.
        """
        rigs = worlds_from_rigs.reshape(-1, 4, 4)
        self.cameras = len(rigs)
        poses = self._poses[: self.cameras]
        viewpoints_m = rigs[:, :3, 3]
        poses[:, 0, :, :3] = rigs[:, :3, :3].transpose(0, 2, 1)
        # in float64, which keeps precision far from the origin
        poses[:, 1, :, 3] = self._anchor_m - viewpoints_m
        if self.objects > 1:
            objects = np.asarray(worlds_from_objects)[..., :3, :]
            poses[:, 2:, :, :3] = objects[..., :3]
            poses[:, 2:, :, 3] = objects[..., 3] - viewpoints_m[:, None]
        self.poses.write(poses)
