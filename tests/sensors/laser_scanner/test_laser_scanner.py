"""The scanner's specification and errors, without a scene."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.errors import OpticsError
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner


@pytest.mark.parametrize(
    ("scanner", "beams", "first_deg", "last_deg"),
    [
        (LaserScanner(), 361, -90.0, 90.0),
        (LaserScanner.lms200(1.0), 181, -90.0, 90.0),
        (LaserScanner.lms200(0.25), 401, -50.0, 50.0),
        (LaserScanner(resolution_deg=1.0 / 3.0), 541, -90.0, 90.0),
        (LaserScanner(resolution_deg=0.7), 258, -90.0, 89.9),
        (LaserScanner(field_of_view_deg=360.0, resolution_deg=1.0), 361, -180.0, 180.0),
        (LaserScanner.usarsim(), 181, -90.0, 90.0),
    ],
)
def test_beams_run_from_right_to_left(scanner, beams, first_deg, last_deg):
    assert scanner.beams == len(scanner.angles_deg) == beams
    assert scanner.angles_deg[[0, -1]] == pytest.approx((first_deg, last_deg), abs=0.05)
    assert scanner.angle_min_rad == pytest.approx(np.radians(first_deg), abs=1e-3)
    assert scanner.angle_max_rad == pytest.approx(np.radians(last_deg), abs=1e-3)
    np.testing.assert_allclose(
        np.diff(np.radians(scanner.angles_deg)), scanner.angle_increment_rad, rtol=1e-9
    )


def test_lms200_modes():
    near, far = LaserScanner.lms200(), LaserScanner.lms200(mode="cm", seed=3)
    assert near == LaserScanner()
    assert (near.range_max_m, near.step_m) == (8.19, 0.001)
    assert (far.range_max_m, far.step_m, far.seed) == (81.9, 0.01, 3)


def test_usarsim_scanner():
    scanner = LaserScanner.usarsim(max_range_m=20.0, noise=0.001)
    assert (scanner.range_max_m, scanner.sigma_per_m, scanner.sigma_m) == (20.0, 0.001, 0.0)
    assert scanner.device_error_m == 0.0
    assert scanner.angle_increment_rad == pytest.approx(0.01745)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("field_of_view_deg", 361.0),
        ("resolution_deg", 0.0),
        ("resolution_deg", 1e-6),
        ("range_min_m", -0.1),
        ("range_min_m", 9.0),
        ("range_max_m", np.nan),
        ("step_m", -0.001),
        ("sigma_m", np.inf),
        ("systematic_error_m", np.nan),
        ("seed", 2**32),
        ("seed", 0.5),
    ],
)
def test_impossible_scanners_are_refused(key, value):
    with pytest.raises(OpticsError, match=rf"^scanner\.{key}: expected .*, got "):
        LaserScanner(**{key: value})


def test_invalid_lms200_settings_are_refused():
    with pytest.raises(OpticsError, match=r"resolution_deg: expected 1, 0\.5 or 0\.25, got 0\.3"):
        LaserScanner.lms200(0.3)
    with pytest.raises(OpticsError, match=r"scanner\.mode: expected mm or cm, got 'km'"):
        LaserScanner.lms200(mode="km")
    with pytest.raises(OpticsError, match=r"scan_number: expected .*, got -1"):
        LaserScanner().measure(np.ones(361), -1)


def test_noise_has_the_specified_mean_and_deviation():
    scanner = LaserScanner(seed=5)
    true_m = np.linspace(1.0, 8.0, scanner.beams)
    scans = 300
    errors = np.array([scanner.measure(true_m, number) - true_m for number in range(scans)])
    count = errors.size
    sigma = np.hypot(scanner.sigma_m, scanner.step_m / np.sqrt(12.0))  # rounding adds its own
    # five standard deviations of the mean and of the spread of `count` normal numbers
    assert abs(errors.mean() - scanner.device_error_m) < 5.0 * sigma / np.sqrt(count)
    assert abs(errors.std() / sigma - 1.0) < 5.0 / np.sqrt(2.0 * count)
    kurtosis = np.mean((errors - errors.mean()) ** 4) / errors.var() ** 2
    assert abs(kurtosis - 3.0) < 5.0 * np.sqrt(24.0 / count)
    # neighbors in beam and in time know nothing of each other
    free = (errors - errors.mean()) / errors.std()
    assert abs(np.mean(free[:, 1:] * free[:, :-1])) < 5.0 / np.sqrt(count)
    assert abs(np.mean(free[1:] * free[:-1])) < 5.0 / np.sqrt(count)


def test_relative_noise_grows_with_the_range():
    scanner = dataclasses.replace(LaserScanner.usarsim(), step_m=0.0)
    for true_m in (2.0, 15.0):
        ranges = [scanner.measure(np.full(scanner.beams, true_m), number) for number in range(100)]
        count = 100 * scanner.beams
        assert abs(np.std(ranges) / (0.001 * true_m) - 1.0) < 5.0 / np.sqrt(2.0 * count)


def test_systematic_error_is_constant_per_device():
    errors = np.array([LaserScanner(seed=seed).device_error_m for seed in range(1000)])
    bound = LaserScanner().systematic_error_m
    assert np.abs(errors).max() <= bound
    assert abs(errors.mean()) < 5.0 * bound / np.sqrt(3.0 * 1000)
    assert errors.std() == pytest.approx(bound / np.sqrt(3.0), rel=0.1)
    assert LaserScanner(seed=7).device_error_m == errors[7]


def test_scans_are_reproducible_one_by_one():
    scanner = LaserScanner(seed=11)
    true_m = np.full(scanner.beams, 4.0)
    drive = [scanner.measure(true_m, number) for number in range(8)]
    np.testing.assert_array_equal(LaserScanner(seed=11).measure(true_m, np.int64(6)), drive[6])
    assert np.any(drive[5] != drive[6])
    assert np.any(LaserScanner(seed=12).measure(true_m, 6) != drive[6])
    # what the other beams see changes nothing for this one
    elsewhere = np.where(np.arange(scanner.beams) % 3 == 0, 4.0, np.inf)
    again = scanner.measure(elsewhere, 6)
    np.testing.assert_array_equal(again[::3], drive[6][::3])
    assert np.all(np.isposinf(again[1::3]))


def test_limits_and_rounding():
    scanner = LaserScanner().without_noise()
    given = [0.0, 0.0994, 0.0996, 0.1, 1.23449, 1.2351, 8.19, 8.1904, 8.1906, 9.0, np.inf]
    expected = [-np.inf, -np.inf, 0.1, 0.1, 1.234, 1.235, 8.19, 8.19, np.inf, np.inf, np.inf]
    true_m = np.full(scanner.beams, np.inf)
    true_m[: len(given)] = given
    np.testing.assert_array_equal(scanner.measure(true_m, 0)[: len(expected)], expected)
    coarse = LaserScanner.lms200(mode="cm").without_noise().measure(true_m, 0)
    assert coarse[4] == 1.23
    exact = scanner.without_errors().measure(true_m, 0)
    assert exact[4] == 1.23449


def test_reach_covers_noise():
    scanner = LaserScanner()
    assert scanner.range_max_m + 10.0 * scanner.sigma_m < scanner.reach_m < 8.3
    assert LaserScanner(range_max_m=np.inf).reach_m == np.inf
