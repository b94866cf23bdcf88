"""Which triangle each texel of the cube shows: numbers instead of colours."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.gl_functions import clear_integers, flush
from omnisim.gpu.ground_truth.triangle_ids import TriangleIdGeometry, TriangleIds, surfaces_of
from omnisim.gpu.ground_truth.visibility_program import (
    NumberedPrograms,
    VisibilityProgram,
    VisibilityVariant,
    alpha_cutoff,
)
from omnisim.gpu.scene.reversed_depth import float_depth
from omnisim.gpu.scene.scene_buffers import InstanceTransforms, SceneBuffers
from omnisim.gpu.scene.static_drawer import StaticDrawer
from omnisim.gpu.scene.tile_drawer import TileDrawer
from omnisim.gpu.scene.vertex_format import vertex_array
from omnisim.scene.model import Material


class VisibilityPass:
    """Draws the faces into an atlas of integers; everything on the GPU is made once.

    Sides, planes and holes are those of the picture (`CubePass`), and what stands still is drawn as
    there. A blended surface counts where its alpha reaches `BLENDED_CUTOFF`.

    Args:
        context: where.
        buffers: the scene and its dynamic objects; other passes may draw from them, too.
        plan: the faces.
        near_m, far_m: of the virtual cameras.
        hidden: names of the dynamic objects' instances that are not drawn.
        albedo: also be able to draw plain base colours.

    Attributes:
        plan, near_m, far_m, buffers: as given.
        id_atlas: texture of integers: 1 + number of the triangle; 0: nothing is seen.
        triangle_ids: what these numbers are.
        albedo_atlas: texture of the square root of linear RGB, or None.

    Raises:
        GraphicsError: the atlas does not fit on the GPU.
        SceneError: a hidden name that no dynamic object has.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: SceneBuffers,
        plan: TilePlan,
        near_m: float,
        far_m: float,
        hidden: Collection[str] = (),
        albedo: bool = False,
    ):
        self.buffers, self.plan, self.near_m, self.far_m = buffers, plan, near_m, far_m
        self._context = context
        self._drawing = TileDrawer(context, buffers, plan, near_m, far_m)
        size = (plan.width_px, plan.height_px)
        try:
            self.id_atlas = context.texture(size, 1, dtype="u4")
            self.albedo_atlas = context.texture(size, 4) if albedo else None
            depth = float_depth(context, size, 0)
            self._targets = {False: context.framebuffer([self.id_atlas], depth)}
            if self.albedo_atlas is not None:
                self._targets[True] = context.framebuffer([self.id_atlas, self.albedo_atlas], depth)
        except moderngl.Error as reason:
            raise GraphicsError(
                f"ground truth by an atlas of {size[0]} × {size[1]} px does not fit on this GPU "
                f"({reason}): make the picture smaller"
            ) from None
        self.id_atlas.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if self.albedo_atlas is not None:
            self.albedo_atlas.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._holed = [alpha_cutoff(draw.material) > 0.0 for draw in buffers.draw_items]
        self._programs = {
            variant: VisibilityProgram(context, variant)
            for variant in _variants(set(self._holed), albedo)
        }
        self._vertex_arrays = {
            variant: vertex_array(context, one.program, buffers.vertices, buffers.triangles.indices)
            for variant, one in self._programs.items()
        }
        seen = [not _is_never_seen(draw.material) for draw in buffers.draw_items]
        alone = buffers.shown(hidden) & ~buffers.static_geometry.taken & np.array(seen)
        self._alone = np.flatnonzero(alone)
        self.triangle_ids = TriangleIds(context, buffers.draw_items, self._alone)
        self._static = None
        if not buffers.static_geometry.is_empty:
            surfaces = surfaces_of(buffers.static_geometry, buffers.draw_items)
            geometry = TriangleIdGeometry(buffers.static_geometry, surfaces, self.triangle_ids)
            self._numbered = NumberedPrograms(self._programs)
            self._static = StaticDrawer(context, geometry, self._numbered, plan, unlit=True)

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        placement: InstanceTransforms,
        albedo: bool = False,
    ) -> None:
        """DrawItem all faces from a pose (4, 4), with the draws where they are seen from there."""
        target = self._targets[albedo]
        self._drawing.begin(target, (0.0, 0.0, 0.0, 0.0))
        clear_integers(0)

        def paint(index: int, clip_from_mesh: NDArray[np.float32]) -> None:
            draw, variant = (
                self.buffers.draw_items[index],
                VisibilityVariant(self._holed[index], albedo),
            )
            program = self._programs[variant]
            program.set_matrix(clip_from_mesh)
            program.set_first_number(self.triangle_ids.first_of_draw[index])
            program.bind_material(draw.material, draw.texture)
            self._vertex_arrays[variant].render(
                moderngl.TRIANGLES, vertices=draw.count, first=draw.first
            )

        order = self.buffers.front_to_back(self._alone, placement)
        views = self._drawing.views(world_from_rig)
        self.triangle_ids.begin()
        if self._static is not None:
            self._numbered.albedo = albedo
            self._static.prepare(views, world_from_rig[:3, 3])
        for number, view in enumerate(views):
            self._drawing.aim(target, view)
            self._drawing.draw(view, placement, order, paint)
            if self._static is not None:
                self._static.draw(number)
                flush()  # as the picture's pass does
        while self._static is not None and self._static.has_more:
            self._static.prepare_more(partial(self._read_depth, target))
            for number, view in enumerate(views):
                self._drawing.aim(target, view)
                self._static.draw(number)
        self._drawing.end(target)
        for program in self._programs.values():
            program.end()

    def _read_depth(self, target: moderngl.Framebuffer) -> NDArray[np.float32]:
        """Depth (height, width) of what was drawn so far."""
        depth = np.empty((self.plan.height_px, self.plan.width_px), dtype=np.float32)
        target.read_into(depth, components=1, attachment=-1, dtype="f4")
        return depth


def _variants(holed: set[bool], albedo: bool) -> list[VisibilityVariant]:
    return [
        VisibilityVariant(holes, with_albedo)
        for holes in holed
        for with_albedo in ((False, True) if albedo else (False,))
    ]


def _is_never_seen(material: Material) -> bool:
    """Whether it is so clear everywhere that no texel can show it: textures only take away."""
    return material.base_color[3] < alpha_cutoff(material)
