"""Visibility pass: triangle IDs in place of colours."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.gl_functions import clear_integers
from omnisim.gpu.ground_truth.triangle_ids import TriangleIds
from omnisim.gpu.ground_truth.visibility_program import VisibilityProgram, VisibilityVariant
from omnisim.gpu.layer_targets import COLORS, DEPTH, attach_layer, attach_texture
from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.scene.cluster_drawer import BucketProgram
from omnisim.gpu.scene.clustered_geometry import Bucket
from omnisim.gpu.scene.reversed_depth import depth_texture
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.scene_drawer import SceneDrawer
from omnisim.gpu.scene.tile_renderer import TileRenderer, VirtualCameras

# Pose (4, 4) of a camera's rig, and those of the dynamic objects.
CameraPoses = tuple[NDArray[np.float64], Sequence[NDArray[np.float64]]]


class VisibilityPass:
    """Draws the tiles into an atlas of integers; everything on the GPU is made once.

    Sides, frusta and holes are those of the picture (`CubePass`), as is the draw loop. A blended
    surface counts where its alpha reaches `BLENDED_CUTOFF`.

    Args:
        buffers: the scene and its dynamic objects; other passes may draw from them, too.
        plan: the tiles.
        cameras: their depth range and sides, and the hidden instances count.
        albedo: also be able to draw plain base colours.

    Attributes:
        buffers, plan, cameras, near_m, far_m, both_sides: as given.
        id_atlas: texture of integers: 1 + ID of the triangle; 0: nothing is seen.
        triangle_ids: table of the IDs.
        albedo_atlas: texture of the square root of linear RGB, or None.

    Raises:
        GraphicsError: the atlas does not fit on the GPU.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        plan: TilePlan,
        cameras: VirtualCameras,
        albedo: bool = False,
    ):
        context = buffers.context
        self.buffers, self.plan = buffers, plan
        self.near_m, self.far_m = cameras.near_m, cameras.far_m
        self.both_sides = cameras.both_sides
        size = (plan.width_px, plan.height_px)
        with gpu_allocation(
            f"ground truth by an atlas of {size[0]} × {size[1]} px", "make the picture smaller"
        ):
            self.id_atlas = context.texture(size, 1, dtype="u4")
            self.albedo_atlas = context.texture(size, 4) if albedo else None
            self._depth = depth = depth_texture(context, size)
            self._targets = {False: context.framebuffer([self.id_atlas], depth)}
            if self.albedo_atlas is not None:
                atlases = [self.id_atlas, self.albedo_atlas]
                self._targets[True] = context.framebuffer(atlases, depth)
        for texture in (self.id_atlas, self.albedo_atlas):
            if texture is not None:
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.cameras = cameras
        self._compiled: dict[VisibilityVariant, VisibilityProgram] = {}
        self.triangle_ids = TriangleIds(buffers, self._one_by_one())
        self._draw_by_ids()

    def refresh(self) -> None:
        """Draw what the buffers have now."""
        self.triangle_ids.refresh(self._one_by_one())
        self._draw_by_ids()

    def _draw_by_ids(self) -> None:
        items = self._one_by_one()
        self._drawn = {
            colored: (self._make_drawer(colored, items), self._make_tiles(colored, items))
            for colored in self._targets
        }

    def _one_by_one(self) -> NDArray[np.intp]:
        """Draw items that are not drawn by clusters."""
        items, cameras = self.buffers.draw_items, self.cameras
        shown = self.buffers.shown_one_by_one(cameras.hidden)
        # a material may be so clear that no texel can show it: textures only take away
        alphas = np.array([one.material.base_color[3] for one in items])
        shown &= alphas >= np.array([one.material.hit_cutoff for one in items])
        return np.flatnonzero(shown)

    def _make_drawer(
        self, colored: bool, items: NDArray[np.intp]
    ) -> SceneDrawer[VisibilityProgram]:
        """Drawer of IDs, with base colours or without."""
        return SceneDrawer(
            self.buffers,
            self.buffers.triangles.indices,
            items,
            lambda item: self._program(VisibilityVariant(item.material.hit_cutoff > 0.0, colored)),
            self.triangle_ids.first_of_item,
            self.cameras.both_sides,
        )

    def read_depth(self) -> NDArray[np.float32]:
        """Depth (height, width) of the atlas as last drawn."""
        depth = np.empty((self.plan.height_px, self.plan.width_px), dtype=np.float32)
        self._targets[False].read_into(depth, components=1, attachment=-1, dtype="f4")
        return depth

    def _make_tiles(self, colored: bool, items: NDArray[np.intp]) -> TileRenderer:
        """Renderer of the clusters' IDs, with base colours or without."""
        find_program = partial(self.bucket_program, colored)
        return TileRenderer(self.buffers, self.plan, self.cameras, items, find_program, self._depth)

    def draw_items(
        self, poses: Sequence[CameraPoses], layers: Sequence[moderngl.TextureArray]
    ) -> None:
        """Draw the items that are no clusters' into layers of IDs, perhaps albedo, and depth."""
        colored = len(layers) > 2
        target, (drawer, tiles) = self._targets[colored], self._drawn[colored]
        if not tiles.has_items:
            return
        own = (
            [self.id_atlas, self.albedo_atlas, self._depth]
            if colored
            else [self.id_atlas, self._depth]
        )
        attachments = [*range(COLORS, COLORS + len(layers) - 1), DEPTH]
        target.use()
        try:
            for number, one in enumerate(poses):
                for attachment, layer in zip(attachments, layers, strict=True):
                    attach_layer(target.glo, layer.glo, number, attachment)
                tiles.draw_one_by_one(target, *one, drawer)
        finally:
            for attachment, texture in zip(attachments, own, strict=True):
                if texture is not None:
                    attach_texture(target.glo, texture.glo, attachment)

    @property
    def command_bytes(self) -> int:
        """Memory of the draw commands."""
        return self._drawn[False][1].command_bytes

    def bucket_program(self, colored: bool, bucket: Bucket, layered: bool = False) -> BucketProgram:
        """Program of a bucket's IDs, with base colours or without."""
        variant = VisibilityVariant(bucket.cutoff, colored, bucket.array is not None, True, layered)
        found = self._program(variant)
        found.first_plus_one.value = self.triangle_ids.first_of_clusters + 1
        return BucketProgram(found.program, found.sampler(bucket.array), found.first_command)

    def end(self) -> None:
        """Leave the state that later passes expect."""
        for program in self._compiled.values():
            program.end()

    def _program(self, variant: VisibilityVariant) -> VisibilityProgram:
        if variant not in self._compiled:
            self._compiled[variant] = VisibilityProgram(self.buffers.context, variant)
        return self._compiled[variant]

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
        albedo: bool = False,
    ) -> None:
        """Draw all tiles from a pose (4, 4), dynamic objects at theirs."""
        target, (drawer, tiles) = self._targets[albedo], self._drawn[albedo]
        tiles.begin(target, (0.0, 0.0, 0.0, 0.0))
        clear_integers(0)
        tiles.draw(target, world_from_rig, world_from_objects, drawer)
        tiles.end(target)
        self.end()
