"""Texture array layers as render targets."""

from __future__ import annotations

import ctypes

import moderngl

from omnisim.rendering.opengl.gl.functions import gl_function

COLORS, DEPTH = 0x8CE0, 0x8D00  # attachments; further colors follow the first
_TEXTURE_2D_ARRAY, _DEPTH_COMPONENT32F = 0x8C1A, 0x8CAC
_DEPTH_COMPONENT, _FLOAT = 0x1902, 0x1406
_ENUM, _INT = ctypes.c_uint, ctypes.c_int


def attach_texture(
    framebuffer: int, texture: int, attachment: int = COLORS, level: int = 0
) -> None:
    """Attach a mip level of a texture, or of all layers of an array, to a framebuffer."""
    attach = gl_function("glNamedFramebufferTexture", _ENUM, _ENUM, _ENUM, _INT)
    attach(framebuffer, attachment, texture, level)


def attach_layer(
    framebuffer: int, array: int, layer: int, attachment: int = COLORS, level: int = 0
) -> None:
    """Attach one layer of a texture array to a framebuffer."""
    attach = gl_function("glNamedFramebufferTextureLayer", _ENUM, _ENUM, _ENUM, _INT, _INT)
    attach(framebuffer, attachment, array, level, layer)


def draw_into_all(target: moderngl.Framebuffer) -> None:
    """Enable all color attachments of a target: moderngl does so only when it binds one."""
    count = len(target.color_attachments)
    attachments = (_ENUM * count)(*range(COLORS, COLORS + count))
    draw = gl_function("glNamedFramebufferDrawBuffers", _ENUM, _INT, ctypes.c_void_p)
    draw(target.glo, count, ctypes.addressof(attachments))


def layered_target(
    context: moderngl.Context, *colors: moderngl.TextureArray
) -> tuple[moderngl.Framebuffer, moderngl.TextureArray]:
    """Framebuffer with all layers of texture arrays, and its readable 32-bit float depth array."""
    # moderngl has no layered depth: its color texture gets other storage
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
