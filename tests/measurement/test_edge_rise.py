"""Rise of an edge: that of edges whose blur is known."""

import numpy as np
import pytest
from scipy.special import ndtr

from omnisim.measurement.comparison.comparison import edge_rise_px

GAUSSIAN_RISE = 2.5631  # 10-90 % rise of a Gaussian with σ = 1


def edge(sigma_px, slope=0.2, black=30.0, white=220.0, samples=8):
    """Image (60, 60) of an edge through its middle, blurred by a Gaussian, averaged over pixels."""
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    v, u = np.mgrid[:60, :60].astype(np.float64)
    direction = np.array([1.0, slope]) / np.hypot(1.0, slope)
    levels = np.zeros_like(u)
    for dv in steps:
        for du in steps:
            distance = (u + du - 29.5) * direction[0] + (v + dv - 29.5) * direction[1]
            levels += ndtr(distance / sigma_px)
    return np.rint(black + (white - black) * levels / samples**2).astype(np.uint8)


@pytest.mark.parametrize("sigma_px", [0.5, 0.8, 1.5])
@pytest.mark.parametrize("slope", [0.2, -0.4])
def test_rise_of_a_gaussian_edge(sigma_px, slope):
    along = np.array([-slope, 1.0]) / np.hypot(1.0, slope) * 20.0
    middle = np.array([29.5, 29.5])
    rise = edge_rise_px(edge(sigma_px, slope), middle - along, middle + along)
    pixel = (np.cos(np.arctan(slope)) ** 2 + np.sin(np.arctan(slope)) ** 2) / 12.0
    expected = GAUSSIAN_RISE * np.hypot(sigma_px, np.sqrt(pixel))
    assert rise == pytest.approx(expected, rel=0.05)  # the bins of 0.25 px widen it by 0.01 px


def test_faint_and_short_edges_have_none():
    ends = np.array([29.5, 10.0]), np.array([29.5, 50.0])
    assert np.isnan(edge_rise_px(edge(1.0, 0.0, 100.0, 110.0), *ends))
    assert np.isnan(edge_rise_px(edge(1.0, 0.0), ends[0], ends[0] + (0.0, 4.0)))
