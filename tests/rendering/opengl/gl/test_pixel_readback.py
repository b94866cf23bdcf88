"""Readback through mapped buffers, and fences: all formats, any order, and what goes wrong."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug, functions
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.functions import gl_function
from omnisim.rendering.opengl.gl.pixel_readback import (
    LENGTH,
    PixelReadback,
    TargetPixels,
    read_once,
)

pytestmark = pytest.mark.usefixtures("needs_opengl")

SIZE = 7, 5  # odd: rows of bytes do not end at multiples of four
TYPES = {"f1": np.uint8, "f2": np.float16, "f4": np.float32, "u1": np.uint8, "u4": np.uint32}


def _values(components, dtype, seed=0):
    random = np.random.default_rng(seed).integers(0, 200, (*SIZE[::-1], components))
    return random.astype(TYPES[dtype])


def _texture(context, components, dtype, seed=0):
    values = _values(components, dtype, seed)
    return context.texture(SIZE, components, values, dtype=dtype, alignment=1), values


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("components", [1, 4])
def test_pixels_and_textures_are_read_as_they_are_stored(context, components, dtype):
    texture, values = _texture(context, components, dtype)
    target = context.framebuffer([texture])
    pixels, texels, part = np.empty_like(values), np.empty_like(values), np.empty_like(values[:2])
    read_once(
        context,
        (TargetPixels(target), pixels),
        (texture, texels),
        (TargetPixels(target, region=(0, 0, SIZE[0], 2)), part),
    )
    np.testing.assert_array_equal(pixels, values)
    np.testing.assert_array_equal(texels, values)
    np.testing.assert_array_equal(part, values[:2])


def test_arrays_take_the_first_components_in_their_own_type(context):
    colors, values = _texture(context, 4, "f2")
    numbers, others = _texture(context, 2, "u4", seed=1)
    target = context.framebuffer([colors, numbers])
    rgb, both = np.empty((*SIZE[::-1], 3), np.float32), np.empty((*SIZE[::-1], 5), np.float64)
    region = (1, 2, 3, 2)
    window = np.empty((2, 3, 4), np.float32)
    read_once(
        context,
        (TargetPixels(target), rgb),
        (TargetPixels(target, 1), both[..., :2]),
        (TargetPixels(target), both[..., 2:]),
        (TargetPixels(target, region=region), window),
    )
    np.testing.assert_array_equal(rgb, values[..., :3])
    np.testing.assert_array_equal(both, np.concatenate((others, values[..., :3]), axis=-1))
    np.testing.assert_array_equal(window, values[2:4, 1:4])
    content, expected = np.empty(1000, np.float32), np.arange(1000, dtype=np.float32)
    read_once(context, (gpu_buffer(context, expected), content))
    np.testing.assert_array_equal(content, expected)


def test_readings_end_in_any_order_and_a_fourth_ends_the_oldest(context):
    ring = PixelReadback(context)
    textures = [_texture(context, 4, "f1", seed) for seed in range(LENGTH + 2)]
    arrays = [np.zeros_like(values) for _, values in textures]
    readings = [
        ring.start((texture, out)) for (texture, _), out in zip(textures, arrays, strict=True)
    ]
    done = [out.any() for out in arrays]
    assert done == [True, True, False, False, False]
    for reading in (*readings[::-1], readings[0]):
        reading.finish()
    for (_, values), out in zip(textures, arrays, strict=True):
        np.testing.assert_array_equal(out, values)
    assert (len(ring._readings), len(ring._free)) == (0, LENGTH)
    get = gl_function("glGetNamedBufferParameteriv", ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p)
    value = ctypes.c_int()
    for mapped in ring._free:
        for name, expected in ((0x821F, 1), (0x8220, 0x2C1), (0x88BC, 1)):  # immutable, and mapped
            get(mapped.buffer.glo, name, ctypes.addressof(value))
            assert value.value == expected


def test_buffers_are_used_again_and_small_ones_replaced(context):
    ring = PixelReadback(context)
    texture, values = _texture(context, 4, "f4")
    out, row = np.empty_like(values), np.empty_like(values[:1])
    first_row = TargetPixels(context.framebuffer([texture]), region=(0, 0, SIZE[0], 1))
    sizes = []
    for source, array in ((first_row, row), (texture, out), (first_row, row), (texture, out)):
        ring.read((source, array))
        sizes.append(ring._free[-1].buffer.size)
        assert len(ring._free) == 1
    assert sizes == [112, 560, 560, 560]
    np.testing.assert_array_equal(out, values)
    np.testing.assert_array_equal(row, values[:1])


def test_discarded_readings_leave_their_arrays(context):
    ring = PixelReadback(context)
    texture, values = _texture(context, 4, "f1")
    out = np.zeros_like(values)
    reading = ring.start((texture, out))
    reading.discard()
    reading.finish()
    assert not out.any()
    ring.read((texture, out))
    np.testing.assert_array_equal(out, values)


def test_errors_of_opengl_are_named(context):
    ring = PixelReadback(context)
    texture, values = _texture(context, 4, "f1")
    gl_function("glEnable", ctypes.c_uint)(0xDEAD)
    debug.take_messages()  # expected
    with pytest.raises(GraphicsError, match=r"^OpenGL failed to draw .*: GL_INVALID_ENUM$"):
        ring.start((texture, values))
    assert not ring._readings
    ring.read((texture, values))


@pytest.mark.parametrize(
    ("status", "words"), [(0x911B, "did not finish within 600 s"), (0x911D, "open a new stage")]
)
def test_a_gpu_that_does_not_finish_is_an_error(context, monkeypatch, status, words):
    ring, waits = PixelReadback(context), []
    texture, values = _texture(context, 4, "f1")
    reading = ring.start((texture, np.zeros_like(values)))

    def wait(*arguments):
        waits.append(arguments)
        return status

    with monkeypatch.context() as patch:
        patch.setattr(context.extra.fences, "_wait", wait)
        with pytest.raises(GraphicsError, match=words) as error:
            reading.finish()
    assert "\n" not in str(error.value)
    assert len(waits) == (functions._MAX_WAIT_STEPS if status == 0x911B else 1)
    reading.finish()


@pytest.mark.parametrize("keeps_passes", [False, True])
def test_fences_are_deleted_at_once_or_when_no_thread_uses_them(context, keeps_passes):
    own = functions.Fences(keeps_passes)
    is_sync = gl_function("glIsSync", ctypes.c_void_p, returns=ctypes.c_ubyte)
    first = own.create()
    own.wait(first)
    own.release(first)
    assert is_sync(first) == keeps_passes
    for _ in range(functions._MAX_FENCES):
        own.release(own.create())
    assert not is_sync(first)
    while own._kept:
        own._delete(own._kept.popleft())


SOURCE = Path(__file__).with_name("late_broadcast.c")
DRAWING = """
import numpy as np
import omnisim
from omnisim.core.poses import pose
from omnisim.rendering import OmniCamera, open_sensor
from omnisim.sensors import SpinningLidar

def motion(time_s):
    return pose((time_s, 0.0, 0.8), yaw_deg=20.0 * time_s)

scene = omnisim.load_scene("soccer")
with open_sensor(scene, SpinningLidar()) as lidar:
    for revolution in range(20):
        lidar.scan(motion, 0.1 * revolution, revolution)
camera = OmniCamera().resized(96)
poses = np.stack([camera.base_pose((0.1 * number, 0.0, 0.0)) for number in range(8)])
with open_sensor(scene, camera) as renderer:
    for one in poses:
        renderer.render(one)
    renderer.render_batch(poses)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_memory_is_sound_where_threads_are_late(tmp_path):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler")
    library = tmp_path / "late_broadcast.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, SOURCE, "-ldl"], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(library), "LP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", DRAWING], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
