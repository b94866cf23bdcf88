"""Shifts between two images of a known pattern."""

import numpy as np
import pytest

from omnisim.validation.image_differences import displacements

EVERYWHERE = np.ones((240, 240), dtype=bool)


def _pattern(shift):
    v, u = np.indices((240, 240)).astype(np.float64)
    u, v = u - shift[0], v - shift[1]
    return 128.0 + 50.0 * np.sin(0.6 * u + 0.2 * v) + 50.0 * np.cos(0.5 * v - 0.1 * u)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.1, 0.0), (0.0, -0.05), (-0.2, 0.15)])
def test_a_known_shift_is_found(shift):
    found = displacements(_pattern((0.0, 0.0)), _pattern(shift), EVERYWHERE)
    assert len(found.shifts_px) == 100
    # central differences underrate a gradient of 0.6 rad a pixel by 0.6²/6, so shifts seem 6 %
    # longer
    np.testing.assert_allclose(found.shifts_px, np.tile(shift, (100, 1)), rtol=0.08, atol=0.003)


def test_patches_without_edges_both_ways_do_not_count():
    stripes = np.tile(_pattern((0.0, 0.0))[:1], (240, 1))
    assert len(displacements(stripes, stripes, EVERYWHERE).shifts_px) == 0


def test_patches_that_are_not_wholly_inside_do_not_count():
    inside = EVERYWHERE.copy()
    inside[:30] = False
    pattern = _pattern((0.0, 0.0))
    found = displacements(pattern, pattern, inside)
    assert found.middles_px[:, 1].min() > 48.0
