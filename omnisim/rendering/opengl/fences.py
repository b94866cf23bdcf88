"""Fences of llvmpipe's last passes, kept until no thread uses them.

Mesa's llvmpipe draws on threads of its own. It frees the fence of a pass when it sees that the pass
is done, and does so without the fence's lock: the thread that has just signaled it may not have
unlocked it yet, and then writes into memory that is free. This happens where that thread is
interrupted, on a busy machine, and the next pass is short. So a sync object holds the fence of each
pass, and lives until many more passes are drawn.
"""

from __future__ import annotations

import ctypes
from collections import deque
from functools import partial

import moderngl

from omnisim.rendering.opengl.gl_functions import gl_function

_GPU_COMMANDS_COMPLETE = 0x9117
_MAX_FENCES = 32  # llvmpipe has no more than 5 passes under way


class Fences:
    """Sync objects of the current context, the newest last."""

    def __init__(self) -> None:
        create = gl_function("glFenceSync", ctypes.c_uint, ctypes.c_uint, returns=ctypes.c_void_p)
        self._create = partial(create, _GPU_COMMANDS_COMPLETE, 0)
        self._delete = gl_function("glDeleteSync", ctypes.c_void_p)
        self._names: deque[int] = deque()

    def keep(self) -> None:
        """Keep the fence of all commands so far."""
        self._names.append(self._create())
        if len(self._names) > _MAX_FENCES:
            self._delete(self._names.popleft())


def end_pass(context: moderngl.Context) -> None:
    """End what was drawn so far, before another target is drawn into."""
    if context.extra.fences is not None:
        context.extra.fences.keep()


def use_target(target: moderngl.Framebuffer) -> None:
    """Draw into a target, with moderngl's state of it."""
    end_pass(target.ctx)
    target.use()


def clear_target(
    target: moderngl.Framebuffer,
    color: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    depth: float = 1.0,
    viewport: tuple[int, int, int, int] | None = None,
) -> None:
    """Clear a target, or a viewport of it, in a pass of its own."""
    end_pass(target.ctx)
    target.clear(*color, depth=depth, viewport=viewport)
    end_pass(target.ctx)
