"""OpenGL functions that moderngl does not wrap, called through their addresses."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import moderngl

_UNSIGNED_INT, _TRIANGLES = 0x1405, 4
_DRAW_INDIRECT_BUFFER, _PARAMETER_BUFFER, _SHADER_STORAGE_BUFFER = 0x8F3F, 0x80EE, 0x90D2
_ENUM, _INT = ctypes.c_uint, ctypes.c_int

COMMAND_BYTES = 20  # of an indirect draw command


@cache
def gl_function(name: str, *parameters: type, returns: type | None = None) -> Callable[..., Any]:
    """OpenGL function by name, parameter types and return type."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    return ctypes.CFUNCTYPE(returns, *parameters)(egl.eglGetProcAddress(name.encode()))


def constant_call(function: Callable[..., Any], *arguments: int) -> Callable[[], Any]:
    """Call of an OpenGL function with constant arguments.

    They are converted here, once: that takes longer than most calls.
    """
    typed: Any = function
    converted = [kind(value) for kind, value in zip(typed.argtypes, arguments, strict=True)]
    address: Any = ctypes.cast(typed, ctypes.c_void_p).value
    return partial(ctypes.CFUNCTYPE(typed.restype)(address), *converted)


def flush() -> None:
    """Submit all pending commands to the driver."""
    gl_function("glFlush")()


class IndirectDraws:
    """Multi-draws of indexed triangles; commands and draw counts are in GPU buffers.

    Moderngl needs the draw count on the CPU, and calling it takes longer than a short draw. Each
    function is therefore looked up once.
    """

    def __init__(self) -> None:
        self.use_program = gl_function("glUseProgram", _ENUM)
        self._bind_vertex_array = gl_function("glBindVertexArray", _ENUM)
        self._bind_buffer = gl_function("glBindBuffer", _ENUM, _ENUM)
        self._draw = gl_function(
            "glMultiDrawElementsIndirectCountARB",
            _ENUM, _ENUM, ctypes.c_void_p, ctypes.c_void_p, _INT, _INT,
        )  # fmt: skip

    def bind(self, commands: int, counts: int, vertex_array: int) -> None:
        """Bind the buffers that the next draws use."""
        self._bind_buffer(_DRAW_INDIRECT_BUFFER, commands)
        self._bind_buffer(_PARAMETER_BUFFER, counts)
        self._bind_vertex_array(vertex_array)

    def drawing(
        self, first_command: int, count_index: int, max_commands: int
    ) -> Callable[[], object]:
        """Call that draws as many commands as the counter says, with the bindings at that time."""
        return constant_call(
            self._draw, _TRIANGLES, _UNSIGNED_INT,
            COMMAND_BYTES * first_command, 4 * count_index, max_commands, COMMAND_BYTES,
        )  # fmt: skip


class StorageBindings:
    """Buffers bound to consecutive storage bindings.

    Args:
        buffers: buffers in order.
        first: first binding.
    """

    def __init__(self, buffers: Sequence[moderngl.Buffer], first: int = 0):
        self.buffers = tuple(buffers)
        self._names = (ctypes.c_uint * len(buffers))(*(one.glo for one in buffers))
        bind = gl_function("glBindBuffersBase", _ENUM, _ENUM, _INT, ctypes.c_void_p)
        address = ctypes.addressof(self._names)
        self.bind = constant_call(bind, _SHADER_STORAGE_BUFFER, first, len(buffers), address)

    @property
    def size(self) -> int:
        """Size of the buffers in bytes."""
        return sum(one.size for one in self.buffers)
