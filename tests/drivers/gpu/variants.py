"""Earlier ways to use OpenGL, one of which makes an NVIDIA H100 stall, to tell which.

Buffers were mutable, with hints about their use. A driver may move such a buffer when its use
contradicts the hint; immutable buffers stay where they are.
"""

import ctypes
from collections.abc import Callable
from typing import Any

from omnisim.rendering.opengl.gl import buffers
from omnisim.rendering.opengl.gl.functions import gl_function

_STATIC_DRAW, _DYNAMIC_DRAW, _DYNAMIC_COPY = 0x88E4, 0x88E8, 0x88EA
_DYNAMIC_STORAGE, _MAP_PERSISTENT = 0x100, 0x40
IMMUTABLE = "immutable"


def _as_before(flags: int, is_filled: bool) -> int:
    return _DYNAMIC_DRAW if flags & _DYNAMIC_STORAGE else _STATIC_DRAW


def _static(flags: int, is_filled: bool) -> int:
    return _STATIC_DRAW


def _copy(flags: int, is_filled: bool) -> int:
    if flags & _DYNAMIC_STORAGE or is_filled:
        return _as_before(flags, is_filled)
    return _DYNAMIC_COPY  # written and read by the GPU


HINTS: dict[str, Callable[[int, bool], int]] = {
    "dynamic": _as_before,  # buffers that the processor writes
    "static": _static,
    "copy": _copy,
}


def use_buffers(kind: str) -> None:
    """Make all buffers of this process immutable, or mutable with the hints of a kind."""
    if kind == IMMUTABLE:
        return
    hint_of = HINTS[kind]
    types = (ctypes.c_uint, ctypes.c_ssize_t, ctypes.c_void_p, ctypes.c_uint)

    def function(name: str, *parameters: type, **options: Any) -> Callable[..., Any]:
        if name != "glNamedBufferStorage":
            return gl_function(name, *parameters, **options)
        make_storage, make_data = (
            gl_function(name, *types),
            gl_function("glNamedBufferData", *types),
        )

        def allocate(buffer: int, size: int, content: int | None, flags: int) -> None:
            if flags & _MAP_PERSISTENT:
                make_storage(buffer, size, content, flags)
            else:
                make_data(buffer, size, content, hint_of(flags, content is not None))

        return allocate

    buffers.gl_function = function


def draw_nothing_blended() -> None:
    """Leave out blended triangles, whose indices and commands a shader writes."""
    from omnisim.rendering.opengl.surfaces.cluster_drawer import BlendedDrawer

    BlendedDrawer.draw = lambda self, *arguments: None


def finish_around_draws() -> None:
    """Wait for the GPU before and after the draws of clusters."""
    from omnisim.rendering.opengl.surfaces.cluster_drawer import ClusterDrawer

    draw = ClusterDrawer.draw
    finish = gl_function("glFinish")

    def finished(self: Any, *arguments: Any) -> None:
        finish()
        draw(self, *arguments)
        finish()

    ClusterDrawer.draw = finished


def copy_between_buffers(context: Any) -> None:
    """Copy once from buffer to buffer: then the channel for copies has worked before a draw."""
    source = buffers.gpu_buffer(context, bytes(4096))
    target = buffers.gpu_buffer(context, 4096)
    context.copy_buffer(target, source)
    context.finish()


# Changes before a sequence by the name of the variant; all but `immutable` have mutable buffers.
CHANGES: dict[str, tuple[str, Callable[[], None] | None]] = {
    IMMUTABLE: (IMMUTABLE, None),
    "as before": ("dynamic", None),
    "static hints": ("static", None),
    "copy hints": ("copy", None),
    "nothing blended": ("dynamic", draw_nothing_blended),
    "a copy first": ("dynamic", None),
    "finished draws": ("dynamic", finish_around_draws),
}
COPY_FIRST = "a copy first"
