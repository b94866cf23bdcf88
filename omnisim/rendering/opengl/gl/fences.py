"""Fences of llvmpipe's last passes, kept until no thread uses them.

Mesa's llvmpipe draws on its own threads. Once it sees that a pass is finished it frees the pass's
fence, without taking the fence's lock: the thread that signaled the fence may still be unlocking
it, and then writes to freed memory. This happens if that thread is preempted on a busy machine and
the next pass is short. A sync object therefore keeps each pass's fence alive for many more passes.
"""

from __future__ import annotations

import ctypes
from collections import deque

import moderngl

from omnisim.rendering.opengl.gl.functions import constant_call, gl_function

_GPU_COMMANDS_COMPLETE = 0x9117
_MAX_FENCES = 32  # llvmpipe has at most 5 passes in flight


class Fences:
    """Sync objects of the current context, newest last."""

    def __init__(self) -> None:
        create = gl_function("glFenceSync", ctypes.c_uint, ctypes.c_uint, returns=ctypes.c_void_p)
        self._create = constant_call(create, _GPU_COMMANDS_COMPLETE, 0)
        self._delete = gl_function("glDeleteSync", ctypes.c_void_p)
        self._names: deque[int] = deque()

    def keep(self) -> None:
        """Keep the fence of all commands issued so far."""
        self._names.append(self._create())
        if len(self._names) > _MAX_FENCES:
            self._delete(self._names.popleft())


def end_pass(context: moderngl.Context) -> None:
    """End the current pass before drawing to another target."""
    if context.extra.fences is not None:
        context.extra.fences.keep()
