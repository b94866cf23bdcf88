"""Which triangle each texel of the cube shows: numbers instead of colours."""

from __future__ import annotations

import ctypes
from collections.abc import Collection
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.face_drawing import FaceDrawing
from omnisim.gpu.face_plan import FacePlan
from omnisim.gpu.reversed_depth import float_depth, gl_function
from omnisim.gpu.scene_buffers import Draw, Placement, SceneBuffers
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.vertex_format import vertex_array
from omnisim.scene.model import AlphaMode, Material

# Glass, or a picture with soft edges: it counts where it hides at least half of what is behind it.
BLENDED_CUTOFF = 0.5
_COLOR = 0x1800  # GL_COLOR


def alpha_cutoff(material: Material) -> float:
    """Alpha from which on a surface counts; 0: everywhere."""
    if material.alpha_mode is AlphaMode.MASK:
        return material.alpha_cutoff
    return BLENDED_CUTOFF if material.alpha_mode is AlphaMode.BLEND else 0.0


class _Variant(NamedTuple):
    """What differs between compiled versions of the shader."""

    holes: bool
    albedo: bool

    @property
    def defines(self) -> tuple[str, ...]:
        return (*(("HOLES",) if self.holes else ()), *(("ALBEDO",) if self.albedo else ()))


class VisibilityPass:
    """Draws the faces into an atlas of integers; everything on the GPU is made once.

    Sides, planes and holes are those of the picture (`CubePass`). A blended surface counts where
    its alpha reaches `BLENDED_CUTOFF`.

    Args:
        context: where.
        buffers: the scene and its movers; other passes may draw from them, too.
        plan: the faces.
        near_m, far_m: of the virtual cameras.
        hidden: names of the movers' instances that are not drawn.
        albedo: also be able to draw plain base colours.

    Attributes:
        plan, near_m, far_m, buffers: as given.
        surfaces: texture of two integers: 1 + number of the draw (0: nothing is seen), and number
            of its triangle.
        albedos: texture of the square root of linear RGB, or None.

    Raises:
        GraphicsError: the atlas does not fit on the GPU.
        SceneError: a hidden name that no mover has.
    """

    def __init__(
        self,
        context: moderngl.Context,
        buffers: SceneBuffers,
        plan: FacePlan,
        near_m: float,
        far_m: float,
        hidden: Collection[str] = (),
        albedo: bool = False,
    ):
        self.buffers, self.plan, self.near_m, self.far_m = buffers, plan, near_m, far_m
        self._context = context
        self._drawing = FaceDrawing(context, buffers, plan, near_m, far_m)
        size = (plan.width_px, plan.height_px)
        try:
            self.surfaces = context.texture(size, 2, dtype="u4")
            self.albedos = context.texture(size, 4) if albedo else None
            depth = float_depth(context, size, 0)
            self._targets = {False: context.framebuffer([self.surfaces], depth)}
            if self.albedos is not None:
                self._targets[True] = context.framebuffer([self.surfaces, self.albedos], depth)
        except moderngl.Error as reason:
            raise GraphicsError(
                f"ground truth by an atlas of {size[0]} × {size[1]} px does not fit on this GPU "
                f"({reason}): make the picture smaller"
            ) from None
        self.surfaces.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if self.albedos is not None:
            self.albedos.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._holed = [alpha_cutoff(draw.material) > 0.0 for draw in buffers.draws]
        self._programs: dict[_Variant, _VisibilityProgram] = {}
        for holes in set(self._holed):
            for with_albedo in self._targets:
                variant = _Variant(holes, with_albedo)
                self._programs[variant] = _VisibilityProgram(context, buffers, variant)
        seen = [not _is_never_seen(draw.material) for draw in buffers.draws]
        self._shown = np.flatnonzero(buffers.shown(hidden) & np.array(seen))

    def render(
        self, world_from_rig: NDArray[np.float64], placement: Placement, albedo: bool = False
    ) -> None:
        """Draw all faces from a pose (4, 4), with the draws where they are seen from there."""
        target = self._targets[albedo]
        self._drawing.begin(target, (0.0, 0.0, 0.0, 0.0))
        clear_integers(0)

        def paint(index: int, clip_from_mesh: NDArray[np.float32]) -> None:
            draw = self.buffers.draws[index]
            program = self._programs[_Variant(self._holed[index], albedo)]
            program.draw(draw, index, clip_from_mesh)

        order = self.buffers.from_near_to_far(self._shown, placement)
        for view in self._drawing.views(world_from_rig):
            self._drawing.aim(target, view)
            self._drawing.draw(view, placement, order, paint)
        self._drawing.end(target)
        for program in self._programs.values():
            program.end()


class _VisibilityProgram:
    """One compiled variant with its vertex array."""

    def __init__(self, context: moderngl.Context, buffers: SceneBuffers, variant: _Variant):
        folder = "ground_truth/visibility"
        program = build_program(context, f"{folder}.vert", f"{folder}.frag", variant.defines)
        self._vertex_array = vertex_array(
            context, program, buffers.vertices, buffers.triangles.indices
        )
        self._clip_from_mesh = program["u_clip_from_mesh"]
        self._number = program["u_draw_plus_one"]
        self._base_color = program.get("u_base_color", None)
        self._alpha_cutoff = program["u_alpha_cutoff"] if variant.holes else None
        self._samplers: dict[tuple[bool, bool], moderngl.Sampler] = {}
        if self._base_color is not None:
            program["u_texture"] = 0
            # Holes are those of the picture, and are filtered as there. Plain colours need no blend
            # between two levels, which costs a quarter of the pass.
            between = moderngl.LINEAR_MIPMAP_NEAREST
            if variant.holes:
                between = moderngl.LINEAR_MIPMAP_LINEAR
            for repeats in ((False, False), (False, True), (True, False), (True, True)):
                self._samplers[repeats] = context.sampler(
                    *repeats, filter=(between, moderngl.LINEAR)
                )

    def draw(self, draw: Draw, index: int, clip_from_mesh: NDArray[np.float32]) -> None:
        self._clip_from_mesh.write(clip_from_mesh)
        self._number.value = index + 1
        if self._base_color is not None:
            self._base_color.value = draw.material.base_color
            draw.texture.use(0)
            self._samplers[draw.texture.repeat_x, draw.texture.repeat_y].use(0)
        if self._alpha_cutoff is not None:
            self._alpha_cutoff.value = alpha_cutoff(draw.material)
        self._vertex_array.render(moderngl.TRIANGLES, vertices=draw.count, first=draw.first)

    def end(self) -> None:
        """Leave the textures to their own filters."""
        for sampler in self._samplers.values():
            sampler.clear(0)


def _is_never_seen(material: Material) -> bool:
    """Whether it is so clear everywhere that no texel can show it: textures only take away."""
    return material.base_color[3] < alpha_cutoff(material)


def clear_integers(attachment: int) -> None:
    """Zero an attachment of integers of the framebuffer in use: glClear is for floats."""
    zeros = (ctypes.c_uint * 4)()
    clear = gl_function("glClearBufferuiv", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
    clear(_COLOR, attachment, ctypes.addressof(zeros))
