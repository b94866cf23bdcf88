"""Devices of EGL, and the numbers that CUDA gives them."""

import ctypes

import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import diagnosis
from omnisim.rendering.opengl.gl.context import list_devices
from omnisim.rendering.opengl.gl.diagnosis import cuda_numbers, device_number


def test_every_device_is_counted(needs_opengl):
    assert len(cuda_numbers()) == len(list_devices())


@pytest.mark.parametrize(
    ("device", "number"),
    [(0, 0), ("2", 2), ("cuda:0", 2), ("cuda:1", 0)],
)
def test_cuda_s_numbers_are_looked_up(monkeypatch, device, number):
    monkeypatch.setattr(diagnosis, "cuda_numbers", lambda: [1, None, 0])
    assert device_number(device) == number


@pytest.mark.parametrize("device", [-1, 64, True, "x", "cuda:2", "cuda:-1", "cuda:x", "cuda", 1.5])
def test_other_devices_are_refused(monkeypatch, device):
    monkeypatch.setattr(diagnosis, "cuda_numbers", lambda: [1])
    with pytest.raises(GraphicsError, match=f"device {device}: there is no such device: expected"):
        device_number(device)


def test_cuda_s_number_is_the_driver_s_answer(monkeypatch):
    """A driver of stubs: two devices, the second NVIDIA's with CUDA's number 3."""
    extensions = {1: b"EGL_MESA_device_software", 2: b"EGL_EXT_device_drm EGL_NV_device_cuda"}

    def query(most, handles, count):
        (ctypes.c_void_p * most).from_address(handles)[:2] = (1, 2)
        count._obj.value = 2
        return 1

    def attribute(handle, name, value):
        value._obj.value = 3 if (handle, name) == (2, 0x323A) else -1
        return handle == 2

    def text(handle, name):
        return extensions[handle] if name == 0x3055 else None

    stubs = {
        "eglQueryDevicesEXT": query,
        "eglQueryDeviceAttribEXT": attribute,
        "eglQueryDeviceStringEXT": text,
    }
    monkeypatch.setattr(diagnosis, "_function", lambda name, *types, **returns: stubs[name])
    assert cuda_numbers() == [None, 3]
