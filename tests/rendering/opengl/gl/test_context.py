"""Contexts: devices, how they are kept and used again, and reports of errors."""

import ctypes
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

import omnisim.rendering.opengl.gl.context as context_module
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import diagnosis
from omnisim.rendering.opengl.gl.context import current, list_devices, open_context, release_context
from omnisim.rendering.opengl.gl.diagnosis import cuda_numbers, device_number


def test_one_broken_device_does_not_hide_the_others(needs_opengl, monkeypatch):
    real = context_module._open

    def first_is_broken(device):
        if device in (None, 0):
            raise GraphicsError("no permission")
        return real(0)

    monkeypatch.setattr(context_module, "_open", first_is_broken)
    monkeypatch.setattr(context_module, "cuda_numbers", lambda: [None, None])
    broken, working = list_devices()
    assert isinstance(broken[1], GraphicsError)
    assert working[0] == 1
    assert working[1].renderer
    open_context().release()  # the first that works
    with pytest.raises(GraphicsError, match="no permission"):
        open_context(0)  # but not instead of one that was asked for


def test_a_released_context_is_emptied_and_used_again(needs_opengl):
    context = open_context()
    context.texture((4, 4), 4)
    assert context.objects
    release_context(context)
    assert not context.objects
    again = open_context()
    assert again is context
    other = open_context()
    assert other is not again
    other.release()
    again.release()


def test_a_thread_uses_no_context_of_another(needs_opengl):
    context = open_context()
    release_context(context)
    with ThreadPoolExecutor(1) as executor:
        other = executor.submit(open_context).result()
        assert other is not context
        executor.submit(other.release).result()
    assert open_context() is context
    context.release()


ENDED_DISPLAY = """
import ctypes
from omnisim.rendering.opengl.gl.context import open_context, release_context
first = open_context()
egl = ctypes.CDLL("libEGL.so.1")
egl.eglGetCurrentDisplay.restype = ctypes.c_void_p
display = egl.eglGetCurrentDisplay()
release_context(first)
assert egl.eglReleaseThread()
assert egl.eglTerminate(ctypes.c_void_p(display))  # as pyrender does
second = open_context()
second.texture((4, 4), 4)
assert second.error == "GL_NO_ERROR"
"""


def test_a_display_that_another_library_ended_opens_again(needs_opengl):
    done = subprocess.run(
        [sys.executable, "-c", ENDED_DISPLAY], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_a_context_stays_current_within_a_block_of_its_own(needs_opengl):
    contexts = [open_context(), open_context()]
    contexts[1].__exit__(None, None, None)  # opening makes it current
    first, second = contexts
    with current(first):
        with current(first):
            assert context_module._current_handle() == first.extra.handle
        assert context_module._current_handle() == first.extra.handle
        with current(second):
            assert context_module._current_handle() == second.extra.handle
        with current(first):  # as after another library's context
            assert context_module._current_handle() == first.extra.handle
    assert context_module._current_handle() is None
    with ThreadPoolExecutor(1) as executor:  # once no thread has it current
        executor.submit(_use, first).result()
        with current(first), pytest.raises(GraphicsError, match="another thread uses this stage"):
            executor.submit(_use, first).result()
    for context in contexts:
        context.release()


def _use(context):
    with current(context):
        assert context.error == "GL_NO_ERROR"


def test_a_context_is_released_within_a_block_of_its_own(needs_opengl):
    context = open_context()
    with current(context):
        release_context(context)
        assert context_module._current_handle() is None
    again = open_context()
    assert again is context
    again.release()


def test_every_device_is_counted(needs_opengl):
    assert len(cuda_numbers()) == len(list_devices())


@pytest.mark.parametrize(("device", "number"), [(0, 0), ("2", 2), ("cuda:0", 2), ("cuda:1", 0)])
def test_cuda_s_numbers_are_looked_up(monkeypatch, device, number):
    monkeypatch.setattr(diagnosis, "cuda_numbers", lambda: [1, None, 0])
    assert device_number(device) == number


@pytest.mark.parametrize("device", [-1, 64, True, "x", "cuda:2", "cuda:-1", 1.5])
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


WRONG = """
import ctypes
import numpy as np
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.context import current, open_context
from omnisim.rendering.opengl.gl.functions import gl_function

context = open_context()
buffer = gpu_buffer(context, 16)
enum, pointer = ctypes.c_uint, ctypes.c_void_p
label, length = ctypes.create_string_buffer(99), ctypes.c_int()
get = gl_function("glGetObjectLabel", enum, enum, ctypes.c_int, pointer, pointer)
get(0x82E0, buffer.glo, 99, ctypes.addressof(length), ctypes.addressof(label))
print(label.value.decode())
try:
    with current(context):
        buffer.write(np.float32(1.0))
except GraphicsError as error:
    print(error)
with current(context):
    pass
"""


def test_errors_are_raised_where_they_happen_and_objects_are_labeled(needs_opengl):
    environment = {**os.environ, "OMNISIM_GL_DEBUG": "1"}
    done = subprocess.run(
        [sys.executable, "-c", WRONG], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    label, error = done.stdout.splitlines()
    assert label == "<string>:10"
    assert error.startswith("OpenGL: GL_INVALID_OPERATION in glBufferSubData")
    assert ", line 18, in <module>" in done.stderr
