"""Calls of OpenGL in a frame, as many for few objects as for many, and objects that are kept."""

import ctypes
from contextlib import contextmanager

import numpy as np
import pytest

import omnisim
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl import scene_view
from omnisim.rendering.opengl.gl.context import collect_garbage
from omnisim.rendering.opengl.gl.functions import gl_function
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.robots.vehicle import Vehicle
from omnisim.scene.light.environment import Environment
from omnisim.scene.model import AlphaMode, Lighting, Material
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from tests.cameras.optics.examples import SYSTEMS
from tests.drivers.cases import poses_in
from tests.rendering.opengl.gl_calls import GlCalls
from tests.rendering.opengl.sheets import SUN, sheet
from tests.rendering.opengl.surfaces.test_blended_drawer import _scene as scene_of_panes
from tests.scenes import room, scene_of
from tests.vehicles import mounted_on_p2at, p2at_body

pytestmark = pytest.mark.usefixtures("needs_opengl")

CAMERA = OmniCamera().resized(60).with_quality("fast")
SUBMISSIONS = (
    "glDispatchCompute", "glDispatchComputeIndirect", "glMultiDrawElementsIndirectCountARB",
    "glDrawArraysInstanced", "glDrawElementsInstanced", "glMultiDrawElementsIndirect",
)  # fmt: skip
MAX_SCAN_CALLS, MAX_OPTICS_CALLS = 60, 250


def _poses(count):
    return np.stack([CAMERA.base_pose((0.1 * number, 0.0, 1.0)) for number in range(count)])


def _frame(calls, renderer):
    """Calls of a frame, and of batches of 1, 3 and 9 images."""
    poses = _poses(9)
    runs = [lambda: renderer.render(poses[0])]
    runs += [lambda some=poses[:count]: renderer.render_batch(some) for count in (1, 3, 9)]
    counted = []
    for run in runs:
        run()  # programs are compiled, buffers made
        run()
        counted.append(calls.of(run))
    return counted


@pytest.mark.parametrize(
    ("has_body", "most_calls", "most_submissions"), [(False, 185, 45), (True, 230, 55)]
)
def test_calls_of_a_frame_are_few_and_those_of_a_batch_as_many(
    has_body, most_calls, most_submissions, monkeypatch
):
    """A body has materials of its own; the glass around the robot's camera shows it nothing."""
    calls = GlCalls(monkeypatch)
    camera = mounted_on_p2at(60)[0].with_quality("fast") if has_body else CAMERA
    body = p2at_body() if has_body else None
    with open_sensor(omnisim.load_scene("soccer"), camera, body=body) as renderer:
        frame, *batches = _frame(calls, renderer)
    assert batches[0] == batches[1] == batches[2]
    for made in (frame, batches[0]):
        assert 0 < sum(made.values()) <= most_calls
        assert sum(made[submission] for submission in SUBMISSIONS) <= most_submissions


def test_calls_do_not_depend_on_the_number_of_tiles(monkeypatch):
    """With a sky behind the scene."""
    calls = GlCalls(monkeypatch)
    sky = Environment(np.full((8, 16, 3), 0.5, dtype=np.float32))
    lighting = Lighting((0.1, 0.1, 0.1), (), environment=sky)
    scene = scene_of([sheet("sheet", 0, seed=1)], lighting=lighting)
    tiles, made = [], []
    for size_px in (60, 140):  # with one mip level each
        camera = CAMERA.resized(size_px).with_quality("fine")
        with open_sensor(scene, camera, unlit=True) as renderer:
            tiles.append(len(renderer._passes.cube.plan.tiles))
            renderer.render(_poses(1)[0])
            made.append(calls.of(lambda: renderer.render(_poses(1)[0])))
    assert tiles[0] < tiles[1]
    assert made[0] == made[1]


def test_a_frame_of_optics_keeps_its_depth_on_the_gpu(monkeypatch):
    """Only undecided samples and the image come to the processor."""
    calls = GlCalls(monkeypatch)
    with open_sensor(scene_of([room()]), OmniCamera.of(SYSTEMS["sphere"].scaled(0.1))) as renderer:
        renderer.render(pose())
        made = calls.of(lambda: renderer.render(pose()))
    assert made["glCopyImageSubData"] == 1
    assert made["glReadPixels"] <= 3
    assert made["glTexSubImage2D"] <= 2
    assert sum(made.values()) <= MAX_OPTICS_CALLS


def test_calls_do_not_depend_on_the_number_of_objects(monkeypatch):
    calls = GlCalls(monkeypatch)
    fence = Material(base_color=(1.0, 1.0, 1.0, 0.7), alpha_mode=AlphaMode.MASK)
    scans, frames = [], []
    for count in (2, 40):
        meshes = [sheet(f"sheet {number}", number % 2, seed=number) for number in range(count)]
        poses = [pose((0.2 * number, 1.0, 0.0), roll_deg=90.0) for number in range(count)]
        scene = scene_of(meshes, [Material(), fence], poses)
        with open_sensor(scene, LaserScanner().without_errors()) as renderer:
            assert np.isfinite(renderer.scan(pose()).ranges_m).any()
            scans.append(calls.of(lambda: renderer.scan(pose())))
        with open_sensor(scene, CAMERA) as renderer:
            frames.append(_frame(calls, renderer))
    assert scans[0] == scans[1]
    assert scans[0]["glDispatchCompute"] == 2
    assert sum(scans[0].values()) <= MAX_SCAN_CALLS
    assert frames[0] == frames[1]


@pytest.mark.parametrize("kind", ["image", "batch", "scan"])
def test_a_second_frame_moves_no_buffer(kind, monkeypatch):
    """Drivers may move buffers that are allocated anew or mapped."""
    calls = GlCalls(monkeypatch)
    vehicle = Vehicle.load("p2at")
    sensor = LaserScanner() if kind == "scan" else CAMERA
    with Stage(omnisim.load_scene("soccer"), vehicle.body) as stage, stage.open(sensor) as opened:
        take = {
            "image": lambda pose: opened.render(pose),
            "batch": lambda pose: opened.render_batch(np.stack([pose] * 3)),
            "scan": lambda pose: opened.scan(pose),
        }[kind]
        for pose_of_base in _poses(2):
            take(pose_of_base)
        made = calls.of(lambda: take(_poses(3)[2]))
    moving = ("BufferData", "BufferStorage", "MapBuffer", "MapBufferRange", "MapNamedBufferRange")
    assert made
    assert not [name for name in made if name.endswith(moving)]


def test_depth_is_sampled_while_another_target_is_bound(monkeypatch):
    """Otherwise OpenGL leaves undefined what is sampled."""
    bound, sampled = [], []
    plain = GlState.sampling

    @contextmanager
    def watched(self, unit, attached, target):
        with plain(self, unit, attached, target):
            sampled.append((_integer(0x8CA6), target.glo, target.ctx.extra.lasting_target.glo))
            yield
        bound.append((_integer(0x8CA6), target.glo))

    monkeypatch.setattr(GlState, "sampling", watched)
    monkeypatch.setattr(scene_view, "MIN_TRIANGLES_OF_PASSES", (0,))  # two passes
    with open_sensor(omnisim.load_scene("soccer"), CAMERA) as renderer:
        renderer.render(_poses(1)[0])
        renderer.render_batch(_poses(2))
    assert sampled
    assert all(now == lasting != target for now, target, lasting in sampled)
    assert all(now == target for now, target in bound)


def _integer(name):
    value = ctypes.c_int()
    gl_function("glGetIntegerv", ctypes.c_uint, ctypes.c_void_p)(name, ctypes.addressof(value))
    return value.value


_ENUM, BOOLEAN, POINTER = ctypes.c_uint, ctypes.c_ubyte, ctypes.c_void_p
MAX_NAMES, ATTRIBUTES = 300, 16
BUFFER_OF_ATTRIBUTE, BUFFER_OF_INDICES = 0x889F, 0x8895
KIND_OF_ATTACHMENT, NAME_OF_ATTACHMENT = 0x8CD0, 0x8CD1
TEXTURE, RENDERBUFFER = 0x1702, 0x8D41
ATTACHMENTS = (0x8CE0, 0x8CE1, 0x8CE2, 0x8D00)  # three colors, and depth


def _is(kind, name):
    return bool(gl_function(f"glIs{kind}", _ENUM, returns=BOOLEAN)(name))


def _asked(function, *arguments):
    value = ctypes.c_int()
    ask = gl_function(function, *(_ENUM for _ in arguments), POINTER)
    ask(*arguments, ctypes.addressof(value))
    return value.value


def _named(kind):
    return [name for name in range(1, MAX_NAMES) if _is(kind, name)]


def _buffers_of_arrays():
    """Vertex array and buffer, of all vertex arrays of the current context."""
    bind = gl_function("glBindVertexArray", _ENUM)
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
    """Buffers and textures outlive the vertex arrays and framebuffers that use them.

    OpenGL keeps deleted buffers alive while a vertex array uses them. A driver that does not reads
    memory that is gone: an NVIDIA GPU stops for 15 seconds in each frame, or draws garbage.
    """
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
            assert [buffer for buffer in buffers if not _is("Buffer", buffer[1])] == []
            assert images
            assert [image for image in images if not _is(*image[1:])] == []
