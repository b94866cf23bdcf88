"""One body of tests over every camera model."""

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from tests.camera_examples import CAMERA_EXAMPLES

examples = pytest.mark.parametrize("camera", CAMERA_EXAMPLES.values(), ids=CAMERA_EXAMPLES.keys())


@examples
def test_pixel_to_ray_to_pixel(camera):
    pixels = pixel_grid(camera.width_px, camera.height_px)
    rays = camera.ray_from_pixel(pixels)
    assert rays.directions.shape == (*pixels.shape[:-1], 3)
    assert rays.valid.any()
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=-1), 1.0, atol=1e-12)
    again = camera.pixel_from_ray(3.7 * rays.directions[rays.valid])
    assert again.valid.all()
    assert np.abs(again.positions_px - pixels[rays.valid]).max() < 1e-9


@examples
def test_unseen_directions_are_not_valid_and_finite(camera):
    directions = np.random.default_rng(1).normal(size=(5000, 3))
    pixels = camera.pixel_from_ray(directions)
    assert 0 < pixels.valid.sum() < len(directions)
    assert np.isfinite(pixels.positions_px).all()


@examples
def test_leading_axes_broadcast(camera):
    one = camera.ray_from_pixel((10.0, 20.0))
    many = camera.ray_from_pixel(np.full((2, 3, 2), (10.0, 20.0)))
    assert one.directions.shape == (3,)
    assert one.valid.shape == ()
    assert many.directions.shape == (2, 3, 3)
    np.testing.assert_array_equal(many.directions[1, 2], one.directions)
