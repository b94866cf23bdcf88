"""Stages and renderers that are dropped and not closed, or inherited by forked processes."""

import gc
import subprocess
import sys
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
        (again,) = (other for other in others if other._stage.context is context)  # emptied
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


FORKED = """
import multiprocessing, os, sys
from omnisim import LaserScanner, OmniCamera, open_sensor
from omnisim.core.errors import GraphicsError
from tests.scenes import room, scene_of

scene, camera = scene_of([room()]), OmniCamera(polygons=None).resized(24)

def render(renderer):
    return renderer.render(renderer.camera.base_pose((0.0, 0.0, 0.0)))

def expect_error(task):
    try:
        task()
    except GraphicsError as reason:
        assert "'spawn'" in str(reason), reason
    else:
        sys.exit("no error")
"""
IN_CHILDREN = (
    "expect_error(lambda: render(renderer))",  # which it has inherited
    "expect_error(lambda: open_sensor(scene, camera))",
    "renderer.close(); expect_error(lambda: open_sensor(scene, LaserScanner()))",
    "del renderer",
    "pass",
)


def run_code(code):
    """Run code in a process of its own, which must end by itself."""
    command = [sys.executable, "-c", FORKED + code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr


def test_a_forked_process_says_that_it_cannot_render():
    """At once, and so that its parent can render on."""
    run_code(
        "renderer = open_sensor(scene, camera)\n"
        "before = render(renderer).rgba\n"
        f"for task in {IN_CHILDREN!r}:\n"
        "    child = os.fork()\n"
        "    if child == 0:\n        exec(task)\n        sys.exit()\n"
        "    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, task\n"
        "    assert (render(renderer).rgba == before).all(), task\n"
        "renderer.close()\n"
    )


def test_a_process_that_was_forked_before_it_rendered_can_render():
    """As each worker of a data loader does that opens a renderer of its own."""
    run_code(
        "def work(number):\n"
        "    with open_sensor(scene, camera) as renderer:\n"
        "        return render(renderer).rgba.mean()\n"
        "with multiprocessing.get_context('fork').Pool(2) as pool:\n"
        "    first, second = pool.map(work, range(2))\n"
        "assert first == second\n"
    )
