"""Buffers and textures outlive the vertex arrays and framebuffers that use them.

OpenGL keeps deleted buffers alive while a vertex array uses them. A driver that does not reads
memory that is gone: an NVIDIA GPU stops for 15 seconds in each frame, or draws garbage.
"""

import ctypes

import pytest

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.context import collect_garbage
from omnisim.rendering.opengl.gl.functions import gl_function
from omnisim.rendering.stage import Stage
from tests.drivers.cases import poses_in
from tests.rendering.opengl.sheets import SUN
from tests.rendering.opengl.surfaces.test_blended_drawer import _scene as scene_of_panes

pytestmark = pytest.mark.usefixtures("needs_opengl")

ENUM, BOOLEAN, POINTER = ctypes.c_uint, ctypes.c_ubyte, ctypes.c_void_p
MAX_NAMES, ATTRIBUTES = 300, 16
BUFFER_OF_ATTRIBUTE, BUFFER_OF_INDICES = 0x889F, 0x8895
KIND_OF_ATTACHMENT, NAME_OF_ATTACHMENT = 0x8CD0, 0x8CD1
TEXTURE, RENDERBUFFER = 0x1702, 0x8D41
ATTACHMENTS = (0x8CE0, 0x8CE1, 0x8CE2, 0x8D00)  # three colors, and depth


def _is(kind, name):
    return bool(gl_function(f"glIs{kind}", ENUM, returns=BOOLEAN)(name))


def _asked(function, *arguments):
    value = ctypes.c_int()
    ask = gl_function(function, *(ENUM for _ in arguments), POINTER)
    ask(*arguments, ctypes.addressof(value))
    return value.value


def _named(kind):
    return [name for name in range(1, MAX_NAMES) if _is(kind, name)]


def _buffers_of_arrays():
    """Vertex array and buffer, of all vertex arrays of the current context."""
    bind = gl_function("glBindVertexArray", ENUM)
    used = []
    for array in _named("VertexArray"):
        used.append((array, _asked("glGetVertexArrayiv", array, BUFFER_OF_INDICES)))
        bind(array)
        for attribute in range(ATTRIBUTES):
            used.append((array, _asked("glGetVertexAttribiv", attribute, BUFFER_OF_ATTRIBUTE)))
    bind(0)
    return [(array, buffer) for array, buffer in used if buffer]


def _images_of_targets():
    """Framebuffer, kind and name of all attachments of the current context."""
    ask = "glGetNamedFramebufferAttachmentParameteriv"
    for target in _named("Framebuffer"):
        for attachment in ATTACHMENTS:
            kind = _asked(ask, target, attachment, KIND_OF_ATTACHMENT)
            if kind in (TEXTURE, RENDERBUFFER):
                name = "Texture" if kind == TEXTURE else "Renderbuffer"
                yield target, name, _asked(ask, target, attachment, NAME_OF_ATTACHMENT)


@pytest.mark.parametrize("polygons", ["auto", None])
def test_nothing_that_is_drawn_with_is_deleted(polygons):
    scene = scene_of_panes(SUN)
    poses = poses_in(scene, 2)
    camera = OmniCamera(polygons=polygons).resized(48).with_quality("fast")
    with Stage(scene) as stage, stage.open(camera) as renderer:
        assert renderer._passes.cube._view.blended_drawer is not None
        renderer.render(poses[0], also=("range", "instance"))
        renderer.render_batch(poses)
        with stage.current():
            collect_garbage(stage.context)
            buffers, images = _buffers_of_arrays(), list(_images_of_targets())
            assert len(buffers) > ATTRIBUTES
            assert [one for one in buffers if not _is("Buffer", one[1])] == []
            assert images
            assert [one for one in images if not _is(*one[1:])] == []
