"""Stages and renderers that are dropped and not closed: they warn, and their memory is freed."""

import gc
import threading
from contextlib import ExitStack

import pytest

from omnisim import OmniCamera, Stage, open_sensor
from omnisim.rendering.opengl.gl.context import _MAX_IDLE as MAX_IDLE
from tests.scenes import room, scene_of

pytestmark = pytest.mark.usefixtures("needs_opengl")

CAMERA = OmniCamera(polygons=None).resized(24)


def render(renderer):
    return renderer.render(renderer.camera.base_pose((0.0, 0.0, 0.0))).rgba


def drop(held):
    held.clear()
    gc.collect()


def test_a_dropped_renderer_warns_and_a_closed_one_does_not():
    held = [open_sensor(scene_of([room()]), CAMERA)]
    with pytest.warns(ResourceWarning, match="unclosed") as caught:
        drop(held)
    assert caught[0].filename == __file__
    open_sensor(scene_of([room()]), CAMERA).close()  # a warning is an error in tests
    gc.collect()


def test_dropped_beside_another_renderer():
    with open_sensor(scene_of([room()]), CAMERA) as renderer:
        before = render(renderer)
        held = [open_sensor(scene_of([room()]), CAMERA)]
        render(held[0])
        with renderer._stage.current():
            with pytest.warns(ResourceWarning, match="unclosed"):
                drop(held)
            assert renderer._stage.context.error == "GL_NO_ERROR"
        assert (render(renderer) == before).all()


def test_renderers_dropped_from_a_shared_stage_are_freed_by_its_next_frame():
    with Stage(scene_of([room()])) as stage, stage.open(CAMERA) as kept:
        before = render(kept)
        held = [stage.open(CAMERA)]
        render(held[0])
        drop(held)
        garbage = set(stage.context.objects)
        assert garbage
        assert (render(kept) == before).all()
        assert not garbage & set(stage.context.objects)


def test_garbage_of_another_thread_is_released_by_its_own():
    held = [open_sensor(scene_of([room()]), CAMERA)]
    render(held[0])
    context = held[0]._stage.context
    with pytest.warns(ResourceWarning, match="unclosed"):
        run_in_a_thread(lambda: drop(held))
    with ExitStack() as stack:  # other tests' contexts may wait before it
        others = [
            stack.enter_context(open_sensor(scene_of([room()]), CAMERA)) for _ in range(MAX_IDLE)
        ]
        (again,) = (one for one in others if one._stage.context is context)  # emptied
        render(again)


def test_garbage_of_a_thread_that_has_ended_is_released_at_once():
    held = []
    run_in_a_thread(lambda: held.append(open_sensor(scene_of([room()]), CAMERA)))
    context = held[0]._stage.context
    with pytest.warns(ResourceWarning, match="unclosed"):
        drop(held)
    assert not is_open(context)


def run_in_a_thread(task):
    thread = threading.Thread(target=task)
    thread.start()
    thread.join()


def is_open(context):
    return type(context.mglo).__name__ != "InvalidObject"
