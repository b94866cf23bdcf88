"""EGL's devices, and their numbers in CUDA."""

from __future__ import annotations

import ctypes
from typing import Any

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.diagnosis import LIBRARIES, check_libraries

MAX_DEVICES = 64  # more than any machine has
_EXTENSIONS, _CUDA_DEVICE = 0x3055, 0x323A  # EGL_EXTENSIONS, EGL_CUDA_DEVICE_NV
_INT, _POINTER = ctypes.c_int, ctypes.c_void_p


def cuda_numbers() -> list[int | None]:
    """CUDA's number of each of EGL's devices, as the driver states it; None: it knows no CUDA.

    Raises:
        GraphicsError: EGL or OpenGL is not installed.
    """
    check_libraries()
    handles, count = (ctypes.c_void_p * MAX_DEVICES)(), ctypes.c_int()
    query = _function("eglQueryDevicesEXT", _INT, _POINTER, _POINTER)
    query(MAX_DEVICES, ctypes.addressof(handles), ctypes.byref(count))
    text = _function("eglQueryDeviceStringEXT", _POINTER, _INT, returns=ctypes.c_char_p)
    attribute = _function("eglQueryDeviceAttribEXT", _POINTER, _INT, _POINTER)
    numbers: list[int | None] = []
    for handle in handles[: count.value]:
        number, extensions = ctypes.c_ssize_t(), text(handle, _EXTENSIONS) or b""
        has_number = b"EGL_NV_device_cuda" in extensions.split() and attribute(
            handle, _CUDA_DEVICE, ctypes.byref(number)
        )
        numbers.append(number.value if has_number else None)
    return numbers


def device_number(device: int | str) -> int:
    """EGL's number of a device; CUDA's are written cuda:1.

    Raises:
        GraphicsError: neither a number nor cuda:N, or EGL has no such device.
    """
    text = str(device)
    kind, _, cuda = text.partition(":")
    number = int(text) if text.isdecimal() else -1
    if kind == "cuda" and cuda.isdecimal() and int(cuda) in (numbers := cuda_numbers()):
        number = numbers.index(int(cuda))
    if not 0 <= number < MAX_DEVICES:
        raise GraphicsError(
            f"device {text}: there is no such device: expected a number as `omnisim info` lists "
            "them, or cuda:N"
        )
    return number


def _function(name: str, *parameters: type, returns: type = ctypes.c_uint) -> Any:
    """Function of EGL by name; one that this EGL lacks returns 0."""
    get: Any = ctypes.CDLL(LIBRARIES[0]).eglGetProcAddress
    get.restype = ctypes.c_void_p
    address = get(name.encode())
    return ctypes.CFUNCTYPE(returns, *parameters)(address) if address else lambda *_: 0
