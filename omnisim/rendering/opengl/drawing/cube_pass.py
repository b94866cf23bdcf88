"""Cube pass: colors that the virtual cameras at the effective viewpoint see."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import GraphicsError
from omnisim.core.short_repr import counted
from omnisim.core.world import Pose, Poses
from omnisim.rendering.atlas.tile_plan import Tile, TilePlan
from omnisim.rendering.opengl.drawing.atlas_levels import AtlasLevels
from omnisim.rendering.opengl.drawing.scene_view import SceneView, TileRenderer, VirtualCameras
from omnisim.rendering.opengl.drawing.sky_pass import SkyPass
from omnisim.rendering.opengl.drawing.surface_program import SurfacePrograms
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.framebuffers import (
    attach_layer,
    attach_texture,
    framebuffer,
    layered_target,
    resolve,
)
from omnisim.rendering.opengl.gl.gpu_textures import DEPTH, depth_texture, renderbuffer, texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.pixel_readback import Pixels, read_once

if TYPE_CHECKING:
    from omnisim.rendering.opengl.drawing.mirror_pass import MirrorPass
    from omnisim.rendering.opengl.drawing.probe_pass import ProbePass


EXTENSIONS = {"GL_ARB_shader_draw_parameters", "GL_ARB_shader_viewport_layer_array"}
_POSITIONS = 15  # binding, as in `scene/lighting.glsl`
_LAYER_TEXEL_BYTES = 12  # color and depth


class CubePass:
    """Renders the tiles into one atlas texture.

    Args:
        buffers: scene and dynamic objects; other passes may share them.
        programs: surface programs for the scene's lights.
        plan: tiles of the atlas.
        cameras: virtual cameras.
        whole: tiles of the whole image, if `plan` are those of a part of it.

    Attributes:
        plan: see the arguments.
        atlas: linear RGBA half floats, top row of each face's image first.

    Raises:
        GraphicsError: the atlas is larger than the GPU allows.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        plan: TilePlan,
        cameras: VirtualCameras,
        whole: TilePlan | None = None,
    ):
        context = buffers.context
        self._context, self._buffers = context, buffers
        self.plan = self._first_plan = plan
        self._whole = whole or plan
        self._background = cameras.background
        size = (plan.width_px, plan.height_px)
        samples = min(cameras.samples, int(context.max_samples))
        with gpu_allocation(
            f"an atlas of {size[0]} × {size[1]} px with {counted(samples, 'sample')}",
            "make the image, or virtual_cameras.texels_per_pixel, size_px or samples smaller",
        ):
            self.atlas = texture_2d(context, size, 4, dtype="f2", levels=1 + plan.max_level)
            self._resolved = framebuffer(context, [self.atlas])
            color: moderngl.Texture | moderngl.Renderbuffer = self.atlas
            if samples > 1:
                color = renderbuffer(context, size, 4, dtype="f2", samples=samples)
            # multisampled depth cannot be read, and one sample may show what another occludes
            self._depth = None if samples > 1 else depth_texture(context, size)
            depth = self._depth or renderbuffer(context, size, 1, DEPTH, samples)
            self._target = framebuffer(context, [color], depth)
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
        self.use_plan(self._first_plan)
        self._probes = self._make_probes()
        shown, with_probe = self._buffers.shown(self._cameras.hidden), frozenset[int]()
        if self._probes is not None:
            with_probe = self._probes.items
        self._shown_with_probe = np.array([one for one in with_probe if shown[one]], dtype=np.intp)
        self._mirrors = self._make_mirrors()
        self._view = SceneView(
            self._buffers,
            self._programs,
            self.plan,
            self._cameras,
            self._depth,
            self._samples,
            self._sky,
            self._mirrors,
            probes=self._probes,
        )
        self._layers: CubeLayers | None = None

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        if plan is not self.plan:
            self.plan = plan
            for one in (self.tiles, self._sky, *self._mirrors):
                if one is not None:
                    one.use_plan(plan)

    @property
    def tiles(self) -> TileRenderer:
        """Renderer of the tiles."""
        return self._view.tiles

    def _make_probes(self) -> ProbePass | None:
        """Pass of the reflection probes; None: no surface has one, or base colors are shown."""
        places = self._buffers.probe_places[: self._cameras.reflection_probes]
        if self._cameras.unlit or not places:
            return None
        from omnisim.rendering.opengl.drawing.probe_pass import shared_probes  # few scenes need it

        return shared_probes(self._buffers, self._programs, places, self._background)

    def _make_mirrors(self) -> list[MirrorPass]:
        """Passes of the views in mirrors and in panes; none if base colors are shown."""
        buffers = self._buffers
        if self._cameras.unlit or not self._cameras.mirrors:
            return []
        planes = ((buffers.mirrors, False), (buffers.pane_mirrors, True))
        if not any(mirrors for mirrors, _ in planes):
            return []
        from omnisim.rendering.opengl.drawing.mirror_pass import MirrorPass  # few scenes need it

        return [
            MirrorPass(
                buffers,
                mirrors,
                of_panes,
                self._programs,
                self.plan,
                self._whole,
                self._cameras,
                self._sky,
                self._probes,
            )
            for mirrors, of_panes in planes
            if mirrors
        ]

    def render(
        self, world_from_rig: Floats, world_from_objects: Sequence[Floats] = ()
    ) -> moderngl.Texture:
        """Render all tiles from a pose (4, 4) with the objects at their poses; return the atlas."""
        self._draw(world_from_rig, world_from_objects)
        self._levels.draw()
        return self.atlas

    def render_layers(
        self,
        poses: Sequence[tuple[Floats, Sequence[Floats]]],
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
        blended_drawer = self._view.blended_drawer
        sorted_bytes = 0 if blended_drawer is None else blended_drawer.memory_bytes
        return _LAYER_TEXEL_BYTES * texels + self.tiles.culling_bytes + sorted_bytes

    def _layers_of(
        self, poses: Sequence[tuple[Floats, Sequence[Floats]]], atlases: moderngl.TextureArray
    ) -> CubeLayers | None:
        """Drawer of all layers together; None: this scene needs one layer after the other."""
        has_drawers = self.tiles.culler is not None and not self.tiles.has_items
        if self._is_multisampled or not has_drawers or not self._context.extensions >= EXTENSIONS:
            return None
        if not all(self._view.sorts_blended(rig[:3, 3], objects) for rig, objects in poses):
            return None
        shadows = None if self._cameras.unlit else self._programs.shadows
        if shadows is not None and not shadows.are_shared(poses):
            return None
        if self._layers is None or self._layers.atlases is not atlases:
            self._layers = None  # frees its memory first
            self._layers = CubeLayers(
                self._buffers, self._programs, self.plan, self._cameras, atlases
            )
        return self._layers

    def _draw_each(
        self, poses: Sequence[tuple[Floats, Sequence[Floats]]], atlases: moderngl.TextureArray
    ) -> None:
        """Draw the layers one after the other."""
        target = self._resolved if self._is_multisampled else self._target
        try:
            for layer, (world_from_rig, world_from_objects) in enumerate(poses):
                attach_layer(target.glo, atlases.glo, layer)
                self._draw(world_from_rig, world_from_objects)
        finally:
            attach_texture(target.glo, self.atlas.glo)

    def _draw(self, world_from_rig: Floats, world_from_objects: Sequence[Floats]) -> None:
        target = self._target
        self._buffers.deform(world_from_objects)
        if self._probes is not None:
            self._probes.render(
                self._seen_in_probes(self._probes, world_from_rig, world_from_objects),
                world_from_objects,
            )
        if self._programs.shadows is not None and not self._cameras.unlit:
            self._programs.shadows.prepare(world_from_rig[:3, 3], world_from_objects)
        self._programs.bind_tables()
        for mirrors in self._mirrors:
            mirrors.render(self._view, world_from_rig, world_from_objects)
        self.tiles.begin(target, [(*self._background, 1.0)])
        self._view.draw(target, world_from_rig, world_from_objects)
        if self._is_multisampled:
            resolve(self._resolved, target)

    def _seen_in_probes(
        self, probes: ProbePass, world_from_rig: Floats, world_from_objects: Sequence[Floats]
    ) -> frozenset[int]:
        """Indices of items with a probe that are in view, or may be so in a mirror."""
        if self._mirrors:
            return probes.items
        buffers, viewpoint_m = self._buffers, world_from_rig[:3, 3]
        items = [*buffers.showing(self._shown_with_probe, viewpoint_m, world_from_objects)]
        if not items:
            return frozenset()
        transforms = buffers.instance_transforms(viewpoint_m, world_from_objects)
        seen = transforms.seen_in(self.tiles.views.at(world_from_rig), np.array(items))
        return frozenset(np.array(items)[seen.any(axis=0)].tolist())

    @property
    def depth(self) -> moderngl.Texture:
        """Depth (height, width) of the last rendered atlas, without blended surfaces.

        Raises:
            GraphicsError: the atlas is multisampled.
        """
        if self._depth is None:
            raise GraphicsError("virtual_cameras.samples: expected 1 to read depth, got more")
        return self._depth

    def read_face(self, tile: Tile) -> Floats32:
        """Read the 90° of a face as last rendered: linear RGB (size, size, 3), top row first.

        The tile must cover the whole face.
        """
        size = tile.face_size_px
        pixels = np.empty((size, size, 3), dtype=np.float32)
        region = (*tile.face_corner_px, size, size)
        read_once(self._buffers.context, (Pixels(self._resolved, region=region), pixels))
        return pixels


class CubeLayers:
    """Culls and draws clusters and blended items for many cameras together.

    A layer has the viewport and matrices of a single atlas, and therefore the same bytes.

    Args:
        buffers, programs, plan, cameras: see `CubePass`.
        atlases: texture array with one atlas layer per camera.

    Attributes:
        atlases: see the arguments.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        plan: TilePlan,
        cameras: VirtualCameras,
        atlases: moderngl.TextureArray,
    ):
        self.atlases, self._cameras = atlases, cameras
        self._buffers, self._programs = buffers, programs
        context, count = buffers.context, atlases.layers
        self._target, depth = layered_target(context, atlases)
        sky = programs.sky_seen(cameras.unlit)
        sky_pass = None if sky is None else SkyPass(context, sky, plan, count)
        self._view = SceneView(
            buffers, programs, plan, cameras, depth, samples=1, sky=sky_pass, layers=count
        )
        self._positions = written_buffer(context, 16 * count * len(programs.positions_m))

    def draw(self, poses: Sequence[tuple[Pose, Poses]]) -> None:
        """Draw from poses of rigs and dynamic objects that all share the shadow maps."""
        rigs = np.array([rig for rig, _ in poses])
        objects = np.array([objects for _, objects in poses])
        programs, positions_m = self._programs, self._programs.positions_m
        if len(positions_m):
            positions = np.zeros((len(poses), len(positions_m), 4), dtype=np.float32)
            positions[..., :3] = positions_m - rigs[:, None, :3, 3]
            self._positions.write(positions)
        if programs.shadows is not None and not self._cameras.unlit:
            self._buffers.deform(poses[0][1])  # objects outside of the view cast shadows, too
            programs.shadows.prepare(poses[0][0][:3, 3], poses[0][1])
        self._view.tiles.begin(self._target, [(*self._cameras.background, 1.0)])
        programs.bind_tables()
        self._positions.bind_to_storage_buffer(_POSITIONS)
        self._view.draw_layers(self._target, rigs, objects)
