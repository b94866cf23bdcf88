"""Centrality, caustics and designed mirrors against what theory says of them."""

import numpy as np
import pytest

from omnisim.cameras.optics import (
    Design,
    OpticalSystem,
    Surface,
    caustic_points,
    common_point,
    measure_centrality,
    pixel_jacobians,
    ray_jacobians,
)
from omnisim.cameras.optics.shapes import TabulatedProfile
from omnisim.core.errors import OpticsError
from tests.cameras.optics.examples import HYPERBOLA, SYSTEMS, at, pinhole

DISTANCES_M = (0.3, 1.0, 5.0)


def test_common_point():
    generator = np.random.default_rng(5)
    directions = generator.normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins_m = (1.0, 2.0, 3.0) + generator.uniform(-5, 5, (50, 1)) * directions
    np.testing.assert_allclose(common_point(origins_m, directions), (1.0, 2.0, 3.0))
    parallel = np.tile((0.0, 0.0, 1.0), (50, 1))
    np.testing.assert_allclose(common_point(origins_m, parallel), origins_m.mean(axis=0))


def test_hyperbola_is_central():
    measured = measure_centrality(SYSTEMS["hyperbola"], DISTANCES_M)
    np.testing.assert_allclose(measured.viewpoint_m, (0, 0, HYPERBOLA.focal_distance_m), atol=1e-12)
    assert measured.misses_m.max() < 1e-12
    assert max(error.max_px for error in measured.errors) < 1e-8


def test_error_of_the_central_model_falls_with_distance():
    errors = measure_centrality(SYSTEMS["sphere"], DISTANCES_M).errors
    # a parallax: inversely as the distance
    assert errors[1].median_px == pytest.approx(errors[0].median_px * 0.3, rel=0.1)
    assert errors[2].median_px == pytest.approx(errors[0].median_px * 0.06, rel=0.1)
    assert errors[0].median_px > 0.3


def test_error_is_that_of_the_rays():
    """The error in the image, turned back to an angle, is the miss over the distance."""
    system, distance_m = SYSTEMS["port"], 1000.0
    measured = measure_centrality(system, [distance_m])
    largest_rad = measured.misses_m.max() / distance_m
    # the fisheye has 110 px a radian in air, at most n times as many in water at the axis
    assert measured.errors[0].max_px < 110.0 * 1.34 * 6.0 * largest_rad


@pytest.mark.parametrize("distance_m", [0.0, -1.0, np.nan, np.inf])
def test_impossible_distances(distance_m):
    with pytest.raises(OpticsError, match="at_distance: expected more than 0"):
        measure_centrality(SYSTEMS["sphere"], [distance_m])


def test_jacobians_are_those_of_the_inverse():
    system = SYSTEMS["tilted camera"]
    pixels = np.array([[170.0, 200.0], [220.0, 150.0], [130.0, 160.0]])
    by_pixel = ray_jacobians(system, pixels)
    rays = system.rays(pixels)
    for axis in range(2):
        step = 1e-5 * np.eye(2)[axis]
        moved = rays.directions + by_pixel.directions[..., axis] * 1e-5
        np.testing.assert_allclose(
            system.pixel_from_ray(moved).positions_px, pixels + step, atol=1e-7
        )


def test_jacobians_of_pixels_by_points():
    system = SYSTEMS["tilted camera"]
    pixels = np.array([[170.0, 200.0], [220.0, 150.0]])
    rays = system.rays(pixels)
    points_m = rays.origins_m + 0.7 * rays.directions
    found = pixel_jacobians(system, pixels, points_m)
    for axis in range(3):
        step_m = 1e-5 * np.eye(3)[axis]
        ahead, back = (
            system.pixel_from_point(points_m + x).positions_px for x in (step_m, -step_m)
        )
        np.testing.assert_allclose(found[..., axis], (ahead - back) / 2e-5, rtol=1e-6, atol=1e-5)


def test_caustic_of_a_hyperbola_is_its_focus():
    pixels = np.array([[179.5, 240.0], [120.0, 130.0], [250.0, 179.5]])
    points_m = caustic_points(SYSTEMS["hyperbola"], pixels)
    np.testing.assert_allclose(points_m - (0, 0, HYPERBOLA.focal_distance_m), 0.0, atol=1e-5)


def test_caustic_of_a_cone():
    """A cone's rays meet those of the same ring on its axis, and none in their meridian but the
    pinhole's image: all appear to come from the mirror image of the pinhole."""
    pixels = np.array([[179.5, 240.0], [100.0, 179.5]])
    points_m = caustic_points(SYSTEMS["cone"], pixels)
    beside_axis = np.hypot(points_m[..., 0], points_m[..., 1])
    assert (beside_axis.min(axis=1) < 1e-9).all()
    alpha = np.radians(50.0)
    image_m = 0.12 * np.sin(2.0 * alpha) * np.sin(alpha) / np.sin(alpha)
    np.testing.assert_allclose(beside_axis.max(axis=1), image_m, rtol=1e-6)


def _rays_of_design(profile):
    """Radii (90,) along u from the axis, as shares of the rim's, and their rays."""
    surface = Surface(TabulatedProfile(*profile), at(0.1))
    radii_px = np.linspace(1.0, 179.0, 90)
    pixels = np.column_stack((179.5 + radii_px, np.full(90, 179.5)))
    rays = OpticalSystem(pinhole(494.5), (surface,)).rays(pixels)
    assert rays.valid.all()
    return radii_px / (494.5 * np.tan(np.radians(20.0))), rays


def test_equi_angular_mirror():
    shares, rays = _rays_of_design(Design(0.1, 20.0).equi_angular(105.0))
    theta_deg = np.degrees(np.arccos(-rays.directions[:, 2]))
    np.testing.assert_allclose(theta_deg, 105.0 * shares, atol=1e-5)


def test_equi_ground_mirror():
    shares, rays = _rays_of_design(Design(0.1, 20.0).equi_ground(0.6, 5.0))
    lengths_m = (-0.6 - rays.origins_m[:, 2]) / rays.directions[:, 2]
    ground_m = (rays.origins_m + lengths_m[:, None] * rays.directions)[:, 0]
    np.testing.assert_allclose(ground_m, 5.0 * shares, atol=1e-4)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Design(0.0, 20.0),
        lambda: Design(0.1, 90.0),
        lambda: Design(0.1, 20.0).equi_angular(10.0),
        lambda: Design(0.1, 20.0).equi_ground(0.6, 0.01),
        lambda: Design(0.1, 20.0).equi_ground(-1.0, 5.0),
    ],
)
def test_impossible_designs(make):
    with pytest.raises(OpticsError, match=r"design: .*expected"):
        make()
