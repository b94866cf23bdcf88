"""Accuracy of detections, and the initial conditions of the experiments."""

import math

import numpy as np
import pytest

from omnisim.perception.landmarks.landmark_detector import Detection
from omnisim.perception.localization.filter import LandmarkMap, read_parameters
from omnisim.perception.localization.track import mean_interval
from omnisim.validation.experiments.experiment_runs import (
    REAL_PARAMETERS,
    DetectionMatch,
    SeedRuns,
    accuracy,
    compare,
)
from omnisim.validation.experiments.recordings import TRAINING_WAYPOINTS, real_camera


def _detection(name, range_m, bearing_rad, sigma_m=0.01):
    return Detection(name, bearing_rad, range_m, range_m - 0.01, 0.01, sigma_m, 0, 1, 0, 1, 4)


def test_matches_are_near_the_landmark():
    landmarks = LandmarkMap({"a": (2.0, 0.0), "b": (0.0, 3.0), "c": (-1.0, 0.0), "d": (0, -6.0)})
    pose = np.zeros((1, 3))
    seen = [[
        _detection("a", 2.1, math.radians(1.0)),
        _detection("b", 3.0, math.radians(90.0 + 4.0)),  # 4° off is somewhere else
        _detection("c", 1.0, math.radians(-179.0)),  # 1° off, across the half turn
    ]]  # fmt: skip
    found = {each.landmark: each for each in compare(seen, pose, landmarks, (0.0, 0.0))}
    assert {name for name, each in found.items() if each.is_right} == {"a", "c"}
    assert found["a"].range_error_m == pytest.approx(0.1)
    assert found["c"].bearing_error_rad == pytest.approx(math.radians(1.0))
    assert found["d"].detection is None
    near = accuracy(list(found.values()), 0.0, 4.0)
    assert (near.recall, near.precision, near.count) == (2 / 3, 2 / 3, 2)
    assert near.range_rms_share == pytest.approx(math.sqrt(0.05**2 / 2))
    assert near.eq2_mean_m == pytest.approx(-0.01)
    assert accuracy(list(found.values()), 4.0, 9.0).recall == 0.0
    nothing = accuracy([], 0.0, 4.0)
    assert math.isnan(nothing.recall)
    assert math.isnan(nothing.bearing_rms_rad)


def test_a_range_that_is_far_off_is_no_find_unless_it_says_so():
    off = DetectionMatch(0, "a", 2.0, _detection("a", 2.7, 0.0), 0.7, 0.0)
    unsure = DetectionMatch(0, "a", 2.0, _detection("a", 2.7, 0.0, sigma_m=0.5), 0.7, 0.0)
    assert (off.is_right, unsure.is_right) == (False, True)


def test_seeds_are_averaged_over_finite_values():
    runs = SeedRuns(
        (), np.zeros((2, 3)), np.zeros((2, 3)),
        np.array([[np.nan, 2.0, 4.0], [np.nan, np.nan, 2.0]]),
        np.array([[np.nan, 3.0, 2.0], [np.nan, np.nan, 6.0]]),
        np.array([[0, 4, 2], [0, 0, 6]]),
    )  # fmt: skip
    np.testing.assert_array_equal(runs.nees_by_step, [np.nan, 2.0, 3.0])
    np.testing.assert_array_equal(runs.nis_by_step, [np.nan, 0.75, 1.0])
    assert runs.nis_intervals[2] == mean_interval(1, 8)


def test_the_real_setting_starts_without_any_doubt():
    parameters = read_parameters(REAL_PARAMETERS)
    assert parameters.start.position_sigma_m == parameters.start.heading_sigma_rad == 0.0
    camera = real_camera()
    assert {"defocus", "shutter", "exposure", "noise", "bayer", "dirt"} <= camera.parts.keys()


def test_colors_are_learned_on_another_way():
    lap = np.array([(2.3, 1.5), (-2.3, 1.5), (-2.3, -1.5), (2.3, -1.5)])
    way = np.array(TRAINING_WAYPOINTS)
    assert np.linalg.norm(way[:, None] - lap, axis=2).min() > 0.5
    assert np.all(np.abs(way) < (2.7, 1.8))
