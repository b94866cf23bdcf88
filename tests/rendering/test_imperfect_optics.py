"""Optical systems as imperfect cameras in worlds that move, by both back ends."""

import dataclasses
import itertools

import numpy as np
import pytest

from omnisim import OmniCamera, Stage, open_sensor
from omnisim.cameras.optics import OpticalSystem, Surface
from omnisim.cameras.optics.shapes import Conic
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.camera.degradations import Degradation, Shutter, preset
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.twist import Twist, moved_px
from omnisim.scene.model import DynamicObject, Material
from omnisim.scene.motion.object_motion import Orbit
from omnisim.validation.image_differences import psnr_db, psnr_of_levels_db
from tests.cameras.optics.examples import SYSTEMS, at, pinhole
from tests.rendering.frames import BACKENDS, assert_batch_is_frames, each_backend
from tests.scenes import room, scene_of
from tests.vehicles import box

pytestmark = pytest.mark.usefixtures("needs_opengl", "embree")
NOW = pose((0.4, -0.3, 0.1), roll_deg=2.0, pitch_deg=-4.0, yaw_deg=30.0)
BALL = OpticalSystem(pinhole(550.0), (Surface(Conic(0.06), at(0.2), 0.057),)).scaled(0.25)
PORT = SYSTEMS["port"].scaled(0.25)
each_system = pytest.mark.parametrize(
    "system", [BALL, pytest.param(PORT, marks=pytest.mark.slow)], ids=["ball", "port"]
)


@pytest.fixture
def embree():
    """Skip without the ray caster."""
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")


def _sensor(system, degradation, **options):
    options = {"supersampling": 2} | options
    return OmniCamera(system, degradation=degradation, near_m=0.02, **options)


def _world():
    """A room with boxes of all colors, and one that circles among them."""
    colors = (0.85, 0.85, 0.85), (0.7, 0.1, 0.05), (0.05, 0.1, 0.7), (0.9, 0.8, 0.1)
    materials = [Material(base_color=(*color, 1.0), double_sided=True) for color in colors]
    circling = scene_of([box("box", 3, half_m=0.25)], materials)
    around = np.radians(np.arange(0.0, 360.0, 40.0))
    places = [pose((0.4 + np.cos(a), -0.3 + np.sin(a), 0.5 * np.sin(3.0 * a))) for a in around]
    boxes = [box("box", 1 + k % 2, half_m=0.15) for k in range(len(places))]
    still = scene_of([room(), *boxes], materials, [np.eye(4), *places])
    orbit = Orbit((0.4, -0.3, 0.3), 0.8, 3.0, 200.0)
    return dataclasses.replace(still, objects=(DynamicObject("cart", circling, orbit),))


def _taken(stage, system, *states, **options):
    """Frames of an ideal camera at states, in plain colors."""
    with stage.open(_sensor(system, Degradation(), **options), unlit=True) as still:
        return [still.render(state, linear=True) for state in states]


def _motion(twist):
    path = twist.through(NOW)
    return lambda time_s: WorldState({"body": path(time_s)}, time_s)


@each_system
@pytest.mark.parametrize("name", ["bad-day", "webcam"])
def test_both_back_ends_degrade_alike(system, name):
    degradation = preset(name)
    degradation = degradation.scaled(system.width_px / 360)
    motion = _motion(Twist((0.3, 0.0, 0.0), (0.0, 0.0, 0.5)))
    frames = []
    for backend in BACKENDS:
        with open_sensor(
            _world(), _sensor(system, degradation), seed=5, backend=backend
        ) as renderer:
            frames.append(renderer.render(motion(0.0), motion=motion))
    one, other = (frame.metadata["degradation"] for frame in frames)
    assert one["sub_frames"] == other["sub_frames"]
    assert one.get("noise") == other.get("noise")
    valid = frames[0].valid
    np.testing.assert_array_equal(valid, frames[1].valid)
    assert frames[0].rgb[valid].std() > 5.0
    assert psnr_of_levels_db(frames[0].rgb[valid], frames[1].rgb[valid]) > 28.0


@each_backend
@each_system
def test_rows_of_a_rolling_shutter_are_those_of_their_instants(system, backend):
    readout_s, height = 0.2, system.height_px
    motion = _motion(Twist((0.4, 0.2, 0.0), (0.0, 0.0, 0.7)))
    rolling = _sensor(system, Degradation(shutter=Shutter(readout_s=readout_s)))
    with Stage(_world(), backend=backend) as stage:
        with stage.open(rolling, unlit=True) as renderer:
            ours = renderer.render(motion(0.0), linear=True, motion=motion)
        rows = np.arange(2, height, 17)
        times_s = (rows / (height - 1) - 0.5) * readout_s
        *instants, middle = _taken(stage, system, *map(motion, (*times_s, 0.0)))
    expected = np.stack([instant.linear[row] for instant, row in zip(instants, rows, strict=True)])
    valid = np.stack([instant.valid[row] for instant, row in zip(instants, rows, strict=True)])
    assert ours.metadata["degradation"]["sub_frames"] > 10
    found_db = psnr_db(ours.linear[rows], expected, valid)
    assert found_db > 35.0
    assert psnr_db(middle.linear[rows], expected, valid) < found_db - 8.0


@each_backend
@each_system
def test_blur_is_the_mean_of_its_instants(system, backend):
    exposure_s = 0.1
    motion = _motion(Twist((0.5, 0.0, 0.0), (0.0, 0.0, -1.0)))
    blurred = _sensor(system, Degradation(shutter=Shutter(exposure_s=exposure_s)))
    times_s = ((np.arange(16) + 0.5) / 16 - 0.5) * exposure_s
    with Stage(_world(), backend=backend) as stage:
        with stage.open(blurred, unlit=True) as renderer:
            ours = renderer.render(motion(0.0), linear=True, motion=motion)
        *frames, sharp = _taken(stage, system, *map(motion, (*times_s, 0.0)))
    mean = np.mean([frame.linear for frame in frames], axis=0)
    found_db = psnr_db(ours.linear, mean, sharp.valid)
    assert found_db > 40.0
    assert psnr_db(sharp.linear, mean, sharp.valid) < found_db - 6.0


@each_system
def test_what_moves_is_where_it_is_at_the_time(system):
    """Objects, another robot, and a body whose hidden part is not seen."""
    body = scene_of(
        [box("hull", 0, half_m=0.05), box("mast", 0, half_m=0.08)],
        [Material(base_color=(0.1, 0.6, 0.2, 1.0), double_sided=True)],
        [pose((0.3, 0.1, -0.1)), pose((0.0, 0.0, 0.1))],
    )
    other = scene_of([box("other", 0, half_m=0.15)], [Material(base_color=(0.1, 0.2, 0.9, 1.0))])
    frames = {}
    for backend in BACKENDS:
        with (
            Stage(_world(), vehicles={"body": body, "other": other}, backend=backend) as stage,
            stage.open(_sensor(system, Degradation()), hidden=("object 1",)) as renderer,
        ):
            for time_s in (0.0, 1.0):
                there = NOW @ pose((1.2 - 0.4 * time_s, 0.1, 0.0))
                state = WorldState({"body": NOW, "other": there}, time_s)
                frame = renderer.render(state, also=("instance", "range"))
                frames[backend, time_s] = frame
    for time_s in (0.0, 1.0):
        cube, rays = (frames[backend, time_s] for backend in BACKENDS)
        assert psnr_of_levels_db(cube.rgb[cube.valid], rays.rgb[cube.valid]) > 28.0
        names = {
            instance.id: (instance.object_name, instance.name) for instance in rays.labels.instances
        }
        seen = {names[one] for one in np.unique(rays.channels["instance"]).tolist() if one}
        assert ("body", "object 1") not in seen
        assert ("other", "object 0") in seen
        same = cube.channels["instance"] == rays.channels["instance"]
        assert same.mean() > 0.999  # the virtual cameras miss a triangle here and there
    apart = frames["rays", 0.0].channels["instance"] != frames["rays", 1.0].channels["instance"]
    assert apart.sum() > 20


@each_backend
def test_supersampling(backend):
    with Stage(_world(), backend=backend) as stage:
        expected, *frames = (_taken(stage, BALL, NOW, supersampling=n)[0] for n in (8, 1, 2))
    for ours, bound_db in zip(frames, (24.0, 28.0), strict=True):
        both = ours.valid & expected.valid
        assert (ours.valid != expected.valid).mean() < 0.02
        assert psnr_db(ours.linear, expected.linear, both) > bound_db


@each_backend
def test_batches(backend):
    moved = [NOW, NOW @ pose((0.2, 0.1, 0.0), yaw_deg=10.0)]
    with open_sensor(_world(), _sensor(BALL, Degradation()), backend=backend) as renderer:
        assert_batch_is_frames(renderer, moved, ("rgb", "range", "instance"))


def test_objects_move_as_seen_from_the_mirror():
    """A mirror 2 m before its camera: an object passes 0.5 m from the mirror."""
    mirror = OpticalSystem(pinhole(900.0), (Surface(Conic(0.3), at(2.0), 0.25),))
    lifted = dataclasses.replace(mirror, origin_m=(0.0, 0.0, 2.0))
    corners_m = [0.1 * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))]
    found = []
    for system, z_m in ((mirror, 2.0), (lifted, 0.0)):
        states = [ScenePoses(np.eye(4), (pose((0.5, y_m, z_m)),)) for y_m in (-0.05, 0.0, 0.05)]
        found.append(moved_px(system, states, corners_m))
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert found[0] > 1.0
