"""Contexts: which device they open, and how they are kept and used again."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

import omnisim.rendering.opengl.gl.context as context_module
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.context import (
    current,
    list_devices,
    open_context,
    release_context,
)


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
    for one in contexts:
        one.release()


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
