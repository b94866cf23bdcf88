"""OpenGL functions that moderngl lacks, called by their addresses."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

_COLOR = 0x1800  # GL_COLOR
_LOWER_LEFT, _ZERO_TO_ONE = 0x8CA1, 0x935F
_RENDERBUFFER, _DEPTH_COMPONENT32F = 0x8D41, 0x8CAC
_TEXTURE_2D, _RGBA, _UNSIGNED_BYTE = 0x0DE1, 0x1908, 0x1401


@cache
def gl_function(name: str, *parameters: type) -> Callable[..., None]:
    """Function of OpenGL that returns nothing, by its name and the types of its parameters."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    return ctypes.CFUNCTYPE(None, *parameters)(egl.eglGetProcAddress(name.encode()))


def clip_depth_from_zero_to_one() -> None:
    """Clip depth to [0, w] in the current context, as reversed depth needs it."""
    gl_function("glClipControl", ctypes.c_uint, ctypes.c_uint)(_LOWER_LEFT, _ZERO_TO_ONE)


def clear_integers(attachment: int) -> None:
    """Zero an attachment of integers of the framebuffer in use: glClear is for floats."""
    zeros = (ctypes.c_uint * 4)()
    clear = gl_function("glClearBufferuiv", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p)
    clear(_COLOR, attachment, ctypes.addressof(zeros))


def flush() -> None:
    """Submit all commands so far to the driver."""
    gl_function("glFlush")()


def allocate_float_depth(renderbuffer: int, size: tuple[int, int], samples: int) -> None:
    """Give a renderbuffer storage of 32-bit float depth; `samples` is 0 for none."""
    gl_function("glBindRenderbuffer", ctypes.c_uint, ctypes.c_uint)(_RENDERBUFFER, renderbuffer)
    allocate = gl_function(
        "glRenderbufferStorageMultisample",
        ctypes.c_uint, ctypes.c_int, ctypes.c_uint, ctypes.c_int, ctypes.c_int,
    )  # fmt: skip
    allocate(_RENDERBUFFER, samples, _DEPTH_COMPONENT32F, *size)


def upload_mip_level(level: int, internal_format: int, size: tuple[int, int], rgba: bytes) -> None:
    """Allocate and fill a mip level of the 2D texture that is bound, of 8-bit RGBA."""
    upload = gl_function(
        "glTexImage2D",
        ctypes.c_uint, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_int,
        ctypes.c_uint, ctypes.c_uint, ctypes.c_char_p,
    )  # fmt: skip
    upload(_TEXTURE_2D, level, internal_format, *size, 0, _RGBA, _UNSIGNED_BYTE, rgba)
