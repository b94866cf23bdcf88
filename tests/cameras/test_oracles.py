"""Models that no calibration file has, against OpenCV and SciPy.

`tests/cameras/calibration/test_oracles.py` compares the others, by their files.
"""

import math

import numpy as np
import pytest
import scipy

from omnisim.cameras import PerspectiveCamera, RadialTableCamera
from tests.camera_examples import CAMERA_EXAMPLES, points_around_axis

NO_TURN = np.zeros(3)


def _assert_same(camera, points, pixels):
    ours = camera.pixel_from_ray(points)
    assert ours.valid.all()
    assert np.abs(ours.positions_px - np.reshape(pixels, (-1, 2))).max() < 1e-6


def test_perspective_is_opencv():
    cv2 = pytest.importorskip("cv2", reason="OpenCV is an optional oracle")
    camera = PerspectiveCamera(640, 480, 500.0, (320.5, 239.0))
    points = points_around_axis(math.radians(70.0))
    matrix = np.array([[500.0, 0.0, 320.5], [0.0, 500.0, 239.0], [0.0, 0.0, 1.0]])
    pixels, _ = cv2.projectPoints(points, NO_TURN, NO_TURN, matrix, np.zeros(5))
    _assert_same(camera, points, pixels)


def test_elliptic_mirror_is_opencv_omnidir_in_a_mirrored_frame():
    cv2 = pytest.importorskip("cv2", reason="OpenCV is an optional oracle")
    if not hasattr(cv2, "omnidir"):
        pytest.skip("OpenCV without its contributed modules has no omnidir")
    camera = CAMERA_EXAMPLES["elliptic"]
    e, (u, v) = camera.eccentricity, camera.principal_point_px
    xi = 2.0 * e / (1.0 + e**2)
    gamma = camera.focal_length_px * (1.0 - e**2) / (1.0 + e**2)
    matrix = np.array([[gamma, 0.0, u], [0.0, gamma, v], [0.0, 0.0, 1.0]])
    points = points_around_axis(0.99 * camera.theta_max_rad)
    pixels, _ = cv2.omnidir.projectPoints(
        points[:, None], NO_TURN, NO_TURN, matrix, xi, np.zeros(4)
    )
    _assert_same(camera, -points, pixels)


STEEPER = RadialTableCamera(90, 90, (44.5, 44.5), (0.0, 0.2, 0.4), (0.0, 2.0, 22.0))


@pytest.mark.parametrize("camera", [CAMERA_EXAMPLES["radial-table"], STEEPER])
def test_radial_table_is_scipys_pchip(camera):
    theta = np.linspace(0.0, camera.thetas_rad[-1], 500)
    rays = np.stack((np.sin(theta), 0.0 * theta, np.cos(theta)), axis=-1)
    radius = scipy.interpolate.PchipInterpolator(camera.thetas_rad, camera.radii_px)(theta)
    expected = np.stack((radius, 0.0 * radius), axis=-1) + camera.principal_point_px
    _assert_same(camera, rays, expected)
