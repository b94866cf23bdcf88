"""Depth that is as fine far away as it is near: reversed, in floats.

A depth buffer stores near/z. Counted from 1 at the near plane down to 0 at infinity, floats give
it a relative precision of 6e-8 at every distance; the usual 24 bits from −1 to 1 confuse surfaces
10 cm apart at 500 m. moderngl has neither of the two calls that this takes, so they are made here.

Source: Reed, "Depth precision visualized", 2015.
"""

from __future__ import annotations

import ctypes
from functools import cache

import moderngl

DEPTH_FUNCTION = ">"
CLEARED_DEPTH = 0.0

_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F
_RENDERBUFFER, _DEPTH_COMPONENT32F = 0x8D41, 0x8CAC


def clip_depth_from_zero_to_one() -> None:
    """Make the current context clip depth to [0, w], as the projections here expect it."""
    gl_function("glClipControl", ctypes.c_uint, ctypes.c_uint)(_LOWER_LEFT, _ZERO_TO_ONE)


def float_depth(
    context: moderngl.Context, size: tuple[int, int], samples: int
) -> moderngl.Renderbuffer:
    """A depth buffer of 32-bit floats; `samples` is 0 for none."""
    buffer = context.depth_renderbuffer(size, samples=samples)
    gl_function("glBindRenderbuffer", ctypes.c_uint, ctypes.c_uint)(_RENDERBUFFER, buffer.glo)
    allocate = gl_function(
        "glRenderbufferStorageMultisample",
        ctypes.c_uint, ctypes.c_int, ctypes.c_uint, ctypes.c_int, ctypes.c_int,
    )  # fmt: skip
    allocate(_RENDERBUFFER, samples, _DEPTH_COMPONENT32F, *size)
    return buffer


@cache
def gl_function(name: str, *kinds: type) -> ctypes._CFuncPtr:
    """One of OpenGL's functions that returns nothing, by its name and its parameters' types."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    return ctypes.CFUNCTYPE(None, *kinds)(egl.eglGetProcAddress(name.encode()))
