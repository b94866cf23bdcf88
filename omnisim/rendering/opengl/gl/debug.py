"""OpenGL's own report of errors and undefined behavior, with `OMNISIM_GL_DEBUG=1`.

The driver then reports within the call that is wrong: the stack is printed, and `current` raises
the message. Buffers, textures, framebuffers and programs are labeled by the line that made them.
"""

from __future__ import annotations

import ctypes
import os
import sys
import traceback

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.functions import gl_function

IS_ON = os.environ.get("OMNISIM_GL_DEBUG") == "1"
BUFFER, PROGRAM, TEXTURE, FRAMEBUFFER, RENDERBUFFER = 0x82E0, 0x82E2, 0x1702, 0x8D40, 0x8D41
_DEBUG_OUTPUT, _SYNCHRONOUS, _API, _ANY = 0x92E0, 0x8242, 0x8246, 0x1100
_REPORTED = 0x824C, 0x824E  # errors, and undefined behavior
_ENUM, _INT, _POINTER, _TEXT = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_char_p
_CALLBACK = ctypes.CFUNCTYPE(None, _ENUM, _ENUM, _ENUM, _ENUM, _INT, _TEXT, _POINTER)
_ROOM = os.path.dirname(__file__)
_messages: list[str] = []


def _report(
    source: int, kind: int, code: int, severity: int, size: int, text: bytes, _: object
) -> None:
    message = text.decode(errors="replace").strip()
    _messages.append(message)
    print(f"OpenGL: {message}", *traceback.format_stack()[-8:-1], file=sys.stderr)


_held = _CALLBACK(_report)  # for as long as any context may call it


def listen() -> None:
    """Report the current context's errors from now on, if `IS_ON`."""
    if not IS_ON:
        return
    for capability in (_DEBUG_OUTPUT, _SYNCHRONOUS):
        gl_function("glEnable", _ENUM)(capability)
    kinds = _ENUM, _ENUM, _ENUM, _INT, _POINTER, ctypes.c_ubyte
    control = gl_function("glDebugMessageControl", *kinds)
    control(_ANY, _ANY, _ANY, 0, None, False)
    for kind in _REPORTED:
        control(_API, kind, _ANY, 0, None, True)
    gl_function("glDebugMessageCallback", _CALLBACK, _POINTER)(_held, None)


def take_messages() -> list[str]:
    """Messages since the last call."""
    taken = _messages.copy()
    _messages.clear()
    return taken


def raise_messages() -> None:
    """Raise messages since the last call as a `GraphicsError`."""
    if _messages:
        raise GraphicsError(f"OpenGL: {'; '.join(take_messages())}")


def label(kind: int, name: int, text: str = "") -> None:
    """Label an object, if `IS_ON`; without a text by the line outside of this package."""
    if IS_ON:
        stack = (
            frame for frame in reversed(traceback.extract_stack()) if _ROOM not in frame.filename
        )
        line = next(stack)
        set_label = gl_function("glObjectLabel", _ENUM, _ENUM, _INT, _TEXT)
        set_label(kind, name, -1, (text or f"{line.filename}:{line.lineno}").encode())
