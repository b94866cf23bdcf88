"""Bounding boxes of points and triangles."""

import numpy as np
import pytest

from omnisim.core.arrays import bounds_of, triangle_bounds

POINTS = np.random.default_rng(0).normal(size=(60, 3))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_bounds_are_the_smallest_and_largest_of_each_axis(dtype):
    points = POINTS.astype(dtype)
    bounds = bounds_of(points)
    assert bounds.dtype == dtype
    np.testing.assert_array_equal(bounds, [points.min(axis=0), points.max(axis=0)])


def test_bounds_of_triangles_are_those_of_their_corners():
    corners = POINTS.reshape(20, 3, 3)
    low, high = triangle_bounds(corners)
    np.testing.assert_array_equal(low, corners.min(axis=1))
    np.testing.assert_array_equal(high, corners.max(axis=1))
