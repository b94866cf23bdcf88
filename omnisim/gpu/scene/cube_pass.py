"""The virtual cameras: the scene drawn into the faces of the cube at the effective viewpoint."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.atlas.tile_plan import Tile, TilePlan
from omnisim.gpu.gl_functions import flush
from omnisim.gpu.scene.reversed_depth import float_depth
from omnisim.gpu.scene.scene_buffers import InstanceTransforms, SceneBuffers, is_blended
from omnisim.gpu.scene.static_drawer import StaticDrawer
from omnisim.gpu.scene.surface_program import SurfacePrograms, variant_of
from omnisim.gpu.scene.tile_drawer import TileDrawer, TileView
from omnisim.gpu.uniforms import columns_first


class CubePass:
    """Draws the faces into one atlas texture.

    Args:
        context: where.
        buffers: the scene and its dynamic objects; other passes may draw from them, too.
        surfaces: their programs, lit by the scene's lamps.
        plan: the faces.
        near_m, far_m, samples: of the virtual cameras.
        unlit: show plain base colours.
        background: linear RGB where nothing is hit.
        hidden: names of the dynamic objects' instances that are not drawn.
        plain: draw one instance after the other, whole: slower, but there is little to go wrong.

    Attributes:
        plan: the faces and their places.
        atlas: linear RGBA, half floats, first row of each face's picture first.

    Raises:
        GraphicsError: the atlas is larger than the GPU allows.
        SceneError: a hidden name that no dynamic object has.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: SceneBuffers,
        surfaces: SurfacePrograms,
        plan: TilePlan,
        near_m: float,
        far_m: float,
        samples: int,
        unlit: bool,
        background: tuple[float, float, float],
        hidden: Collection[str] = (),
        plain: bool = False,
    ):
        self._context, self._buffers, self.plan = context, buffers, plan
        self._background = background
        self._drawing = TileDrawer(context, buffers, plan, near_m, far_m)
        size = (plan.width_px, plan.height_px)
        face_px = max(tile.face_size_px for tile in plan.tiles)
        limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > limit:
            raise GraphicsError(
                f"virtual cameras of {face_px} px need an atlas "
                f"of {size[0]} × {size[1]} px: this GPU takes at most {limit}; "
                "make the picture, virtual_cameras.texels_per_pixel or size_px smaller"
            )
        self.atlas = _texture(context, size)
        self.atlas.repeat_x = self.atlas.repeat_y = False
        mipmapped = moderngl.LINEAR_MIPMAP_LINEAR if plan.max_level else moderngl.LINEAR
        self.atlas.filter = (mipmapped, moderngl.LINEAR)
        samples = min(samples, int(context.max_samples))
        try:
            self._resolved = context.framebuffer([self.atlas]) if samples > 1 else None
            color = (
                context.renderbuffer(size, 4, samples=samples, dtype="f2")
                if samples > 1
                else self.atlas
            )
            depth = float_depth(context, size, samples if samples > 1 else 0)
            self._target = context.framebuffer([color], depth)
        except moderngl.Error as reason:
            raise GraphicsError(
                f"virtual cameras of {face_px} px with {samples} "
                f"samples do not fit on this GPU ({reason}): make the picture, "
                "virtual_cameras.size_px or virtual_cameras.samples smaller"
            ) from None
        variants = [variant_of(draw.material, unlit) for draw in buffers.draw_items]
        self._programs = [surfaces[variant] for variant in variants]
        arrays = {one: buffers.vertex_array(surfaces[one].program) for one in set(variants)}
        self._vertex_arrays = [arrays[variant] for variant in variants]
        self._static = None
        if not (plain or buffers.static_geometry.is_empty):
            # OpenGL reads no depth of several samples, and what one of them hides another may show
            self._static = StaticDrawer(
                context, buffers.static_geometry, surfaces, plan, unlit, samples
            )
        self._all_programs = set(self._programs)
        if self._static is not None:
            self._all_programs |= self._static.programs
        alone = buffers.shown(hidden)
        if not plain:
            alone &= ~buffers.static_geometry.taken
        blended = np.array([is_blended(draw.material) for draw in buffers.draw_items])
        self._opaque = np.flatnonzero(alone & ~blended)
        self._blended = np.flatnonzero(alone & blended)

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> moderngl.Texture:
        """Draw all faces from a pose (4, 4), objects at theirs, and return the atlas."""
        context, target = self._context, self._target
        viewpoint_m = world_from_rig[:3, 3]
        placement = self._buffers.instance_transforms(viewpoint_m, world_from_objects)
        for program in self._all_programs:
            program.set_viewpoint(viewpoint_m)
        opaque = self._buffers.front_to_back(self._opaque, placement)
        views = self._drawing.views(world_from_rig)
        blended = self._back_to_front(views, placement)
        here_matrices = columns_first(placement.viewpoint_from_mesh)
        normal_matrices = columns_first(placement.normal_from_mesh)

        def paint(index: int, clip_from_mesh: NDArray[np.float32]) -> None:
            draw, program = self._buffers.draw_items[index], self._programs[index]
            program.set_matrices(clip_from_mesh, here_matrices[index], normal_matrices[index])
            program.bind_material(draw.material, draw.texture)
            self._vertex_arrays[index].render(
                moderngl.TRIANGLES, vertices=draw.count, first=draw.first
            )

        self._drawing.begin(target, (*self._background, 1.0))
        context.blend_func = (
            moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ZERO, moderngl.ONE
        )  # fmt: skip
        if self._static is not None:
            self._static.prepare(views, viewpoint_m)
        for number, view in enumerate(views):
            self._drawing.aim(target, view)
            self._drawing.draw(view, placement, opaque, paint)
            if self._static is not None:
                self._static.draw(number)
                # tile by tile: a software renderer keeps what it was told of all tiles in memory
                # otherwise, and is slower by up to a seventh
                flush()
        while self._static is not None and self._static.has_more:
            self._static.prepare_more(self._read_depth)
            for number, view in enumerate(views):
                self._drawing.aim(target, view)
                self._static.draw(number)
        for view in views if blended.size else ():
            self._drawing.aim(target, view)
            target.depth_mask = False
            context.enable(moderngl.BLEND)
            self._drawing.draw(view, placement, blended, paint)
            context.disable(moderngl.BLEND)
            target.depth_mask = True
        self._drawing.end(target)
        if self._resolved is not None:
            context.copy_framebuffer(self._resolved, target)
        if self.plan.max_level:
            self.atlas.build_mipmaps(0, self.plan.max_level)
        return self.atlas

    def read_face(self, tile: Tile) -> NDArray[np.float32]:
        """The 90° of a face as last drawn, linear RGB (size, size, 3), first row at the top.

        The plan must have the whole face.
        """
        framebuffer = self._resolved or self._target
        pixels = np.empty((tile.face_size_px, tile.face_size_px, 3), dtype=np.float32)
        region = (*tile.face_corner_px, tile.face_size_px, tile.face_size_px)
        framebuffer.read_into(pixels, region, components=3, dtype="f4")
        return pixels

    def _read_depth(self) -> NDArray[np.float32]:
        """Depth (height, width) of what was drawn so far."""
        depth = np.empty((self.plan.height_px, self.plan.width_px), dtype=np.float32)
        self._target.read_into(depth, components=1, attachment=-1, dtype="f4")
        return depth

    def _back_to_front(
        self, views: Sequence[TileView], placement: InstanceTransforms
    ) -> NDArray[np.intp]:
        """Blended draws that are seen, in the order to draw them, with their triangles sorted."""
        if not self._blended.size:
            return self._blended
        seen = [self._drawing.sees(view, placement, self._blended) for view in views]
        blended = self._blended[np.any(seen, axis=0)]
        distances = np.linalg.norm(placement.centres_m[blended], axis=1)
        blended = blended[np.argsort(-distances, kind="stable")]
        for index in blended:
            self._buffers.sort_blended(
                self._buffers.draw_items[index], placement.viewpoint_from_mesh[index]
            )
        return blended


def _texture(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    try:
        return context.texture(size, 4, dtype="f2")
    except moderngl.Error as reason:
        raise GraphicsError(
            f"an atlas of {size[0]} × {size[1]} px does not fit on this GPU ({reason}): "
            "make the picture or virtual_cameras.size_px smaller"
        ) from None
