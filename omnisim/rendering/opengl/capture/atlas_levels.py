"""Mip levels of an atlas, rendered in each frame."""

from __future__ import annotations

import moderngl

from omnisim.rendering.opengl.gl.framebuffers import (
    attach_layer,
    attach_texture,
    framebuffer,
    use_target,
)
from omnisim.rendering.opengl.gl.gpu_textures import limit_levels
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform

_LAYERED = "GL_ARB_shader_viewport_layer_array"  # lets a vertex shader choose the layer


class AtlasLevels:
    """Mip levels of an atlas, or of a texture array of atlases.

    Each level is a pass of ours, so that all drivers compute the same means. Llvmpipe's own passes,
    one per level and layer, do not keep their fences, see `functions.py`.

    Args:
        texture: half-float texture with these levels.
        max_level: last level; 0: no further levels.
    """

    def __init__(self, texture: moderngl.Texture | moderngl.TextureArray, max_level: int):
        self._texture, self._max_level = texture, max_level
        if not max_level:
            return
        context = texture.ctx
        self._is_array = isinstance(texture, moderngl.TextureArray)
        self._is_layered = self._is_array and _LAYERED in context.extensions
        defines = ["ARRAY"] * self._is_array + ["LAYERED"] * self._is_layered
        program = build_program(context, "scene/mip_level.vert", "scene/mip_level.frag", defines)
        uniform(program, "u_finer").value = 0
        self._texels = uniform(program, "u_texels")
        self._layer = None
        if self._is_array and not self._is_layered:
            self._layer = uniform(program, "u_layer")
        self._triangle = context.vertex_array(program, [])
        self._sampler = context.sampler(
            repeat_x=False, repeat_y=False, filter=(moderngl.LINEAR, moderngl.LINEAR)
        )
        self._targets = [framebuffer(context, [texture]) for _ in range(max_level)]
        for level, target in enumerate(self._targets, start=1):
            attach_texture(target.glo, texture.glo, level=level)
            target.viewport = 0, 0, *(max(1, side >> level) for side in texture.size[:2])

    def draw(self, layers: int = 1) -> None:
        """Draw all levels but the first, for `layers` layers."""
        if not self._max_level:
            return
        self._texture.use(0)
        self._sampler.use(0)
        for level, target in enumerate(self._targets, start=1):
            limit_levels(self._texture.glo, level - 1, level - 1)
            _, _, width, height = target.viewport
            self._texels.value = 1.0 / width, 1.0 / height
            if self._layer is None:
                use_target(target)
                self._triangle.render(moderngl.TRIANGLES, vertices=3, instances=layers)
                continue
            for layer in range(layers):
                attach_layer(target.glo, self._texture.glo, layer, level=level)
                use_target(target)
                self._layer.value = float(layer)
                self._triangle.render(moderngl.TRIANGLES, vertices=3)
        limit_levels(self._texture.glo, 0, self._max_level)
        self._sampler.clear(0)
