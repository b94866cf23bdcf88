"""One edge, against closed forms."""

import numpy as np
import pytest
from scipy.special import ndtr

from omnisim.measurement.sharpness.slanted_edge import EdgeLine, Flaw, UnusableEdge, measure_edge
from omnisim.validation.checks.measured.sharpness import gaussian, true_mtf50
from tests.measurement.sharpness.edges import disc, edge_image, edge_levels, motion

MIDDLE = np.array((40.0, 40.0))


def line_at(angle_deg, length=48.0, reach=12.0):
    """Ends of an edge through the middle, half a pixel off."""
    angle = np.radians(angle_deg)
    half = 0.5 * length * np.array((-np.sin(angle), np.cos(angle)))
    return EdgeLine(MIDDLE - half, MIDDLE + half, reach)


def measured(image, angle_deg, clipped=None, **line):
    values = image if image.ndim == 3 else image[..., None]
    clipped = np.zeros(image.shape[:2], bool) if clipped is None else clipped
    return measure_edge(values, clipped, line_at(angle_deg, **line))


@pytest.mark.parametrize(
    ("spread", "angle_deg"),
    [
        *((gaussian(0.5), angle_deg) for angle_deg in (3.0, 12.0, 41.0, 95.0, 200.0)),
        (gaussian(0.3), 12.0),
        (gaussian(2.5), 41.0),
        (disc(1.0), 3.0),
        (disc(2.5), 200.0),
        (motion(3.0), 95.0),
    ],
)
def test_mtf50_is_that_of_the_formula(spread, angle_deg):
    """0.5 % without noise."""
    edge = measured(edge_image(spread, angle_deg), angle_deg)
    assert edge.mtf50 == pytest.approx(true_mtf50(spread, angle_deg), rel=0.005)
    angle = np.radians(angle_deg)
    np.testing.assert_allclose(edge.normal, (np.cos(angle), np.sin(angle)), atol=2e-3)
    assert abs(edge.asymmetry) < 0.006


@pytest.mark.parametrize("sigma_px", [0.4, 0.9, 2.0])
def test_width_and_rise_are_those_of_the_normal_distribution(sigma_px):
    edge = measured(edge_image(gaussian(sigma_px), 8.0), 8.0)
    assert np.sqrt(edge.variance_px2) == pytest.approx(sigma_px, rel=0.005)
    distances, levels = edge_levels(gaussian(sigma_px), 8.0, 20.0)
    low, high = np.interp((0.1, 0.9), levels, distances)
    # lines between bins cut off the bends, by 0.025 px
    assert edge.rise_px == pytest.approx(high - low, abs=0.03)


def test_whole_transfer_is_that_of_the_formula():
    edge = measured(edge_image(gaussian(0.6), 10.0), 10.0)
    frequencies = np.arange(0.0, 1.0001, 0.01)[:51]  # up to Nyquist
    angle = np.radians(10.0)
    pixel = np.sinc(frequencies * np.cos(angle)) * np.sinc(frequencies * np.sin(angle))
    expected = pixel * np.exp(-2.0 * (np.pi * 0.6 * frequencies) ** 2)
    np.testing.assert_allclose(edge.transfer[:51], expected, atol=3e-3)


def test_standard_deviation_is_that_of_the_noise():
    """The truth lies within two of them in most cases, and they are not larger than needed."""
    image, random = edge_image(gaussian(0.7), 7.0), np.random.default_rng(1)
    edges = [measured(image + 0.01 * random.normal(size=image.shape), 7.0) for _ in range(20)]
    errors = np.array([edge.mtf50 for edge in edges]) - true_mtf50(gaussian(0.7), 7.0)
    sigmas = np.array([edge.mtf50_sigma for edge in edges])
    assert np.mean(np.abs(errors) < 2.0 * sigmas) >= 0.8  # of 20: 95 % ± 4.9 %
    assert errors.std() == pytest.approx(sigmas.mean(), rel=0.5)  # known to 16 %
    assert errors.std() < 0.015 * edges[0].mtf50


def test_curved_edge_is_as_sharp_as_a_straight_one():
    """A circle of 150 px radius: a parabola is not enough without the fit of its height."""
    u, v = np.meshgrid(np.arange(80.0), np.arange(80.0))
    radius = np.hypot(u + 108.0, v - 25.0)
    image = 0.1 + 0.6 * ndtr((radius - 150.0) / np.hypot(0.8, np.sqrt(1.0 / 12.0)))
    edge = measured(image, np.degrees(np.arctan2(15.0, 148.0)))
    assert edge.mtf50 == pytest.approx(true_mtf50(gaussian(0.8), 6.0), rel=0.02)


def test_uneven_light_does_not_blur():
    image = edge_image(gaussian(0.8), 9.0)
    image *= np.linspace(0.93, 1.07, 80)
    edge = measured(image, 9.0)
    assert edge.mtf50 == pytest.approx(true_mtf50(gaussian(0.8), 9.0), rel=0.015)


def test_shift_of_colors_along_the_normal():
    angle = np.radians(14.0)
    normal = np.array((np.cos(angle), np.sin(angle)))
    colors = [
        edge_image(gaussian(width), 14.0, point_px=tuple(MIDDLE + shift * normal))
        for shift, width in ((0.37, 0.9), (0.0, 0.6), (-1.2, 0.7))
    ]
    image = np.stack(colors, axis=-1)
    image += 0.005 * np.random.default_rng(2).normal(size=image.shape)
    edge = measured(image, 14.0)
    np.testing.assert_allclose(edge.shifts_px, (0.37, -1.2), atol=0.012)
    assert (np.abs(edge.shifts_px - (0.37, -1.2)) < 4.0 * edge.shift_sigmas_px + 0.003).all()


def flaw(image, angle_deg, **arguments):
    with pytest.raises(UnusableEdge) as reason:
        measured(image, angle_deg, **arguments)
    return reason.value.args[0]


def test_flaws_have_names():
    image, random = edge_image(gaussian(0.8), 9.0), np.random.default_rng(3)
    for angle_deg, name in ((1.0, Flaw.STRAIGHT), (91.5, Flaw.STRAIGHT), (45.0, Flaw.PHASES)):
        assert flaw(edge_image(gaussian(0.8), angle_deg), angle_deg) is name
    assert flaw(image, 9.0, length=15.0) is Flaw.SHORT
    assert flaw(image, 9.0, clipped=image > 0.7) is Flaw.CLIPPED
    assert flaw(0.05 * image, 9.0) is Flaw.FAINT
    assert flaw(image + 0.2 * random.normal(size=image.shape), 9.0) is Flaw.FAINT
    assert flaw(edge_image(gaussian(6.0), 9.0), 9.0) is Flaw.WIDE
    assert flaw(image, 9.0, reach=60.0) is Flaw.OUTSIDE
    striped = image * (1.0 - 0.5 * (np.arange(80)[:, None] % 40 < 20))
    assert flaw(striped, 9.0) is Flaw.UNEVEN
