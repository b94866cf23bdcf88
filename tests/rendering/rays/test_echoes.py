"""Echoes of beams through panes and by mirrors: mirrored geometry, and Fresnel's equations."""

import dataclasses

import numpy as np
import pytest

from omnisim.scene.model import Lighting, Material
from omnisim.validation.material_chart import sphere
from tests.ray_casting import embree_ranges
from tests.rendering.rays.test_caster import rays_from, soup
from tests.rendering.rays.test_panes import reflected_by_pane, slope
from tests.scenes import scene_of, square

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.ground_truth.hits import EchoLimits
from omnisim.rendering.rays.cast_beams import Echoes, cast_echoes, select_returns
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene

RED = 0.5
WALL = Material(base_color=(RED, 0.1, 0.9, 1.0), double_sided=True)
GLASS = Material(
    base_color=(0.9, 0.5, 0.2, 1.0), roughness=0.0, specular=1.0, transmission=0.8, ior=1.52,
    double_sided=True,
)  # fmt: skip
METAL = Material(base_color=(0.8, 0.7, 0.6, 1.0), roughness=0.0, metallic=1.0, double_sided=True)
FLOOR = Material(base_color=(0.4, 0.4, 0.4, 1.0), roughness=0.0, specular=1.0, double_sided=True)


def echoes(scene, rays):
    return cast_echoes(RayScene(scene), rays, ObjectState())


def of_surface(found, number, beams):
    """Ranges and intensities (beams,) of the echoes of a surface; +inf: none."""
    ranges_m, intensities = np.full(beams, np.inf), np.zeros(beams)
    some = found.take(np.flatnonzero(found.surfaces == number))
    assert len(set(some.beams.tolist())) == len(some.beams)
    ranges_m[some.beams], intensities[some.beams] = some.ranges_m, some.intensities
    return ranges_m, intensities


def beams_down(count=4000, seed=5):
    """Beams from (0, 0, 2) to places on the ground within 3 m."""
    places = np.random.default_rng(seed).uniform(-3.0, 3.0, (count, 2))
    return rays_from((0.0, 0.0, 2.0), np.column_stack((places, np.full(count, -2.0))))


def cluttered(material, side):
    """A plane at z = 0, and triangles on one side of it."""
    clutter = soup(300, 1)
    heights = side * (np.abs(clutter.positions[:, 2]) + 0.5)
    positions = np.column_stack((clutter.positions[:, :2], heights)).astype(np.float32)
    clutter = dataclasses.replace(clutter, positions=positions)
    scene = scene_of([square(half_m=40.0), clutter], [material, WALL])
    return scene, positions[clutter.triangles].astype(np.float64)


@pytest.mark.parametrize(("material", "side"), [(GLASS, -1.0), (METAL, 1.0)])
def test_beams_go_straight_on_behind_a_pane_and_meet_the_mirrored_scene(material, side):
    scene, corners_m = cluttered(material, side)
    rays = beams_down()
    if material is METAL:  # the beams that reach the mirror
        above_m = embree_ranges(corners_m, rays.origins_m, rays.directions)
        rays = rays.take(np.flatnonzero(np.isinf(above_m)))
        corners_m = corners_m * (1.0, 1.0, -1.0)
    ranges_m, _ = of_surface(echoes(scene, rays), 1, len(rays.near_m))
    expected_m = embree_ranges(corners_m, rays.origins_m, rays.directions)
    # rays along an edge, which is float32 to Embree, may end on the triangle behind
    assert np.mean(np.isfinite(ranges_m) == np.isfinite(expected_m)) > 0.9995
    both = np.isfinite(ranges_m) & np.isfinite(expected_m)
    assert both.sum() > 400
    assert np.mean(np.abs(ranges_m[both] - expected_m[both]) < 1e-3) > 0.9995


@pytest.mark.parametrize("degrees", [0.0, 45.0, 75.0])
def test_a_pane_leaves_fresnels_share_on_both_ways(degrees):
    scene = scene_of([square(half_m=1e3), square(half_m=1e3, z_m=-3.0, material=1)], [GLASS, WALL])
    found = echoes(scene, slope(degrees))
    _, (intensity,) = of_surface(found, 1, 1)
    once = (1.0 - reflected_by_pane(degrees, GLASS.ior)) * GLASS.transmission * 0.9
    expected = once**2 * RED * np.cos(np.radians(degrees))
    np.testing.assert_allclose(intensity, expected, rtol=1e-5)  # the sum of 60 reflections is exact


@pytest.mark.parametrize("degrees", [0.0, 60.0, 80.0])
@pytest.mark.parametrize("material", [METAL, FLOOR], ids=["metal", "dielectric"])
def test_a_mirror_leaves_schlicks_share_on_both_ways(material, degrees):
    scene = scene_of(
        [square(half_m=1e3), square(half_m=1e3, z_m=3.0, material=1)], [material, WALL]
    )
    found = echoes(scene, slope(degrees))
    (range_m,), (intensity,) = of_surface(found, 1, 1)
    cosine = np.cos(np.radians(degrees))
    f0 = 0.8 if material is METAL else 0.04
    once = f0 + (1.0 - f0) * (1.0 - cosine) ** 5
    expected = once**2 * RED * cosine
    assert range_m == pytest.approx(4.0 / cosine, abs=1e-6)
    assert intensity == pytest.approx(expected, rel=1e-4)
    _, (own,) = of_surface(found, 0, 1)
    if material is FLOOR and degrees:  # the body below the gloss
        np.testing.assert_allclose(own, (1.0 - once) ** 2 * 0.4 * cosine, rtol=0.01)


def test_polished_metal_returns_nothing_but_perpendicularly():
    """A Gaussian beam whose return falls to 1/e where the plane turns it by 3.2 mrad."""
    scene, limits = scene_of([square(half_m=1e3)], [METAL]), EchoLimits(1, 0.1, 100.0)
    peak = 0.8 / (4.0 * 0.0016**2)
    for degrees in (0.0, 0.2, 0.3, 1.0, 20.0, 60.0, 85.0):
        found = echoes(scene, slope(degrees))
        expected = peak * np.exp(-((np.radians(degrees) / 0.0016) ** 2))
        # small angles: tangents and cosines differ by less than 1 %
        np.testing.assert_allclose(found.intensities, [expected], rtol=0.01, atol=1e-4)
        returned = np.isfinite(select_returns(found, 1, limits).ranges_m[0, 0])
        assert returned == (degrees < 0.39)


def test_rough_metal_returns_by_gltf_s_facets():
    """f0 π D V cosθ, where half vector, view and light are one direction, at roughness 0.3."""
    rough = dataclasses.replace(METAL, roughness=0.3)
    scene = scene_of([square(half_m=1e3)], [rough])
    for degrees in (0.0, 5.0, 30.0, 70.0):
        cosine, squared = np.cos(np.radians(degrees)), 0.3**4
        facets = squared / (cosine**2 * (squared - 1.0) + 1.0) ** 2
        visible = 0.5 / (2.0 * cosine * np.sqrt(cosine**2 * (1.0 - squared) + squared))
        found = echoes(scene, slope(degrees))
        np.testing.assert_allclose(found.intensities, [0.8 * facets * visible * cosine], rtol=1e-4)
        assert found.is_certain.all()


def test_a_curved_mirror_returns_only_its_glint():
    ball = sphere(0.5, 24)
    scene = scene_of([ball, square(half_m=50.0, z_m=-1.0, material=1)], [METAL, WALL])
    rays = rays_from((0.0, 0.0, 2.0), [(0.02 * x, 0.01, -1.0) for x in range(12)])
    found = echoes(scene, rays)
    assert set(found.surfaces.tolist()) == {0}
    assert len(found.beams) == 12


def test_mirrors_that_face_each_other_end():
    scene = scene_of([square(half_m=1e3), square(half_m=1e3, z_m=3.0)], [
        dataclasses.replace(METAL, base_color=(1.0, 1.0, 1.0, 1.0))
    ])  # fmt: skip
    found = echoes(scene, slope(5.0))
    assert len(found.beams) == 16
    np.testing.assert_allclose(np.diff(found.ranges_m), 3.0 / np.cos(np.radians(5.0)), rtol=1e-6)


def test_matte_scenes_have_one_echo():
    matte = Lighting((1.0, 1.0, 1.0), (), is_matte=True)
    meshes = [square(half_m=1e3), square(half_m=1e3, z_m=-3.0)]
    found = echoes(scene_of(meshes, [GLASS], None, matte), slope(30.0))
    assert found.surfaces.tolist() == [0]
    assert found.is_certain.all()


def _echoes(*rows):
    beams, ranges_m, intensities, surfaces = map(np.array, zip(*rows, strict=True))
    certain = np.zeros(len(rows), dtype=np.bool_)
    return Echoes(beams, ranges_m, intensities, surfaces, certain)


def test_two_returns_are_the_strongest_and_the_last():
    found = _echoes(
        (0, 2.0, 0.1, 0), (0, 5.0, 0.9, 1), (0, 9.0, 0.5, 2),  # strongest 1: 0.036, last 2
        (1, 2.0, 0.2, 0), (1, 3.0, 0.1, 1), (1, 4.0, 0.9, 2),  # strongest is last: second is 0
        (3, 1.0, 0.1, 0),
        (4, 50.0, 0.02, 1),  # needs 0.025 there
    )  # fmt: skip
    returns = select_returns(found, 5, EchoLimits(2, 0.1, 100.0))
    inf = np.inf
    np.testing.assert_array_equal(
        returns.ranges_m, [[5.0, 4.0, inf, 1.0, inf], [9.0, 2.0, inf, inf, inf]]
    )
    np.testing.assert_array_equal(returns.surfaces_plus_one, [[2, 3, 0, 1, 0], [3, 1, 0, 0, 0]])
    np.testing.assert_array_equal(returns.intensities[0], [0.9, 0.9, 0.0, 0.1, 0.0])
    one = select_returns(found, 5, EchoLimits(1, 0.1, 100.0))
    np.testing.assert_array_equal(one.ranges_m, returns.ranges_m[:1])


def test_surfaces_that_are_directly_hit_and_not_specular_always_return():
    found = _echoes((0, 99.0, 1e-6, 0))._replace(is_certain=np.array([True]))
    assert select_returns(found, 1, EchoLimits(1, 1.0, 100.0)).ranges_m[0, 0] == 99.0
