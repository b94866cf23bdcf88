"""Fences: waiting for the GPU, and llvmpipe's last passes, kept until no thread uses them.

Mesa's llvmpipe draws on its own threads. Once it sees that a pass is finished it frees the pass's
fence, without taking the fence's lock: the thread that signaled the fence may still be unlocking
it, and then writes to freed memory. This happens if that thread is preempted on a busy machine and
the next pass is short. A sync object therefore keeps each pass's fence alive for many more passes.
"""

from __future__ import annotations

import ctypes
from collections import deque

import moderngl

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.functions import constant_call, gl_function

_GPU_COMMANDS_COMPLETE, _FLUSH_COMMANDS = 0x9117, 1
_TIMEOUT_EXPIRED, _WAIT_FAILED = 0x911B, 0x911D
_MAX_FENCES = 32  # llvmpipe has at most 5 passes in flight
_STEP_NS = 500_000_000  # Ctrl-C interrupts a wait between two steps
_MAX_WAIT_STEPS = 1200  # 10 minutes: more than any image takes by software


class Fences:
    """Sync objects of the current context.

    Args:
        keeps_passes: the driver is llvmpipe, whose last fences are kept.
    """

    def __init__(self, keeps_passes: bool) -> None:
        create = gl_function("glFenceSync", ctypes.c_uint, ctypes.c_uint, returns=ctypes.c_void_p)
        self.create = constant_call(create, _GPU_COMMANDS_COMPLETE, 0)
        self._wait = gl_function(
            "glClientWaitSync",
            ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64, returns=ctypes.c_uint,
        )  # fmt: skip
        self._delete = gl_function("glDeleteSync", ctypes.c_void_p)
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
