"""The vehicle: a robot file's sensors as objects, its identity, and what cannot be mounted."""

import shutil

import numpy as np
import pytest

from omnisim.core.errors import RobotFileError, SensorFileError
from omnisim.core.files.sources import fingerprint
from omnisim.core.poses import pose
from omnisim.robots import builtin_robots, parse_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from tests.vehicles import P2AT, p2at_with_every_sensor

CAMERA = {"name": "omni", "type": "omnicamera", "position_m": (0.0, 0.0, 1.0)}
SCANNER = {"name": "scan", "type": "lms200", "position_m": (0.0, 0.0, 1.0)}
RANGES = {"name": "scan", "type": "usarsim_range_scanner", "position_m": (0.0, 0.0, 1.0)}
CUBE = """o cube
v -1 -1 -1\nv 1 -1 -1\nv -1 1 -1\nv 1 1 -1\nv -1 -1 1\nv 1 -1 1\nv -1 1 1\nv 1 1 1
f 1 3 4 2\nf 5 6 8 7\nf 2 4 8 6\nf 1 5 7 3\nf 3 7 8 4\nf 1 2 6 5
"""


def toml(table):
    """A table of words, numbers and lists of them as TOML."""
    tables = ((key, list(v) if isinstance(v, tuple) else v) for key, v in table.items())
    return "".join(f"{key} = {value!r}\n" for key, value in tables)


def vehicle_of(*sensors):
    """A vehicle without a body."""
    return Vehicle.from_robot(parse_robot({"name": "a", "sensors": sensors}, "robot"))


@pytest.fixture
def load(tmp_path):
    """Writes a robot file of sensors, with a cube of 2 m about its base as body, and loads it."""
    (tmp_path / "body.obj").write_text(CUBE)

    def write_and_load(*sensors, body="body.obj", **keys):
        text = toml({"name": "cart", "body": body, **keys})
        text += "".join("[[sensors]]\n" + toml(sensor) for sensor in sensors)
        (tmp_path / "robot.toml").write_text(text)
        return Vehicle.load(tmp_path)

    return write_and_load


def test_built_in_robots_are_whole(tmp_path):
    for name in builtin_robots():
        vehicle = Vehicle.load(name)
        assert vehicle.name == name
        assert vehicle.body.triangle_count > 3000
        assert vehicle.camera().name == "omnicam"
        height_m = vehicle.body.bounds_m()[1, 2]
        assert height_m == pytest.approx(vehicle.footprint.height_m, abs=1e-3)
    for name in ("p2at.glb", "omnicam.toml"):
        (tmp_path / name).symlink_to(P2AT / name)
    (tmp_path / "robot.toml").write_text(p2at_with_every_sensor())
    types = [mount.type for mount in Vehicle.load(tmp_path).sensors]
    assert types[:2] == ["omnicamera", "lms200"]
    assert {"imu", "depth_camera", "usarsim_sonar", "lidar"} <= set(types[2:])


def test_the_pioneer():
    pioneer = Vehicle.load("p2at")
    assert pioneer.camera("omnicam").origin_m.tolist() == [-0.08, 0.0, 0.65]
    assert pioneer.camera().sensor.supersampling == 3
    laser = pioneer.scanner("lms200")
    assert laser.sensor == LaserScanner.lms200()
    np.testing.assert_array_equal(laser.base_from_sensor, pose((0.160, 0.0, 0.361)))
    assert (laser.hides, pioneer.camera().hides) == (("lms200",), ())


def test_a_body_is_put_off_its_files_origin(load):
    at_origin, body = load().body, load(body_offset_m=(0.5, 0.0, 1.0)).body
    np.testing.assert_allclose(body.bounds_m() - at_origin.bounds_m(), [(0.5, 0.0, 1.0)] * 2)
    assert body.instances[0].world_from_node[:3, 3].tolist() == [0.5, 0.0, 1.0]


def test_mounts_are_composed(load, tmp_path):
    """A sensor file's own mounting, seen from a mount that is turned to the left."""
    (tmp_path / "s.toml").write_text(
        "[mirror.mounting]\nposition_m = [0.5, 0, 0.25]\nroll_deg = 10\n"
    )
    mount = {**CAMERA, "position_m": (1.0, 2.0, 3.0), "yaw_deg": 90.0, "file": "s.toml"}
    camera = load(mount).camera()
    np.testing.assert_allclose(camera.origin_m, (1.0, 2.5, 3.25), atol=1e-15)
    expected = pose((1, 2, 3), yaw_deg=90) @ pose((0.5, 0, 0.25), roll_deg=10)
    np.testing.assert_allclose(camera.sensor.base_from_rig, expected, atol=1e-15)
    (tmp_path / "s.toml").write_text("[mirror]\nk = 1\n")
    with pytest.raises(SensorFileError, match=r"s\.toml: mirror\.k: expected .*, got 1"):
        load(mount)


def test_scanners_are_as_asked_for():
    lms = {**SCANNER, "resolution_deg": 0.25, "mode": "cm", "noise": False, "seed": 3}
    vehicle = vehicle_of(lms, RANGES | {"name": "b"})
    assert vehicle.scanners[0].sensor == LaserScanner.lms200(0.25, "cm", 3).without_noise()
    assert vehicle.scanners[1].sensor == LaserScanner.usarsim()
    assert vehicle.body is None
    around = vehicle_of({**RANGES, "scan_fov_rad": 6.2832}).scanner().sensor
    assert around.field_of_view_deg == 360.0


def test_sensors_by_name():
    vehicle = vehicle_of(CAMERA, SCANNER)
    assert vehicle.camera("omni") is vehicle.camera()
    with pytest.raises(RobotFileError, match=r"^robot 'a': camera 'omi': not found; did you mean"):
        vehicle.camera("omi")
    with pytest.raises(RobotFileError, match=r"^robot 'a': scanner: not found; it has none$"):
        vehicle_of().scanner()


OUTSIDE, INSIDE = {"position_m": (0.0, 0.0, 1.01)}, {"position_m": (0.0, 0.0, 0.9)}


@pytest.mark.parametrize(
    ("sensors", "words"),
    [
        ([CAMERA | OUTSIDE, SCANNER | OUTSIDE], None),
        ([CAMERA | INSIDE | {"hides": ("cube",)}], None),
        ([CAMERA | INSIDE], r"sensor 'omni': its effective viewpoint \(0, 0, 0.9\) m is inside "
         "the body's cube: move it, or name in hides what it does not see"),
        ([SCANNER | INSIDE], r"sensor 'scan': its origin \(0, 0, 0.9\) m is inside the bod"),
        ([SCANNER | {"hides": ("cub",)}], "hides 'cub': no such node in the body; did you mean"),
        ([SCANNER | {"hides": ("x",)}], "hides 'x': no such node in the body; it has cube"),
        ([CAMERA | {"file": "s.toml"}], "sensor 'omni': file = 's.toml': no such file beside it"),
        ([SCANNER, CAMERA | {"name": "scan"}], "sensor 'scan': a second sensor of this name"),
        ([RANGES | {"resolution_rad": 1e-9}],
         "sensor 'scan': resolution_deg: expected fewer than 100000 beams, got 5.72958e-08"),
        ([RANGES | {"min_range_m": 30}],
         "sensor 'scan': range_min_m: expected less than range_max_m = 20, got 30"),
    ],
)  # fmt: skip
def test_what_cannot_be_mounted(load, tmp_path, sensors, words):
    if words is None:
        assert load(*sensors).sensors[0].hides == sensors[0].get("hides", ())
        return
    with pytest.raises(RobotFileError, match=words) as caught:
        load(*sensors)
    assert str(caught.value).startswith(f"{tmp_path / 'robot.toml'}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("none.glb", "body = 'none.glb': no such file beside it"),
        ("a" * 300, "cannot be read: File name too long"),
        ("courtyard", "body = 'courtyard': no such file beside it"),
        ("empty.glb", "body = 'empty.glb': is an empty file"),
        ("words.glb", "body = 'words.glb': "),
        ("words.xyz3", "body = 'words.xyz3': unknown scene format"),
    ],
)
def test_bad_bodies(load, tmp_path, body, words):
    (tmp_path / "empty.glb").touch()
    for name in ("words.glb", "words.xyz3"):
        (tmp_path / name).write_text("no mesh at all")
    with pytest.raises(RobotFileError, match=words) as caught:
        load(body=body)
    assert str(caught.value).startswith(f"{tmp_path / 'robot.toml'}: ")
    assert "\n" not in str(caught.value)


def test_a_vehicle_is_the_same_in_another_folder_but_not_with_another_file(tmp_path):
    shutil.copytree(P2AT, tmp_path / "mine")
    there, here = Vehicle.load("p2at"), Vehicle.load(tmp_path / "mine")
    assert (here.name, here.body.name) == (there.name, there.body.name) == ("p2at", "p2at.glb")
    assert fingerprint(there) == fingerprint(here)
    known = {fingerprint(here)}
    for file, old, new in (
        ("robot.toml", "resolution_deg = 0.5", "resolution_deg = 1"),
        ("omnicam.toml", "", "[degradation.defocus]\nrim_defocus_px = 1.0\n"),
    ):
        text = (tmp_path / "mine" / file).read_text()
        changed = text.replace(old, new, 1) if old else f"{text}\n{new}"
        (tmp_path / "mine" / file).write_text(changed)
        known.add(fingerprint(Vehicle.load(tmp_path / "mine")))
    assert len(known) == 3


def test_options_of_cameras_count():
    robot = Vehicle.load("p2at")
    small, smaller = robot.with_cameras(size_px=64), robot.with_cameras(size_px=48)
    assert len({fingerprint(vehicle) for vehicle in (robot, small, smaller)}) == 3
    assert fingerprint(robot.with_cameras(size_px=64)) == fingerprint(small)
