"""OpenGL contexts without a display, through EGL."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import moderngl

from omnisim.errors import GraphicsError
from omnisim.gpu.gl_functions import clip_depth_from_zero_to_one

REQUIRED_VERSION = 450
INSTALL_HINT = (
    "install OpenGL: sudo apt-get install libegl1 libgl1 libgl1-mesa-dri (software), "
    "or your graphics card's driver"
)
_NO_DRIVER = "there is no OpenGL driver"
_NO_SUCH_DEVICE = "there is no such device"
_MAX_DEVICES = 64  # more than a machine has; ends a driver's endless list
_LIBRARIES = ("libEGL.so.1", "libGL.so.1")


class GraphicsInfo(NamedTuple):
    """OpenGL implementation, and its limits."""

    vendor: str
    renderer: str
    version: str
    max_texture_size_px: int
    max_samples: int


def open_context(device: int | None = None) -> moderngl.Context:
    """Open an offscreen OpenGL context.

    Args:
        device: EGL's number of the device, as `omnisim info` lists them; None takes the default,
            or else the first that works: software, on most machines, is the last.

    Raises:
        GraphicsError: no EGL, no driver, no such device, or an OpenGL that is too old.
    """
    _check_libraries()
    try:
        return _open(device)
    except GraphicsError as reason:
        if device is None:
            for number, found in list_devices():
                if isinstance(found, GraphicsInfo):
                    return _open(number)
        raise reason from None


def _check_libraries() -> None:
    for library in _LIBRARIES:
        try:
            ctypes.CDLL(library)
        except OSError:
            raise GraphicsError(f"{library} is not there: {INSTALL_HINT}") from None


def _open(device: int | None) -> moderngl.Context:
    settings: dict[str, object] = {"libegl": _LIBRARIES[0], "libgl": _LIBRARIES[1]}
    if device is not None:
        settings["device_index"] = device
    try:
        context = moderngl.create_context(
            standalone=True,
            require=REQUIRED_VERSION,
            backend="egl",  # type: ignore[arg-type]  # moderngl's stub takes dicts only
            **settings,  # type: ignore[arg-type]  # likewise
        )
    except Exception as reason:  # glcontext raises nothing more specific
        raise GraphicsError(_reason(str(reason), device)) from None
    clip_depth_from_zero_to_one()
    context.gc_mode = "context_gc"  # `context.gc()` frees unreferenced objects
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
    """List EGL's devices by number, with their OpenGL or the reason why it cannot be used.

    Raises:
        GraphicsError: EGL or OpenGL itself is not installed.
    """
    _check_libraries()
    devices: list[tuple[int, GraphicsInfo | GraphicsError]] = []
    for number in range(_MAX_DEVICES):
        try:
            context = _open(number)
        except GraphicsError as reason:
            if _NO_SUCH_DEVICE in str(reason) or _NO_DRIVER in str(reason):
                break
            devices.append((number, reason))
        else:
            devices.append((number, graphics_info(context)))
            context.release()
    return devices


def _reason(message: str, device: int | None) -> str:
    """Explain glcontext's message, which has "found N devices" and EGL's error numbers."""
    if "found 0 devices" in message:
        return f"{_NO_DRIVER}: {INSTALL_HINT}"
    if "requested device index" in message:
        return f"device {device}: {_NO_SUCH_DEVICE} ({message}): see `omnisim info`"
    wanted = f"OpenGL {REQUIRED_VERSION // 100}.{REQUIRED_VERSION % 100 // 10}"
    if "version" in message.lower() or "eglCreateContext" in message:
        return f"{wanted} or newer is needed and not there ({message}): {INSTALL_HINT}"
    return f"OpenGL could not be opened ({message}): {INSTALL_HINT}"
