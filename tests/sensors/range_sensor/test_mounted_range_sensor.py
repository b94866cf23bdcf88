"""Sonars and infrared sensors: ranges by geometry, noise, and runs that go on."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.rendering.stage import open_sensor
from omnisim.robots import parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import load_scene
from omnisim.scene.model import Material
from omnisim.sensors.range_sensor.range_sensor import RangeSensor
from tests.scenes import scene_of
from tests.vehicles import box, scaled

SONAR = {"name": "sonar", "type": "usarsim_sonar", "position_m": [0.2, 0.0, 0.3]}
INFRARED = {"name": "ir", "type": "usarsim_ir_sensor", "position_m": [0.2, 0.0, 0.3]}
EXACT = RangeSensor(noise_share=0.0)


def directions(sensor):
    """Unit vectors (n, 3) of all rays, from the planes that they lie in."""
    angles = sensor.fan_rad
    fan = np.column_stack((np.cos(angles), np.sin(angles), np.zeros_like(angles)))
    return np.concatenate([fan @ pose(roll_deg=roll)[:3, :3].T for roll in sensor.rolls_deg])


@pytest.mark.parametrize("rays_per_cone", [16, 5])
def test_rays_are_those_of_usarsim(rays_per_cone):
    sensor = RangeSensor(rays_per_cone=rays_per_cone, cones=3)
    expected = [(1.0, 0.0, 0.0)]
    for cone in (1, 2, 3):
        # pitched away from the axis, and turned about it
        angle = math.radians(0.5 * sensor.beam_angle_deg) * cone / 3
        for ray in range(rays_per_cone):
            turn = 2.0 * math.pi * ray / rays_per_cone
            sine = math.sin(angle)
            expected.append((math.cos(angle), -sine * math.sin(turn), sine * math.cos(turn)))
    found = {tuple(row) for row in np.round(directions(sensor), 9) + 0.0}
    assert found == {tuple(row) for row in np.round(expected, 9) + 0.0}


def test_an_infrared_sensor_has_one_ray():
    assert directions(RangeSensor(beam_angle_deg=0.0)).tolist() == [[1.0, 0.0, 0.0]]
    sensors = Vehicle.from_robot(parse_robot({"name": "a", "sensors": [SONAR, INFRARED]}, "r"))
    summaries = [mount.summary() for mount in sensors.sensors]
    assert summaries == ["cone of 20° to 5 m", "one ray to 1.5 m"]


def boxes(*places):
    """Boxes of 0.2 m, with their near faces at some places."""
    poses = [scaled(pose((x + 0.1, y, z)), 0.2, 0.2, 0.2) for x, y, z in places]
    meshes = [box(f"box {index}", 0) for index in range(len(places))]
    return scene_of(meshes, [Material(double_sided=True)], poses)


def measured(scene, sensor, **options):
    with open_sensor(scene, sensor, **options) as renderer:
        return renderer.measure(np.eye(4)).range_m


@pytest.mark.usefixtures("needs_opengl")
def test_the_nearest_hit_in_the_cone_counts():
    # 10° to either side reach 0.35 m at 2 m: the edge of the nearer box is 0.25 m away
    scene = boxes((3.0, 0.0, 0.0), (2.0, 0.35, 0.0))
    # the nearest of the rays of 1° from ray to ray
    nearest = 2.0 / math.cos(math.atan(0.25 / 2.0))
    assert measured(scene, EXACT) == pytest.approx(nearest, abs=0.005 + 2.0 * math.radians(1.0) / 8)
    assert measured(scene, dataclasses.replace(EXACT, beam_angle_deg=10.0)) == 3.0
    assert measured(scene, dataclasses.replace(EXACT, beam_angle_deg=0.0)) == 3.0
    # above, too: it is a cone and no fan
    above = boxes((3.0, 0.0, 0.0), (2.0, 0.0, 0.35))
    assert measured(above, EXACT) == measured(scene, EXACT)


@pytest.mark.usefixtures("needs_opengl")
def test_out_of_range_and_too_near():
    assert measured(boxes((5.5, 0.0, 0.0)), EXACT) == math.inf
    assert measured(boxes((0.05, 0.0, 0.0)), EXACT) == -math.inf
    assert measured(boxes((-2.0, 0.0, 0.0)), EXACT) == math.inf
    mount = pose((-1.0, 0.0, 0.0), yaw_deg=180.0)
    assert measured(boxes((-2.2, 0.0, 0.0)), EXACT, base_from_sensor=mount) == 1.0


@pytest.mark.usefixtures("needs_opengl")
def test_noise_is_a_share_of_the_range():
    sensor = RangeSensor(beam_angle_deg=0.0, noise_share=0.05)
    with open_sensor(boxes((2.0, 0.0, 0.0)), sensor) as renderer:
        ranges = [renderer.measure(np.eye(4), number).range_m for number in range(200)]
        assert renderer.measure(np.eye(4), 7).range_m == ranges[7]
    # 0.1 m, within four standard errors; in centimeters, as USARSim writes them
    assert np.std(ranges) == pytest.approx(0.1, rel=4.0 / math.sqrt(400))
    assert np.mean(ranges) == pytest.approx(2.0, abs=4.0 * 0.1 / math.sqrt(200))
    np.testing.assert_allclose(ranges, np.round(ranges, 2), atol=1e-12)


@pytest.mark.usefixtures("needs_opengl")
def test_a_run_goes_on_with_the_same_bytes(tmp_path):
    vehicle = Vehicle.from_robot(parse_robot({"name": "a", "sensors": [SONAR, INFRARED]}, "robot"))
    poses = np.stack([pose((0.5 * step, 0.0, 0.0)) for step in range(3)])
    drive = Drive(load_scene("mapping"), vehicle, Route("lap"))
    planned, run = drive.along(Trajectory(np.arange(3.0), poses)), tmp_path / "run"
    assert list(planned.record(run))[-1] == 3
    files = [run / name / f"{step:06d}.csv" for name in ("sonar", "ir") for step in range(3)]
    before = [file.read_bytes() for file in files]
    files[4].unlink()
    assert list(planned.record(run)) == [2, 3]
    assert [file.read_bytes() for file in files] == before
    lines = files[0].read_text().splitlines()
    assert lines[-2] == "range_m"
    assert float(lines[-1]) > 0.0


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"beam_angle_rad": 0.0}, "beam_angle_rad"),
        ({"cones": 0}, "cones"),
        ({"range_min_m": 7.0}, r"sensor 'sonar': range_min_m: expected less than range_max_m = 5"),
    ],
)
def test_a_sonar_that_cannot_be_is_refused(keys, message):
    with pytest.raises(RobotFileError, match=message):
        Vehicle.from_robot(parse_robot({"name": "a", "sensors": [SONAR | keys]}, "robot"))
    with pytest.raises(OpticsError, match="beam_angle_deg"):
        RangeSensor(beam_angle_deg=180.0)
