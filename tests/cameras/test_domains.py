"""Valid domains of the camera models, against their authors' formulas."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim.cameras import PlanarCamera
from omnisim.cameras.lens_polynomials import first_root
from omnisim.cameras.mirrors.hyperbolic import image_radius_eq2_px
from tests.camera_examples import CAMERA_EXAMPLES
from tests.cameras import formulas


def _ray(theta_rad, azimuth_rad=0.7):
    sine = math.sin(theta_rad)
    return np.array(
        [sine * math.cos(azimuth_rad), sine * math.sin(azimuth_rad), math.cos(theta_rad)]
    )


def _assert_ends_at(camera, theta_rad):
    assert camera.pixel_from_ray(_ray(theta_rad - 1e-6)).valid
    assert not camera.pixel_from_ray(_ray(theta_rad + 1e-6)).valid


@pytest.mark.parametrize(
    "name", ["double-sphere-tum-vi", "double-sphere-no-fold", "double-sphere-to-its-fold"]
)
def test_double_sphere_is_the_formula_of_its_paper(name):
    camera = CAMERA_EXAMPLES[name]
    xi, alpha = camera.xi, camera.alpha
    w1 = alpha / (1.0 - alpha) if alpha <= 0.5 else (1.0 - alpha) / alpha
    w2 = (w1 + xi) / math.sqrt(2.0 * w1 * xi + xi * xi + 1.0)
    # the paper's limit of the projection is inside that of its inverse, which is ours
    assert math.acos(-w2) < camera.theta_edge_rad < math.acos(-w2) + math.radians(15.0)
    _assert_ends_at(camera, camera.theta_edge_rad)
    ray = 3.0 * _ray(1.2)
    expected = formulas.double_sphere(camera, *ray)
    np.testing.assert_allclose(camera.pixel_from_ray(ray).positions_px, expected, atol=1e-9)


def test_kannala_brandt_ends_at_its_fold():
    camera = CAMERA_EXAMPLES["kannala-brandt-to-its-fold"]
    k1, k2, k3, k4 = camera.coefficients
    theta = camera.theta_edge_rad
    slope = 1 + 3 * k1 * theta**2 + 5 * k2 * theta**4 + 7 * k3 * theta**6 + 9 * k4 * theta**8
    assert slope == pytest.approx(0.0, abs=1e-12)
    _assert_ends_at(camera, theta)


def test_eucm_ends_where_the_unified_model_does_on_the_stretched_plane():
    camera = CAMERA_EXAMPLES["eucm-to-its-fold"]
    w = (1.0 - camera.alpha) / camera.alpha
    # tan θ = tan θ′/√β
    theta = math.acos(-w)
    stretched = math.atan2(math.sin(theta) / math.sqrt(camera.beta), math.cos(theta))
    _assert_ends_at(camera, stretched)


def test_unified_ends_before_the_fold_that_opencv_projects_past():
    camera = CAMERA_EXAMPLES["unified-kitti-360"]
    fold = math.acos(-1.0 / camera.xi)
    assert math.degrees(fold) == pytest.approx(116.86, abs=0.01)
    _assert_ends_at(camera, fold)
    # two rays, one pixel, without the domain
    pixels = camera.pixel_from_ray([_ray(fold - 1e-4), _ray(fold + 1e-4)])
    assert pixels.valid.tolist() == [True, False]


def test_barrel_distortion_ends_at_its_fold():
    camera = CAMERA_EXAMPLES["unified-barrel-fold"]
    k1, _, p1, p2 = camera.distortion
    radius = camera.radius_limit
    assert 1.0 + 3.0 * k1 * radius**2 == pytest.approx(6.0 * math.hypot(p1, p2) * radius)
    _assert_ends_at(camera, 2.0 * math.atan(radius))  # ξ = 1


def test_ocamcalib_axes_are_those_of_the_toolbox():
    camera = CAMERA_EXAMPLES["ocamcalib-fisheye"]
    c, d, e = camera.affine
    down, right = 60.0, -35.0  # x' and y' of the toolbox
    column, row = camera.principal_point_px
    pixel = (e * down + right + column, c * down + d * right + row)
    height = np.polynomial.polynomial.polyval(math.hypot(down, right), camera.polynomial)
    ray = np.array([right, down, -height])  # it looks along −z
    expected = ray / np.linalg.norm(ray)
    np.testing.assert_allclose(camera.ray_from_pixel(pixel).directions, expected, atol=1e-12)


def test_parabolic_is_equation_2():
    camera = CAMERA_EXAMPLES["parabolic-off-center"]
    theta = 1.3
    upside_down = _ray(theta, azimuth_rad=0.0) * (1.0, 1.0, -1.0)
    radius = camera.pixel_from_ray(upside_down).positions_px - camera.principal_point_px
    expected = image_radius_eq2_px(theta, camera.horizon_radius_px)
    np.testing.assert_allclose(radius, (expected, 0.0), atol=1e-12)


def test_planar_is_the_hyperbolic_mirror_with_k_2():
    hyperbolic = CAMERA_EXAMPLES["hyperbolic-plane"]
    plane = PlanarCamera(300, 200, hyperbolic.focal_length_px, hyperbolic.principal_point_px)
    pixels = [(10.0, 20.0), (150.0, 99.0), (200.5, 120.0)]
    ours, theirs = (camera.ray_from_pixel(pixels).directions for camera in (plane, hyperbolic))
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


@pytest.mark.parametrize("power", [3, 5, 8])
@pytest.mark.parametrize("size", [1e-88, 1e-250])
def test_a_term_that_vanishes_moves_no_root(power, size):
    terms = np.zeros(1 + power)
    terms[:3] = 6.0, -5.0, 1.0
    terms[power] = size
    assert first_root(terms, 1e12) == pytest.approx(2.0, rel=1e-12)


def test_ocamcalib_with_a_term_that_vanishes_ends_where_it_does_without():
    camera = CAMERA_EXAMPLES["ocamcalib-fisheye"]
    longer = dataclasses.replace(camera, polynomial=(*camera.polynomial, 2.7e-88))
    assert longer.radius_max_px == pytest.approx(camera.radius_max_px, rel=1e-9)
