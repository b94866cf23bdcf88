"""Reversed float depth: equally precise near and far.

A depth buffer stores near/z. With 1 at the near plane and 0 at infinity, floats have a relative
precision of 6e-8 at every distance; the usual 24 bits from −1 to 1 confuse surfaces 10 cm apart at
500 m.

Source: Reed, "Depth precision visualized", 2015.
"""

from __future__ import annotations

import moderngl

from omnisim.rendering.opengl.gl.framebuffers import DEPTH, attach_texture
from omnisim.rendering.opengl.gl.functions import allocate_depth_texture, allocate_float_depth

DEPTH_FUNCTION = ">"  # set per context, see omnisim/rendering/opengl/gl/state.py
CLEAR_DEPTH = 0.0


def float_depth(
    context: moderngl.Context, size: tuple[int, int], samples: int
) -> moderngl.Renderbuffer:
    """32-bit float depth buffer; `samples` 0: no multisampling."""
    buffer = context.depth_renderbuffer(size, samples=samples)
    allocate_float_depth(buffer.glo, size, samples)
    return buffer


def depth_texture(context: moderngl.Context, size: tuple[int, int]) -> moderngl.Texture:
    """32-bit float depth texture."""
    texture = context.depth_texture(size)
    _allocate(texture, size, 1)
    return texture


def large_depth_texture(
    context: moderngl.Context, size: tuple[int, int], levels: int
) -> moderngl.Texture:
    """32-bit float depth texture with `levels` mip levels, without moderngl's own allocation.

    Moderngl therefore takes it for a texture of one texel: see `depth_target`.
    """
    texture = context.depth_texture((1, 1))
    _allocate(texture, size, levels)
    return texture


def depth_target(
    context: moderngl.Context, texture: moderngl.Texture, size: tuple[int, int], level: int
) -> moderngl.Framebuffer:
    """Render target of `size` that draws into a mip level of a large depth texture."""
    target = context.empty_framebuffer(size)
    target.depth_mask = True
    attach_texture(target.glo, texture.glo, DEPTH, level)
    return target


def _allocate(texture: moderngl.Texture, size: tuple[int, int], levels: int) -> None:
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.compare_func = ""
    texture.repeat_x = texture.repeat_y = False
    texture.use()
    allocate_depth_texture(size, levels)
