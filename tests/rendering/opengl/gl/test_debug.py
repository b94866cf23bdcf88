"""Reports of OpenGL with OMNISIM_GL_DEBUG=1, in a process of its own."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.usefixtures("needs_opengl")
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


def test_errors_are_raised_where_they_happen_and_objects_are_labeled():
    environment = {**os.environ, "OMNISIM_GL_DEBUG": "1"}
    done = subprocess.run(
        [sys.executable, "-c", WRONG], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    label, error = done.stdout.splitlines()
    assert label == "<string>:10"
    assert error.startswith("OpenGL: GL_INVALID_OPERATION in glBufferSubData")
    assert ", line 18, in <module>" in done.stderr
