"""The report's measuring tools, on images that are known exactly."""

import math

import numpy as np
import pytest

from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.report.report import Measure
from omnisim.validation.checks.lit_scenes import edge_distance_px, inside_surfaces, lit_share
from omnisim.validation.checks.materials import ciede2000, lab_from_linear
from omnisim.validation.checks.paper_mirror import ring_radii
from omnisim.validation.fixture import max_abs, mean_abs
from omnisim.validation.image_differences import (
    converged_psnr_db,
    displacements,
    noise_floor_db,
    psnr_db,
    ssim,
)
from omnisim.validation.plain_scenes import centroids, marker_positions, rim_centroids_px

SIDE = 120
EVERYWHERE = np.ones((SIDE, SIDE), dtype=bool)


def _smooth_ring(radius, center, width=1.5):
    v, u = np.indices((201, 201)).astype(np.float64)
    distance = np.hypot(u - center[0], v - center[1])
    return np.exp(-0.5 * ((distance - radius) / width) ** 2)


@pytest.mark.parametrize("radius", [10.0, 80.77])
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
    assert np.degrees(np.arccos((rays @ rays.T - 2.0 * np.eye(200)).max())) > 5.0


@pytest.mark.parametrize(
    ("value", "at_least", "passed"),
    [(1.0, False, True), (1.1, False, False), (0.9, True, False), (1.0, True, True)],
)
def test_bounds(value, at_least, passed):
    assert Measure("x", value, bound=1.0, at_least=at_least).passed == passed
    for nothing in (max_abs(np.array([])), mean_abs(np.array([np.nan, 0.0]))):
        assert not Measure("x", nothing, bound=1.0, at_least=at_least).passed


def _image(levels):
    return linear_from_srgb(np.broadcast_to(levels, (SIDE, SIDE, 3)) / 255.0)


def test_psnr_counts_levels_of_the_chosen_pixels():
    assert np.isclose(psnr_db(_image(100.0), _image(101.0), EVERYWHERE), 48.1308, atol=1e-4)
    other, where = _image(100.0).copy(), EVERYWHERE.copy()
    other[:, :50], where[:, :50] = 1.0, False
    assert psnr_db(_image(100.0), other, where) == np.inf


def test_noise_does_not_hide_the_distance_from_a_converged_image():
    """At two levels off, noise of 8 levels in each image limits the plain PSNR to 30 dB."""
    random = np.random.default_rng(0)
    noisy = [_image(128.0 + random.normal(0.0, 8.0, (SIDE, SIDE, 3))) for _ in range(2)]
    off, truth = _image(130.0), _image(128.0)
    # 43 200 products with a standard deviation of 66 levels² about 4: 0.35 dB
    expected = psnr_db(off, truth, EVERYWHERE)
    assert abs(converged_psnr_db(off, *noisy, EVERYWHERE) - expected) < 1.0
    assert psnr_db(off, noisy[0], EVERYWHERE) < 31.0
    floor = noise_floor_db(*noisy, EVERYWHERE)
    assert abs(floor - psnr_db(noisy[0], truth, EVERYWHERE)) < 0.15  # of squares: 0.03 dB


def test_structural_similarity():
    image, other = np.random.default_rng(1).random((2, SIDE, SIDE, 3))
    noisy = image + 0.05 * np.random.default_rng(2).standard_normal(image.shape)
    assert ssim(image, image, EVERYWHERE) == pytest.approx(1.0)
    assert 0.8 < ssim(image, np.clip(noisy, 0.0, 1.0), EVERYWHERE) < 0.999
    assert ssim(image, other, EVERYWHERE) < 0.2
    a, b = srgb_from_linear(np.array((0.2, 0.5))).tolist()  # even images: in closed form
    found = ssim(np.full_like(image, 0.2), np.full_like(image, 0.5), EVERYWHERE)
    assert found == pytest.approx((2 * a * b + 1e-4) / (a * a + b * b + 1e-4), rel=1e-6)


def _pattern(shift):
    v, u = np.indices((SIDE, SIDE)).astype(np.float64)
    u, v = u - shift[0], v - shift[1]
    return 128.0 + 50.0 * np.sin(0.6 * u + 0.2 * v) + 50.0 * np.cos(0.5 * v - 0.1 * u)


@pytest.mark.parametrize("shift", [(0.1, 0.0), (0.0, -0.05), (-0.2, 0.15)])
def test_a_known_shift_is_found(shift):
    found = displacements(_pattern((0.0, 0.0)), _pattern(shift), EVERYWHERE)
    # central differences underrate a gradient of 0.6 rad a pixel by 0.6²/6, so shifts seem 6 %
    # longer
    np.testing.assert_allclose(found.shifts_px, np.tile(shift, (25, 1)), rtol=0.08, atol=0.003)


def test_patches_without_edges_both_ways_or_partly_outside_do_not_count():
    pattern = _pattern((0.0, 0.0))
    stripes, inside = np.tile(pattern[:1], (SIDE, 1)), EVERYWHERE.copy()
    assert len(displacements(stripes, stripes, EVERYWHERE).shifts_px) == 0
    inside[:30] = False
    assert displacements(pattern, pattern, inside).middles_px[:, 1].min() > 48.0


# Sharma, Wu and Dalal, 2005, table 1: pairs 1, 4, 7, 9, 13, 17, 21, 25, 31 and 34
PAIRS = [
    ((50, 2.6772, -79.7751), (50, 0, -82.7485), 2.0425),
    ((50, -1.3802, -84.2814), (50, 0, -82.7485), 1.0000),
    ((50, 0, 0), (50, -1, 2), 2.3669),
    ((50, 2.4900, -0.0010), (50, -2.4900, 0.0009), 7.1792),
    ((50, -0.0010, 2.4900), (50, 0.0009, -2.4900), 4.8045),
    ((50, 2.5, 0), (73, 25, -18), 27.1492),
    ((50, 2.5, 0), (50, 3.1736, 0.5854), 1.0000),
    ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
    ((90.8027, -2.0831, 1.4410), (91.1528, -1.6435, 0.0447), 1.4441),
    ((2.0776, 0.0795, -1.1350), (0.9033, -0.0636, -0.5514), 0.9082),
]


def test_color_differences_are_those_that_their_authors_published():
    first, second, expected = zip(*PAIRS, strict=True)
    found = ciede2000(np.array(first, float), np.array(second, float))
    assert found == pytest.approx(np.array(expected), abs=1e-4)
    found = lab_from_linear(np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]))
    assert found == pytest.approx(np.array([[100.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), abs=1e-9)


def half_plane(at_px, angle_deg=0.0, size_px=40):
    """Shares of light right of a line near the middle, two pixels wide."""
    v, u = np.indices((size_px, size_px)) - 0.5 * size_px
    angle = math.radians(angle_deg)
    away = u * math.cos(angle) + v * math.sin(angle) - at_px
    return np.clip(0.5 * away + 0.5, 0.0, 1.0).astype(np.float32)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0])
@pytest.mark.parametrize("shift_px", [0.0, 0.4, 3.0])
def test_distance_is_the_shift_of_a_straight_edge(angle_deg, shift_px):
    where = np.zeros((40, 40), bool)
    first, second = (half_plane(at_px, angle_deg) for at_px in (0.2, 0.2 + shift_px))
    assert math.isnan(edge_distance_px(first, second, where))
    where[10:-10, 10:-10] = True  # so that ends at the image's edge do not count
    found = edge_distance_px(first, second, where)
    assert found == pytest.approx(shift_px, abs=0.13)  # edges are whole eighths of a pixel


def test_shares_are_of_the_light_without_shadows():
    unshadowed = np.full((2, 2, 3), 0.5, np.float32)
    assert np.allclose(lit_share(0.5 * unshadowed, unshadowed), 0.5)
    assert (lit_share(np.zeros_like(unshadowed), 0.0 * unshadowed) == 0.0).all()


def test_edges_of_objects_bends_and_dark_surfaces_do_not_count():
    instances, normals = np.zeros((20, 40), int), np.zeros((20, 40, 3))
    instances[:, 20:] = 1
    normals[..., 2] = 1.0
    normals[:, 30:] = (1.0, 0.0, 0.0)
    bright = np.ones((20, 40, 3), np.float32)
    bright[:, :10] = 0.0
    row = inside_surfaces(instances, normals, bright)[10]
    assert row[[13, 24, 25, 35]].all()
    assert not row[[*range(10), *range(18, 22), *range(28, 32)]].any()
