"""Frames in progress: those of `render`, whatever happens until they are waited for."""

import dataclasses

import numpy as np
import pytest

from omnisim import Stage, open_sensor
from omnisim.core.errors import GraphicsError
from omnisim.rendering.camera.degradations import Degradation, Exposure, Noise
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback
from tests.rendering.opengl.sheets import mixed_scene

CAMERA = OmniCamera().resized(40).with_quality("fast")
METERED = dataclasses.replace(
    CAMERA, degradation=Degradation(exposure=Exposure(auto=True), noise=Noise())
)
NAMES = ("range", "instance")


def _poses(count):
    return [CAMERA.base_pose((0.3 * number, 0.2, 0.8), 30.0 * number) for number in range(count)]


def assert_same(pending, frame):
    made = pending.result()
    assert pending.result() is made
    np.testing.assert_array_equal(made.rgba, frame.rgba)
    np.testing.assert_array_equal(made.linear, frame.linear)
    assert made.metadata == frame.metadata
    assert list(made.metadata) == list(frame.metadata)
    assert list(made.channels) == list(frame.channels)
    for name, values in frame.channels.items():
        np.testing.assert_array_equal(made.channels[name], values)


@pytest.fixture(params=["cube", "rays"])
def renderer(request):
    request.getfixturevalue("needs_opengl")
    with open_sensor(mixed_scene(), CAMERA, backend=request.param) as renderer:
        yield renderer


def test_frames_are_those_of_render_in_any_order(renderer):
    """Five are in progress: two have to end before they are waited for."""
    poses = _poses(5)
    options = [{}, {"linear": True}, {"also": NAMES}, {}, {"also": NAMES, "linear": True}]
    frames = [renderer.render(pose, **more) for pose, more in zip(poses, options, strict=True)]
    pending = [renderer.submit(pose, **more) for pose, more in zip(poses, options, strict=True)]
    for number in (3, 0, 4, 1, 2):
        assert_same(pending[number], frames[number])


def test_frames_and_batches_are_in_progress_together(renderer):
    poses = _poses(3)
    frame, images = renderer.render(poses[0]), renderer.render_batch(np.stack(poses))
    pending = [renderer.submit(poses[0]), renderer.begin_batch(np.stack(poses))]
    pending += [renderer.submit(poses[0]), renderer.begin_batch(np.stack(poses))]
    for one in (0, 2):
        assert_same(pending[one], frame)
    for one in (3, 1):
        np.testing.assert_array_equal(pending[one].result()["rgb"], images)


def test_a_closed_renderer_has_no_results(renderer):
    finished, unread = renderer.submit(_poses(1)[0]), renderer.submit(_poses(1)[0])
    frame = finished.result()
    renderer.close()
    with pytest.raises(GraphicsError, match="renderer is closed"):
        unread.result()
    assert finished.result() is frame


def test_an_edit_after_the_submission_changes_nothing(renderer):
    pose, scene = _poses(1)[0], renderer.scene
    before = renderer.render(pose, also=NAMES)
    pending = renderer.submit(pose, also=NAMES)
    renderer.scene = dataclasses.replace(scene, instances=scene.instances[::2])
    after = renderer.submit(pose, also=NAMES)
    assert_same(pending, before)
    assert_same(after, renderer.render(pose, also=NAMES))
    assert (after.result().rgba != before.rgba).any()


@pytest.mark.parametrize("backend", ["cube", "rays"])
@pytest.mark.usefixtures("needs_opengl")
def test_degraded_frames_in_progress(backend):
    with open_sensor(mixed_scene(), METERED, backend=backend) as renderer:
        poses = _poses(3)
        exposures = [None, 0.5, -0.5]
        frames, pending = (
            [
                make(pose, frame_number=number, exposure_ev=ev)
                for number, (pose, ev) in enumerate(zip(poses, exposures, strict=True))
            ]
            for make in (renderer.render, renderer.submit)
        )
        for one, frame in zip(pending, frames, strict=True):
            assert_same(one, frame)


@pytest.mark.usefixtures("needs_opengl")
def test_a_given_exposure_needs_no_readback_within_the_frame(monkeypatch):
    """Its luminance is reported all the same: the one that an auto-exposed image follows."""
    reads = []
    start = PixelReadback.start

    def counted(readback, *sources):
        reads.append(len(sources))
        return start(readback, *sources)

    with open_sensor(mixed_scene(), METERED) as renderer:
        pose = _poses(1)[0]
        renderer.render(pose)
        monkeypatch.setattr(PixelReadback, "start", counted)
        auto = renderer.render(pose).metadata["degradation"]["exposure"]
        given = renderer.render(pose, exposure_ev=1.0).metadata["degradation"]["exposure"]
    assert reads == [1, 1, 2]
    assert auto["ev"] == auto["metered_ev"] == given["metered_ev"]
    assert given["ev"] == 1.0


@pytest.mark.usefixtures("needs_opengl")
def test_frames_of_several_renderers_are_in_progress_together():
    with Stage(mixed_scene()) as stage:
        renderers = [stage.open(CAMERA), stage.open(CAMERA.resized(52))]
        pose = _poses(1)[0]
        pending = [one.submit(pose) for one in (*renderers, *renderers)]
        for one, renderer in zip(pending, (*renderers, *renderers), strict=True):
            assert_same(one, renderer.render(pose))
