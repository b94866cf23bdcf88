"""Camera models, against OpenCV and COLMAP."""

import math

import numpy as np
import pytest

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


def _omnidir():
    omnidir = getattr(_cv2(), "omnidir", None)
    if omnidir is None:
        pytest.skip("OpenCV without its contributed modules has no omnidir")
    return omnidir


def _points(camera, widest_deg):
    """Points up to an angle that the camera sees."""
    points = points_around_axis(math.radians(widest_deg))
    points = points[camera.pixel_from_ray(points).valid]
    assert len(points) > 1000
    return points


@pytest.mark.parametrize(
    ("name", "widest_deg"),
    [
        ("perspective-wide", 70.0),
        ("unified-pinhole-with-k3", 45.0),
        ("rational-polynomial-kinect", 70.0),
        ("rational-polynomial-wide", 70.0),
        ("rational-polynomial-tilted-to-its-fold", 70.0),
    ],
)
def test_pinhole_cameras_are_opencvs(name, widest_deg):
    camera = CAMERA_EXAMPLES[name]
    points = _points(camera, widest_deg)
    coefficients = np.array(getattr(camera, "distortion", (0.0,) * 5))
    pixels, _ = _cv2().projectPoints(points, NO_TURN, NO_TURN, _matrix(camera), coefficients)
    _assert_same(camera, points, pixels)


def test_kannala_brandt_is_opencv_in_front():
    camera = CAMERA_EXAMPLES["kannala-brandt-tum-vi"]
    points = _points(camera, 80.0)  # past 90° OpenCV is wrong
    pixels, _ = _cv2().fisheye.projectPoints(
        points[:, None], NO_TURN, NO_TURN, _matrix(camera), np.array(camera.coefficients)
    )
    _assert_same(camera, points, pixels)


def _own(camera, *names):
    """COLMAP's parameters; its first pixel has its center at (0.5, 0.5)."""
    values = [np.atleast_1d(getattr(camera, name)) for name in names]
    return [*camera.focal_lengths_px, *np.add(camera.principal_point_px, 0.5), *np.hstack(values)]


@pytest.mark.parametrize(
    ("name", "model", "names", "widest_deg"),
    [
        ("rational-polynomial-kinect", "FULL_OPENCV", ("distortion",), 60.0),
        ("kannala-brandt-tum-vi", "OPENCV_FISHEYE", ("coefficients",), 89.0),
        ("kannala-brandt-to-its-fold", "OPENCV_FISHEYE", ("coefficients",), 89.0),
        ("eucm", "EUCM", ("alpha", "beta"), 89.0),
        ("eucm-no-fold", "EUCM", ("alpha", "beta"), 89.0),
        ("equirectangular", "EQUIRECTANGULAR", None, 179.0),
        ("equirectangular-odd", "EQUIRECTANGULAR", None, 179.0),
    ],
)
def test_cameras_are_colmaps(name, model, names, widest_deg):
    pycolmap = pytest.importorskip("pycolmap", reason="COLMAP is an optional oracle")
    camera = CAMERA_EXAMPLES[name]
    size = camera.width_px, camera.height_px
    parameters = [*size] if names is None else _own(camera, *names)
    other = pycolmap.Camera(model=model, width=size[0], height=size[1], params=parameters)
    points = _points(camera, widest_deg)
    _assert_same(camera, points, other.img_from_cam(points) - 0.5)


@pytest.mark.parametrize("name", ["unified-kitti-360", "unified-no-distortion", "unified-kalibr"])
def test_unified_is_opencv_omnidir(name):
    camera = CAMERA_EXAMPLES[name]
    points = _points(camera, 100.0)
    pixels, _ = _omnidir().projectPoints(
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
    is_elliptic = name == "elliptic"
    points = points_around_axis(0.99 * camera.theta_max_rad if is_elliptic else math.radians(100.0))
    frame = np.diag([-1.0, -1.0, -1.0] if is_elliptic else [1.0, 1.0, -1.0])
    u, v = camera.principal_point_px
    matrix = np.array([[gamma(camera), 0.0, u], [0.0, gamma(camera), v], [0.0, 0.0, 1.0]])
    pixels, _ = _omnidir().projectPoints(
        points[:, None], NO_TURN, NO_TURN, matrix, xi(camera), np.zeros(4)
    )
    _assert_same(camera, points @ frame, pixels)


def test_radial_table_is_scipys_pchip():
    interpolate = pytest.importorskip("scipy.interpolate", reason="SciPy is an optional oracle")
    camera = CAMERA_EXAMPLES["radial-table"]
    theta = np.linspace(0.0, camera.thetas_rad[-1], 500)
    rays = np.stack((np.sin(theta), 0.0 * theta, np.cos(theta)), axis=-1)
    radius = interpolate.PchipInterpolator(camera.thetas_rad, camera.radii_px)(theta)
    expected = np.stack((radius, 0.0 * radius), axis=-1) + camera.principal_point_px
    _assert_same(camera, rays, expected)
