"""Fixtures for all tests; every floating-point error in NumPy is a failure."""

import gc
import os
from functools import cache

# Before pyrender, an oracle, is imported: no display, and none of X11's libraries either.
os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
os.environ.setdefault("PYGLET_HEADLESS", "1")
# Before NumPy is: its threads would wait for each other, and for those of the other process.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl import debug
from omnisim.rendering.opengl.gl.context import open_context, release_context
from omnisim.rendering.opengl.shadows import shadow_plan
from tests.read_once import cluster_triangles_once, make_mipmaps_once, read_built_in_scenes_once


def pytest_collection_finish():
    """Leave all that is imported by now out of each later collection of garbage."""
    gc.collect()
    gc.freeze()


def pytest_sessionfinish():
    gc.unfreeze()


@pytest.fixture(scope="session", autouse=True)
def _numpy_errors_are_failures():
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        yield


@pytest.fixture(scope="session", autouse=True)
def _scenes_are_made_once():
    with pytest.MonkeyPatch.context() as monkeypatch:
        read_built_in_scenes_once(monkeypatch)
        make_mipmaps_once(monkeypatch)
        cluster_triangles_once(monkeypatch)
        yield


@pytest.fixture(autouse=True)
def _opengl_reports_nothing():
    """With OMNISIM_GL_DEBUG=1, what OpenGL reports is a failure."""
    yield
    assert debug.take_messages() == []


@pytest.fixture
def context():
    """An OpenGL context that must be free of errors when the test is done with it."""
    context = open_context_or_skip()
    assert context.error == "GL_NO_ERROR"
    yield context
    assert context.error == "GL_NO_ERROR"
    context.__exit__(None, None, None)  # other libraries' calls would otherwise reach it
    context.release()


@pytest.fixture
def needs_opengl():
    """For tests that open their own context."""
    if reason := _no_opengl():
        pytest.skip(reason)


@pytest.fixture(scope="module")
def coarse_shadows():
    """Shadow maps of a sixteenth of the texels, for tests whose images all have the same maps."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(shadow_plan, "_MAX_TEXELS", shadow_plan._MAX_TEXELS // 16)
        yield


def open_context_or_skip():
    if reason := _no_opengl():
        pytest.skip(reason)
    return open_context()


@cache
def _no_opengl():
    """The reason why OpenGL cannot be opened, or "": asked once per process."""
    try:
        release_context(open_context())
    except GraphicsError as reason:
        if os.environ.get("CI"):
            raise  # CI must have OpenGL
        return str(reason)
    return ""
