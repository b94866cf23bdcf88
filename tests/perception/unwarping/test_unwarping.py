"""Unwarping against images whose every pixel is known."""

import math

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, HyperbolicCamera, PerspectiveCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.core.errors import OpticsError
from omnisim.core.srgb import linear_from_srgb
from omnisim.perception.unwarping import (
    Unwarping,
    birdseye_view,
    cylinder_view,
    highest_elevation_deg,
    perspective_view,
)

CAMERA = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), 600, 600)
BASE_FROM_OPTICAL = RIG_FROM_OPTICAL_LOOKING_UP


def _colors(directions_base):
    """A color that says where it is: the direction itself, in [0, 1]."""
    return 0.5 + 0.5 * directions_base


def _image(camera=CAMERA):
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    return (_colors(rays.directions @ BASE_FROM_OPTICAL.T) * rays.valid[..., None]).astype("f4")


def _unwarped(view, image):
    unwarp = Unwarping(CAMERA, view.camera, BASE_FROM_OPTICAL.T @ view.base_from_view, samples=1)
    return unwarp(image), unwarp.valid


VIEWS = {
    "cylinder": cylinder_view(900, math.radians(-60), math.radians(10), math.radians(20)),
    "perspective": perspective_view(300, 200, math.radians(80), math.radians(-50), 0.5),
    "birdseye": birdseye_view(301, 4.0, 1.2, math.radians(70)),
}


@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS.keys())
def test_every_pixel_shows_its_direction(view):
    pixels, valid = _unwarped(view, _image())
    grid = pixel_grid(view.camera.width_px, view.camera.height_px)
    wanted = _colors(view.camera.ray_from_pixel(grid).directions @ view.base_from_view.T)
    assert valid.mean() > 0.5
    # between two pixels, 1/127 rad apart at the mirror's middle, a direction bends: (1/127)²/8
    assert np.abs(pixels - wanted)[valid].max() < 1e-5
    assert not pixels[~valid].any()


def test_sides_and_corners_of_the_views():
    """Positions of the vehicle's front, left and the ground in the views."""
    ahead, left = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    cylinder = cylinder_view(800, -0.5, 0.2)
    u, _ = cylinder.camera.pixel_from_ray(left @ cylinder.base_from_view).positions_px
    assert u == pytest.approx(0.25 * 800 - 0.5)  # left of the middle, a quarter of a turn
    birdseye = birdseye_view(101, 5.0, 2.0)
    for ground_m, wanted_px in (((5.0, 0.0), (50.0, -0.5)), ((0.0, 5.0), (-0.5, 50.0))):
        direction = np.array([*ground_m, -2.0])
        found_px = birdseye.camera.pixel_from_ray(direction @ birdseye.base_from_view).positions_px
        np.testing.assert_allclose(found_px, wanted_px, atol=1e-9)
    perspective = perspective_view(200, 100, 1.0, pitch_rad=0.2)
    _, v = perspective.camera.pixel_from_ray(ahead @ perspective.base_from_view).positions_px
    assert v < 49.5  # looking down, the horizon is in the upper half


def test_bytes_are_blended_in_linear_light():
    camera = PerspectiveCamera(2, 2, 10.0, (0.5, 0.5))
    image = np.zeros((2, 2, 3), dtype=np.uint8)
    image[:, 1] = 255
    view = PerspectiveCamera(1, 1, 10.0, (0.0, 0.0))
    between = Unwarping(camera, view, np.eye(3), samples=1)(image)[0, 0, 0]
    assert linear_from_srgb(between / 255.0) == pytest.approx(0.5, abs=0.005)


def test_bytes_pass_unchanged_where_nothing_is_blended():
    camera = PerspectiveCamera(16, 16, 20.0, (7.5, 7.5))
    image = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    same = Unwarping(camera, camera, np.eye(3), samples=1)
    # only rounding blends in a neighbor: below half a level
    np.testing.assert_array_equal(same(image), image)
    assert same.valid.all()


def test_fine_patterns_are_averaged_and_not_skipped():
    stripes = np.zeros((400, 400, 3), dtype=np.float32)
    stripes[:, ::2] = 1.0
    camera = PerspectiveCamera(400, 400, 400.0, (199.5, 199.5))
    coarse = PerspectiveCamera(50, 50, 50.0, (24.5, 24.5))
    pixels = Unwarping(camera, coarse, np.eye(3))(stripes)
    assert np.abs(pixels[2:-2, 2:-2] - 0.5).max() < 0.01


def test_blocks_and_a_table_that_is_not_kept_change_nothing(monkeypatch):
    view, image = VIEWS["perspective"], _image()
    rotation = BASE_FROM_OPTICAL.T @ view.base_from_view
    whole = Unwarping(CAMERA, view.camera, rotation, samples=2)
    monkeypatch.setattr("omnisim.perception.unwarping.BLOCK_SAMPLES", 7 * 300 * 4 + 1)
    monkeypatch.setattr("omnisim.perception.unwarping.MAX_KEPT_SAMPLES", 1000)
    banded = Unwarping(CAMERA, view.camera, rotation, samples=2)
    np.testing.assert_array_equal(banded.valid, whole.valid)
    for _ in range(2):
        np.testing.assert_array_equal(banded(image), whole(image))


def test_what_the_camera_does_not_see_is_masked():
    view = perspective_view(200, 200, math.radians(90))
    covered = CAMERA.ray_from_pixel(pixel_grid(600, 600)).valid
    covered[:, 300:] = False  # the vehicle's left
    unwarp = Unwarping(CAMERA, view.camera, BASE_FROM_OPTICAL.T @ view.base_from_view, covered)
    grid = pixel_grid(200, 200)
    elevations = np.arcsin(
        (view.camera.ray_from_pixel(grid).directions @ view.base_from_view.T)[..., 2]
    )
    assert not unwarp.valid[elevations > math.radians(15.0)].any()
    assert not unwarp.valid[:, :100].any()
    assert unwarp.valid[120:, 102:].all()


def test_a_cylinder_of_a_lens_ahead_reaches_the_top_of_its_image():
    ahead = BASE_FROM_OPTICAL_LOOKING_AHEAD
    fisheye = EquidistantCamera(640, 640, 193.0, (319.5, 319.5), math.radians(95.0))
    assert highest_elevation_deg(fisheye, ahead) == 60.0
    # 55° × 43°: half of the height is visible
    pinhole = PerspectiveCamera(640, 480, 610.0, (319.5, 239.5))
    assert highest_elevation_deg(pinhole, ahead) == 21.0
    # at all azimuths; the rim, at 15°, is halfway through the outermost pixels
    assert highest_elevation_deg(CAMERA, BASE_FROM_OPTICAL) == 14.0


def test_bad_views_are_named():
    image = np.zeros((10, 20, 3), dtype=np.uint8)
    view = perspective_view(20, 20, 1.0)
    unwarp = Unwarping(CAMERA, view.camera, BASE_FROM_OPTICAL.T @ view.base_from_view)
    with pytest.raises(OpticsError, match="expected the camera's 600 × 600 px, got 20 × 10"):
        unwarp(image)
    up = perspective_view(20, 20, 0.2, pitch_rad=-math.pi / 2)
    with pytest.raises(OpticsError, match="nothing of this view"):
        Unwarping(CAMERA, up.camera, BASE_FROM_OPTICAL.T @ up.base_from_view)
    for view, arguments, words in (
        (cylinder_view, (100, -math.pi / 2, 0.0), "elevation -90°"),
        (birdseye_view, (100, 1.0, 0.0), "height: expected a finite number of .* above 0"),
        (perspective_view, (10, 10, math.pi), "field of view: expected .*, got 180°"),
        (perspective_view, (10, 10, 1.0, math.nan), "expected finite numbers"),
    ):
        with pytest.raises(OpticsError, match=words):
            view(*arguments)
