"""OpenGL functions that moderngl does not wrap, called through their addresses; and fences."""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import moderngl

from omnisim.core.errors import GraphicsError

_UNSIGNED_INT, _TRIANGLES = 0x1405, 4
_DRAW_INDIRECT_BUFFER, _PARAMETER_BUFFER, _SHADER_STORAGE_BUFFER = 0x8F3F, 0x80EE, 0x90D2
# Types of the functions' parameters, and of the elements of arrays that they read or write.
ENUM, INT, SIZE, FLOAT = ctypes.c_uint, ctypes.c_int, ctypes.c_ssize_t, ctypes.c_float
BOOLEAN, POINTER = ctypes.c_ubyte, ctypes.c_void_p  # 0 or 1; an address or an array

COMMAND_BYTES = 20  # of an indirect draw command


@cache
def gl_function(name: str, *parameters: type, returns: type | None = None) -> Callable[..., Any]:
    """OpenGL function by name, parameter types and return type."""
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    return ctypes.CFUNCTYPE(returns, *parameters)(egl.eglGetProcAddress(name.encode()))


def constant_call(function: Callable[..., Any], *arguments: int) -> Callable[[], Any]:
    """Call with constant arguments, converted once: that takes longer than most calls."""
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
        self.use_program = gl_function("glUseProgram", ENUM)
        self._bind_vertex_array = gl_function("glBindVertexArray", ENUM)
        self._bind_buffer = gl_function("glBindBuffer", ENUM, ENUM)
        self._draw = gl_function(
            "glMultiDrawElementsIndirectCountARB",
            ENUM, ENUM, POINTER, POINTER, INT, INT,
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
    """Buffers bound to consecutive storage bindings; `first`: first binding."""

    def __init__(self, buffers: Sequence[moderngl.Buffer], first: int = 0):
        self.buffers = tuple(buffers)
        self._names = (ENUM * len(buffers))(*(buffer.glo for buffer in buffers))
        bind = gl_function("glBindBuffersBase", ENUM, ENUM, INT, POINTER)
        address = ctypes.addressof(self._names)
        self.bind = constant_call(bind, _SHADER_STORAGE_BUFFER, first, len(buffers), address)

    @property
    def size(self) -> int:
        """Size of the buffers in bytes."""
        return sum(buffer.size for buffer in self.buffers)


# Fences: waiting for the GPU, and llvmpipe's last passes, kept until no thread uses them.
#
# Mesa's llvmpipe draws on its own threads. Once it sees that a pass is finished it frees the
# pass's fence, without taking the fence's lock: the thread that signaled the fence may still be
# unlocking it, and then writes to freed memory. This happens if that thread is preempted on a
# busy machine and the next pass is short. A sync object therefore keeps each pass's fence alive
# for many more passes.
_GPU_COMMANDS_COMPLETE, _FLUSH_COMMANDS = 0x9117, 1
_TIMEOUT_EXPIRED, _WAIT_FAILED = 0x911B, 0x911D
_MAX_FENCES = 32  # llvmpipe has at most 5 passes in flight
_STEP_NS = 500_000_000  # Ctrl-C interrupts a wait between two steps
_MAX_WAIT_STEPS = 1200  # 10 minutes: more than any image takes by software


class Fences:
    """Sync objects of the current context; llvmpipe's last ones are kept."""

    def __init__(self, keeps_passes: bool) -> None:
        create = gl_function("glFenceSync", ENUM, ENUM, returns=POINTER)
        self.create = constant_call(create, _GPU_COMMANDS_COMPLETE, 0)
        wait = "glClientWaitSync"
        self._wait = gl_function(wait, POINTER, ENUM, ctypes.c_uint64, returns=ENUM)
        self._delete = gl_function("glDeleteSync", POINTER)
        self.keeps_passes = keeps_passes
        self._kept: deque[int] = deque()  # newest last

    def wait(self, fence: int) -> None:
        """Wait until the GPU has executed all commands before a fence.

        Raises:
            GraphicsError: the GPU does not get there.
        """
        for _ in range(_MAX_WAIT_STEPS):
            status = self._wait(fence, _FLUSH_COMMANDS, _STEP_NS)
            if status == _WAIT_FAILED:
                raise GraphicsError("the GPU's driver lost what it was drawing: open a new stage")
            if status != _TIMEOUT_EXPIRED:
                return
        seconds = _MAX_WAIT_STEPS * _STEP_NS // 10**9
        raise GraphicsError(
            f"the GPU did not finish within {seconds} s: its driver has stalled; choose another "
            "device, see `omnisim info`"
        )

    def release(self, fence: int) -> None:
        """Delete a fence, at once or when no thread uses it any longer."""
        self._kept.append(fence)
        while len(self._kept) > (_MAX_FENCES if self.keeps_passes else 0):
            self._delete(self._kept.popleft())


def end_pass(context: moderngl.Context) -> None:
    """End the current pass before drawing to another target."""
    fences: Fences = context.extra.fences
    if fences.keeps_passes:
        fences.release(fences.create())
