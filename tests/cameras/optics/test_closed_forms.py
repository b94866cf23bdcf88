"""Traced rays against closed forms: 1e-10 rad, and 1e-9 of the size."""

import math
from dataclasses import replace

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, HyperbolicCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.models.field_of_view import edge_pixels
from omnisim.cameras.optics import OpticalSystem, Surface
from omnisim.cameras.optics.centrality import lateral_color_px, seen_rays
from omnisim.cameras.optics.shapes import Asphere, Conic, Plane, Polynomial, TabulatedProfile
from omnisim.cameras.optics.surface import MEDIA, refractive_index
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.validation import optical_systems as closed_forms
from omnisim.validation.optical_systems import AxialRays
from tests.cameras.optics.examples import (
    HYPERBOLA,
    SYSTEMS,
    at,
    behind_a_dome,
    dome,
    pinhole,
    port,
)

ANGLE_RAD = 1e-10
SHARE = 1e-9  # of a surface's distance


def _radial(system):
    """Valid rays of an image: (azimuth's direction, angle to the axis, origins, directions)."""
    return closed_forms.traced_rays(system)[1:]


def _expect(system, form, *parameters):
    """Expect rays in closed form."""
    traced = closed_forms.traced_rays(system)
    assert len(traced.beta_rad) > 2000
    angle_rad, distance_m = traced.misses(form(traced.beta_rad, *parameters))
    assert angle_rad < ANGLE_RAD
    assert distance_m < SHARE * 0.1


def test_sphere():
    _expect(SYSTEMS["sphere"], closed_forms.sphere, 0.15, 0.03)


def test_cone():
    _expect(SYSTEMS["cone"], closed_forms.cone, 0.12, math.radians(50.0))


def test_flat_port():
    indices = [refractive_index(medium) for medium in ("air", "acrylic", "water")]
    system = OpticalSystem(pinhole(150.0), port())
    _expect(system, closed_forms.flat_port, 0.05, (0.01,), indices)


def test_centerd_dome_refracts_nothing():
    system = OpticalSystem(pinhole(150.0), dome())

    def form(beta):
        return AxialRays(0.055 * np.sin(beta), 0.055 * np.cos(beta), beta)

    _expect(system, form)


def test_hyperbola_is_central():
    system = SYSTEMS["hyperbola"]
    mirror = HyperbolicMirror(theta_max_rad=math.radians(100.0))
    central = HyperbolicCamera(360, 360, 1300.0, (179.5, 179.5), mirror)
    u, v = np.meshgrid(np.linspace(100, 260, 41), np.linspace(100, 260, 43))
    pixels = np.stack((u, v), axis=-1)
    rays, expected = system.rays(pixels), central.ray_from_pixel(pixels)
    assert (rays.valid & expected.valid).all()
    assert np.abs(rays.directions - expected.directions).max() < ANGLE_RAD
    viewpoint_m = np.array([0.0, 0.0, HYPERBOLA.focal_distance_m])
    misses_m = np.linalg.norm(np.cross(rays.origins_m - viewpoint_m, rays.directions), axis=-1)
    assert misses_m.max() < SHARE * 0.1
    theta = np.arccos(-expected.directions[..., 2])
    azimuth = np.arctan2(*expected.directions[..., [1, 0]].T).T
    on_mirror = mirror.surface_points(theta, -azimuth).positions_m * np.diag(MIRROR_FROM_OPTICAL)
    assert np.abs(rays.origins_m - viewpoint_m - on_mirror).max() < SHARE * 0.1


def test_ellipsoid_goes_from_focus_to_focus():
    axis_m, eccentricity = 0.2, 0.6
    radius_m = axis_m * (1.0 - eccentricity**2)
    shape = Conic(-radius_m, -(eccentricity**2))
    first_m = axis_m * (1.0 + eccentricity)
    system = OpticalSystem(pinhole(150.0), (Surface(shape, at(first_m), 0.15),))
    _, _, origins_m, directions = _radial(system)
    other_m = np.array([0.0, 0.0, 2.0 * eccentricity * axis_m])
    assert len(origins_m) > 500  # farther out the mirror reflects twice
    assert np.linalg.norm(np.cross(origins_m - other_m, directions), axis=1).max() < SHARE * 0.1


def _table(shape, radius_m, count):
    radii_m = np.linspace(0.0, radius_m, count)
    return TabulatedProfile(radii_m, shape.sag_m(radii_m))


@pytest.mark.parametrize(
    ("profile", "conic", "bound_rad"),
    [
        (Asphere(0.03), Conic(0.03), ANGLE_RAD),
        (Asphere(0.03, -1.2), Conic(0.03, -1.2), ANGLE_RAD),
        (Polynomial((0.0, 1.0 / 0.06)), Conic(0.03, -1.0), ANGLE_RAD),
        # 1001 points of a cubic spline: its slope is off by the cube of their distance
        (_table(Conic(0.03, -1.2), 0.03, 1001), Conic(0.03, -1.2), 1e-9),
    ],
    ids=["sphere", "hyperboloid", "paraboloid", "table"],
)
def test_profile_equals_conic(profile, conic, bound_rad):
    posed = replace(SYSTEMS["sphere"].surfaces[0], system_from_surface=at(0.15, 0.002, roll_deg=4))
    profiles, conics = (
        replace(SYSTEMS["sphere"], surfaces=(replace(posed, shape=shape),)).all_rays()
        for shape in (profile, conic)
    )
    # a ray that grazes the limb may count to either side
    assert (profiles.valid != conics.valid).mean() < 1e-4
    both = profiles.valid & conics.valid
    assert np.abs(profiles.origins_m - conics.origins_m)[both].max() < 1e-8
    differences = np.linalg.norm(profiles.directions - conics.directions, axis=-1)[both]
    assert np.percentile(differences, 99.9) < bound_rad


@pytest.mark.parametrize(
    ("medium", "index", "abbe"),
    # catalogues; those of acrylic differ by as much
    [("glass", 1.51680, 64.17), ("acrylic", 1.4918, 57.4), ("water", 1.3334, 55.7)],
)
def test_refractive_indices(medium, index, abbe):
    d, f, c = (MEDIA[medium](wavelength_um) for wavelength_um in (0.58756, 0.48613, 0.65627))
    assert d == pytest.approx(index, abs=5e-6 if medium == "glass" else 1e-3)
    assert (d - 1.0) / (f - c) == pytest.approx(abbe, rel=0.05)


def test_blue_is_refracted_more():
    system = SYSTEMS["port"]
    pixel = [60.0, 179.5]
    angles = [system.of_color(color).rays(pixel).directions[2] for color in "RGB"]
    assert angles[0] < angles[1] < angles[2]
    assert angles[2] - angles[0] > 1e-3


def test_rays_that_touch_a_sphere_end_on_it():
    """Up to the last bit of a pixel inside its outline."""
    system = OpticalSystem(pinhole(620.0), (Surface(Conic(0.02), at(0.0815, 0.0012)),))
    pixels = edge_pixels(system, 720)
    rays = system.rays(pixels)
    assert rays.valid.all()
    distances_m = np.linalg.norm(rays.origins_m - (0.0012, 0.0, 0.1015), axis=1)
    np.testing.assert_allclose(distances_m, 0.02, rtol=SHARE)
    assert rays.directions[:, 2].min() > 0.9  # hardly reflected


# Lateral color of far points behind a flat port.


LENS = EquidistantCamera(100, 100, 40.0, (49.5, 49.5), math.radians(60.0))
INDICES = (1.30, 1.33, 1.36)


@pytest.mark.parametrize(
    "surfaces",
    [port(), (Surface(Plane(), at(0.05), medium=INDICES),)],
    ids=["acrylic and water", "three indices"],
)
def test_lateral_color_of_a_flat_port(surfaces):
    """An equidistant lens's radius is f times the angle in air: asin of n sin θ in water."""
    system = OpticalSystem(LENS, surfaces)
    outside = np.linalg.norm(seen_rays(system).directions[:, :2], axis=1)  # sin θ in the water

    def radius_px(color):
        ratio = refractive_index(surfaces[-1].medium, color) / refractive_index("air", color)
        return LENS.focal_length_px * np.arcsin(ratio * outside)

    expected = radius_px("B") - radius_px("R")
    inside = radius_px("B") < LENS.focal_length_px * math.radians(60.0)
    np.testing.assert_allclose(lateral_color_px(system), expected[inside], atol=1e-6)
    assert expected[inside].max() > 0.15


def test_no_lateral_color_where_nothing_is_bent():
    assert len(lateral_color_px(SYSTEMS["sphere"])) == 0
    assert lateral_color_px(behind_a_dome(LENS, 0.1)).max() < 1e-6


def test_lateral_color_is_the_same_if_images_are_chromatic():
    system = OpticalSystem(LENS, (Surface(Plane(), at(0.05), medium=INDICES),))
    chromatic = replace(system, chromatic=True)
    # but for the directions of the pixels: those of green, and of the d line, in air
    np.testing.assert_allclose(lateral_color_px(chromatic), lateral_color_px(system), atol=1e-4)
