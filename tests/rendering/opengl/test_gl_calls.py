"""Calls of OpenGL in a frame: as many for one view as for many, for few objects as for many."""

import ctypes
from contextlib import contextmanager

import numpy as np
import pytest

import omnisim
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl import scene_view
from omnisim.rendering.opengl.gl.functions import gl_function
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.robots.vehicle import Vehicle
from omnisim.scene.light.environment import Environment
from omnisim.scene.model import AlphaMode, Lighting, Material
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from tests.cameras.optics.examples import SYSTEMS
from tests.rendering.opengl.gl_calls import GlCalls
from tests.rendering.opengl.sheets import sheet
from tests.scenes import room, scene_of
from tests.vehicles import mounted_on_p2at, p2at_body

pytestmark = pytest.mark.usefixtures("needs_opengl")

CAMERA = OmniCamera().resized(60).with_quality("fast")
SUBMISSIONS = (
    "glDispatchCompute", "glDispatchComputeIndirect", "glMultiDrawElementsIndirectCountARB",
    "glDrawArraysInstanced", "glDrawElementsInstanced", "glMultiDrawElementsIndirect",
)  # fmt: skip
# In the built-in scenes: state, draws, dispatches; lamps that shine bind the tables of materials.
MAX_CALLS, MAX_SUBMISSIONS = 185, 45
MAX_SCAN_CALLS, MAX_OPTICS_CALLS = 60, 250
MAX_CALLS_WITH_BODY, MAX_SUBMISSIONS_WITH_BODY = 230, 55  # which has materials of its own


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
    "name",
    ["soccer", *(pytest.param(name, marks=pytest.mark.slow) for name in ("mapping", "courtyard"))],
)
def test_calls_of_a_frame_are_few_and_those_of_a_batch_as_many(name, monkeypatch):
    calls = GlCalls(monkeypatch)
    # the courtyard's sun has maps that follow the viewpoint, and are drawn for each image
    sky = "none" if name == "courtyard" else None
    with open_sensor(omnisim.load_scene(name, sky=sky), CAMERA) as renderer:
        frame, *batches = _frame(calls, renderer)
    assert batches[0] == batches[1] == batches[2]
    for made in (frame, batches[0]):
        assert 0 < sum(made.values()) <= MAX_CALLS
        assert sum(made[one] for one in SUBMISSIONS) <= MAX_SUBMISSIONS


def test_calls_of_a_drive_are_few_and_batches_are_drawn_together(monkeypatch):
    """The glass around the robot's camera shows nothing to it, and is not drawn."""
    calls = GlCalls(monkeypatch)
    camera = mounted_on_p2at(60)[0].with_quality("fast")
    scene = omnisim.load_scene("soccer")
    with open_sensor(scene, camera, body=p2at_body()) as renderer:
        frame, *batches = _frame(calls, renderer)
    assert batches[0] == batches[1] == batches[2]
    for made in (frame, batches[0]):
        assert 0 < sum(made.values()) <= MAX_CALLS_WITH_BODY
        assert sum(made[one] for one in SUBMISSIONS) <= MAX_SUBMISSIONS_WITH_BODY


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


def test_calls_of_a_scan_do_not_depend_on_the_number_of_objects(monkeypatch):
    calls = GlCalls(monkeypatch)
    fence = Material(base_color=(1.0, 1.0, 1.0, 0.7), alpha_mode=AlphaMode.MASK)
    made = []
    for count in (2, 40):
        meshes = [sheet(f"sheet {number}", number % 2, seed=number) for number in range(count)]
        poses = [pose((0.2 * number, 1.0, 0.0), roll_deg=90.0) for number in range(count)]
        scene = scene_of(meshes, [Material(), fence], poses)
        with open_sensor(scene, LaserScanner().without_errors()) as renderer:
            assert np.isfinite(renderer.scan(pose()).ranges_m).any()
            made.append(calls.of(lambda: renderer.scan(pose())))
    assert made[0] == made[1]
    assert made[0]["glDispatchCompute"] == 2
    assert sum(made[0].values()) <= MAX_SCAN_CALLS


def test_calls_do_not_depend_on_the_number_of_objects(monkeypatch):
    calls = GlCalls(monkeypatch)
    made = []
    for count in (2, 40):
        meshes = [sheet(f"sheet {number}", 0, seed=number) for number in range(count)]
        poses = [pose((0.2 * number, 1.0, 0.0)) for number in range(count)]
        with open_sensor(scene_of(meshes, [Material()], poses), CAMERA) as renderer:
            made.append(_frame(calls, renderer))
    assert made[0] == made[1]


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
