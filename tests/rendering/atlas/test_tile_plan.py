import math

import numpy as np
import pytest

from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.cube import face_index, face_tangents
from omnisim.rendering.atlas.tile_plan import plan_tiles, whole_faces


def _plan(theta_max_deg=105.0, size_px=360, **options):
    mirror = HyperbolicMirror(theta_max_rad=math.radians(theta_max_deg))
    camera = HyperbolicCamera.framed_on_rim(mirror, size_px, size_px)
    return plan_tiles(camera, RIG_FROM_OPTICAL_LOOKING_UP, **options)


FIVE = {"front", "left", "back", "right", "down"}


@pytest.mark.parametrize(
    ("theta_max_deg", "names"),
    [
        (40.0, {"down"}),
        (44.9, {"down"}),
        (45.1, FIVE),
        (105.0, FIVE),
        (125.2, FIVE),
        (125.3, FIVE | {"up"}),  # past 90° + atan(1/√2) = 125.264°
        (150.0, FIVE | {"up"}),
    ],
)
def test_faces_that_the_rim_asks_for(theta_max_deg, names):
    assert {tile.face_name for tile in _plan(theta_max_deg).tiles} == names


def test_auto_sizes_are_the_closed_form():
    """Side faces D, bottom face D/(2 tan(θ_max/2)) texels; ours may have 5 % to spare."""
    sizes = {tile.face_name: tile.face_size_px for tile in _plan().tiles}
    assert 0.95 * 360 <= sizes["front"] <= 1.05 * 360
    bottom = 360 / (2.0 * math.tan(math.radians(105.0) / 2.0))
    assert bottom <= sizes["down"] <= 1.05 * bottom
    assert sizes["front"] == sizes["left"] == sizes["back"] == sizes["right"]


@pytest.mark.parametrize("face_size_px", [None, 64, 333, 1024])
def test_tiles_do_not_overlap_and_keep_to_mip_texels(face_size_px):
    plan = _plan(150.0, face_size_px=face_size_px)
    step = 1 << plan.max_level
    used = np.zeros((plan.height_px, plan.width_px), dtype=int)
    for tile in plan.tiles:
        numbers = (tile.left_px, tile.top_px, *tile.origin_px, *tile.size_px)
        assert all(number % step == 0 for number in numbers)
        right, bottom = tile.left_px + tile.size_px[0], tile.top_px + tile.size_px[1]
        used[tile.top_px : bottom, tile.left_px : right] += 1
    assert used.max() == 1
    if face_size_px:
        assert {tile.face_size_px for tile in plan.tiles} == {face_size_px}


@pytest.mark.parametrize(
    ("width_px", "height_px", "focal_length_px"),
    [(8, 8, 5000.0), (32, 32, 14000.0), (64, 2, 5000.0), (360, 1, 3000.0), (1, 1, 1447.0)],
)
def test_small_windows_by_a_long_lens_get_every_face_they_see(width_px, height_px, focal_length_px):
    mirror = HyperbolicMirror()
    reach_px = 0.9 * focal_length_px * float(mirror.tangent_from_theta(mirror.theta_max_rad))
    generator = np.random.default_rng(3)
    for _ in range(30):
        angle, radius = generator.uniform(0.0, 2.0 * np.pi), reach_px * generator.uniform() ** 0.5
        center = (radius * np.cos(angle), radius * np.sin(angle))
        camera = HyperbolicCamera(width_px, height_px, focal_length_px, center, mirror)
        rays = camera.ray_from_pixel(pixel_grid(width_px, height_px))
        seen = face_index(rays.directions[rays.valid] @ RIG_FROM_OPTICAL_LOOKING_UP.T)
        planned = {tile.face for tile in plan_tiles(camera, RIG_FROM_OPTICAL_LOOKING_UP).tiles}
        assert set(seen.tolist()) <= planned


@pytest.mark.parametrize("theta_max_deg", [50.0, 105.0, 120.0, 150.0])
def test_every_ray_of_the_image_is_inside_of_its_tile_with_a_mip_texel_to_spare(theta_max_deg):
    mirror = HyperbolicMirror(theta_max_rad=math.radians(theta_max_deg))
    camera = HyperbolicCamera.framed_on_rim(mirror, 200, 200)
    plan = plan_tiles(camera, RIG_FROM_OPTICAL_LOOKING_UP)
    rays = camera.ray_from_pixel(pixel_grid(200, 200))
    seen = rays.directions[rays.valid] @ RIG_FROM_OPTICAL_LOOKING_UP.T
    faces = face_index(seen)
    for tile in plan.tiles:
        spare = 2.0 * (1 << plan.max_level) / tile.face_size_px
        tangents = face_tangents(seen[faces == tile.face], tile.face)
        first, last = tile.padded_region
        assert np.all((tangents >= first + spare - 1e-9) & (tangents <= last - spare + 1e-9))


def test_a_side_face_is_drawn_only_as_high_as_the_rim_reaches():
    """To √2 tan(θ_max − 90°) at the corners; one sample of the grid and the margin to spare."""
    plan = _plan(105.0)
    front = next(tile for tile in plan.tiles if tile.face_name == "front")
    highest = math.sqrt(2.0) * math.tan(math.radians(15.0))
    margin = 2.0 * (1 << plan.max_level) * 2.0 / front.face_size_px
    top = -front.padded_region[0, 1]
    assert highest <= top <= highest + 2.0 / 32.0 + margin


def test_whole_faces_are_drawn_to_their_edges():
    plan = whole_faces(_plan(105.0))
    for tile in plan.tiles:
        assert np.all(tile.padded_region[0] < -1.0)
        assert np.all(tile.padded_region[1] > 1.0)
