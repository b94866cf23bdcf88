"""Forked processes: OpenGL's threads are not in them, and they say so instead of waiting."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")

HEAD = """
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


def run(code):
    """Run code in a process of its own, which must end by itself."""
    command = [sys.executable, "-c", HEAD + code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.usefixtures("needs_opengl")
def test_a_forked_process_says_that_it_cannot_render():
    """At once, and so that its parent can render on."""
    run(
        "renderer = open_sensor(scene, camera)\n"
        "before = render(renderer).rgba\n"
        f"for task in {IN_CHILDREN!r}:\n"
        "    child = os.fork()\n"
        "    if child == 0:\n        exec(task)\n        sys.exit()\n"
        "    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, task\n"
        "    assert (render(renderer).rgba == before).all(), task\n"
        "renderer.close()\n"
    )


@pytest.mark.usefixtures("needs_opengl")
def test_a_process_that_was_forked_before_it_rendered_can_render():
    """As each worker of a data loader does that opens a renderer of its own."""
    run(
        "def work(number):\n"
        "    with open_sensor(scene, camera) as renderer:\n"
        "        return render(renderer).rgba.mean()\n"
        "with multiprocessing.get_context('fork').Pool(2) as pool:\n"
        "    first, second = pool.map(work, range(2))\n"
        "assert first == second\n"
    )
