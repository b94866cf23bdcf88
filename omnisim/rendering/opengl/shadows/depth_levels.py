"""Depth of all shadow maps in one texture, with coarser levels for surfaces that are far away.

Where a texel of the image has many texels of a map on it, the finest level would be looked up in
places far apart: slowly, and with shadows that flicker. A texel of a coarser level is one of the
finest that it covers, not their mean, so that it is depth that a lamp sees there.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from omnisim.rendering.opengl.drawing.reversed_depth import DEPTH_FUNCTION, depth_texture
from omnisim.rendering.opengl.fences import use_target
from omnisim.rendering.opengl.gl_functions import limit_levels
from omnisim.rendering.opengl.layer_targets import DEPTH, attach_texture
from omnisim.rendering.opengl.shader_files import build_program
from omnisim.rendering.opengl.uniforms import uniform

LEVELS = 4  # as in shaders/scene/shadow.glsl


class DepthLevels:
    """Texture of depth with its levels.

    Args:
        context: where.
        size_px: of the finest level, multiples of the coarsest's texels.

    Attributes:
        texture: for samplers that compare.
        target: the finest level, to draw into.
    """

    def __init__(self, context: moderngl.Context, size_px: tuple[int, int]):
        self._context = context
        self.texture = depth_texture(context, size_px, LEVELS)
        self.texture.compare_func = ">="
        self.texture.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
        self.target, *self._coarser = (
            context.framebuffer(depth_attachment=self.texture) for _ in range(LEVELS)
        )
        for level, target in enumerate(self._coarser, start=1):
            attach_texture(target.glo, self.texture.glo, DEPTH, level)
        limit_levels(self.texture.glo, 0, LEVELS - 1)
        self._sampler = context.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST))
        self._sampler.compare_func = ""
        program = build_program(context, "common/full_screen.vert", "scene/coarser_depth.frag")
        uniform(program, "u_finer").value = 0
        self._triangle = context.vertex_array(program, [])

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


def _halved(rectangle_px: Sequence[int], level: int) -> tuple[int, int, int, int]:
    """Rectangle of a level's texels that has all of one of the finest."""
    left, top, width, height = rectangle_px
    first = left >> level, top >> level
    last = -(-(left + width) >> level), -(-(top + height) >> level)
    return *first, last[0] - first[0], last[1] - first[1]
