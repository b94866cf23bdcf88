"""The report's measuring tools, on images that are known exactly."""

import numpy as np
import pytest

from omnisim.report.report import Measure, Section
from omnisim.validation.checks.paper_mirror import ring_radii
from omnisim.validation.fixture import max_abs, mean_abs
from omnisim.validation.plain_scenes import centroids, marker_positions, rim_centroids_px


def _smooth_ring(radius, center, width=1.5):
    v, u = np.indices((201, 201)).astype(np.float64)
    distance = np.hypot(u - center[0], v - center[1])
    return np.exp(-0.5 * ((distance - radius) / width) ** 2)


@pytest.mark.parametrize("radius", [10.0, 40.3, 80.77])
def test_a_known_ring_is_measured(radius):
    center = (100.2, 99.7)
    found = ring_radii(_smooth_ring(radius, center), center, radius + 0.4, 6.0)
    # the root's weight moves a ring that is not blurred, but thick, by half its variance over the
    # radius; what is left then is bilinear interpolation between pixels
    error = found - radius - 0.5 * 1.5**2 / radius
    assert np.abs(error).max() < 0.02
    assert abs(error.mean()) < 0.01


def test_a_ring_off_the_center_is_noticed():
    found = ring_radii(_smooth_ring(50.0, (100.0, 100.0)), (100.5, 100.0), 50.0, 6.0)
    assert np.ptp(found) == pytest.approx(1.0, abs=0.05)


def test_centroids_of_known_spots():
    v, u = np.indices((100, 100)).astype(np.float64)
    places = np.array([[30.25, 40.5], [70.8, 60.1]])
    spots = sum(np.exp(-((u - x) ** 2 + (v - y) ** 2) / 8.0) for x, y in places)
    np.testing.assert_allclose(centroids(spots, np.rint(places)), places, atol=1e-3)
    assert np.isnan(centroids(np.zeros((100, 100)), places)).all()


def test_middle_of_an_outline_is_that_of_its_area():
    turn = 2.0 * np.pi * np.arange(96) / 96
    # a circle with its corners crowded to one side: the area's middle does not care
    crowded = turn + 0.5 * np.sin(turn)
    outline = np.stack((3.0 + np.cos(crowded), -2.0 + np.sin(crowded)), axis=-1)[None]
    np.testing.assert_allclose(rim_centroids_px(outline), [[3.0, -2.0]], atol=2e-3)


def test_markers_stand_apart_and_in_their_cone():
    viewpoint = np.array([1.0, 2.0, 3.0])
    rays = marker_positions(viewpoint, (0.0, 0.0, -1.0), 1.8, 200) - viewpoint
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert (rays[:, 2] <= -np.cos(1.8)).all()
    cosines = rays @ rays.T - 2.0 * np.eye(200)
    assert np.degrees(np.arccos(cosines.max())) > 5.0


@pytest.mark.parametrize(
    ("value", "at_least", "passed"),
    [(1.0, False, True), (1.1, False, False), (0.9, True, False), (1.0, True, True)],
)
def test_bounds(value, at_least, passed):
    measure = Measure("x", value, bound=1.0, at_least=at_least)
    assert measure.passed == passed
    assert (Section("", "", (measure,)).status == "passed") == passed


@pytest.mark.parametrize("at_least", [True, False])
def test_nan_never_passes(at_least):
    assert not Measure("x", max_abs(np.array([])), bound=1.0, at_least=at_least).passed
    assert not Measure("x", mean_abs(np.array([np.nan, 0.0])), bound=1.0, at_least=at_least).passed
