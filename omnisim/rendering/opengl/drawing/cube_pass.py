"""Cube pass: colors that the virtual cameras at the effective viewpoint see."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import GraphicsError
from omnisim.core.world import time_of
from omnisim.rendering.opengl.atlas.tile_plan import Tile, TilePlan
from omnisim.rendering.opengl.atlas.tile_views import TileView
from omnisim.rendering.opengl.drawing.atlas_levels import AtlasLevels
from omnisim.rendering.opengl.drawing.blended_drawer import BlendedDrawer, arrays_of, fits
from omnisim.rendering.opengl.drawing.cluster_drawer import BucketProgram
from omnisim.rendering.opengl.drawing.cube_layers import EXTENSIONS, CubeLayers
from omnisim.rendering.opengl.drawing.reversed_depth import depth_texture, float_depth
from omnisim.rendering.opengl.drawing.scene_drawer import SceneDrawer
from omnisim.rendering.opengl.drawing.sky_pass import SkyPass
from omnisim.rendering.opengl.drawing.surface_program import (
    SurfacePrograms,
    variant_of,
    variant_of_blended,
    variant_of_bucket,
)
from omnisim.rendering.opengl.drawing.tile_renderer import TileRenderer, VirtualCameras
from omnisim.rendering.opengl.fences import end_pass
from omnisim.rendering.opengl.geometry.clustered_geometry import Bucket
from omnisim.rendering.opengl.geometry.draw_item import DrawItem, InstanceTransforms
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl_state import GlState
from omnisim.rendering.opengl.layer_targets import attach_layer, attach_texture
from omnisim.rendering.opengl.memory import gpu_allocation

_LAYER_TEXEL_BYTES = 12  # color and depth


class CubePass:
    """Renders the tiles into one atlas texture.

    Args:
        buffers: scene and dynamic objects; other passes may share them.
        programs: surface programs for the scene's lights.
        plan: tiles of the atlas.
        cameras: virtual cameras.

    Attributes:
        plan: see the arguments.
        atlas: linear RGBA half floats, top row of each face's image first.
        tiles: renderer of the tiles.

    Raises:
        GraphicsError: the atlas is larger than the GPU allows.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        plan: TilePlan,
        cameras: VirtualCameras,
    ):
        context = buffers.context
        self._context, self._buffers, self.plan = context, buffers, plan
        self._background, self._state = cameras.background, GlState()
        size = (plan.width_px, plan.height_px)
        limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > limit:
            raise GraphicsError(
                f"virtual cameras of {max(tile.face_size_px for tile in plan.tiles)} px need an "
                f"atlas of {size[0]} × {size[1]} px: this GPU takes at most {limit}; "
                "make the image, virtual_cameras.texels_per_pixel or size_px smaller"
            )
        samples = min(cameras.samples, int(context.max_samples))
        with gpu_allocation(
            f"an atlas of {size[0]} × {size[1]} px with {samples} samples",
            "make the image, virtual_cameras.size_px or virtual_cameras.samples smaller",
        ):
            self.atlas = context.texture(size, 4, dtype="f2")
            self._resolved = context.framebuffer([self.atlas])
            color: moderngl.Texture | moderngl.Renderbuffer = self.atlas
            if samples > 1:
                color = context.renderbuffer(size, 4, samples=samples, dtype="f2")
            # multisampled depth cannot be read, and one sample may show what another occludes
            self._depth = None if samples > 1 else depth_texture(context, size)
            depth = self._depth or float_depth(context, size, samples)
            self._target = context.framebuffer([color], depth)
        self.atlas.repeat_x = self.atlas.repeat_y = False
        self._levels = AtlasLevels(self.atlas, plan.max_level)
        mipmapped = moderngl.LINEAR_MIPMAP_LINEAR if plan.max_level else moderngl.LINEAR
        self.atlas.filter = (mipmapped, moderngl.LINEAR)
        self._is_multisampled = samples > 1
        self._cameras, self._programs, self._samples = cameras, programs, samples
        sky = programs.sky_seen(cameras.unlit)
        self._sky = None if sky is None else SkyPass(context, sky, plan)
        self.refresh()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        buffers, cameras, programs = self._buffers, self._cameras, self._programs
        shown = buffers.shown_one_by_one(cameras.hidden)
        blended = np.array([item.is_blended for item in buffers.draw_items], dtype=np.bool_)
        self._blended = np.flatnonzero(shown & blended)
        opaque = np.flatnonzero(shown & ~blended)
        self._drawer = SceneDrawer(
            buffers,
            buffers.indices,
            opaque if self._sorts_blended else np.flatnonzero(shown),
            lambda item: programs[variant_of(item, cameras.unlit)],
            id_of_item={},
        )
        self._programs_used = set(self._drawer.programs)

        def find_program(bucket: Bucket) -> BucketProgram:
            program = programs[variant_of_bucket(bucket, cameras.unlit)]
            self._programs_used.add(program)
            return BucketProgram(program.program)

        self.tiles = TileRenderer(
            buffers, self.plan, cameras, opaque, find_program, self._depth, self._samples
        )
        self._layers: CubeLayers | None = None
        self._blended_drawer = self._make_blended_drawer()

    @property
    def _blended_items(self) -> list[DrawItem]:
        return [self._buffers.draw_items[index] for index in self._blended.tolist()]

    @property
    def _sorts_blended(self) -> bool:
        """The blended items are sorted on the GPU."""
        return fits(self._blended_items, self._buffers.clustered_geometry)

    def _make_blended_drawer(self) -> BlendedDrawer | None:
        """Drawer that sorts blended items on the GPU; None: no blended items, or too many."""
        geometry, culler = self._buffers.clustered_geometry, self.tiles.culler
        if geometry is None or culler is None or not self._sorts_blended:
            return None
        items = self._blended_items
        variant = variant_of_blended(len(arrays_of(items)), self._cameras.unlit, items)
        program = self._programs[variant]
        self._programs_used.add(program)
        return BlendedDrawer(self._context, geometry, culler, items, program.program)

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> moderngl.Texture:
        """Render all tiles from a pose (4, 4) with the objects at their poses; return the atlas."""
        self._draw(world_from_rig, world_from_objects)
        self._levels.draw()
        return self.atlas

    def render_layers(
        self,
        poses: Sequence[tuple[NDArray[np.float64], Sequence[NDArray[np.float64]]]],
        atlases: moderngl.TextureArray,
        levels: AtlasLevels,
    ) -> None:
        """Render all tiles from poses as `render` takes them, one texture array layer per pose.

        The layers have the size of the atlas, which stays unchanged.
        """
        layers = self._layers_of(poses, atlases)
        if layers is None:
            self._draw_each(poses, atlases)
        else:
            layers.draw(poses)
        levels.draw(len(poses))

    @property
    def bytes_of_layer(self) -> int:
        """Size of a layer, and of its buffers for culling and sorting, bytes."""
        plan = self.plan
        texels = plan.width_px * plan.height_px * (2 if plan.max_level else 1)
        sorted_bytes = 0 if self._blended_drawer is None else self._blended_drawer.memory_bytes
        return _LAYER_TEXEL_BYTES * texels + self.tiles.culling_bytes + sorted_bytes

    def _layers_of(
        self,
        poses: Sequence[tuple[NDArray[np.float64], Sequence[NDArray[np.float64]]]],
        atlases: moderngl.TextureArray,
    ) -> CubeLayers | None:
        """Drawer of all layers together; None: this scene needs one layer after the other."""
        has_drawers = self.tiles.culler is not None and not self.tiles.has_items
        if self._blended.size and self._blended_drawer is None:
            has_drawers = False
        if self._is_multisampled or not has_drawers or not self._context.extensions >= EXTENSIONS:
            return None
        shadows = None if self._cameras.unlit else self._programs.shadows
        if shadows is not None and not shadows.are_shared(poses):
            return None
        if self._layers is None or self._layers.atlases is not atlases:
            self._layers = None  # frees its memory first
            items = [self._buffers.draw_items[index] for index in self._blended.tolist()]
            self._layers = CubeLayers(
                self._buffers, self._programs, self.plan, self._cameras, items, atlases
            )
        return self._layers

    def _draw_each(
        self,
        poses: Sequence[tuple[NDArray[np.float64], Sequence[NDArray[np.float64]]]],
        atlases: moderngl.TextureArray,
    ) -> None:
        """Draw the layers one after the other."""
        target = self._resolved if self._is_multisampled else self._target
        try:
            for layer, (world_from_rig, world_from_objects) in enumerate(poses):
                attach_layer(target.glo, atlases.glo, layer)
                self._draw(world_from_rig, world_from_objects)
        finally:
            attach_texture(target.glo, self.atlas.glo)

    def _draw(
        self, world_from_rig: NDArray[np.float64], world_from_objects: Sequence[NDArray[np.float64]]
    ) -> None:
        context, target, tiles = self._context, self._target, self.tiles
        viewpoint_m = world_from_rig[:3, 3]
        self._buffers.deform(world_from_objects)
        if self._programs.shadows is not None and not self._cameras.unlit:
            self._programs.shadows.prepare(viewpoint_m, world_from_objects)
        for program in self._programs_used:
            program.set_viewpoint(viewpoint_m)
        self._programs.bind_tables()
        tiles.begin(target, [(*self._background, 1.0)])
        with self._state.drawing():
            tiles.draw(target, world_from_rig, world_from_objects, self._drawer)
            if self._sky is not None:
                self._sky.draw(target, world_from_rig[None])
            if self._blended.size:
                with self._state.blending():
                    self._draw_blended(world_from_rig, world_from_objects)
        if self._is_multisampled:
            end_pass(context)
            context.copy_framebuffer(self._resolved, target)

    def read_depth(self) -> NDArray[np.float32]:
        """Depth (height, width) of the last rendered atlas, without blended surfaces.

        Raises:
            GraphicsError: the atlas is multisampled.
        """
        if self._is_multisampled:
            raise GraphicsError("virtual_cameras.samples: expected 1 to read depth, got more")
        depth = np.empty((self.plan.height_px, self.plan.width_px), dtype=np.float32)
        self._target.read_into(depth, components=1, attachment=-1, dtype="f4")
        return depth

    def read_face(self, tile: Tile) -> NDArray[np.float32]:
        """Read the 90° of a face as last rendered: linear RGB (size, size, 3), top row first.

        The tile must cover the whole face.
        """
        size = tile.face_size_px
        pixels = np.empty((size, size, 3), dtype=np.float32)
        region = (*tile.face_corner_px, size, size)
        self._resolved.read_into(pixels, region, components=3, dtype="f4")
        return pixels

    def _draw_blended(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
    ) -> None:
        """Draw the blended items."""
        target, tiles = self._target, self.tiles
        if self._blended_drawer is not None:
            self._blended_drawer.draw()
            return
        transforms = self._buffers.instance_transforms(world_from_rig[:3, 3], world_from_objects)
        views = tiles.views.at(world_from_rig)
        blended = self._back_to_front(views, transforms, time_of(world_from_objects))
        self._drawer.begin(transforms)
        tiles.draw_items(target, views, transforms, blended, self._drawer)

    def _back_to_front(
        self, views: Sequence[TileView], transforms: InstanceTransforms, time_s: float
    ) -> NDArray[np.intp]:
        """Sort visible blended items, and their triangles, back to front."""
        seen = [self.tiles.cull_items(view, transforms, self._blended) for view in views]
        blended = self._blended[np.any(seen, axis=0)]
        distances = np.linalg.norm(transforms.centers_m[blended], axis=1)
        blended = blended[np.argsort(-distances, kind="stable")]
        for index in blended:
            self._buffers.sort_triangles(
                self._buffers.draw_items[index], transforms.viewpoint_from_mesh[index], time_s
            )
        return blended
