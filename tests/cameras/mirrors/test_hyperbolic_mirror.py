import math

import numpy as np
import pytest

from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.errors import OpticsError


def test_paper_mirror_in_paper_units():
    mirror = HyperbolicMirror(meters_per_unit=1.0)
    # Values of the closed forms for k = 11.546, c = 2.321, to the digits given
    assert mirror.semi_major_axis_m == pytest.approx(1.05521, abs=5e-6)
    assert mirror.semi_minor_axis_m == pytest.approx(0.48300, abs=5e-6)
    assert mirror.eccentricity == pytest.approx(1.0997781, abs=5e-8)
    assert mirror.xi == pytest.approx(0.9954942, abs=5e-8)
    assert mirror.vertex_height_m == pytest.approx(0.105287, abs=5e-7)
    assert math.degrees(mirror.theta_limit_rad) == pytest.approx(155.405, abs=5e-4)
    assert mirror.rim_radius_m == pytest.approx(0.29852, abs=5e-6)
    assert mirror.rim_height_m == pytest.approx(-0.07999, abs=5e-6)


@pytest.mark.parametrize("k", [2.0, 2.5, 11.546, 300.0])
def test_surface_satisfies_equation_1_and_its_rays_the_focus_property(k):
    """The pinhole's rays, reflected by the normals, meet in the origin."""
    mirror = HyperbolicMirror(k=k, theta_max_rad=math.radians(80.0))
    theta = np.linspace(0.01, mirror.theta_max_rad, 50)
    found = mirror.surface_points(theta[:, None], np.linspace(0.0, 6.0, 7))
    points = found.positions_m
    assert points.shape == (50, 7, 3)
    assert found.valid.all()
    assert np.abs(mirror.equation_residual(points)).max() < 1e-14  # of c²
    normals = mirror.normals(points)
    towards = points - (0.0, 0.0, mirror.c_m)
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    assert np.all(np.sum(towards * normals, axis=-1) < 0.0)  # the reflecting side
    reflected = towards - 2.0 * np.sum(towards * normals, axis=-1, keepdims=True) * normals
    miss = np.linalg.norm(np.cross(reflected, points), axis=-1)
    assert miss.max() < 1e-13 * mirror.c_m
    assert np.all(np.sum(reflected * points, axis=-1) > 0.0)  # away from the viewpoint
    # the tangent at the pinhole, by similar triangles
    tangent = points[:, 0, 0] / (mirror.c_m - points[:, 0, 2])
    np.testing.assert_allclose(mirror.tangent_from_theta(theta), tangent, rtol=1e-12)
    np.testing.assert_allclose(mirror.theta_from_tangent(tangent), theta, atol=1e-12)


def test_rim_by_radius_is_the_rim_by_angle():
    mirror = HyperbolicMirror(theta_max_rad=math.radians(118.0))
    again = HyperbolicMirror.with_rim_radius(mirror.rim_radius_m)
    assert again.theta_max_rad == pytest.approx(mirror.theta_max_rad, abs=1e-12)


def test_beyond_the_rim_is_not_valid():
    mirror = HyperbolicMirror()
    points = mirror.surface_points(np.radians([-1.0, 0.0, 105.0, 106.0, 170.0]), 0.0)
    assert points.valid.tolist() == [False, True, True, False, False]
    assert np.isnan(points.positions_m[-1]).all()  # past the asymptote there is no surface


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"k": 1.99}, "k: expected a number ≥ 2, got 1.99"),
        ({"k": math.nan}, "k: expected a finite number, got nan"),
        ({"c": 0.0}, "c: expected a number > 0, got 0"),
        ({"c": -1.0}, "c: expected a number > 0, got -1"),
        ({"meters_per_unit": 0.0}, "meters_per_unit: expected a number > 0, got 0"),
        ({"theta_max_rad": math.radians(156.0)}, "asymptote of k = 11.546, 155.405°"),
        ({"theta_max_rad": 0.0}, "theta_max_rad: expected a number > 0, got 0"),
        ({"k": 2.0, "theta_max_rad": math.radians(90.0)}, "asymptote"),
    ],
)
def test_impossible_mirrors_are_refused(parameters, words):
    with pytest.raises(OpticsError, match=words):
        HyperbolicMirror(**parameters)


@pytest.mark.parametrize("radius", [0.0, -0.1, math.inf, math.nan])
def test_impossible_rim_radius_is_refused(radius):
    with pytest.raises(OpticsError, match="rim_radius_m"):
        HyperbolicMirror.with_rim_radius(radius)
