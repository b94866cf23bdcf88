"""Points back to their pixels: 1e-8 px, whatever the distance."""

from dataclasses import replace

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.cameras.optics import Fate, OpticalSystem, Rod, Surface, read_optics_file
from omnisim.cameras.optics.shapes import Conic
from omnisim.core import poses
from tests.cameras.optics.examples import EXAMPLES, SYSTEMS, at, pinhole

BOUND_PX = 1e-8


def _pixels(system, count=3000):
    generator = np.random.default_rng(7)
    pixels = generator.uniform((-0.5, -0.5), (359.5, 359.5), (count, 2))
    return pixels[system.rays(pixels).valid]


def _found(system, rays, distances_m):
    """Pixels of points on rays, each at a distance, or at infinity."""
    if np.isinf(distances_m).any():
        return system.pixel_from_ray(rays.directions)
    return system.pixel_from_point(rays.origins_m + distances_m * rays.directions)


@pytest.mark.parametrize("name", sorted(SYSTEMS.keys() - {"wave"}))
def test_round_trip(name):
    system = SYSTEMS[name]
    pixels = _pixels(system, 1500)
    rays = system.rays(pixels)
    assert len(pixels) > 150
    for distance_m in (0.3, 1.0, 5.0, np.inf):
        found = _found(system, rays, distance_m)
        assert found.valid.all(), distance_m
        assert np.linalg.norm(found.positions_px - pixels, axis=1).max() < BOUND_PX, distance_m


@pytest.mark.slow
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_all_pixels_of_the_examples(path):
    """Each pixel at one distance, its neighbors at others."""
    system = read_optics_file(path)
    rays = system.all_rays()
    pixels = pixel_grid(system.width_px, system.height_px)[rays.valid]
    seen = type(rays)(*(part[rays.valid] for part in rays))
    found = _found(system, seen, np.resize((0.3, 1.0, 5.0), (len(pixels), 1)))
    assert found.valid.all()
    assert np.abs(found.positions_px - pixels).max() < BOUND_PX


def test_pixels_around_a_tip():
    """Rays turn by half a circle within a few pixels."""
    system = SYSTEMS["polynomial"]
    pixels = np.stack(np.meshgrid(np.arange(170.0, 200.0), np.arange(165.0, 195.0)), axis=-1)
    rays = system.rays(pixels)
    pixels = pixels[rays.valid]
    points_m = (rays.origins_m + rays.directions)[rays.valid]
    found = system.pixel_from_point(points_m)
    assert len(pixels) > 800
    assert found.valid.all()
    assert np.abs(found.positions_px - pixels).max() < BOUND_PX


def test_optical_frame_begins_at_the_origin():
    system = SYSTEMS["misaligned hyperbola"]
    moved = replace(system, origin_m=(0.01, 0.02, 0.03))
    pixels = _pixels(system, 100)
    here, there = system.rays(pixels), moved.rays(pixels)
    np.testing.assert_allclose(here.origins_m - there.origins_m, [(0.01, 0.02, 0.03)] * len(pixels))
    found = moved.pixel_from_point(there.origins_m + there.directions)
    assert np.abs(found.positions_px - pixels).max() < BOUND_PX


def test_point_seen_twice():
    system = SYSTEMS["wave"]
    first = np.array([179.5, 210.0])
    ray = system.rays(first)
    point_m = ray.origins_m + 2.0 * ray.directions
    pixels = system.pixels_from_point(point_m)
    assert len(pixels) >= 2
    assert np.linalg.norm(pixels - first, axis=1).min() < BOUND_PX
    rays = system.rays(pixels)
    toward = point_m - rays.origins_m
    assert np.linalg.norm(np.cross(toward, rays.directions), axis=1).max() < 1e-9
    assert len(SYSTEMS["sphere"].pixels_from_point(point_m)) == 1


def test_all_pixels_have_that_of_the_ray():
    system = SYSTEMS["wave"]
    pixels = _pixels(system, 100)
    rays = system.rays(pixels)
    points_m = rays.origins_m + rays.directions
    nearest_px = [
        np.linalg.norm(system.pixels_from_point(point_m) - pixel, axis=1).min(initial=np.inf)
        for point_m, pixel in zip(points_m, pixels, strict=True)
    ]
    # the rest is beside a fold, where two pixels of a point meet
    assert np.mean(np.less(nearest_px, BOUND_PX)) > 0.98


@pytest.mark.parametrize("name", ["sphere", "port"])
def test_points_that_nothing_shows(name):
    system = SYSTEMS[name]
    behind = [(0.0, 0.0, 0.6 if name == "sphere" else -1.0)] * 2
    assert not system.pixel_from_point(behind).valid.any()
    assert not system.pixel_from_point([(np.nan, 0.0, 1.0), (np.inf, 0.0, 0.0)]).valid.any()


def _fates(system, *pixels):
    return [Fate(fate).name for fate in system.rays(pixels).fates]


def test_fates():
    sphere = SYSTEMS["sphere"]
    assert _fates(sphere, (179.5, 150.0), (0.0, 0.0)) == ["SEEN", "MISSED"]
    narrow = replace(sphere, surfaces=(replace(sphere.surfaces[0], rim_radius_m=0.01),))
    assert _fates(narrow, (179.5, 150.0), (179.5, 90.0)) == ["SEEN", "RIM"]
    assert _fates(SYSTEMS["needle"], (179.5, 175.0), (179.5, 100.0)) == ["SHADOWED", "SEEN"]
    water = OpticalSystem(
        pinhole(100.0), (Surface(Conic(1e3), at(0.1), medium="air"),), medium="water"
    )
    assert _fates(water, (179.5, 179.5), (0.0, 179.5)) == ["SEEN", "TOTAL_REFLECTION"]
    assert _fates(SYSTEMS["port"], (-0.4, -0.4)) == ["OUTSIDE"]
    assert _fates(SYSTEMS["folded"], (179.5, 230.0), (179.5, 355.0)) == ["SEEN", "RIM"]


def test_body_of_the_camera_shadows_the_mirrors_middle():
    body = Rod((0.0, 0.0, -0.1), (0.0, 0.0, -0.02), 0.015, "body")
    system = replace(SYSTEMS["sphere"], obstacles=(body,))
    rays = system.all_rays()
    shadowed = rays.fates == Fate.SHADOWED
    # by the closed form of the sphere: where the ray meets the body's lid
    unshadowed = SYSTEMS["sphere"].all_rays()
    with np.errstate(divide="ignore", invalid="ignore"):
        lengths = (-0.02 - unshadowed.origins_m[..., 2]) / unshadowed.directions[..., 2]
        at_lid = unshadowed.origins_m + lengths[..., None] * unshadowed.directions
    expected = unshadowed.valid & (lengths > 0.0) & (np.hypot(*at_lid[..., :2].T).T < 0.015)
    assert shadowed.sum() > 50
    np.testing.assert_array_equal(shadowed, expected)


def test_decentered_rim():
    sphere = SYSTEMS["sphere"].surfaces[0]
    cut = replace(sphere, rim_center_m=(0.004, 0.0), rim_radius_m=0.012)
    system = replace(SYSTEMS["sphere"], surfaces=(cut,))
    paths = system.paths(_pixels(system))
    offsets = paths.points_m[1, :, :2] - (0.004, 0.0)
    assert np.hypot(*offsets.T).max() == pytest.approx(0.012, abs=1e-3)


def test_misalignment_of_the_camera_is_the_mirrors_inverse():
    """A camera moved against its mirror sees as one whose mirror is moved the other way."""
    pose = poses.pose((0.002, -0.001, 0.003), roll_deg=2.0, pitch_deg=-1.0, yaw_deg=0.5)
    surface = SYSTEMS["sphere"].surfaces[0]
    moved = OpticalSystem(pinhole(800.0), (surface,), system_from_camera=pose)
    placed = poses.inverse(pose) @ surface.system_from_surface
    other = OpticalSystem(pinhole(800.0), (replace(surface, system_from_surface=placed),))
    pixels = _pixels(moved, 500)
    here, there = moved.rays(pixels), other.rays(pixels)
    np.testing.assert_allclose(here.directions, there.directions @ pose[:3, :3].T, atol=1e-12)
