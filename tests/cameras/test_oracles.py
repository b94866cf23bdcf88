"""Camera models, against OpenCV and COLMAP."""

import math

import numpy as np
import pytest

from omnisim.cameras import PerspectiveCamera
from tests.camera_examples import CAMERA_EXAMPLES, points_around_axis

WITHIN_PX = 1e-6
NO_TURN = np.zeros(3)


def _matrix(camera):
    fx, fy = np.broadcast_to(camera.pixels_per_plane, 2)
    (u, v) = camera.principal_point_px
    return np.array([[fx, 0.0, u], [0.0, fy, v], [0.0, 0.0, 1.0]])


def _assert_same(camera, points, pixels):
    ours = camera.pixel_from_ray(points)
    pixels = np.asarray(pixels).reshape(-1, 2)
    assert ours.valid.all()
    assert np.abs(ours.positions_px - pixels).max() < WITHIN_PX


def _cv2():
    return pytest.importorskip("cv2", reason="OpenCV is an optional oracle")


def _colmap(model, camera, parameters):
    """Its camera; its first pixel has its center at (0.5, 0.5)."""
    pycolmap = pytest.importorskip("pycolmap", reason="COLMAP is an optional oracle")
    return pycolmap.Camera(
        model=model, width=camera.width_px, height=camera.height_px, params=parameters
    )


def test_perspective_is_opencv():
    camera = PerspectiveCamera(640, 480, 500.0, (320.5, 239.0))
    points = points_around_axis(math.radians(70.0))
    pixels, _ = _cv2().projectPoints(points, NO_TURN, NO_TURN, _matrix(camera), np.zeros(5))
    _assert_same(camera, points, pixels)


def test_a_pinhole_with_five_coefficients_is_opencv():
    camera = CAMERA_EXAMPLES["unified-pinhole-with-k3"]
    points = points_around_axis(math.radians(45.0))
    points = points[camera.pixel_from_ray(points).valid]
    assert len(points) > 1000
    coefficients = np.array(camera.distortion)
    pixels, _ = _cv2().projectPoints(points, NO_TURN, NO_TURN, _matrix(camera), coefficients)
    _assert_same(camera, points, pixels)


@pytest.mark.parametrize(
    "name",
    [
        "rational-polynomial-kinect",
        "rational-polynomial-wide",
        "rational-polynomial-tilted-to-its-fold",
    ],
)
def test_rational_polynomial_is_opencv(name):
    camera = CAMERA_EXAMPLES[name]
    points = points_around_axis(math.radians(70.0))
    points = points[camera.pixel_from_ray(points).valid]
    assert len(points) > 1000
    coefficients = np.array(camera.distortion)
    pixels, _ = _cv2().projectPoints(points, NO_TURN, NO_TURN, _matrix(camera), coefficients)
    _assert_same(camera, points, pixels)


def test_rational_polynomial_is_colmap():
    camera = CAMERA_EXAMPLES["rational-polynomial-kinect"]
    points = points_around_axis(math.radians(60.0))
    points = points[camera.pixel_from_ray(points).valid]
    parameters = [*camera.focal_lengths_px, *(c + 0.5 for c in camera.principal_point_px)]
    other = _colmap("FULL_OPENCV", camera, [*parameters, *camera.distortion])
    _assert_same(camera, points, other.img_from_cam(points) - 0.5)


def test_kannala_brandt_is_opencv_in_front():
    camera = CAMERA_EXAMPLES["kannala-brandt-tum-vi"]
    points = points_around_axis(math.radians(80.0))  # past 90° OpenCV is wrong
    coefficients = np.array(camera.coefficients)
    pixels, _ = _cv2().fisheye.projectPoints(
        points[:, None], NO_TURN, NO_TURN, _matrix(camera), coefficients
    )
    _assert_same(camera, points, pixels)


@pytest.mark.parametrize("name", ["kannala-brandt-tum-vi", "kannala-brandt-to-its-fold"])
def test_kannala_brandt_is_colmap_in_front(name):
    camera = CAMERA_EXAMPLES[name]
    points = points_around_axis(math.radians(89.0))
    parameters = [*camera.focal_lengths_px, *(c + 0.5 for c in camera.principal_point_px)]
    other = _colmap("OPENCV_FISHEYE", camera, [*parameters, *camera.coefficients])
    _assert_same(camera, points, other.img_from_cam(points) - 0.5)


@pytest.mark.parametrize("name", ["eucm", "eucm-no-fold"])
def test_eucm_is_colmap(name):
    camera = CAMERA_EXAMPLES[name]
    points = points_around_axis(math.radians(89.0))
    parameters = [*camera.focal_lengths_px, *(c + 0.5 for c in camera.principal_point_px)]
    other = _colmap("EUCM", camera, [*parameters, camera.alpha, camera.beta])
    _assert_same(camera, points, other.img_from_cam(points) - 0.5)


@pytest.mark.parametrize("name", ["unified-kitti-360", "unified-no-distortion", "unified-kalibr"])
def test_unified_is_opencv_omnidir(name):
    camera = CAMERA_EXAMPLES[name]
    omnidir = getattr(_cv2(), "omnidir", None)
    if omnidir is None:
        pytest.skip("OpenCV without its contributed modules has no omnidir")
    points = points_around_axis(math.radians(100.0))
    points = points[camera.pixel_from_ray(points).valid]
    assert len(points) > 1000
    pixels, _ = omnidir.projectPoints(
        points[:, None], NO_TURN, NO_TURN, _matrix(camera), camera.xi, np.array(camera.distortion)
    )
    _assert_same(camera, points, pixels)


@pytest.mark.parametrize(
    ("name", "xi", "gamma"),
    [
        ("hyperbolic-paper", lambda c: c.mirror.xi, lambda c: c.unified_focal_length_px),
        ("parabolic", lambda c: 1.0, lambda c: c.horizon_radius_px),
        (
            "elliptic",
            lambda c: 2.0 * c.eccentricity / (1.0 + c.eccentricity**2),
            lambda c: c.focal_length_px * (1.0 - c.eccentricity**2) / (1.0 + c.eccentricity**2),
        ),
    ],
)
def test_mirrors_are_opencv_omnidir_in_a_mirrored_frame(name, xi, gamma):
    camera = CAMERA_EXAMPLES[name]
    omnidir = getattr(_cv2(), "omnidir", None)
    if omnidir is None:
        pytest.skip("OpenCV without its contributed modules has no omnidir")
    points = points_around_axis(
        0.99 * camera.theta_max_rad if name == "elliptic" else math.radians(100.0)
    )
    frame = np.diag([-1.0, -1.0, -1.0] if name == "elliptic" else [1.0, 1.0, -1.0])
    u, v = camera.principal_point_px
    matrix = np.array([[gamma(camera), 0.0, u], [0.0, gamma(camera), v], [0.0, 0.0, 1.0]])
    pixels, _ = omnidir.projectPoints(
        points[:, None], NO_TURN, NO_TURN, matrix, xi(camera), np.zeros(4)
    )
    _assert_same(camera, points @ frame, pixels)


@pytest.mark.parametrize("name", ["equirectangular", "equirectangular-odd"])
def test_equirectangular_is_colmap(name):
    camera = CAMERA_EXAMPLES[name]
    points = points_around_axis(math.radians(179.0))
    other = _colmap("EQUIRECTANGULAR", camera, [camera.width_px, camera.height_px])
    _assert_same(camera, points, other.img_from_cam(points) - 0.5)


def test_radial_table_is_scipys_pchip():
    interpolate = pytest.importorskip("scipy.interpolate", reason="SciPy is an optional oracle")
    camera = CAMERA_EXAMPLES["radial-table"]
    theta = np.linspace(0.0, camera.thetas_rad[-1], 500)
    rays = np.stack((np.sin(theta), 0.0 * theta, np.cos(theta)), axis=-1)
    radius = interpolate.PchipInterpolator(camera.thetas_rad, camera.radii_px)(theta)
    expected = np.stack((radius, 0.0 * radius), axis=-1) + camera.principal_point_px
    _assert_same(camera, rays, expected)
