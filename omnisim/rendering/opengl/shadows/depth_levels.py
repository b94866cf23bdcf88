"""Depth of all shadow maps in one texture, with coarser levels for distant surfaces.

Where one image texel covers many texels of a map, lookups in the finest level would be scattered:
slow, with flickering shadows. A texel of a coarser level is one of the finest texels that it
covers, not their mean, so that it holds a depth that the lamp sees.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from omnisim.rendering.opengl.gl.framebuffers import depth_target, use_target
from omnisim.rendering.opengl.gl.gpu_textures import (
    DEPTH_FUNCTION,
    copy_region,
    depth_texture,
    limit_levels,
)
from omnisim.rendering.opengl.gl.shader_files import build_program
from omnisim.rendering.opengl.gl.uniforms import uniform

LEVELS = 4  # as in shaders/scene/shadow.glsl


class DepthLevels:
    """Depth texture with its levels.

    Args:
        context: OpenGL context.
        size_px: size of the finest level, multiples of the coarsest level's texels.
        like: other depth in the context, whose program is used, too; None: the first.

    Attributes:
        size_px: see the arguments.
        texture: texture for samplers that compare.
        target: the finest level as a render target.
    """

    def __init__(
        self, context: moderngl.Context, size_px: tuple[int, int], like: DepthLevels | None = None
    ):
        self._context, self.size_px = context, size_px
        self.texture = depth_texture(context, size_px, LEVELS)
        self.texture.compare_func = ">="
        self.texture.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        self.target, *self._coarser = (
            depth_target(context, self.texture, size_px, level) for level in range(LEVELS)
        )
        limit_levels(self.texture.glo, 0, LEVELS - 1)
        self._sampler = context.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST))
        self._sampler.compare_func = ""
        self._triangle: moderngl.VertexArray = (
            _coarser_triangle(context) if like is None else like._triangle
        )

    def coarsen(self, rectangles_px: Sequence[Sequence[int]]) -> None:
        """Draw the coarser levels of rectangles of the finest: left, top, width and height."""
        if not rectangles_px:
            return
        context, texture = self._context, self.texture
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "1"
        texture.use(0)
        self._sampler.use(0)
        for level, target in enumerate(self._coarser, start=1):
            limit_levels(texture.glo, level - 1, level - 1)
            use_target(target)
            for rectangle_px in rectangles_px:
                target.viewport = _halved(rectangle_px, level)
                self._triangle.render(moderngl.TRIANGLES, vertices=3)
        limit_levels(texture.glo, 0, LEVELS - 1)
        self._sampler.clear(0)
        context.depth_func = DEPTH_FUNCTION
        context.disable(moderngl.DEPTH_TEST)

    def copy(
        self,
        source: DepthLevels,
        rectangle_px: Sequence[int],
        first_px: tuple[int, int] | None = None,
    ) -> None:
        """Copy a rectangle of all levels.

        Args:
            source: where to copy from.
            rectangle_px: left, top, width and height of the target in the finest level.
            first_px: left and top in the source, by which the rectangle moves multiples of the
                coarsest level's texels; None: the same place.
        """
        left_px, top_px = rectangle_px[:2] if first_px is None else first_px
        names = source.texture.glo, self.texture.glo
        for level in range(LEVELS):
            to_left, to_top, *size_px = _halved(rectangle_px, level)
            first = left_px >> level, top_px >> level
            copy_region(*names, level, first, (to_left, to_top), (size_px[0], size_px[1]))


def _coarser_triangle(context: moderngl.Context) -> moderngl.VertexArray:
    """Triangle over the whole target, with the program of the coarser levels."""
    program = build_program(context, "common/full_screen.vert", "scene/coarser_depth.frag")
    uniform(program, "u_finer").value = 0
    return context.vertex_array(program, [])


def _halved(rectangle_px: Sequence[int], level: int) -> tuple[int, int, int, int]:
    """Rectangle of a level's texels that covers one of the finest level."""
    left, top, width, height = rectangle_px
    first = left >> level, top >> level
    last = -(-(left + width) >> level), -(-(top + height) >> level)
    return *first, last[0] - first[0], last[1] - first[1]
