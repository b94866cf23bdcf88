"""OpenGL contexts without a display, through EGL.

A released context is emptied and kept for the next `open_context`: that is faster, and moderngl
leaks some memory per context.
"""

from __future__ import annotations

import os
import threading
import warnings
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import NamedTuple

import moderngl
from moderngl import Context as Context  # re-exported

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug
from omnisim.rendering.opengl.gl.diagnosis import (
    LIBRARIES,
    check_libraries,
    cuda_numbers,
    device_number,
    open_fault,
    version_fault,
)
from omnisim.rendering.opengl.gl.framebuffers import framebuffer
from omnisim.rendering.opengl.gl.functions import ENUM, POINTER, Fences, gl_function
from omnisim.rendering.opengl.gl.gpu_textures import delete_texture, renderbuffer
from omnisim.rendering.opengl.gl.state import set_constants

REQUIRED_VERSION = 450
_users: list[int] = []  # process that uses OpenGL, if any; inherited by a fork
_unclosed: deque[tuple[threading.Thread, moderngl.Context]] = deque()  # with their threads
_idle: deque[tuple[threading.Thread, moderngl.Context]] = deque()  # emptied, with their threads
_MAX_IDLE = 2  # an idle context may still hold driver memory


class _ContextResources(NamedTuple):
    """Device of a context, and the objects with the context's lifetime."""

    device: int | None  # requested number of the device; None: the default
    handle: int | None  # EGL's handle of the context
    dropped_textures: list[int]  # names of textures to delete that moderngl does not own
    # target that is never deleted: moderngl rebinds the last one it used
    lasting_target: moderngl.Framebuffer
    fences: Fences  # fences of readbacks and, by llvmpipe, of the last passes


class GraphicsInfo(NamedTuple):
    """OpenGL implementation, and its limits."""

    vendor: str
    renderer: str
    version: str
    max_texture_size_px: int
    max_samples: int


def open_context(device: int | str | None = None) -> moderngl.Context:
    """Open an offscreen OpenGL context, or one that was released on this thread.

    Args:
        device: EGL's number, as `omnisim info` lists them, or CUDA's, such as cuda:1; None takes
            the default device, else the first that works (on most machines the last one is
            software).

    Raises:
        GraphicsError: no EGL, no driver, no such device, OpenGL too old, or a process forked from
            one that uses OpenGL.
    """
    check_process()
    number = None if device is None else device_number(device)
    check_libraries()
    release_unclosed_contexts()
    while (idle := _take_idle(number)) is not None:
        idle.__enter__()  # type: ignore[no-untyped-call]  # current, as a new one is
        if _current_handle() == idle.extra.handle:
            return idle
        # another library has terminated EGL's display, and with it all contexts
    try:
        return _open(number)
    except GraphicsError as reason:
        if number is None:
            for other, result in list_devices():
                if isinstance(result, GraphicsInfo):
                    return _open(other)
        raise reason from None


@contextmanager
def current(context: moderngl.Context) -> Iterator[None]:
    """Make a context current for a `with` block; within another block of it, it stays current.

    Blocks around loops therefore save a change of contexts per image. Other libraries may make
    theirs current in between.

    Raises:
        GraphicsError: another thread uses it, it was ended, or OpenGL reported an error (`debug`).
    """
    handle = context.extra.handle
    is_inner = _current_handle() == handle
    if not is_inner:
        context.__enter__()  # type: ignore[no-untyped-call]
        if _current_handle() != handle:
            raise GraphicsError(
                "another thread uses this stage, or another library ended OpenGL: open a new stage"
            )
    try:
        yield
        debug.raise_messages()
    finally:
        debug.take_messages()  # of the error that is raised
        if not is_inner and _current_handle() == handle:
            context.__exit__(None, None, None)  # type: ignore[no-untyped-call]


def check_process() -> None:
    """Refuse OpenGL after a fork: the child would wait for driver threads that it does not have.

    Raises:
        GraphicsError: this process was forked from one that had opened OpenGL.
    """
    if _users and _users[0] != os.getpid():
        raise GraphicsError(
            "this process was forked from one that uses OpenGL: use multiprocessing's start method "
            "'spawn'"
        )


def release_context(context: moderngl.Context) -> None:
    """Release a context of this thread with everything in it; a forked child leaves it alone."""
    if _users != [os.getpid()]:
        return
    with context:
        is_sound = _current_handle() == context.extra.handle  # no other thread uses it
        if is_sound:
            collect_garbage(context)
            context.finish()  # the driver still holds what pending commands use
            is_sound = context.error == "GL_NO_ERROR"
    if is_sound and len(_idle) < _MAX_IDLE:
        _idle.append((threading.current_thread(), context))
    else:
        context.release()


def collect_garbage(context: moderngl.Context) -> None:
    """Release unreferenced objects of the current context."""
    if not context.objects and not context.extra.dropped_textures:
        return
    context.extra.lasting_target.use()
    gl_function("glBindVertexArray", ENUM)(0)  # deletions change the array that is bound
    context.gc()
    while context.extra.dropped_textures:
        delete_texture(context.extra.dropped_textures.pop())


def _take_idle(device: int | None) -> moderngl.Context | None:
    """Take this thread's idle context of a device; discard those of threads that have ended."""
    idle = None
    for _ in range(len(_idle)):
        thread, context = _idle.popleft()
        if not thread.is_alive():
            context.release()
        elif (
            idle is None and thread is threading.current_thread() and context.extra.device == device
        ):
            idle = context
        else:
            _idle.append((thread, context))
    return idle


def release_unclosed_context(context: moderngl.Context, thread: threading.Thread) -> None:
    """Release a context whose last user dropped it without closing, and warn.

    The garbage collector runs on any thread. If the context belongs to another thread that still
    runs, that thread releases it in its next `release_unclosed_contexts`.
    """
    _unclosed.append((thread, context))
    release_unclosed_contexts()
    warnings.warn(
        "unclosed stage or renderer: close it, or use it in a `with` block",
        ResourceWarning,
        stacklevel=3,  # where the last reference was dropped
    )


def release_unclosed_contexts() -> None:
    """Release the dropped contexts of this thread, and those of threads that have ended."""
    for _ in range(len(_unclosed)):
        try:
            thread, context = _unclosed.popleft()
        except IndexError:  # another thread was faster
            return
        if thread is threading.current_thread():
            release_context(context)
        elif not thread.is_alive():
            context.release()
        else:
            _unclosed.append((thread, context))


def _current_handle() -> int | None:
    """EGL's handle of this thread's current context; None: no context is current."""
    return gl_function("eglGetCurrentContext", returns=POINTER)()


def _open(device: int | None) -> moderngl.Context:
    _users[:] = [os.getpid()]
    settings = {} if device is None else {"device_index": device}
    try:
        context = _create(REQUIRED_VERSION, settings)
    except Exception as reason:  # glcontext raises nothing more specific
        raise _explained(str(reason), settings) from None
    debug.listen()
    set_constants()
    lasting_target = framebuffer(context, [renderbuffer(context, (1, 1), 4)])
    lasting_target.use()
    fences = Fences(keeps_passes="llvmpipe" in context.info["GL_RENDERER"])
    context.extra = _ContextResources(device, _current_handle(), [], lasting_target, fences)
    context.gc_mode = "context_gc"  # `collect_garbage` frees unreferenced objects
    return context


def graphics_info(context: moderngl.Context) -> GraphicsInfo:
    """Names and limits of an open context."""
    info = context.info
    return GraphicsInfo(
        info["GL_VENDOR"],
        info["GL_RENDERER"],
        info["GL_VERSION"],
        int(info["GL_MAX_TEXTURE_SIZE"]),
        int(context.max_samples),
    )


def list_devices() -> list[tuple[int, GraphicsInfo | GraphicsError]]:
    """List EGL's devices by number, with their OpenGL or the error that opening them raises.

    Raises:
        GraphicsError: EGL or OpenGL is not installed.
    """
    check_process()
    devices: list[tuple[int, GraphicsInfo | GraphicsError]] = []
    for number in range(len(cuda_numbers())):
        try:
            context = _open(number)
        except GraphicsError as reason:
            devices.append((number, reason))
        else:
            devices.append((number, graphics_info(context)))
            context.release()
    return devices


def _create(version: int, settings: Mapping[str, int]) -> moderngl.Context:
    return moderngl.create_context(
        standalone=True,
        require=version,
        backend="egl",  # type: ignore[arg-type]  # moderngl's stub takes dicts only
        libegl=LIBRARIES[0],  # type: ignore[arg-type]  # likewise
        libgl=LIBRARIES[1],  # type: ignore[arg-type]
        **settings,  # type: ignore[arg-type]
    )


def _explained(message: str, settings: Mapping[str, int]) -> GraphicsError:
    """Error with the cause of glcontext's message, which has numbers of devices or EGL's errors."""
    if "found 0 devices" not in message and "requested device index" in message:
        device = settings["device_index"]
        return GraphicsError(f"device {device}: there is no such device", "see `omnisim info`")
    if "version" not in message.lower() and "eglCreateContext" not in message:
        return GraphicsError(*open_fault(message))
    required = f"{REQUIRED_VERSION // 100}.{REQUIRED_VERSION % 100 // 10}"
    version, renderer = "", ""
    for older in (330, 310):  # EGL gives no context of a version that the driver lacks
        with suppress(Exception):  # glcontext raises nothing more specific
            context = _create(older, settings)
            version, renderer = context.info["GL_VERSION"], context.info["GL_RENDERER"]
            context.release()
            break
    return GraphicsError(*version_fault(required, version, renderer))
