"""The robot file: what it gives, and one line for what is wrong with it."""

import math
from dataclasses import fields

import pytest

from omnisim import robots
from omnisim.core.errors import RobotFileError
from omnisim.core.package_files import SCENES
from omnisim.sensors.sensor_registry import parse_sensors

DRIVE = """
[kinematics]
type = "differential"
max_speed_mps = 1.0
max_turn_rate_degps = 90.0
max_acceleration_mps2 = 0.5
max_turn_acceleration_degps2 = 180
"""
CAMERA = '[[sensors]]\nname = "omni"\ntype = "omnicamera"\nposition_m = [0, 0, 0.6]\n'
USARSIM = '[[sensors]]\nname = "a"\ntype = "usarsim_range_scanner"\nposition_m = [0, 0, 0]\n'


def scan(more="", name='"scan"', kind='"lms200"', z="0.3"):
    return f"[[sensors]]\nname = {name}\ntype = {kind}\nposition_m = [0.1, 0, {z}]\n{more}\n"


def read(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return robots.read_robot(path)


def test_the_least_robot():
    robot = robots.parse_robot({"name": "cart"}, "a")
    assert (robot.name, robot.title, robot.body, robot.sensors) == ("cart", "cart", None, ())
    assert robot.kinematics is robot.footprint is None
    assert robot.odometry == robots.OdometryErrors()


def test_angles_become_radians_and_every_error_of_the_wheels_has_a_key(tmp_path):
    robot = read(tmp_path, 'name = "a"\n' + DRIVE)
    assert robot.folder == tmp_path
    assert robot.kinematics.max_turn_rate_radps == math.radians(90.0)
    assert robot.kinematics.max_turn_acceleration_radps2 == math.radians(180.0)
    keys = {
        "distance_scale": 1.1, "turn_scale": 1.2, "drift_deg_per_m": -0.3,
        "distance_noise_m_per_sqrt_m": 0.4, "turn_noise_deg_per_sqrt_m": 0.5,
        "turn_noise_deg_per_sqrt_rad": 0.6, "distance_tick_m": 0.7, "turn_tick_deg": 0.8,
    }  # fmt: skip
    errors = robots.parse_robot({"name": "a", "odometry": keys}, "a").odometry
    for field, (key, value) in zip(fields(errors), keys.items(), strict=True):
        wanted = math.radians(value) if "deg" in key else value
        assert getattr(errors, field.name) == pytest.approx(wanted), key


def test_sensors_and_where_they_are(tmp_path):
    text = 'name = "a"\n' + CAMERA + "yaw_deg = 90\n" + scan('resolution_deg = 1\nhides = ["case"]')
    mounts = parse_sensors(read(tmp_path, text + USARSIM + "noise_share = 0\n"))
    assert [mount.name for mount in mounts] == ["omni", "scan", "a"]
    assert mounts[0].file is None
    assert mounts[0].base_from_mount[:2, 0] == pytest.approx((0, 1))
    assert mounts[0].base_from_mount[:3, 3].tolist() == [0, 0, 0.6]
    assert mounts[1].hides == ("case",)
    assert (mounts[1].resolution_deg, mounts[1].noise, mounts[1].seed) == (1.0, True, 0)
    assert (mounts[2].scan_fov_rad, mounts[2].noise_share) == (3.14159, 0.0)


def test_the_built_in_robots():
    """The paper's two. Speed and turn rate of the Pioneer and the Scout's counters are published;
    that its odometry has any error at all, and which, is tested in test_odometry."""
    assert robots.builtin_robots() == ["p2at", "superscout"]
    pioneer, scout = robots.load_robot("p2at"), robots.load_robot("superscout")
    assert (pioneer.title, scout.title) == ("Pioneer 2 AT", "Nomad Super Scout II")
    assert (pioneer.kinematics.drive, scout.kinematics.drive) == ("skid_steer", "differential")
    assert pioneer.kinematics.max_speed_mps == 1.2
    assert pioneer.kinematics.max_turn_rate_radps == math.radians(300.0)
    assert scout.odometry.distance_tick_m == 2.54e-3
    assert scout.odometry.turn_tick_rad == math.radians(0.1)
    assert pioneer.footprint == robots.Footprint(0.626, 0.505, 0.670)
    assert pioneer.odometry.turn_scale > 1.0  # it skids


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("p2ta", "^p2ta: no such robot file, and no built-in robot; did you mean 'p2at'?"),
        ("zzz", "^zzz: no such robot file, and no built-in robot; built-in: p2at, superscout$"),
        ("folder", "folder: is a folder without a robot.toml: expected a robot file$"),
        ("a" * 300, "^a{300}: cannot be read: File name too long$"),
        ("/dev/null", "^/dev/null: is not a regular file$"),
    ],
)
def test_found_by_name_folder_and_path_or_not(name, words, tmp_path, monkeypatch):
    robot = SCENES / "p2at" / "robot.toml"
    assert robots.find_robot("p2at") == robots.find_robot(robot.parent) == robot
    assert robots.find_robot(str(robot)) == robot
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(RobotFileError, match=words):
        robots.find_robot(name)


FOOTPRINT = "[footprint]\nlength_m = 1\nwidth_m = 1\nheight_m = "


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "name: missing"),
        ("name = 3", "name: expected text.*, got 3"),
        ("name = ", "not TOML: "),
        ('name = "a"\nbdy = "b"', "bdy: unknown key; did you mean 'body'?"),
        (DRIVE.replace("1.0", "-1.0"), "kinematics.max_speed_mps: expected a number.*, got -1.0"),
        (DRIVE.replace("1.0", "nan"), "max_speed_mps: expected a finite number.*, got nan"),
        (DRIVE.replace("90.0", '"fast"'), "max_turn_rate_degps: expected a number, got 'fast'"),
        (DRIVE.replace("diff", "def"), "type: expected 'differential' or.*, got 'deferential'"),
        (DRIVE + "tipe = 1", "kinematics.tipe: unknown key; did you mean 'type'?"),
        ("[odometry]\ndistance_scale = 0", "distance_scale: expected a number > 0.*, got 0"),
        ("[odometry]\nturn_tick_deg = 1e-12", "expected 0, or at least 1e-09"),
        (FOOTPRINT + "inf", "footprint.height_m: expected.*, got inf"),
        ("sensors = 3", r"sensors: expected tables, \[\[sensors\]\], got 3$"),
        ("sensors = [3]", r"sensors.0: expected a table, \[\[sensors\]\], got 3$"),
        ('[[sensors]]\nname = "a"', "sensor 'a': type: missing; expected one of omnicamera"),
        (scan(kind='"lms2oo"'), "type = 'lms2oo': unknown sensor type; did you mean"),
        (scan(kind='"sonar"'), "type = 'sonar': unknown sensor type; expected one of"),
        (scan(kind="[]"), r"type = \[\]: unknown sensor type; expected one of"),
        (scan() + scan(), "sensor 'scan': a second sensor of this name: expected each name once"),
        (scan(z="nan"), "sensor 'scan': position_m.2: expected a finite number.*, got nan"),
        (scan(z="361"), None),
        (scan(z="3610"), "position_m.2: expected a number ≤ 1000.*, got 3610"),
        (scan(name='""'), "sensor '': name: expected at least 1 character.*, got ''"),
        (scan(name='"a/b"'), "name: expected letters, digits.*, got 'a/b'"),
        (scan(name='"manifest.json"'), "name: expected letters.*, got 'manifest.json'"),
        (scan(name='".."'), r"name: expected letters.*, got '\.\.'"),
        (scan(name='"-o"'), "name: expected letters.*, got '-o'"),
        (scan(name=r'"a\u0000"'), "name: expected letters.*, got 'a.x00'"),
        (scan(name=f'"{61 * "x"}"'), "name: expected letters.* at most 60.*, got 'x*'"),
        (scan(name='"vorne links_2-ü"'), None),
        (scan(name="7"), r"sensors\.0: name: expected text.*, got 7"),
        (scan("resolution_deg = 0.3"), "resolution_deg: expected 1, 0.5 or 0.25, got 0.3"),
        (scan('mode = "km"'), "sensor 'scan': mode: expected 'mm' or 'cm'.*, got 'km'"),
        (scan("seed = -1"), "sensor 'scan': seed: expected a number ≥ 0.*, got -1"),
        (scan("noise = 1"), "sensor 'scan': noise: expected true or false.*, got 1"),
        (scan('hide = ["a"]'), "sensor 'scan': hide: unknown key; did you mean 'hides'?"),
        (CAMERA + "yaw_deg = inf", "sensor 'omni': yaw_deg: expected a finite number.*, got inf"),
        (USARSIM + "scan_fov_rad = 32768", "scan_fov_rad: expected a number ≤ 6.2.*, got 32768"),
    ],
)  # fmt: skip
def test_bad_files(tmp_path, text, words):
    text = text if "name" in text.partition("[")[0] or not text else 'name = "a"\n' + text
    if words is None:
        parse_sensors(read(tmp_path, text))
        return
    with pytest.raises(RobotFileError, match=words) as caught:
        parse_sensors(read(tmp_path, text))
    assert str(caught.value).startswith(f"{tmp_path / 'robot.toml'}: ")
    assert "\n" not in str(caught.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(RobotFileError, match="cannot be read: No such file"):
        robots.read_robot(tmp_path / "none.toml")
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RobotFileError, match="not a text file"):
        robots.read_robot(tmp_path / "b.toml")
