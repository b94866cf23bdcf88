"""Batches for CUDA: refused without it, and packed into one buffer, which a stand-in takes."""

import sys
import types

import numpy as np
import pytest

from omnisim.errors import GraphicsError, OmnisimError
from omnisim.gpu import cuda_buffer
from omnisim.sensors import OmniCamera, Renderer, Stage
from tests.gpu.sheets import mixed_scene

pytestmark = pytest.mark.usefixtures("needs_opengl")

CAMERA = OmniCamera().resized(33).with_quality("fast")  # rows of no multiple of four bytes


@pytest.fixture(scope="module")
def stage():
    with Stage(mixed_scene()) as stage:
        yield stage


class _Resource:
    """Registered buffer, which notes what is done with it."""

    def __init__(self):
        self.done = []

    def map(self, *, stream):
        self.done.append("map")
        return types.SimpleNamespace(handle=4096)

    def unmap(self, *, stream):
        self.done.append("unmap")

    def close(self):
        self.done.append("close")


@pytest.fixture
def resource(monkeypatch):
    """Stand-in of CUDA, as `cuda.core` is documented."""
    resource = _Resource()
    stream = types.SimpleNamespace(sync=lambda: resource.done.append("sync"))
    device = types.SimpleNamespace(set_current=lambda: None, create_stream=lambda: stream)
    core = types.ModuleType("cuda.core")
    core.Device = lambda number: device
    core.GraphicsResource = types.SimpleNamespace(from_gl_buffer=lambda buffer: resource)
    monkeypatch.setitem(sys.modules, "cuda", types.ModuleType("cuda"))
    monkeypatch.setitem(sys.modules, "cuda.core", core)
    monkeypatch.setattr(cuda_buffer, "check_cuda", lambda context: None)
    return resource


def _poses(count):
    return np.stack([CAMERA.base_pose((0.2 * k, 0.0, 0.8), 30.0 * k) for k in range(count)])


def test_pictures_are_packed_into_the_buffer(stage, resource, monkeypatch):
    with Renderer(stage, CAMERA) as renderer:
        expected = renderer.render_batch(_poses(5))
        monkeypatch.setattr(renderer._passes.batches, "slice_length", 2)
        with renderer.cuda_batch(5) as batch:
            for poses, pictures in ((_poses(5), expected), (_poses(5)[::-1], expected[::-1])):
                taken = batch.render(poses)
                assert taken.__cuda_array_interface__ == {
                    "shape": (5, 33, 33, 3), "typestr": "|u1", "data": (4096, False), "version": 3,
                }  # fmt: skip
                with stage.current():
                    content = np.frombuffer(taken.buffer.read(), np.uint8)
                np.testing.assert_array_equal(content.reshape(expected.shape), pictures)
    assert resource.done == ["map", "sync", "unmap", "map", "sync", "close"]


def test_refuses_what_cannot_be(stage, resource):
    with Renderer(stage, CAMERA) as renderer:
        batch = renderer.cuda_batch(2)
        with pytest.raises(GraphicsError, match="states: expected 2, got 3"):
            batch.render(_poses(3))
        with pytest.raises(GraphicsError, match="expected a finished batch, got none"):
            _ = batch._buffer.__cuda_array_interface__
        batch.close()
        batch.close()
        with pytest.raises(GraphicsError, match="this batch is closed"):
            batch.render(_poses(2))


def test_refuses_other_drivers_than_nvidias(stage):
    with stage.current():
        vendor = stage.context.info["GL_VENDOR"]
    if "NVIDIA" in vendor:
        pytest.skip("this machine has a GPU of NVIDIA")
    with Renderer(stage, CAMERA) as renderer, pytest.raises(GraphicsError) as error:
        renderer.cuda_batch(2)
    assert str(error.value) == f"pictures in CUDA's memory: expected OpenGL of NVIDIA, got {vendor}"


def test_names_the_extra_that_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "cuda", None)
    context = types.SimpleNamespace(info={"GL_VENDOR": "NVIDIA Corporation"})
    with pytest.raises(OmnisimError, match=r"needs cuda-bindings and cuda-core: pip install 'omni"):
        cuda_buffer.check_cuda(context)
