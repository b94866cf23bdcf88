"""Buffers, textures and targets: immutable storage, what OpenGL refuses, and calls."""

import ctypes
from ctypes import CFUNCTYPE, c_int, c_ubyte, c_uint, c_void_p

import numpy as np
import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug, gpu_textures
from omnisim.rendering.opengl.gl.buffers import (
    AllocationError,
    gpu_allocation,
    gpu_buffer,
    read_buffer,
    written_buffer,
)
from omnisim.rendering.opengl.gl.framebuffers import framebuffer
from omnisim.rendering.opengl.gl.functions import constant_call, gl_function

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


@pytest.mark.parametrize(
    ("make", "size", "limit"),
    [
        (lambda *of: gpu_textures.texture_2d(*of, 4), (1, 99_999), "GL_MAX_TEXTURE_SIZE"),
        (lambda *of: gpu_textures.renderbuffer(*of, 4), (99_999, 1), "GL_MAX_TEXTURE_SIZE"),
        (gpu_textures.depth_texture, (99_999, 1), "GL_MAX_TEXTURE_SIZE"),
        (gpu_textures.depth_array, (1, 1, 99_999), "GL_MAX_ARRAY_TEXTURE_LAYERS"),
    ],
)
def test_sizes_beyond_a_limit_are_refused_before_opengl_is_asked(context, make, size, limit):
    text = rf" of {' × '.join(map(str, size))} texels.*at most {context.info[limit]}"
    with pytest.raises(AllocationError, match=text):
        make(context, size)
    with (
        pytest.raises(GraphicsError, match=rf"^an atlas does not fit .*{text}\): fewer rings"),
        gpu_allocation("an atlas", "fewer rings"),
    ):
        make(context, size)


def test_an_error_is_seen_after_the_allocation_that_made_it(context, monkeypatch):
    # as if the driver stated limits that it does not keep
    monkeypatch.setattr(context, "_info", dict.fromkeys(context.info, 10**6))
    with pytest.raises(AllocationError, match=r"of 99999 × 1 texels .*\(GL_INVALID_VALUE\)"):
        gpu_textures.texture_2d(context, (99_999, 1), 4)
    assert context.error == "GL_NO_ERROR"


def test_a_target_that_is_not_complete_is_named_by_its_attachments(context):
    colors = [gpu_textures.renderbuffer(context, (4, 4), 4, samples=samples) for samples in (0, 4)]
    with pytest.raises(AllocationError, match=r"framebuffer of \(4, 4\), 4 × f1; \(4, 4\), 4 × f1"):
        framebuffer(context, colors)


def test_constant_arguments_arrive_as_those_of_a_typed_function():
    given = []
    kinds = c_uint, c_int, c_ubyte, c_void_p, c_int, c_void_p, c_uint, c_void_p
    function = CFUNCTYPE(c_void_p, *kinds)(lambda *values: given.append(values) or 2**47 + 1)
    values = 2**32 - 1, -3, 1, 2**47, -(2**31), None, 7, 2**63 + 5  # the last two on the stack
    call = constant_call(function, *values)
    assert [call(), call()] == [2**47 + 1] * 2
    assert given == [values, values]
