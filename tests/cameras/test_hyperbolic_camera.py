import math

import numpy as np
import pytest

from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.hyperbolic import image_radius_eq2_px, theta_from_image_radius_eq2_rad
from omnisim.core.errors import OpticsError


def _camera(size_px=360, theta_max_deg=105.0):
    mirror = HyperbolicMirror(theta_max_rad=math.radians(theta_max_deg))
    return HyperbolicCamera.framed_on_rim(mirror, size_px, size_px)


def test_rim_touches_the_edges_of_the_image():
    camera = _camera()
    assert camera.rim_radius_px == pytest.approx(180.0, rel=1e-14)
    edge = camera.ray_from_pixel((-0.5 + 1e-9, 179.5))
    assert edge.valid
    assert np.degrees(np.arccos(-edge.directions[2])) == pytest.approx(105.0, abs=1e-6)
    assert not camera.ray_from_pixel((0.0, 0.0)).valid


def test_exact_image_radius_is_the_unified_model():
    camera = _camera()
    mirror = camera.mirror
    theta = np.radians(np.arange(0.0, 105.0, 5.0))
    psi = 1.0 / (mirror.k - 1.0)
    unified = camera.focal_length_px * psi * np.sin(theta) / (mirror.xi + np.cos(theta))
    np.testing.assert_allclose(camera.image_radius(theta).radii_px, unified, rtol=1e-12)
    np.testing.assert_allclose(camera.incidence(unified).theta_rad, theta, atol=1e-12)
    assert camera.horizon_radius_px == pytest.approx(camera.focal_length_px / 10.49848, rel=1e-6)
    assert camera.image_radius(math.pi / 2).radii_px == pytest.approx(camera.horizon_radius_px)


def test_outside_the_rim_is_not_valid():
    camera = _camera()
    assert camera.image_radius(np.radians([-1, 0, 105, 106, 175])).valid.tolist() == [
        False, True, True, False, False,
    ]  # fmt: skip
    assert camera.incidence([-1.0, 0.0, 179.9, 180.1]).valid.tolist() == [False, True, True, False]


@pytest.mark.parametrize(
    ("theta_deg", "difference_percent"),
    [(15, 0.22), (45, 0.19), (90, 0.0), (110, -0.24), (120, -0.45), (130, -0.81)],
)
def test_equation_2_has_the_derived_error(theta_deg, difference_percent):
    camera = _camera(theta_max_deg=135.0)
    theta = math.radians(theta_deg)
    approximate = image_radius_eq2_px(theta, camera.horizon_radius_px)
    percent = 100.0 * (approximate / camera.image_radius(theta).radii_px - 1.0)
    assert percent == pytest.approx(difference_percent, abs=0.006)  # given to two digits
    back = theta_from_image_radius_eq2_rad(approximate, camera.horizon_radius_px)
    assert back == pytest.approx(theta, abs=1e-12)


def test_bottom_and_horizon_look_down_and_level():
    camera = _camera()
    center = camera.ray_from_pixel(camera.principal_point_px).directions
    np.testing.assert_allclose(center, (0.0, 0.0, -1.0), atol=1e-15)  # at the pinhole itself
    u, v = camera.principal_point_px
    right = camera.ray_from_pixel((u + camera.horizon_radius_px, v)).directions
    np.testing.assert_allclose(right, (1.0, 0.0, 0.0), atol=1e-12)
    down = camera.ray_from_pixel((u, v + camera.horizon_radius_px)).directions
    np.testing.assert_allclose(down, (0.0, 1.0, 0.0), atol=1e-12)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ((0, 360, 100.0, (0.0, 0.0)), "width_px: expected a number ≥ 1, got 0"),
        ((360, 360, 0.0, (0.0, 0.0)), "focal_length_px: .* got 0"),
        ((360, 360, math.nan, (0.0, 0.0)), "focal_length_px: .* got nan"),
        ((360, 360, 100.0, (math.inf, 0.0)), "principal_point_px"),
    ],
)
def test_impossible_cameras_are_refused(values, words):
    with pytest.raises(OpticsError, match=words):
        HyperbolicCamera(*values, HyperbolicMirror())
