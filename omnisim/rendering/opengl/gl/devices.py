"""EGL's devices, and their CUDA numbers."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.diagnosis import LIBRARIES, check_libraries

_MAX_DEVICES = 64  # more than any machine has
_EXTENSIONS, _DEVICE, _CUDA_DEVICE = 0x3055, 0x322C, 0x323A  # EGL_EXTENSIONS, _DEVICE_EXT, …_NV
_DRM_FILE, _RENDER_NODE = 0x3233, 0x3377  # EGL_DRM_DEVICE_FILE_EXT, EGL_DRM_RENDER_NODE_FILE_EXT


class EglDevice(NamedTuple):
    """Device of EGL.

    Attributes:
        handle: EGL's handle.
        cuda: CUDA's number, as the driver states it; None: the driver knows no CUDA.
        file: its device file, such as /dev/dri/renderD128; empty: software, or not stated.
    """

    handle: int
    cuda: int | None = None
    file: str = ""


def egl_devices() -> list[EglDevice]:
    """Devices of EGL in the order of their numbers; nothing is opened.

    Raises:
        GraphicsError: EGL or OpenGL is not installed.
    """
    check_libraries()
    query = _function("eglQueryDevicesEXT", ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
    handles, count = (ctypes.c_void_p * _MAX_DEVICES)(), ctypes.c_int()
    if query is None or not query(_MAX_DEVICES, ctypes.addressof(handles), ctypes.byref(count)):
        return []
    return [_described(handle) for handle in handles[: count.value] if handle]


def current_device() -> int | None:
    """Number of the current context's device; None: EGL does not say."""
    egl: Any = ctypes.CDLL(LIBRARIES[0])
    egl.eglGetCurrentDisplay.restype = ctypes.c_void_p
    query = _function("eglQueryDisplayAttribEXT", ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)
    handle = ctypes.c_void_p()
    if query is None or not query(egl.eglGetCurrentDisplay(), _DEVICE, ctypes.byref(handle)):
        return None
    numbers = [number for number, one in enumerate(egl_devices()) if one.handle == handle.value]
    return numbers[0] if numbers else None


def device_number(device: int | str) -> int:
    """EGL's number of a device; CUDA's are written cuda:1.

    Raises:
        GraphicsError: neither a number nor cuda:N, or EGL has no such device.
    """
    text = str(device)
    kind, _, cuda = text.partition(":")
    number = int(text) if text.isdecimal() else -1
    if kind == "cuda" and (cuda or "0").isdecimal():
        numbers = {one.cuda: number for number, one in enumerate(egl_devices())}
        number = numbers.get(int(cuda or 0), -1)
    if not 0 <= number < _MAX_DEVICES:
        raise GraphicsError(
            f"device {text}: there is no such device: expected a number as `omnisim info` lists "
            "them, or cuda:N"
        )
    return number


def _described(handle: int) -> EglDevice:
    """Device with what its extensions tell."""
    get = _function(
        "eglQueryDeviceStringEXT", ctypes.c_void_p, ctypes.c_int, returns=ctypes.c_char_p
    )
    attribute = _function("eglQueryDeviceAttribEXT", ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)
    if get is None or attribute is None:
        return EglDevice(handle)
    extensions = (get(handle, _EXTENSIONS) or b"").decode().split()
    cuda, file = ctypes.c_ssize_t(), b""
    if "EGL_EXT_device_drm_render_node" in extensions:
        file = get(handle, _RENDER_NODE) or b""
    if "EGL_EXT_device_drm" in extensions:
        file = file or get(handle, _DRM_FILE) or b""
    has_cuda = "EGL_NV_device_cuda" in extensions and attribute(
        handle, _CUDA_DEVICE, ctypes.byref(cuda)
    )
    return EglDevice(handle, cuda.value if has_cuda else None, file.decode())


def _function(name: str, *parameters: type, returns: type = ctypes.c_uint) -> Any:
    """Function of EGL by name; None: this EGL lacks it."""
    get: Any = ctypes.CDLL(LIBRARIES[0]).eglGetProcAddress
    get.restype = ctypes.c_void_p
    address = get(name.encode())
    return ctypes.CFUNCTYPE(returns, *parameters)(address) if address else None
