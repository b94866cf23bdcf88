"""Triangle IDs of many cameras rendered in one submission, one texture array layer each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnisim.ground_truth.hits import HitDetails
from omnisim.rendering.opengl.drawing.cluster_drawer import BucketProgram
from omnisim.rendering.opengl.drawing.tile_renderer import TileRenderer
from omnisim.rendering.opengl.geometry.clustered_geometry import Bucket
from omnisim.rendering.opengl.gl.framebuffers import layered_target
from omnisim.rendering.opengl.gl.gpu_textures import texture_array
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.ground_truth.visibility_pass import CameraPoses, VisibilityPass
from omnisim.rendering.opengl.ground_truth.visibility_program import atlas_formats, clear_colors


class VisibilityLayers:
    """Draws the clusters of many cameras together, then each camera's single items.

    Args:
        visibility: pass of one camera.
        count: maximum number of cameras.
        details: details to draw as well, if textures change them.

    Attributes:
        ids: texture array of triangle IDs, see `VisibilityPass`.
        details: texture arrays of its atlases by sampler name.
    """

    def __init__(self, visibility: VisibilityPass, count: int, details: HitDetails):
        self._visibility, self._wanted = visibility, details.of_texels
        self._state = GlState()
        context, plan = visibility.buffers.context, visibility.plan
        size = (plan.width_px, plan.height_px, count)
        visibility.drawers(self._wanted)  # creates the items' drawers before anything is drawn
        with gpu_allocation(f"ground truth of {count} images", "render fewer at once"):
            self.ids = texture_array(context, size, 1, dtype="u4")
            self.details = {
                name: texture_array(context, size, components, dtype=dtype)
                for name, (components, dtype) in atlas_formats(details).items()
            }
            colors = [self.ids, *self.details.values()]
            self._target, depth = layered_target(context, *colors)
            self._layers = (*colors, depth)
            self._tiles = TileRenderer(
                visibility.buffers, plan, visibility.cameras, np.empty(0, dtype=np.intp),
                self._find_program, depth, max_cameras=count,
            )  # fmt: skip

    def _find_program(self, bucket: Bucket) -> BucketProgram:
        return self._visibility.bucket_program(self._wanted, bucket, layered=True)

    def draw(self, poses: Sequence[CameraPoses]) -> None:
        """Draw from poses of the rigs and of the dynamic objects."""
        self._visibility.bind_materials(self._wanted)
        self._tiles.begin(self._target, clear_colors(self._wanted))
        with self._state.drawing():
            self._tiles.draw_clusters(
                self._target,
                np.array([rig for rig, _ in poses]),
                np.array([objects for _, objects in poses]),
            )
            self._visibility.draw_items(poses, self._layers, self._wanted)
        self._visibility.end()
