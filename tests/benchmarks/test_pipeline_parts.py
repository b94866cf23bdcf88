"""A frame taken apart: the same image, nothing left changed, and counts that hold together."""

import moderngl
import numpy as np
import pytest

from benchmarks.pipeline_parts import RepeatedFrame
from omnisim import OmniCamera, open_sensor
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback
from omnisim.scene import load_scene


@pytest.fixture
def frame(needs_opengl):
    scene = load_scene("rings")
    camera = OmniCamera(supersampling=1, texels_per_pixel=1.0).resized(64)
    with open_sensor(scene, camera) as renderer:
        yield RepeatedFrame(renderer, camera.base_pose(scene.start.position_m))


def test_a_frame_in_parts_is_the_frame(frame, monkeypatch):
    before = (PixelReadback.start, moderngl.VertexArray.render)
    image = frame.render()
    images = []
    render = frame.render
    monkeypatch.setattr(frame, "render", lambda: images.append(render()))
    parts = frame.parts()
    assert np.array_equal(images[0], image)
    assert min(parts) > 0.0
    assert parts.whole == pytest.approx(sum(parts))
    assert (PixelReadback.start, moderngl.VertexArray.render) == before
    assert "render" not in vars(frame.renderer._passes.cube)


def test_a_failure_leaves_nothing_changed(frame, monkeypatch):
    def fails():
        raise RuntimeError

    before = PixelReadback.start
    monkeypatch.setattr(frame, "render", fails)
    with pytest.raises(RuntimeError):
        frame.parts()
    assert PixelReadback.start is before
    assert "render" not in vars(frame.renderer._passes.cube)


def test_counts_are_the_same_each_time(frame):
    counts = frame.count()
    assert counts == frame.count()
    assert counts.draws >= counts.calls > 2  # clusters, near and far, and the image
    faces = counts.virtual_cameras
    assert faces.samples > 0
    if faces.triangles_inside is not None:
        assert 0 < faces.triangles_inside <= faces.triangles + 6 * 64  # clipping may cut one in two
