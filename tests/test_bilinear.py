"""Bilinear interpolation: exact on planes, and clamped at the border."""

import numpy as np

from omnisim.core.bilinear import corner_and_weights, sample


def test_a_plane_is_interpolated_exactly():
    u, v = np.meshgrid(np.arange(7.0), np.arange(5.0))
    positions = np.random.default_rng(0).uniform((0.0, 0.0), (6.0, 4.0), (50, 2))
    expected = 2.0 * positions[:, 0] - 3.0 * positions[:, 1]
    # weights are float32
    np.testing.assert_allclose(sample(2.0 * u - 3.0 * v, positions), expected, atol=1e-5)


def test_the_border_is_clamped_and_masked():
    image = np.arange(6.0).reshape(2, 3)
    positions = np.array([[-1.0, 0.0], [2.0, 1.0], [2.5, 1.0]])
    np.testing.assert_array_equal(sample(image, positions), [0.0, 5.0, 5.0])
    _, weights, inside = corner_and_weights(positions, image.shape)
    np.testing.assert_array_equal(inside, [False, True, False])
    np.testing.assert_allclose(weights.sum(axis=0), 1.0)
