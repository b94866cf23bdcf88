"""Visibility pass: triangle IDs instead of colors."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.arrays import Floats, Indices
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails
from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.gl.framebuffers import (
    COLORS,
    DEPTH,
    attach_layer,
    attach_texture,
    framebuffer,
    layered_target,
)
from omnisim.rendering.opengl.gl.gpu_textures import (
    bind_textures,
    depth_texture,
    texture_2d,
    texture_array,
)
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.hits.triangle_ids import TriangleIds
from omnisim.rendering.opengl.hits.visibility_program import (
    VisibilityProgram,
    VisibilityVariant,
    atlas_formats,
    clear_colors,
)
from omnisim.rendering.opengl.scene_view import TileRenderer, VirtualCameras
from omnisim.rendering.opengl.surfaces.cluster_drawer import BucketProgram
from omnisim.rendering.opengl.surfaces.scene_drawer import SceneDrawer, material_tables
from omnisim.rendering.opengl.world.clustered_geometry import Bucket
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.surface_kind import SurfaceKind


class Drawers(NamedTuple):
    """Drawers of single items and of tiles."""

    drawer: SceneDrawer[VisibilityProgram]
    tiles: TileRenderer


class VisibilityPass:
    """Renders triangle IDs of all tiles into an atlas; GPU resources are created once.

    It shares draw loop, sides, frusta and holes with the image (`CubePass`). A blended surface is
    drawn where its alpha reaches `BLENDED_CUTOFF`.

    Args:
        buffers: scene and dynamic objects; other passes may share them.
        plan: tiles of the atlas.
        cameras: virtual cameras; only depth range, sides and hidden instances matter here.
        details: details that can be drawn as well, if textures change them.

    Attributes:
        buffers, plan, cameras, near_m, far_m, both_sides: see the arguments.
        id_atlas: integer texture, 1 + ID of the triangle; 0: nothing visible.
        triangle_ids: table of the IDs.
        detail_atlases: textures of base colors (square root of linear RGB) and of materials, by
            sampler name.
        depth: depth of the last rendered atlas.

    Raises:
        GraphicsError: the atlas does not fit on the GPU.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        plan: TilePlan,
        cameras: VirtualCameras,
        details: HitDetails = NO_DETAILS,
    ):
        context = buffers.context
        self.buffers, self._state = buffers, GlState()
        self.plan = self._first_plan = plan
        self.near_m, self.far_m = cameras.near_m, cameras.far_m
        self.both_sides = cameras.both_sides
        size = (plan.width_px, plan.height_px)
        with gpu_allocation(
            f"ground truth by an atlas of {size[0]} × {size[1]} px", "make the image smaller"
        ):
            self.id_atlas = texture_2d(context, size, 1, dtype="u4")
            self.detail_atlases = {
                name: texture_2d(context, size, components, dtype=dtype)
                for name, (components, dtype) in atlas_formats(details).items()
            }
            self.depth = depth_texture(context, size)
        self._targets: dict[HitDetails, moderngl.Framebuffer] = {}
        self.cameras = cameras
        self._compiled: dict[VisibilityVariant, VisibilityProgram] = {}
        self.triangle_ids = TriangleIds(buffers, self._one_by_one())
        self._draw_by_ids()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self.triangle_ids.refresh(self._one_by_one())
        self._draw_by_ids()

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        if plan is not self.plan:
            self.plan = plan
            for one in self._drawn.values():
                one.tiles.use_plan(plan)

    def _draw_by_ids(self) -> None:
        self._drawn: dict[HitDetails, Drawers] = {}
        self.drawers(NO_DETAILS)

    def drawers(self, details: HitDetails) -> Drawers:
        """Drawers of IDs and details, created on first use."""
        if details not in self._drawn:
            items = self._one_by_one()
            self._drawn[details] = Drawers(
                self._make_drawer(details, items), self._make_tiles(details, items)
            )
        return self._drawn[details]

    def _target(self, details: HitDetails) -> moderngl.Framebuffer:
        """Target of IDs and details, created on first use."""
        if details not in self._targets:
            atlases = self._atlases(details)
            self._targets[details] = framebuffer(self.buffers.context, atlases, self.depth)
        return self._targets[details]

    def _atlases(self, details: HitDetails) -> list[moderngl.Texture]:
        return [self.id_atlas, *(self.detail_atlases[name] for name in atlas_formats(details))]

    def _one_by_one(self) -> Indices:
        """Draw items outside of clusters."""
        items, cameras = self.buffers.draw_items, self.cameras
        shown = self.buffers.shown_one_by_one(cameras.hidden)
        # a material may be so transparent that no texel shows it: textures only reduce alpha
        alphas = np.array([one.material.base_color[3] for one in items])
        shown &= alphas >= np.array([one.material.hit_cutoff for one in items])
        return np.flatnonzero(shown)

    def _make_drawer(self, details: HitDetails, items: Indices) -> SceneDrawer[VisibilityProgram]:
        """Drawer of the items' IDs and details."""
        return SceneDrawer(
            self.buffers,
            items,
            lambda item: self._item_program(details, item),
            self.triangle_ids.first_of_item,
            self.cameras.both_sides,
            indices=self.buffers.triangles.indices,
        )

    def _item_program(self, details: HitDetails, item: DrawItem) -> VisibilityProgram:
        variant = VisibilityVariant(bool(item.kind & SurfaceKind.HOLES), details)
        found = item.texture_layer.reflectance
        if found is not None:
            variant = variant.with_maps(found.maps, found.second_coordinates)
        return self._program(variant)

    def _make_tiles(self, details: HitDetails, items: Indices) -> TileRenderer:
        """Renderer of the clusters' IDs and details."""
        find_program = partial(self.bucket_program, details)
        tiles = TileRenderer(
            self.buffers, self._first_plan, self.cameras, items, find_program, self.depth
        )
        if self.plan is not self._first_plan:
            tiles.use_plan(self.plan)
        return tiles

    def draw_items(
        self,
        poses: Sequence[ScenePoses],
        layers: Sequence[moderngl.TextureArray],
        details: HitDetails,
    ) -> None:
        """Draw the items outside of clusters into layers of IDs, details and depth.

        Needs the state of `GlState.drawing`.
        """
        details = details.of_texels
        target, (drawer, tiles) = self._target(details), self.drawers(details)
        if not tiles.has_items:
            return
        self.bind_materials(details)
        own = [*self._atlases(details), self.depth]
        attachments = [*range(COLORS, COLORS + len(layers) - 1), DEPTH]
        try:
            for number, one in enumerate(poses):
                for attachment, layer in zip(attachments, layers, strict=True):
                    attach_layer(target.glo, layer.glo, number, attachment)
                self._state.use(target)
                tiles.draw_one_by_one(target, one, drawer)
        finally:
            for attachment, texture in zip(attachments, own, strict=True):
                attach_texture(target.glo, texture.glo, attachment)

    @property
    def culling_bytes(self) -> int:
        """Size of the buffers for culling, draw commands included, bytes."""
        return self.drawers(NO_DETAILS).tiles.culling_bytes

    def bucket_program(
        self, details: HitDetails, bucket: Bucket, layered: bool = False
    ) -> BucketProgram:
        """Program of a bucket's IDs and details."""
        variant = VisibilityVariant(
            SurfaceKind.CUTOUT in bucket.kind, details, bucket.array is not None, True, layered
        )
        variant = variant.with_maps(bucket.maps, bucket.second_coordinates)
        program = self._program(variant)
        program.first_plus_one.value = self.triangle_ids.first_of_clusters + 1
        return BucketProgram(program.program, program.sampler(bucket.array), program.first_command)

    def bind_materials(self, details: HitDetails) -> None:
        """Bind the material tables, if materials are drawn."""
        if details.materials:
            bind_textures(material_tables(self.buffers, has_item_details=True))

    def end(self) -> None:
        """Restore the state that later passes expect."""
        for program in self._compiled.values():
            program.end()

    def _program(self, variant: VisibilityVariant) -> VisibilityProgram:
        if variant not in self._compiled:
            self._compiled[variant] = VisibilityProgram(self.buffers.context, variant)
        return self._compiled[variant]

    def render(
        self,
        world_from_rig: Floats,
        world_from_objects: Sequence[Floats] = (),
        details: HitDetails = NO_DETAILS,
    ) -> None:
        """Render all tiles from a pose (4, 4), with the dynamic objects at their poses."""
        details = details.of_texels
        target, (drawer, tiles) = self._target(details), self.drawers(details)
        self.bind_materials(details)
        self.buffers.deform(world_from_objects, triangles=True)
        tiles.begin(target, clear_colors(details))
        with self._state.drawing():
            tiles.draw(target, (ScenePoses(world_from_rig, world_from_objects),), drawer)
        self.end()


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

    def draw(self, poses: Sequence[ScenePoses]) -> None:
        """Draw from poses of the rigs and of the dynamic objects."""
        self._visibility.bind_materials(self._wanted)
        self._tiles.begin(self._target, clear_colors(self._wanted))
        with self._state.drawing():
            self._tiles.draw_clusters(self._target, poses)
            self._visibility.draw_items(poses, self._layers, self._wanted)
        self._visibility.end()
