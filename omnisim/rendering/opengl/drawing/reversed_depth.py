"""Reversed float depth: equally precise near and far.

A depth buffer stores near/z. With 1 at the near plane and 0 at infinity, floats have a relative
precision of 6e-8 at every distance; the usual 24 bits from −1 to 1 confuse surfaces 10 cm apart at
500 m.

Source: Reed, "Depth precision visualized", 2015.
"""

from __future__ import annotations

import moderngl

from omnisim.rendering.opengl.gl_functions import allocate_depth_texture, allocate_float_depth

DEPTH_FUNCTION = ">"  # set per context, see omnisim/rendering/opengl/gl_state.py
CLEAR_DEPTH = 0.0


def float_depth(
    context: moderngl.Context, size: tuple[int, int], samples: int
) -> moderngl.Renderbuffer:
    """32-bit float depth buffer; `samples` 0: no multisampling."""
    buffer = context.depth_renderbuffer(size, samples=samples)
    allocate_float_depth(buffer.glo, size, samples)
    return buffer


def depth_texture(
    context: moderngl.Context, size: tuple[int, int], levels: int = 1
) -> moderngl.Texture:
    """32-bit float depth texture with `levels` mip levels."""
    texture = context.depth_texture(size)
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.compare_func = ""
    texture.repeat_x = texture.repeat_y = False
    texture.use()
    allocate_depth_texture(size, levels)
    return texture
