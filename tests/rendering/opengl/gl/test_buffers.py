"""Buffers with immutable storage, and what OpenGL refuses."""

import ctypes

import numpy as np
import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug
from omnisim.rendering.opengl.gl.buffers import (
    AllocationError,
    gpu_allocation,
    gpu_buffer,
    read_buffer,
    written_buffer,
)
from omnisim.rendering.opengl.gl.functions import gl_function

pytestmark = pytest.mark.usefixtures("needs_opengl")

IMMUTABLE, STORAGE_FLAGS, DYNAMIC_STORAGE = 0x821F, 0x8220, 0x0100


def _parameter(buffer, name):
    value = ctypes.c_int()
    get = gl_function("glGetNamedBufferParameteriv", ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p)
    get(buffer.glo, name, ctypes.addressof(value))
    return value.value


@pytest.mark.parametrize("make", [gpu_buffer, written_buffer])
def test_storage_is_immutable_and_only_written_buffers_can_be_written(context, make):
    values = np.arange(12, dtype="<f4").reshape(3, 4)
    buffer = make(context, values.T)  # not contiguous
    assert (_parameter(buffer, IMMUTABLE), buffer.size) == (1, 48)
    assert read_buffer(buffer) == values.T.tobytes()
    buffer.write(np.float32(7.0))
    debug.take_messages()  # expected
    is_written = make is written_buffer
    assert _parameter(buffer, STORAGE_FLAGS) == DYNAMIC_STORAGE * is_written
    assert context.error == ("GL_NO_ERROR" if is_written else "GL_INVALID_OPERATION")
    assert np.frombuffer(read_buffer(buffer), "<f4")[0] == (7.0 if is_written else 0.0)


@pytest.mark.parametrize("content", [np.zeros((0, 3)), b"", 0, np.int64(0)])
def test_empty_content_is_a_small_buffer(context, content):
    buffer = written_buffer(context, content)
    buffer.write(b"")
    assert 0 < buffer.size <= 64


def test_sizes_may_be_numpy_integers(context):
    assert gpu_buffer(context, np.int64(1000)).size == 1000


def test_what_does_not_fit_is_named(context):
    with pytest.raises(AllocationError, match=r"^a buffer of 10{12} bytes does not fit"):
        gpu_buffer(context, 10**12)
    with (
        pytest.raises(GraphicsError, match=r"^maps does not fit .* \(a buffer of .*: GL_.*\): few"),
        gpu_allocation("maps", "fewer lamps"),
    ):
        gpu_buffer(context, 10**12)
    assert context.error == "GL_NO_ERROR"
