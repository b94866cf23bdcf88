"""Baked light by mirrors, through panes, bodies of glass and frosted glass, in closed form."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("xatlas")

from omnisim.rendering.baking.bake import Bake
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.rendering.baking.specular import Way, Ways, chosen
from omnisim.scene import Scene
from omnisim.scene.model import Light, Lighting, LightKind, Material
from tests.rendering.baking.bakes import (
    DARK,
    at,
    baked,
    black_room,
    box,
    lit,
    lit_by,
    share_of_corner,
    shining,
)

PANE = Material("pane", roughness=0.0, specular=1.0, transmission=1.0, double_sided=True)
CHROME = Material("chrome", metallic=1.0, roughness=0.0, double_sided=True)
FROSTED = dataclasses.replace(PANE, roughness=0.6)
SUN = Light(LightKind.DIRECTIONAL, (1.0, 1.0, 1.0), 1.0)  # straight down
FLOOR_M = (0.0, 0.0, -1.5)


def made_of(material, shape):
    return dataclasses.replace(shape, materials=(material,))


def level(half_m, z_m=0.0):
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half_m + (0, 0, z_m)
    return Scene.from_arrays("sheet", corners, [(0, 1, 2), (0, 2, 3)])


def reflectance(cosine, ior=1.5):
    """Reflectance of a pane's two interfaces."""
    beyond = np.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
    across = (cosine - ior * beyond) / (cosine + ior * beyond)
    along = (beyond - ior * cosine) / (beyond + ior * cosine)
    once = 0.5 * (across**2 + along**2)
    return 2.0 * once / (1.0 + once)


def mean_reflectance():
    cosines = np.sqrt((np.arange(1000) + 0.5) / 1000)
    return reflectance(cosines).mean()


@pytest.mark.parametrize(
    "material",
    [
        PANE,
        CHROME,
        FROSTED,
        dataclasses.replace(PANE, thickness_m=0.1),
        Material("polish", base_color=(0.5,) * 3 + (1.0,), specular=1.0, roughness=0.0),
    ],
    ids=["pane", "chrome", "frosted", "glass", "polish"],
)
def test_furnace(tmp_path, material):
    """White glass and mirrors neither add nor take light: E = Le / (1 − a) in a closed room."""
    room = lit_by(shining(box("room", (2.0, 3.0, 1.5), color=(0.5,) * 3, inwards=True), 0.7))
    block = shining(box("block", (0.8, 0.6, 0.7), (0.3, 0.4, 0.0)), 0.0)
    if material.name == "polish":
        material = dataclasses.replace(material, emissive=(0.7 * (1.0 - 0.04 - 0.96 / 21.0),) * 3)
    scene = room.added("block", made_of(material, block))
    _, found = lit(tmp_path, scene, texel_m=0.5, samples=8, bounces=12)
    light = found.gathered[found.is_valid]
    np.testing.assert_allclose(light.mean(axis=0), 1.4, rtol=0.02)
    np.testing.assert_allclose(np.median(light, axis=0), 1.4, rtol=0.04)


def test_a_black_pane_ends_all_rays():
    """Its back, which is invisible, passes no light."""
    black, up = np.zeros((3, 3), np.float32), np.full((3, 3), (0.0, 0.0, 1.0), np.float32)
    ways = Ways(black, black, np.ones(3, np.bool_), up, up)
    way, factors = chosen(ways, np.ones(3, np.float32), np.array([0.1, 0.5, 0.9], np.float32))
    assert np.all(way == Way.END)
    assert np.all(np.isfinite(factors))


@pytest.mark.parametrize("double_sided", [False, True])
def test_sun_through_panes(tmp_path, double_sided):
    """A tinted pane passes (1 − R) T color, and a box of panes once per visible side."""
    tint = (0.8, 0.5, 0.2)
    pane = dataclasses.replace(
        PANE, base_color=(*tint, 1.0), transmission=0.9, double_sided=double_sided
    )
    slanted = dataclasses.replace(SUN, direction=np.array([0.0, np.sqrt(0.5), -np.sqrt(0.5)]))
    floor = lit_by(
        box("floor", (4.0, 4.0, 0.1), (0.0, 0.0, -1.55)), Lighting((0.0,) * 3, (slanted,))
    )
    scene = floor.added("pane", made_of(pane, box("window", (1.0, 1.0, 0.02))))
    bake, found = lit(tmp_path, scene, texel_m=0.1, samples=2, bounces=0)
    once = (1.0 - reflectance(np.sqrt(0.5))) * 0.9 * np.array(tint)
    expected = np.sqrt(0.5) * (once**2 if double_sided else once)
    behind = at(bake, found.lamps, 0, (0.0, 1.5, -1.5))
    np.testing.assert_allclose(behind, expected, rtol=1e-4)
    beside = at(bake, found.lamps, 0, (1.5, 1.5, -1.5))
    np.testing.assert_allclose(beside, np.sqrt(0.5), rtol=1e-4)


def test_lamp_in_a_body_of_glass(tmp_path):
    """A slab reflects and tints like two interfaces, and absorbs along the straight way."""
    glass = dataclasses.replace(
        PANE, thickness_m=0.5, attenuation_color=(0.5, 0.25, 1.0), attenuation_distance_m=0.5
    )
    lamp = Light(LightKind.POINT, (1.0, 1.0, 1.0), 4.0, position_m=np.array([0.0, 0.0, 1.0]))
    room = black_room(Lighting((0.0,) * 3, (lamp,)))
    scene = room.added("slab", made_of(glass, box("slab", (2.0, 2.0, 0.5))))
    bake, found = lit(tmp_path, scene, texel_m=0.15, samples=2, bounces=0)
    expected = 4.0 / 2.5**2 * (1.0 - reflectance(1.0)) * np.array([0.5, 0.25, 1.0])
    np.testing.assert_allclose(at(bake, found.lamps, 0, FLOOR_M), expected, rtol=0.01)


def panel_light(x_m, y_m, height_m, half_m):
    """Share of the light of a level, square panel above the origin at a place below."""
    return sum(
        share_of_corner((half_m + one * x_m) / height_m, (half_m + other * y_m) / height_m)
        for one in (-1.0, 1.0)
        for other in (-1.0, 1.0)
    )


def test_panel_by_a_mirror(tmp_path):
    """A floor gets the light of a panel and of its mirror image, by the mirror's reflectance."""
    gold = dataclasses.replace(CHROME, base_color=(0.9, 0.6, 0.3, 1.0))
    panel = shining(box("panel", (1.0, 1.0, 0.002), (0.0, 0.0, 1.001)), 5.0)
    mirror = made_of(gold, box("mirror", (0.01, 3.99, 2.99), (1.99, 0.0, 0.0)))
    scene = black_room().added("panel", panel).added("mirror", mirror)
    bake, found = lit(tmp_path, scene, texel_m=0.2, samples=64, bounces=0)
    surfaces = bake.surfaces(found.is_valid)
    places = surfaces.positions_m + bake.transport.center_m
    floor = found.is_valid & (surfaces.normals[:, 2] > 0.99) & (bake.patches.surfaces == 0)
    floor &= places[:, 0] < 1.9
    x_m, y_m, _ = places[floor].T
    own, image = (panel_light(one, y_m, 2.5, 0.5) for one in (x_m, 2.0 * 1.985 - x_m))
    expected = 5.0 * (own[:, None] + image[:, None] * np.array([0.9, 0.6, 0.3]))
    light = found.gathered[floor]
    np.testing.assert_allclose(light.mean(axis=0), expected.mean(axis=0), rtol=0.015)
    near = x_m > 1.2  # where the image gives a third of the light
    colors = [one[near].mean(axis=0) for one in (light, expected)]
    gilded, known = (1.0 - blue / red for red, _, blue in colors)
    assert gilded == pytest.approx(known, rel=0.03)


@pytest.mark.parametrize("closed", [False, True])
def test_sun_behind_frosted_glass(tmp_path, closed):
    """Frosted glass shines to both sides; the share that it does not transmit is reflected."""
    tint = (0.8, 0.5, 0.2)
    frosted = dataclasses.replace(FROSTED, base_color=(*tint, 1.0), transmission=0.75)
    shape = box("sheet", (1.0, 1.0, 0.004)) if closed else level(0.5)
    floor = box("floor", (4.0, 4.0, 0.1), (0.0, 0.0, -1.05), color=(0.0, 0.0, 0.0))
    scene = lit_by(floor, Lighting((0.0,) * 3, (SUN,))).added("sheet", made_of(frosted, shape))
    bake, found = lit(tmp_path, scene, texel_m=0.1, samples=128, bounces=16)
    passing = 1.0 - mean_reflectance()
    through = 0.75 * passing * np.array(tint)
    kept = 0.25 * passing * np.array(tint) + (1.0 - passing)
    if closed:  # light goes to and fro between both sheets
        through = through**2 / (1.0 - kept**2)
    light = at(bake, found.lamps + found.gathered, 0, (0.0, 0.0, -1.0))
    np.testing.assert_allclose(light, through * panel_light(0.0, 0.0, 1.0, 0.5), rtol=0.06)
    shown = at(bake, bake.light(found), 1, (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), within_m=0.3)
    assert shown == pytest.approx(through / (through + kept) if not closed else shown, rel=0.02)
    matte = dataclasses.replace(scene.lighting, is_matte=True)
    bake, found = lit(tmp_path, dataclasses.replace(scene, lighting=matte), texel_m=0.2, samples=4)
    assert at(bake, found.lamps + found.gathered, 0, (0.0, 0.0, -1.0)).max() < 1e-6


def test_sky_in_a_glass_house(tmp_path):
    """Panes that keep half of the light leave half of it inside: L = (1 − R) / 2 + R L."""
    pane = dataclasses.replace(PANE, base_color=(0.5, 0.5, 0.5, 1.0), double_sided=False)
    house = made_of(pane, box("house", (0.5, 0.5, 0.5), inwards=True))
    plain = lit_by(house, Lighting((1.0, 2.0, 3.0), ()))
    _, found, (_, probes) = baked(tmp_path, plain, texel_m=0.5, samples=64, bounces=0)
    assert probes["valid"].all()
    means = probes["sh"][..., 0, :].mean(axis=(0, 1, 2))
    np.testing.assert_allclose(means, (0.5, 1.0, 1.5), rtol=0.01)
    inside = found.gathered[found.is_valid].mean(axis=0)
    np.testing.assert_allclose(inside, (0.5, 1.0, 1.5), rtol=0.01)
    sunny = lit_by(house, Lighting((0.0,) * 3, (SUN,)))
    _, _, (_, probes) = baked(tmp_path, sunny, texel_m=0.5, samples=2, bounces=0)
    # light of one direction, on a sphere's mean
    once = 0.25 * 0.5 * (1.0 - reflectance(1.0))
    np.testing.assert_allclose(probes["sh"][..., 0, :], once, rtol=1e-3)


def test_rough_metal_and_matte_scenes_cast_plain_rays():
    """Light of a scene without smooth or clear materials goes no other way than before."""
    room = black_room()
    for material, lighting in (
        (dataclasses.replace(CHROME, roughness=0.3), DARK),
        (CHROME, dataclasses.replace(DARK, is_matte=True)),
        (PANE, dataclasses.replace(DARK, is_matte=True)),
    ):
        scene = lit_by(room.added("block", made_of(material, box("block", (1.0,) * 3))), lighting)
        bake = Bake(scene, BakeSettings(texel_m=0.5, samples=2))
        assert not bake.transport.specular.any
        origins, directions = np.array([[0.0, 0.0, 1.0]] * 2), np.array([[0, 0, -1.0], [0, 0, 1]])
        hits = bake.transport.cast(origins.astype(np.float32), directions.astype(np.float32))
        np.testing.assert_array_equal(hits.shares, np.ones((2, 1)))
        np.testing.assert_allclose(hits.ranges_m, (0.5, 0.5))
