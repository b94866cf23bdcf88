"""Rays between pixels beside traced ones, and the tiles in which their points are seen."""

import numpy as np
import pytest

from omnisim import OmniCamera
from omnisim.cameras import pixel_grid
from omnisim.cameras.optics import OpticalSystem, Surface
from omnisim.cameras.optics.shapes import Conic
from omnisim.core.cube import face_index, face_tangents
from omnisim.core.errors import GraphicsError
from omnisim.rendering.atlas.parallax_plan import parallax_tiles, rays_by_color, sample_rays
from tests.cameras.optics.examples import SYSTEMS, at, pinhole, port
from tests.cameras.optics.samples import all_samples

NEAR_M = 0.5


@pytest.mark.parametrize("name", ["port", "needle", "tilted camera"])
def test_rays_between_pixels(name):
    """Interpolated rays are within 0.02 px of traced ones, at the rim they are those."""
    system = SYSTEMS[name].scaled(0.5)
    found = all_samples(sample_rays(system, 3), system)
    exact = system.scaled(3.0).ray_from_pixel(pixel_grid(540, 540))
    assert (found.valid != exact.valid).mean() < 1e-4
    both = found.valid & exact.valid
    misses = np.linalg.norm(found.directions - exact.directions, axis=-1)[both]
    inner = both[:-3] & both[3:]
    pixel = np.linalg.norm(exact.directions[3:] - exact.directions[:-3], axis=-1)[inner]
    assert misses.max() < 0.1 * pixel.max()
    assert np.percentile(misses, 99.0) < 0.02 * np.median(pixel)
    assert np.abs(found.origins_m - exact.origins_m)[both].max() < 1e-4


@pytest.mark.parametrize("name", ["dome", "tilted camera", "needle"])
def test_points_on_all_rays_are_seen_in_one_tile_with_a_texel_to_spare(name):
    (rays,), _ = rays_by_color(OmniCamera(SYSTEMS[name].scaled(0.25), supersampling=1))
    plan = parallax_tiles([rays], 2.0, NEAR_M)
    directions, origins_m = rays.centers()
    for distance_m in (NEAR_M, 1.0, 1e6):
        points_m = distance_m * directions + origins_m
        faces = face_index(points_m)
        tangents, tiles = face_tangents(points_m, faces), np.zeros(len(faces), dtype=int)
        for tile in plan.tiles:
            texel = 2.0 / tile.face_size_px
            first = np.maximum(tile.region[0], tile.padded_region[0] + texel)
            last = np.minimum(tile.region[1], tile.padded_region[1] - texel)
            tiles += (faces == tile.face) & np.all((tangents >= first) & (tangents <= last), axis=1)
        assert (tiles == 1).all()


def test_origins_are_relative_to_the_viewpoint_and_without_a_rim_all_is_interpolated():
    rays = sample_rays(OpticalSystem(pinhole(1300.0), port()).scaled(0.1), 3)
    assert rays.smooth.all()
    assert rays.rim_directions.shape == (0, 9, 3)
    system = SYSTEMS["port"].scaled(0.2)
    (rays,), viewpoint_m = rays_by_color(OmniCamera(system, supersampling=2))
    _, origins_m = sample_rays(system, 2).centers()
    np.testing.assert_allclose(rays.centers()[1] + viewpoint_m, origins_m, atol=1e-6)


def test_optics_that_see_nothing_are_refused():
    tiny = OpticalSystem(pinhole(5.0).scaled(1 / 45), (Surface(Conic(0.06), at(0.2), 0.001),))
    with pytest.raises(GraphicsError, match=r"^camera: no pixel of the image sees anything"):
        rays_by_color(OmniCamera(tiny, polygons=16))
