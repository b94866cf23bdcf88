"""Triangle IDs of many cameras, drawn in one submission: each into a layer of a texture array."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from omnisim.gpu.gl_functions import clear_integers
from omnisim.gpu.ground_truth.visibility_pass import CameraPoses, VisibilityPass
from omnisim.gpu.layer_targets import layered_target
from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.scene.cluster_drawer import BucketProgram
from omnisim.gpu.scene.clustered_geometry import Bucket
from omnisim.gpu.scene.tile_renderer import TileRenderer
from omnisim.gpu.uniforms import uniform


class VisibilityLayers:
    """Culls and draws the clusters of many cameras together, then each one's items.

    Args:
        visibility: of one camera.
        count: most cameras.
        albedo: also draw plain base colours.

    Attributes:
        albedo: as given.
        ids: layers of triangle IDs, see `VisibilityPass`.
        albedos: layers of the square root of linear RGB, or None.
    """

    def __init__(self, visibility: VisibilityPass, count: int, albedo: bool):
        self._visibility, self.albedo = visibility, albedo
        context, plan = visibility.buffers.context, visibility.plan
        size = (plan.width_px, plan.height_px, count)
        self._programs: dict[int, moderngl.Program] = {}
        with gpu_allocation(f"ground truth of {count} pictures", "render fewer at once"):
            self.ids = context.texture_array(size, 1, dtype="u4")
            self.albedos = context.texture_array(size, 4) if albedo else None
            colors = [one for one in (self.ids, self.albedos) if one is not None]
            for texture in colors:
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._target, depth = layered_target(context, *colors)
            self._layers = (*colors, depth)
            self._tiles = TileRenderer(
                visibility.buffers, plan, visibility.cameras, np.empty(0, dtype=np.intp),
                self._find_program, depth, most_cameras=count,
            )  # fmt: skip

    def _find_program(self, bucket: Bucket) -> BucketProgram:
        found = self._visibility.bucket_program(self.albedo, bucket, layered=True)
        self._programs[found.program.glo] = found.program
        return found

    def draw(self, poses: Sequence[CameraPoses]) -> None:
        """Draw all from poses of the cameras' rigs and of the dynamic objects."""
        for program in self._programs.values():
            uniform(program, "u_cameras").value = len(poses)
            uniform(program, "u_tiles").value = len(self._visibility.plan.tiles)
        self._tiles.begin(self._target, (0.0, 0.0, 0.0, 0.0))
        clear_integers(0)
        self._tiles.draw_clusters(
            np.array([rig for rig, _ in poses]),
            np.array([objects for _, objects in poses]),
        )
        self._visibility.draw_items(poses, self._layers)
        self._tiles.end(self._target)
        self._visibility.end()
