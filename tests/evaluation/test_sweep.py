"""Plans of sweeps: varied robots, failures as rows, and work that is not done twice."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from omnisim.core.errors import PlanError
from omnisim.core.files.toml_file import read_tables
from omnisim.core.package_files import sweep_names
from omnisim.evaluation.drive_sweep import points_by_drive, run_sweep
from omnisim.evaluation.sweep_plan import find_plan, read_plan, shown_points
from tests.evaluation.test_estimators import IMU, LIDAR, ROBOT

CAMERA = """
[[sensors]]
name = "front"
type = "omnicamera"
file = "front.toml"
position_m = [0.0, 0.0, 0.5]
"""
PLAN = """
scene = "soccer"
robot = "robot.toml"
path = "way.csv"
estimators = ["wheels", "imu"]
seeds = [3, 4]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "robot.toml").write_text(ROBOT + IMU + LIDAR + CAMERA)
    (tmp_path / "front.toml").write_text("[degradation.shutter]\nexposure_s = 0.01\n")
    (tmp_path / "way.csv").write_text("x_m,y_m\n-1,0\n0,0.6\n")
    return tmp_path


def plan(folder, *variations):
    text = PLAN + "".join(
        f"[[vary]]\nkey = {key!r}\nvalues = {value}\n" for key, value in variations
    )
    (folder / "plan.toml").write_text(text)
    return read_plan(folder / "plan.toml")


def drives(points):
    return [(point.label, point.seed) for point in points]


def test_each_value_and_seed_is_a_drive(folder):
    _, points = plan(folder, ("sensors.imu.rate_hz", [50, 100]), ("odometry.turn_scale", [1.05]))
    assert drives(points) == [
        (label, seed) for label in ("as given", "50", "100", "1.05") for seed in (3, 4)
    ]
    imu, lidar, front = points[2].drive.robot["sensors"]
    assert imu["rate_hz"] == 50
    assert lidar["seed"] == 3  # the noise of a device with a seed of its own differs, too
    assert front["file"] == str(folder / "front.toml")
    assert points[0].drive.robot["sensors"][0]["rate_hz"] == 200.0
    assert points[6].drive.robot["odometry"] == {"turn_scale": 1.05}
    assert len({point.drive.name for point in points}) == len(points)


@pytest.mark.parametrize("changed", ["front.toml", "way.csv"])
def test_a_changed_file_is_another_drive(folder, changed):
    names = [plan(folder)[1][0].drive.name for _ in range(2)]
    text = (folder / changed).read_text()
    (folder / changed).write_text(text.replace("0.01", "0.02").replace("0.6", "0.7"))
    assert len({*names, plan(folder)[1][0].drive.name}) == 2


def test_a_value_that_is_given_is_no_other_drive(folder):
    _, points = plan(folder, ("sensors.imu.rate_hz", [200, 50]))
    shown = {label: len(group) for label, group in shown_points(points, 0)}
    assert shown == {"200": 2, "50": 2}  # not "as given", too
    assert len(points_by_drive(points)) == 4
    _, points = plan(folder, ("sensors.front.file.degradation.shutter.exposure_s", [0.01]))
    assert points[2].drive == points[0].drive


def test_a_key_behind_a_sensor_file_changes_a_copy(folder, tmp_path):
    key = "sensors.fr*.file.degradation.shutter.readout_s"
    _, points = plan(folder, (key, [0.02]))
    place = tmp_path / "point"
    place.mkdir()
    points[2].drive.write(place)
    robot = read_tables(place / "robot.toml", PlanError)
    shutter = read_tables(place / robot["sensors"][2]["file"], PlanError)["degradation"]["shutter"]
    assert shutter == {"exposure_s": 0.01, "readout_s": 0.02}
    assert "readout_s" not in (folder / "front.toml").read_text()


def test_keys_change_together(folder):
    shutter = "sensors.front.file.degradation.shutter"
    keys = (f"{shutter}.readout_s", f"{shutter}.exposure_s", "sensors.imu.rate_hz")
    _, points = plan(folder, (list(keys), [[0.02, 0.03, 50.0]]))
    drive = points[2].drive
    assert drive.files["front.toml"]["degradation"]["shutter"] == {
        "exposure_s": 0.03, "readout_s": 0.02,
    }  # fmt: skip
    assert drive.robot["sensors"][0]["rate_hz"] == 50.0


def test_scene_path_and_options_vary(folder, tmp_path):
    (folder / "other.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    (folder / "wide.toml").write_text("")
    _, points = plan(
        folder, ("scene", ["courtyard"]), ("path", ["other.csv"]), ("drive.sky", ["none"]),
        ("scene.light.exposure", [0.5]), ("sensors.front.file", ["wide.toml"]),
    )  # fmt: skip
    scene, path, option, light, lens = (point.drive for point in points[2::2])
    assert scene.write(tmp_path)[0] == "courtyard"
    assert path.path == str(folder / "other.csv")
    assert option.write(tmp_path)[-2:] == ["--sky", "none"]
    assert lens.robot["sensors"][2]["file"] == str(folder / "wide.toml")
    file = Path(light.write(tmp_path)[0])
    assert read_tables(file, PlanError) == {"extends": "soccer", "light": {"exposure": 0.5}}


def test_a_wrong_calibration_shares_the_drive(folder):
    _, points = plan(folder, ("calibration.imu.time_offset_s", [0.01, 0.0]))
    assert points[2].drive == points[0].drive
    assert points[2].calibration["imu"].time_offset_s == 0.01
    assert points[4].calibration == {}
    assert [label for label, _ in shown_points(points, 0)] == ["0.01", "0.0"]
    assert [len(group) for group in points_by_drive(points)] == [3, 3]


@pytest.mark.slow
def test_a_sweep_resumes_and_names_failures(folder):
    (folder / "robot.toml").write_text(ROBOT + IMU)
    # the second variation is no rate
    sweep, points = plan(folder, ("sensors.imu.rate_hz", [50, -3]))
    wanted = [points[0], points[2], points[4]]
    results = list(run_sweep(sweep, wanted, folder / "out", processes=2))
    results.sort(key=lambda one: wanted.index(one.point))
    assert [one.point for one in results] == wanted
    found = [[one.status for one in result.outcomes] for result in results]
    assert found == [["ok", "ok"], ["ok", "ok"], ["failed", "failed"]]
    assert "rate_hz" in results[2].outcomes[0].reason
    outcome = results[0].estimates / "imu" / "outcome.json"
    content = json.loads(outcome.read_text())
    outcome.write_text(json.dumps(content | {"seconds": 99.0}))
    recorded = (results[0].run / "states.csv").stat().st_mtime_ns
    (again,) = run_sweep(sweep, wanted[:1], folder / "out")
    assert again.outcomes[1].seconds == 99.0
    assert (again.run / "states.csv").stat().st_mtime_ns == recorded


@pytest.mark.slow
@pytest.mark.long
def test_a_sweep_on_ray(folder):
    pytest.importorskip("ray")
    (folder / "robot.toml").write_text(ROBOT + IMU)
    (folder / "plan.toml").write_text(PLAN)
    words = ["evaluate", "plan.toml", "-o", "out", "--engine", "ray"]
    subprocess.run([sys.executable, "-m", "omnisim", *words], cwd=folder, check=True)
    points = json.loads((folder / "out" / "points.json").read_text())
    assert [point["seed"] for point in points] == [3, 4]
    assert {one["status"] for point in points for one in point["outcomes"]} == {"ok"}


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("key = 'sensors.gps.rate_hz'\nvalues = [1]", "keys; sensors: imu, lidar"),
        ("key = 'sensors'\nvalues = [1]", "expected a sensor of the robot"),
        ("key = 'calibration.imu.time'\nvalues = [1]", "did you mean 'time_offset_s'"),
        ("key = 'calibration.imu.focal_scale'\nvalues = [9]", "vary.0.key.*focal_scale"),
        ("key = ['a', 'b']\nvalues = [1]", "lists of 2, one for each key"),
        ("key = 'a'\nvalues = [1, 1]", "a different one for each value"),
        ("key = 'a'\nvalues = [1]\nlabels = ['b', 'c']", "expected 1, one for each"),
        ("key = 'scene'\nvalues = [1]", "expected names or files as values, got 1"),
        ("key = 'sensors.front.file'\nvalues = ['no.toml']", "no.toml: no such file"),
        ("key = 'name.a'\nvalues = [1]", "'name' is not a table"),
        ("key = 'sensors.imu.file.a'\nvalues = [1]", "'imu' has no sensor file"),
        ("key = 'a'", "vary.0.values: missing"),
        ('"imus"', "estimators: estimator 'imus': unknown"),
    ],
)
def test_faults_are_named(folder, fault, message):
    text = f"{PLAN}[[vary]]\n{fault}\n"
    if fault.startswith('"'):
        text = PLAN.replace('"imu"', fault)
    (folder / "plan.toml").write_text(text)
    with pytest.raises(PlanError, match=message) as caught:
        read_plan(folder / "plan.toml")
    assert str(caught.value).startswith(str(folder / "plan.toml"))


def test_the_plans_that_ship_are_valid():
    assert {"courtyard", "soccer", "mapping", "crowd", "mirror"} <= set(sweep_names())
    for name in sweep_names():
        _, points = read_plan(find_plan(Path(name)))
        assert points
    with pytest.raises(PlanError, match="courtyar: no such run or built-in plan; did you"):
        find_plan(Path("courtyar"))
