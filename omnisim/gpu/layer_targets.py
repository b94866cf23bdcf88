"""Layers of texture arrays as targets of drawing."""

from __future__ import annotations

import ctypes

from omnisim.gpu.gl_functions import gl_function

_COLOR_ATTACHMENT = 0x8CE0


def attach_texture(framebuffer: int, texture: int) -> None:
    """Make a 2D texture the colours of a framebuffer."""
    attach = gl_function(
        "glNamedFramebufferTexture", ctypes.c_uint, ctypes.c_uint, ctypes.c_uint, ctypes.c_int
    )
    attach(framebuffer, _COLOR_ATTACHMENT, texture, 0)


def attach_layer(framebuffer: int, array: int, layer: int) -> None:
    """Make a layer of a texture array the colours of a framebuffer."""
    attach = gl_function(
        "glNamedFramebufferTextureLayer",
        ctypes.c_uint, ctypes.c_uint, ctypes.c_uint, ctypes.c_int, ctypes.c_int,
    )  # fmt: skip
    attach(framebuffer, _COLOR_ATTACHMENT, array, 0, layer)
