"""Mip levels of an atlas, drawn anew in each frame."""

from __future__ import annotations

import moderngl

from omnisim.rendering.opengl.fences import use_target
from omnisim.rendering.opengl.gl_functions import (
    allocate_half_floats,
    generate_mipmaps,
    limit_levels,
)
from omnisim.rendering.opengl.layer_targets import attach_texture
from omnisim.rendering.opengl.shader_files import build_program
from omnisim.rendering.opengl.uniforms import uniform


class AtlasLevels:
    """Mip levels of an atlas, or of a texture array of atlases.

    With llvmpipe each level is a pass of ours: the driver's own passes, one for each level of each
    layer, do not keep their fences, see `omnisim.rendering.opengl.fences`.

    Args:
        texture: half floats, without levels so far.
        max_level: number of the last level; 0: there is none but the first.
    """

    def __init__(self, texture: moderngl.Texture | moderngl.TextureArray, max_level: int):
        self._texture, self._max_level = texture, max_level
        if not max_level:
            return
        context = texture.ctx
        is_array = isinstance(texture, moderngl.TextureArray)
        can_draw = not is_array or "GL_ARB_shader_viewport_layer_array" in context.extensions
        self._targets: list[moderngl.Framebuffer] = []
        if context.extra.fences is None or not can_draw:
            texture.build_mipmaps(0, max_level)  # allocates the levels
            return
        texture.use()
        allocate_half_floats(texture.size, max_level + 1)
        limit_levels(texture.glo, 0, max_level)
        defines = ("LAYERED",) if is_array else ()
        program = build_program(context, "scene/mip_level.vert", "scene/mip_level.frag", defines)
        uniform(program, "u_finer").value = 0
        self._texels = uniform(program, "u_texels")
        self._triangle = context.vertex_array(program, [])
        self._sampler = context.sampler(
            repeat_x=False, repeat_y=False, filter=(moderngl.LINEAR, moderngl.LINEAR)
        )
        for level in range(1, max_level + 1):
            target = context.framebuffer([texture])
            attach_texture(target.glo, texture.glo, level=level)
            target.viewport = 0, 0, *(max(1, side >> level) for side in texture.size[:2])
            self._targets.append(target)

    def draw(self, layers: int = 1) -> None:
        """Draw all levels but the first, of so many layers."""
        if not self._max_level:
            return
        if not self._targets:
            generate_mipmaps(self._texture.glo)
            return
        self._texture.use(0)
        self._sampler.use(0)
        for level, target in enumerate(self._targets, start=1):
            limit_levels(self._texture.glo, level - 1, level - 1)
            use_target(target)
            _, _, width, height = target.viewport
            self._texels.value = 1.0 / width, 1.0 / height
            self._triangle.render(moderngl.TRIANGLES, vertices=3, instances=layers)
        limit_levels(self._texture.glo, 0, self._max_level)
        self._sampler.clear(0)
