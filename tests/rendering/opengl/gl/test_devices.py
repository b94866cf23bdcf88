"""Devices of EGL, and the numbers that CUDA gives them."""

import ctypes

import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import devices
from omnisim.rendering.opengl.gl.devices import (
    EglDevice,
    current_device,
    device_number,
    egl_devices,
)


def test_the_current_device_is_one_of_egl_s(context):
    with context:
        assert current_device() in range(len(egl_devices()))


@pytest.mark.parametrize(
    ("device", "number"),
    [(0, 0), ("2", 2), ("cuda", 2), ("cuda:0", 2), ("cuda:1", 0)],
)
def test_cuda_s_numbers_are_looked_up(monkeypatch, device, number):
    monkeypatch.setattr(
        devices, "egl_devices", lambda: [EglDevice(7, 1), EglDevice(8), EglDevice(9, 0)]
    )
    assert device_number(device) == number


@pytest.mark.parametrize("device", [-1, 64, True, "x", "cuda:2", "cuda:-1", "cuda:x", 1.5])
def test_other_devices_are_refused(monkeypatch, device):
    monkeypatch.setattr(devices, "egl_devices", lambda: [EglDevice(7, 1)])
    with pytest.raises(GraphicsError, match=f"device {device}: there is no such device: expected"):
        device_number(device)


def test_cuda_s_number_is_the_driver_s_answer(monkeypatch):
    """A driver of stubs: two devices, the second NVIDIA's with CUDA's number 3."""
    texts = {1: b"EGL_MESA_device_software", 2: b"EGL_NV_device_cuda EGL_EXT_device_drm"}

    def query(most, handles, count):
        (ctypes.c_void_p * most).from_address(handles)[:2] = (1, 2)
        count._obj.value = 2
        return 1

    def attribute(handle, name, value):
        value._obj.value = 3 if (handle, name) == (2, 0x323A) else -1
        return handle == 2

    def text(handle, name):
        return {0x3055: texts[handle], 0x3233: b"/dev/dri/card1"}.get(name)

    stubs = {
        "eglQueryDevicesEXT": query,
        "eglQueryDeviceAttribEXT": attribute,
        "eglQueryDeviceStringEXT": text,
    }
    monkeypatch.setattr(devices, "_function", lambda name, *types, **returns: stubs[name])
    assert egl_devices() == [EglDevice(1), EglDevice(2, 3, "/dev/dri/card1")]
