"""`omnisim evaluate`: reports of runs and plans."""

import json

import pytest

from omnisim.core.trajectories import read_trajectory
from omnisim.evaluation.estimators.dead_reckoning import WheelOdometry
from omnisim.evaluation.estimators.lidar_odometry import KissIcpOdometry
from tests.evaluation.in_process import run_in_process
from tests.evaluation.test_estimators import IMU, ROBOT
from tests.evaluation.test_sweep import PLAN


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "robot.toml").write_text(ROBOT + IMU)
    (tmp_path / "way.csv").write_text("x_m,y_m\n-1,0\n0,0.6\n")
    return tmp_path


@pytest.mark.slow
def test_a_run(omnisim, ran, folder, monkeypatch):
    ran("drive", "soccer", "--robot", "robot.toml", "--path", "way.csv", "-o", "run")
    length_m = read_trajectory(folder / "run" / "ground_truth.tum").path_length_m
    assert 0.0 < length_m < KissIcpOdometry.min_path_m
    monkeypatch.setattr(WheelOdometry, "min_path_m", KissIcpOdometry.min_path_m)
    names = ("--with", "wheels,imu", "--with", "command:false {run} {out}")
    out, error = ran("evaluate", "run", "-o", "report", *names)
    assert "report/report.html: written" in out
    assert f"wheels: the path is {length_m:.3g} m long: its error in percent" in error
    assert "command:false {run} {out}: failed: false: exit status 1" in error
    report = json.loads((folder / "report" / "report.json").read_text())
    errors, failures = report["sections"][0]["tables"]
    assert [row[0] for row in errors["rows"]] == ["wheels", "imu", "command:false {run} {out}"]
    assert failures["rows"][0][:2] == ["command:false {run} {out}", "failed"]
    assert {"trajectories.png", "offsets.png", "report.html"} <= {
        path.name for path in (folder / "report").iterdir()
    }
    status, _, error = omnisim("evaluate", "run", "-o", "none", *names[2:])
    assert (status, "command:false {run} {out}: failed" in error) == (1, True)


@pytest.mark.slow
def test_a_plan(ran, folder, monkeypatch):
    run_in_process(monkeypatch)
    (folder / "plan.toml").write_text(
        PLAN + "[[vary]]\ntitle = 'IMU'\nkey = 'sensors.imu.device'\nvalues = ['bmi160']\n"
    )
    ran("evaluate", "plan.toml", "-o", "report", "--processes", "2")
    base, section = json.loads((folder / "report" / "report.json").read_text())["sections"]
    rows = section["tables"][0]["rows"]
    assert [row[:2] for row in rows] == [
        [value, name] for value in ("as given", "bmi160") for name in ("wheels", "imu")
    ]
    column = section["tables"][0]["columns"].index("ATE m")
    ideal, noisy = (float(rows[row][column].split(" ± ")[0]) for row in (1, 3))
    spread = float(rows[3][column].split(" ± ")[1])
    assert noisy > 10.0 * ideal
    assert spread > 0.0  # two seeds differ
    assert {"base-tracks.png", "vary-0-errors.png", "vary-0-lost.png", "vary-0-times.png"} <= {
        path.name for path in (folder / "report").iterdir()
    }
    assert [row[1] for row in base["tables"][0]["rows"]] == ["wheels", "imu"]
