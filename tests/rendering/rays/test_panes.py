"""Thin panes by rays: what is behind and before them, by Fresnel's equations."""

from dataclasses import replace

import numpy as np
import pytest

from omnisim.scene.model import Light, Lighting, LightKind, Material
from tests.rendering.rays.test_caster import rays_from
from tests.rendering.rays.test_reflections import traced
from tests.scenes import scene_of, square

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.rays.ray_scene import RayScene

TINT = np.array((0.9, 0.5, 0.2))
ABOVE, BELOW = np.array((0.2, 0.4, 0.8)), np.array((0.9, 0.6, 0.1))
DARK = Lighting((0.0, 0.0, 0.0), ())


def slope(degrees):
    angle = np.radians(degrees)
    return rays_from((0.0, 0.0, 1.0), [(np.sin(angle), 0.0, -np.cos(angle))])


def reflected_by_pane(degrees, ior):
    """Sum of all reflections between two interfaces, each by Snell and by Fresnel's sines."""
    outside = np.radians(max(degrees, 1e-3))
    inside = np.arcsin(np.sin(outside) / ior)
    across = (np.sin(outside - inside) / np.sin(outside + inside)) ** 2
    along = (np.tan(outside - inside) / np.tan(outside + inside)) ** 2
    once = 0.5 * (across + along)
    total, inner = once, (1.0 - once) ** 2 * once
    for _ in range(60):
        total, inner = total + inner, inner * once**2
    return total


def between_lights(panes=1, **values):
    """Panes at z = 0 and below, between a light above and one below."""
    glass = Material(
        base_color=(*TINT, 1.0), roughness=0.0, specular=1.0, double_sided=True, **values
    )
    lights = [
        Material(base_color=(*color, 1.0), unlit=True, double_sided=True)
        for color in (ABOVE, BELOW)
    ]
    meshes = [square(half_m=1e4, z_m=3.0), square(half_m=1e4, z_m=-3.0, material=1)]
    meshes += [square(half_m=1e4, z_m=-0.5 * number, material=2) for number in range(panes)]
    return scene_of(meshes, [*lights, glass], None, DARK)


@pytest.mark.parametrize("ior", [1.33, 1.52])
def test_a_pane_reflects_and_transmits_by_fresnel(ior):
    for degrees in (0.0, 56.3, 85.0):
        share = reflected_by_pane(degrees, ior)
        light = traced(between_lights(transmission=1.0, ior=ior), slope(degrees))
        np.testing.assert_allclose(light[0], share * ABOVE + (1 - share) * TINT * BELOW, rtol=1e-4)


def test_two_panes_reflect_each_other():
    """The second shows twice: through the first, and in it."""
    one = reflected_by_pane(40.0, 1.5)
    through = (1.0 - one) * TINT
    below = through * through * BELOW
    between, total = one * through * through * ABOVE, one * ABOVE + below
    total = total + between
    for number in range(1, 3):  # light that bounces between the panes
        total = total + (one * one) ** number * (below + between)
    light = traced(between_lights(panes=2, transmission=1.0), slope(40.0))
    np.testing.assert_allclose(light[0], total, atol=2e-3)  # reflections below 1/512 are left out


def _ggx(roughness, view, light):
    """Reflectance of GGX facets, before Fresnel's term, of directions (n, 3) about z."""
    halfway = view + light
    halfway /= np.linalg.norm(halfway, axis=-1, keepdims=True)
    squared = roughness**4
    facets = squared / (np.pi * (halfway[..., 2] ** 2 * (squared - 1.0) + 1.0) ** 2)

    def spread(cosine):
        return 0.5 * (np.sqrt(1.0 + squared * (1.0 / cosine**2 - 1.0)) - 1.0)

    shadowing = 1.0 / (1.0 + spread(view[2]) + spread(light[..., 2]))
    along = np.einsum("...c,c->...", halfway, view)
    return facets * shadowing / (4.0 * view[2] * light[..., 2]), along


@pytest.mark.parametrize(("degrees", "roughness"), [(0.0, 0.3), (50.0, 0.6), (50.0, 1.0)])
def test_frosted_glass_scatters_by_its_mirrored_gloss(degrees, roughness):
    """Half of the world behind a pane shines; its light is integrated over all directions."""
    glass = Material(
        base_color=(*TINT, 1.0), roughness=roughness, transmission=0.8, double_sided=True
    )
    shining = Material(base_color=(*BELOW, 1.0), unlit=True, double_sided=True)
    half = square(half_m=1e4, z_m=-1.0, material=1)
    half = replace(half, positions=(half.positions + np.float32((1e4 + 0.5, 0, 0))))
    pane = square(half_m=1e5, material=0)
    dark = Material(base_color=(0.0, 0.0, 0.0, 1.0), unlit=True)
    scene = scene_of(
        [pane, half, square(half_m=1e5, z_m=9.0, material=2)], [glass, shining, dark], None, DARK
    )
    angle = np.radians(degrees)
    toward = np.array((np.sin(angle), 0.0, -np.cos(angle)))
    rays = rays_from(-toward, np.tile(toward, (400, 1)))
    light = traced(scene, rays).mean(axis=0)
    heights, azimuths = (np.arange(800) + 0.5) / 800, np.radians(np.arange(360) + 0.5)
    side = np.sqrt(1.0 - heights**2)[:, None]
    mirrored = np.stack(
        (side * np.cos(azimuths), side * np.sin(azimuths), heights[:, None] + 0.0 * azimuths), -1
    )
    shown, along = _ggx(roughness, -toward, mirrored)
    normal = reflected_by_pane(0.0, 1.5)
    shown = shown * (1.0 - normal) * (1.0 - (1.0 - along) ** 5)
    # a mirrored direction goes to the other side
    is_lit = mirrored[..., 0] / mirrored[..., 2] > 0.5
    share = np.mean(shown * mirrored[..., 2] * is_lit) * 2.0 * np.pi
    np.testing.assert_allclose(light, 0.8 * TINT * BELOW * share, rtol=0.03)


@pytest.mark.parametrize(
    ("thickness_m", "double_sided", "from_below", "tints"),
    [(0.0, True, False, 1), (0.0, False, False, 0), (0.0, False, True, 1), (0.5, True, False, 2)],
    ids=["pane", "back", "front", "slab"],
)
def test_a_lamp_shines_through_glass(thickness_m, double_sided, from_below, tints):
    """The floor has the light that passes both interfaces, straight, and a slab also absorbs it."""
    slant = np.radians(40.0)
    toward = np.array((np.sin(slant), 0.0, np.cos(slant)))
    lamp = Light(LightKind.DIRECTIONAL, (1.0, 1.0, 1.0), 1.0, direction=-toward)
    glass = Material(
        base_color=(*TINT, 1.0), roughness=0.0, specular=1.0, transmission=0.8,
        double_sided=double_sided, thickness_m=thickness_m, attenuation_color=(0.5, 0.25, 1.0),
        attenuation_distance_m=0.5,
    )  # fmt: skip
    upper = square(half_m=50.0, z_m=2.0, material=1)
    lower = square(half_m=50.0, z_m=1.5, material=1)
    turned = [replace(one, triangles=one.triangles[:, ::-1].copy()) for one in (upper, lower)]
    panes = [upper, turned[1]] if thickness_m else [turned[0] if from_below else upper]
    scene = scene_of(
        [square(half_m=50.0), *panes], [Material(), glass], None, Lighting((0.0,) * 3, (lamp,))
    )
    light = traced(scene, rays_from((0.0, 0.0, 1.0), [(0.1, 0.2, -1.0)]))
    passed = (1.0 - reflected_by_pane(40.0, 1.5)) * (0.8 * TINT) ** tints
    if thickness_m:
        passed = passed * np.array((0.5, 0.25, 1.0)) ** (1.0 / np.cos(slant))
    if not tints:  # the back of a single-sided pane is not there
        passed = np.ones(3)
    np.testing.assert_allclose(light[0], np.cos(slant) * passed, rtol=1e-4)


def test_without_paths_and_in_metal_a_pane_is_opaque():
    scene = between_lights(transmission=1.0)
    opaque = between_lights()
    np.testing.assert_array_equal(
        RayScene(scene).radiance(slope(30.0)), RayScene(opaque).radiance(slope(30.0))
    )
    metal = between_lights(transmission=1.0, metallic=1.0)
    light = traced(metal, slope(0.0))
    np.testing.assert_allclose(light[0], TINT * ABOVE, rtol=1e-4)


def test_ranges_end_at_a_pane():
    hits = RayScene(between_lights(transmission=1.0)).first_hits(slope(0.0))
    np.testing.assert_allclose(hits.ranges_m, 1.0, rtol=1e-6)
