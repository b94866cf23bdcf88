"""Fig. 10's suite, run as little as can be: no times, only what must be there."""

import dataclasses

import numpy as np
import pytest

from benchmarks.options import Options
from benchmarks.patrol import patrol, viewport
from benchmarks.report import check
from benchmarks.suites import fps
from benchmarks.timer import Timings
from omnisim import Vehicle, load_scene
from omnisim.plots.style import write_plot


@pytest.fixture(scope="module")
def report():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fps, "TIMES_MORE", 1)
        return fps.run(Options(rounds=1, warm_up=0, scenes=("rings",)), sizes_px=(60,))


@pytest.mark.usefixtures("needs_opengl")
def test_every_sensor_is_timed_at_both_settings(report, tmp_path):
    check(report)
    cameras = [(16, 64, 256, 1024, 4096, "exact")] * 2
    assert [row["polygons"] for row in report["rows"] if row["sensor"] == "camera"] == [
        polygons for meshes in cameras for polygons in meshes
    ]
    assert sum(row["sensor"] == "lms200" for row in report["rows"]) == 2
    costs = [row["cost_ms"] for row in report["rows"] if row["sensor"] == "no sensor"]
    assert costs == [0.0, 0.0]
    covered_px = [row["covered_px"] for row in report["rows"] if row["setting"] == "fast"][2:]
    assert covered_px == sorted(covered_px)  # a coarse mesh is smaller
    assert 0.8 * covered_px[-1] < covered_px[0] < 0.95 * covered_px[-1]
    errors_px = [row["mesh_error_px"] for row in report["rows"] if row["setting"] == "fast"][2:]
    # README's table of meshes is for 360 px
    np.testing.assert_allclose(errors_px[:5], np.array([9.95, 2.37, 0.581, 0.144, 0.036]) / 6, 1e-2)
    assert errors_px[5] == 0.0
    write_plot(tmp_path / "fps.png", fps.figure(report))
    assert (tmp_path / "fps.png").stat().st_size > 0


@pytest.mark.usefixtures("needs_opengl")
def test_bound_is_that_of_frames_per_second(report):
    fast = {row["polygons"]: row for row in report["rows"] if row["setting"] == "fast"}
    bound = report["bounds"][0]
    assert "fast" in bound["name"]
    assert bound["value"] == pytest.approx(fast[4096]["fps"] / fast[16]["fps"])
    assert bound["value"] == fast[4096]["share"]
    assert fast[16]["share"] == 1.0
    assert (bound["low"], bound["high"]) == (fast[4096]["share_low"], fast[4096]["share_high"])
    lines = fps.lines(report)
    assert sum("× off" in line or "reached" in line for line in lines) == 2
    assert sum("the paper found them alike" in line for line in lines) == 2
    table = [line.split() for line in lines[lines.index("frames per second, 60²") + 1 :]]
    assert table[0] == ["rings,", "fast", "rings,", "default"]
    (exact,) = (row for row in table if row[-3:-2] == ["exact"])
    assert exact[-2:] == [
        f"{row['fps']:.1f}" for row in report["rows"] if row["polygons"] == "exact"
    ]


def test_the_time_left_is_shared_by_the_groups_left(monkeypatch):
    times = iter([0.0, 0.0, 30.0, 130.0])
    monkeypatch.setattr(fps.time, "perf_counter", lambda: next(times))
    assert list(fps._shares_s(90.0, 3)) == [30.0, 30.0, 0.0]


def test_maps_with_baked_light_are_timed_without_it_too():
    options = Options(scenes=("soccer", "rings"))
    assert list(fps._lit_maps(options)) == ["soccer", "rings"]
    maps = fps._lit_maps(dataclasses.replace(options, is_full=True))
    assert list(maps) == ["soccer", "soccer, even light", "rings"]
    assert [maps[name].lighting.baked is None for name in maps] == [False, True, True]


def test_remark_tells_the_cost_beside_the_view():
    ones = np.ones(30)
    seconds = {"no sensor": 0.010 * ones, "lms200": 0.012 * ones, "1024": 0.018 * ones}
    lines = fps._remark("soccer", "fast", Timings(seconds, seconds))
    assert "costs 8.0 ms, the LMS200 2.0 ms: 4.0 times as much" in lines


def test_patrol_follows_the_path_and_turns_on_the_spot_without_one():
    vehicle = Vehicle.load("p2at")
    soccer, rings = load_scene("soccer"), load_scene("rings")
    along = patrol(soccer, vehicle, 10)
    assert len({tuple(np.round(pose[:2, 3], 3)) for pose in along}) > 5
    np.testing.assert_allclose(along[0][:2, 3], soccer.paths[0].waypoints_m[0])
    turning = patrol(rings, vehicle, 4)
    eyes = turning @ np.append(vehicle.camera().origin_m, 1.0)
    np.testing.assert_allclose(eyes[:, :3], np.tile(rings.start.position_m, (4, 1)), atol=1e-12)
    headings = np.unwrap(np.arctan2(turning[:, 1, 0], turning[:, 0, 0]))
    np.testing.assert_allclose(np.diff(headings), 0.5 * np.pi)


def test_viewport_has_a_sample_for_each_pixel():
    window = viewport()
    assert (window.supersampled_model.width_px, window.supersampled_model.height_px) == (640, 480)
