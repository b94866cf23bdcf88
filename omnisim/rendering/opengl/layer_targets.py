"""Layers of texture arrays as targets of drawing."""

from __future__ import annotations

import ctypes

import moderngl

from omnisim.rendering.opengl.gl_functions import gl_function

COLORS, DEPTH = 0x8CE0, 0x8D00  # attachments; those of more colors follow
_TEXTURE_2D_ARRAY, _DEPTH_COMPONENT32F = 0x8C1A, 0x8CAC
_DEPTH_COMPONENT, _FLOAT = 0x1902, 0x1406
_ENUM, _INT = ctypes.c_uint, ctypes.c_int


def attach_texture(
    framebuffer: int, texture: int, attachment: int = COLORS, level: int = 0
) -> None:
    """Make a mip level of a texture, or all layers of an array, the colors of a framebuffer, or
    another attachment."""  # fmt: skip
    attach = gl_function("glNamedFramebufferTexture", _ENUM, _ENUM, _ENUM, _INT)
    attach(framebuffer, attachment, texture, level)


def attach_layer(
    framebuffer: int, array: int, layer: int, attachment: int = COLORS, level: int = 0
) -> None:
    """Make a layer of a texture array the colors of a framebuffer, or another attachment."""
    attach = gl_function("glNamedFramebufferTextureLayer", _ENUM, _ENUM, _ENUM, _INT, _INT)
    attach(framebuffer, attachment, array, level, layer)


def draw_into_all(target: moderngl.Framebuffer) -> None:
    """Draw into all colors of a target, which moderngl sets only when it uses one."""
    count = len(target.color_attachments)
    attachments = (_ENUM * count)(*range(COLORS, COLORS + count))
    draw = gl_function("glNamedFramebufferDrawBuffers", _ENUM, _INT, ctypes.c_void_p)
    draw(target.glo, count, ctypes.addressof(attachments))


def layered_target(
    context: moderngl.Context, *colors: moderngl.TextureArray
) -> tuple[moderngl.Framebuffer, moderngl.TextureArray]:
    """Framebuffer of all layers of texture arrays, and their depth: 32-bit floats, readable."""
    # moderngl makes no depth of layers: its texture gets other storage
    depth = context.texture_array((1, 1, 1), 1)
    depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
    depth.repeat_x = depth.repeat_y = False
    depth.use()
    allocate = gl_function(
        "glTexImage3D",
        _ENUM, _INT, _INT, _INT, _INT, _INT, _INT, _ENUM, _ENUM, ctypes.c_void_p,
    )  # fmt: skip
    size = colors[0].width, colors[0].height, colors[0].layers
    allocate(_TEXTURE_2D_ARRAY, 0, _DEPTH_COMPONENT32F, *size, 0, _DEPTH_COMPONENT, _FLOAT, None)
    target = context.framebuffer(colors)
    attach_texture(target.glo, depth.glo, DEPTH)
    draw_into_all(target)
    return target, depth
