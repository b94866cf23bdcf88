"""Rays of pixels beside those of the GPU, and their steps to the next samples."""

import math

import numpy as np
import pytest

from omnisim import OmniCamera
from omnisim.cameras import EquidistantCamera, pixel_grid
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.pixel_rays import PixelRays

SMALL = OmniCamera().resized(90)
FISHEYE = OmniCamera(
    EquidistantCamera(80, 70, 25.0, (39.5, 34.5), math.radians(95.0)), polygons=None
)


def _whole(rays):
    """Rays (height, width, 3), their validity, and their steps (height, width, 2, 3)."""
    shape = rays.camera.height_px, rays.camera.width_px
    directions, valid, steps = (
        np.zeros((*shape, 3)),
        np.zeros(shape, bool),
        np.zeros((*shape, 2, 3)),
    )
    for number, rows in enumerate(rays.bands):
        band = rays.band(number)
        valid[rows] = band.valid
        directions[rows][band.valid] = band.directions
        steps[rows][band.valid] = band.footprints
    return directions, valid, steps


@pytest.mark.parametrize("polygons", [None, 64, 1024])
def test_rays_are_those_of_the_gpu(context, polygons):
    camera = SMALL.with_polygons(polygons).model
    theirs, their_valid = PixelMap(context, camera, polygons).read_rays()
    mine, valid, _ = _whole(PixelRays(camera, polygons))
    # along the outline a rounding decides
    assert (valid != their_valid).sum() <= 4
    both = valid & their_valid
    assert np.abs(mine - theirs)[both].max() < 2e-6


@pytest.mark.parametrize("sensor", [SMALL, FISHEYE])
def test_steps_are_those_to_the_next_samples(sensor):
    camera = sensor.model.scaled(2)
    directions, valid, steps = _whole(PixelRays(camera, None, 2))
    pixels = pixel_grid(camera.width_px, camera.height_px)
    for axis, offset in enumerate(((1.0, 0.0), (0.0, 1.0))):
        beside = camera.ray_from_pixel(pixels + offset)
        there = valid & beside.valid
        assert there.mean() > 0.5
        expected = (beside.directions - directions)[there]
        np.testing.assert_allclose(steps[..., axis, :][there], expected, atol=1e-7)
        # at the right and lower border of what is valid, as long as the step before
        lengths = np.linalg.norm(steps[..., axis, :], axis=-1)
        assert (lengths[valid] > 0.0).mean() > 0.99


def test_bands_end_where_pixels_do():
    rays = PixelRays(OmniCamera().model.scaled(3), None, 3)
    assert len(rays.bands) > 10
    assert all(rows.start % 3 == 0 for rows in rays.bands)
    assert rays.bands[-1].stop == rays.camera.height_px
