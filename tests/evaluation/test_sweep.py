"""Plans of sweeps: varied robots, failures as rows, and work that is not done twice."""

import json

import pytest

from omnisim.core.errors import PlanError
from omnisim.core.files.toml_file import read_tables
from omnisim.evaluation.drive_sweep import run_sweep
from omnisim.evaluation.sweep_plan import read_plan
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


def test_each_value_and_seed_is_a_drive(folder):
    _, points = plan(folder, ("sensors.imu.rate_hz", [50, 100]), ("odometry.turn_scale", [1.05]))
    assert [one.name for one in points] == [
        f"{name}-seed{seed}" for name in ("base", "0-50", "0-100", "1-1.05") for seed in (3, 4)
    ]
    imu, lidar, front = points[2].robot["sensors"]
    assert imu["rate_hz"] == 50
    assert lidar["seed"] == 3  # the noise of a device with a seed of its own differs, too
    assert front["file"] == str(folder / "front.toml")
    assert "rate_hz" in points[0].robot["sensors"][0]
    assert points[0].robot["sensors"][0]["rate_hz"] == 200.0
    assert points[6].robot["odometry"] == {"turn_scale": 1.05}


def test_a_key_behind_a_sensor_file_changes_a_copy(folder, tmp_path):
    key = "sensors.front.file.degradation.shutter.readout_s"
    _, points = plan(folder, (key, [0.02]))
    place = tmp_path / "point"
    place.mkdir()
    robot = read_tables(points[2].write_robot(place), PlanError)
    shutter = read_tables(place / robot["sensors"][2]["file"], PlanError)["degradation"]["shutter"]
    assert shutter == {"exposure_s": 0.01, "readout_s": 0.02}
    assert "readout_s" not in (folder / "front.toml").read_text()


@pytest.mark.slow
def test_a_sweep_resumes_and_names_failures(folder):
    (folder / "robot.toml").write_text(ROBOT + IMU)
    # the second variation is no rate
    sweep, points = plan(folder, ("sensors.imu.rate_hz", [50, -3]))
    wanted = [points[0], points[2], points[4]]
    results = list(run_sweep(sweep, wanted, folder, folder / "out", processes=2))
    assert [one.point for one in results] == wanted
    for result in results[:2]:
        assert [one.status for one in result.outcomes] == ["ok", "ok"]
    failed = results[2].outcomes
    assert [one.status for one in failed] == ["failed", "failed"]
    assert "rate_hz" in failed[0].reason
    outcome = folder / "out" / "base-seed3" / "estimates" / "imu" / "outcome.json"
    content = json.loads(outcome.read_text())
    outcome.write_text(json.dumps(content | {"seconds": 99.0}))
    (again,) = run_sweep(sweep, wanted[:1], folder, folder / "out")
    assert again.outcomes[1].seconds == 99.0


@pytest.mark.parametrize(
    ("variation", "message"),
    [
        ("[[vary]]\nkey = 'sensors.gps.rate_hz'\nvalues = [1]\n", "a sensor of the robot: imu"),
        ("[[vary]]\nkey = 'sensors'\nvalues = [1]\n", "expected sensors.NAME.KEY"),
        ("[[vary]]\nkey = 'sensors.imu.file.a'\nvalues = [1]\n", "'imu' has no sensor file"),
        ("[[vary]]\nkey = 'a'\nvalues = []\n", "vary.0.values"),
        ("[[vary]]\nkey = 'a'\n", "vary.0.values: missing"),
        ("[vari]\n", "vari: unknown key; did you mean 'vary'?"),
    ],
)
def test_faults_are_named(folder, variation, message):
    (folder / "plan.toml").write_text(PLAN + variation)
    with pytest.raises(PlanError, match=message) as caught:
        read_plan(folder / "plan.toml")
    assert str(caught.value).startswith(str(folder / "plan.toml"))


def test_unknown_estimators_are_refused(folder):
    (folder / "plan.toml").write_text(PLAN.replace('"imu"', '"imus"'))
    with pytest.raises(PlanError, match=r"plan.toml: estimators: estimator 'imus': unknown"):
        read_plan(folder / "plan.toml")
