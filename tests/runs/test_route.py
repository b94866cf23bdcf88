"""Routes: paths of a scene and of files, their identity, and those that cannot be driven."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.core.errors import TrajectoryError
from omnisim.core.trajectories import Trajectory, write_trajectory
from omnisim.robots.kinematics import find_drift
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.route import Route, plan_route, route_digest
from omnisim.scene import load_scene
from omnisim.scene.model import ScenePath
from tests.scenes import room, scene_of


@pytest.fixture(scope="module")
def vehicle():
    return Vehicle.load("p2at")


@pytest.fixture
def scene():
    """The room: x within ±3 m, y within ±2 m."""
    corner = ScenePath("corner", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), start_yaw_deg=90.0)
    return dataclasses.replace(scene_of([room()]), paths=(corner,))


def _drive(scene, vehicle, path, **options):
    return plan_route(scene, vehicle, Route(str(path), **options)).trajectory


def test_path_of_the_scene(scene, vehicle):
    poses = _drive(scene, vehicle, "corner", step_m=0.25, step_deg=30.0)
    np.testing.assert_allclose(poses.positions_m[0], (0.0, 0.0, -1.5), atol=1e-12)  # the floor
    assert poses.yaw_rad[0] == pytest.approx(math.pi / 2.0)  # the path's start, not its first leg
    np.testing.assert_allclose(poses.positions_m[-1], (1.0, 1.0, -1.5), atol=1e-12)
    assert len(poses) == 1 + 3 + 4 + 3 + 4  # turn, leg, turn, leg
    assert poses.path_length_m == pytest.approx(2.0)
    at_rate = _drive(scene, vehicle, "corner", rate_hz=10.0)
    np.testing.assert_allclose(np.diff(at_rate.times_s), 0.1, atol=1e-9)


@pytest.mark.parametrize(("path", "turn"), [("lap", 1.0), ("lap_clockwise", -1.0)])
def test_the_paper_s_lap(vehicle, path, turn):
    poses = _drive(load_scene("soccer"), vehicle, path)
    assert 80 <= len(poses) <= 120
    x, y, _ = poses.positions_m.T
    area = 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])
    assert area * turn > 6.0  # m²: the way around the field, then a diagonal that encloses none


def test_waypoints_from_a_file(scene, vehicle, tmp_path):
    (tmp_path / "my.csv").write_text("x_m,y_m\n0,0\n1,0\n1,1\n")
    poses = _drive(scene, vehicle, tmp_path / "my.csv", step_m=0.5, step_deg=45.0)
    assert len(poses) == 1 + 2 + 2 + 2
    assert np.all(np.diff(poses.times_s) > 0.0)


def test_ground_of_waypoints(scene, vehicle):
    poses = _drive(scene, vehicle, "corner", ground_m=-0.09)
    np.testing.assert_allclose(poses.positions_m[:, 2], -0.09)
    with pytest.raises(TrajectoryError, match="corner: leaves the map at step 0, at a height of 9"):
        _drive(scene, vehicle, "corner", ground_m=9.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"step_m": 0.0}, "step 0 m: expected more than 0"),
        ({"step_m": math.nan}, "step nan m: expected more than 0"),
        ({"step_deg": 120.0}, "turn step 120°: expected more than 0, at most 90"),
        ({"rate_hz": math.nan}, "rate nan Hz: expected a finite number above 0"),
        ({"rate_hz": -1.0}, "rate -1 Hz: expected a finite number above 0"),
        ({"ground_m": math.nan}, r"ground nan m: expected a finite number below 1e\+15"),
    ],
)
def test_numbers_that_cannot_be(scene, vehicle, tmp_path, options, words):
    """Also where the path has no use for them."""
    (tmp_path / "a.tum").write_text("0 0 0 0 0 0 0 1\n")
    for path in ("corner", tmp_path / "a.tum"):
        with pytest.raises(TrajectoryError, match=f"^{words}$"):
            _drive(scene, vehicle, path, **options)


def test_a_file_without_a_suffix(scene, vehicle, tmp_path, monkeypatch):
    """It is one, but where the scene has a path of this name."""
    monkeypatch.chdir(tmp_path)
    for name in ("poses", "corner"):
        (tmp_path / name).write_text("0 0 0 0 0 0 0 1\n")
    assert len(_drive(scene, vehicle, "poses")) == 1
    assert len(_drive(scene, vehicle, "corner")) > 1


def test_poses_have_heights_of_their_own(scene, vehicle, tmp_path):
    (tmp_path / "my.csv").write_text("x_m,y_m,z_m\n0,0,0\n0.1,0,0\n")
    with pytest.raises(TrajectoryError, match=r"csv: expected waypoints with --ground, got pos"):
        _drive(scene, vehicle, tmp_path / "my.csv", ground_m=0.2)


def test_poses_without_times_are_timed_by_the_robot(scene, vehicle, tmp_path):
    lines = ["x_m,y_m,yaw_deg"] + [f"{0.1 * k},0,0" for k in range(11)]
    (tmp_path / "my.csv").write_text("\n".join(lines) + "\n")
    poses = _drive(scene, vehicle, tmp_path / "my.csv")
    assert len(poses) == 11
    assert poses.duration_s > 1.0 / 1.2  # no faster than it can


def test_recorded_poses_keep_their_times(scene, vehicle, tmp_path):
    times = np.arange(5.0)
    poses = Trajectory.on_ground(times, np.stack((0.3 * times, 0 * times), axis=1), 0 * times)
    write_trajectory(tmp_path / "a.tum", poses)
    np.testing.assert_allclose(_drive(scene, vehicle, tmp_path / "a.tum").times_s, times)
    with pytest.raises(TrajectoryError, match=r"a\.tum: has times of its own: expected no rate"):
        _drive(scene, vehicle, tmp_path / "a.tum", rate_hz=2.0)


def test_kitti_file_drives_ahead_and_says_its_axes(scene, vehicle, tmp_path):
    ahead = "".join(f"1 0 0 0 0 1 0 0 0 0 1 {0.1 * k}\n" for k in range(11))
    (tmp_path / "a.kitti").write_text(ahead)
    notes = []
    route = Route(str(tmp_path / "a.kitti"))
    poses = plan_route(scene, vehicle, route, notes.append).trajectory
    np.testing.assert_allclose(poses.positions_m[-1], (1.0, 0.0, 0.0), atol=1e-12)
    assert len(notes) == 1
    assert "KITTI's axes" in notes[0]
    assert "--axes world" in notes[0]
    as_it_is = dataclasses.replace(route, axes="world", ignore_limits=True)
    poses = plan_route(scene, vehicle, as_it_is, notes.append).trajectory
    np.testing.assert_allclose(poses.positions_m[-1], (0.0, 0.0, 1.0), atol=1e-12)
    assert len(notes) == 1


def test_waypoints_have_no_axes(scene, vehicle, tmp_path):
    (tmp_path / "my.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    for path in ("corner", tmp_path / "my.csv"):
        with pytest.raises(TrajectoryError, match="expected poses with --axes, got waypoints"):
            _drive(scene, vehicle, path, axes="world")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_m,y_m\n0,0\n9,0\n", r"leaves the map at step \d+, \(3\.\d+, 0\.00\) m: test spans"),
        ("x_m,y_m\n0,0\n", r"my\.csv: waypoints: expected at least 2, got 1"),
        ("x_m,y_m\n0,0\nnan,1\n", r"my\.csv.*3.*nan"),
        ("t_s,x_m,y_m\n0,0,0\n1,2.5,0\n", r"my\.csv:3: .*2\.5"),
        ("t_s,x_m,y_m\n0,0,0\n1,0.5,0\n0.5,1,0\n", r"my\.csv.*4"),
        ("t_s,x_m,y_m\n0,0,0\n0.1,0.9,0\n0.2,1.8,0\n", r"my\.csv.*1\.2 m/s; --ignore-limits"),
        ("", r"my\.csv.*empty"),
        ("x_m,y_m\n0,0\n1e-300,0\n1,1\n", r"my\.csv: .*less than a nanosecond apart"),
        ("x_m,y_m,yaw_deg\n0,0,0\n0,0,0\n", r"my\.csv: .*poses 0 and 1 are the same"),
    ],
)
def test_bad_files_are_named(scene, vehicle, tmp_path, text, words):
    scene = dataclasses.replace(scene, name="test")
    (tmp_path / "my.csv").write_text(text)
    with pytest.raises(TrajectoryError, match=words) as info:
        _drive(scene, vehicle, tmp_path / "my.csv")
    assert "\n" not in str(info.value)


def test_slides_are_refused_by_name(scene, vehicle, tmp_path):
    lines = [f"{k},0,{0.1 * k},0" for k in range(11)]
    (tmp_path / "my.csv").write_text("\n".join(["t_s,x_m,y_m,yaw_deg", *lines]) + "\n")
    words = r"my\.csv:4: step 1 → 2 at 1 s: sideways motion 0\.2 m: expected at most 0\.1 m; --ign"
    with pytest.raises(TrajectoryError, match=words):
        _drive(scene, vehicle, tmp_path / "my.csv")
    assert len(_drive(scene, vehicle, tmp_path / "my.csv", ignore_limits=True)) == 11


def test_planned_drives_do_not_drift(vehicle):
    """However much of a turn and a leg is within one step."""
    for rate_hz in (10.0, 0.1):
        assert find_drift(_drive(load_scene("soccer"), vehicle, "lap", rate_hz=rate_hz)) is None


@pytest.mark.parametrize(("rate_hz", "suffix"), [(30.0, ".csv"), (1000.0, ".tum")])
def test_a_drive_s_own_poses_can_be_driven(scene, vehicle, tmp_path, rate_hz, suffix):
    """Though files print nine digits, of which accelerations between close poses are made."""
    file = tmp_path / f"poses{suffix}"
    poses = _drive(scene, vehicle, "corner", rate_hz=rate_hz)
    write_trajectory(file, poses)
    again = _drive(scene, vehicle, file)
    np.testing.assert_allclose(again.world_from_base, poses.world_from_base, atol=1e-8)


def test_a_car_s_steps_are_longer_than_a_meter(scene, vehicle, tmp_path):
    """50 km/h at 10 Hz."""
    lines = [f"{0.1 * k},{1.389 * k - 2.8},0,0" for k in range(5)]
    (tmp_path / "my.csv").write_text("\n".join(["t_s,x_m,y_m,yaw_deg", *lines]) + "\n")
    car = dataclasses.replace(vehicle, kinematics=None)
    assert len(_drive(scene, car, tmp_path / "my.csv")) == 5
    assert len(_drive(scene, vehicle, tmp_path / "my.csv", ignore_limits=True)) == 5
    fast = dataclasses.replace(vehicle.kinematics, max_speed_mps=20.0)
    assert len(_drive(scene, dataclasses.replace(vehicle, kinematics=fast), tmp_path / "my.csv"))
    (tmp_path / "my.csv").write_text("t_s,x_m,y_m\n0,0,0\n0.01,2,0\n")
    words = r"my\.csv:3: step 0 → 1: 2 m in 0\.01 s: expected at most 100 m/s; --ignore-limits"
    with pytest.raises(TrajectoryError, match=words):
        _drive(scene, car, tmp_path / "my.csv")


def test_jumps_without_times_have_a_way_out(scene, vehicle, tmp_path):
    (tmp_path / "my.csv").write_text("x_m,y_m,yaw_deg\n0,0,0\n2,0,0\n")
    words = r"my\.csv:3: step 0 → 1: 2 m without times: expected at most 1 m: --rate HZ gives"
    with pytest.raises(TrajectoryError, match=words):
        _drive(scene, vehicle, tmp_path / "my.csv")
    for options in ({"rate_hz": 0.2}, {"ignore_limits": True}):
        assert len(_drive(scene, vehicle, tmp_path / "my.csv", **options)) == 2


def test_unknown_paths_get_a_hint(scene, vehicle):
    with pytest.raises(TrajectoryError, match="did you mean 'corner'"):
        _drive(scene, vehicle, "corners")
    with pytest.raises(TrajectoryError, match="it has none"):
        _drive(dataclasses.replace(scene, paths=()), vehicle, "corner")
    with pytest.raises(TrajectoryError, match=r"has no \[kinematics\]"):
        _drive(scene, dataclasses.replace(vehicle, kinematics=None), "corner")


def test_a_route_is_of_its_files_content_and_its_options(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "way.csv").write_text("x_m,y_m\n0,0\n1,0\n")
    here, there = (Route(str(tmp_path / name / "way.csv")) for name in ("a", "b"))
    assert route_digest(here) == route_digest(there)
    assert route_digest(Route(here.path, step_m=0.1)) != route_digest(here)
    (tmp_path / "a" / "way.csv").write_text("x_m,y_m\n0,0\n2,0\n")
    assert route_digest(here) != route_digest(there)
    assert route_digest(Route("lap")) == route_digest(Route("lap", ground_m=None))
