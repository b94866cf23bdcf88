"""Baked light against closed forms, and the grid of probes."""

import dataclasses

import numpy as np
import pytest

from omnisim.rendering.baking.bake import PROBE_BUDGET, probe_grid
from omnisim.rendering.baking.baked_files import lightmap
from omnisim.scene import Scene
from omnisim.scene.model import Light, Lighting, LightKind, StartPose
from tests.rendering.baking.bakes import (
    at,
    baked,
    black_room,
    box,
    lit,
    lit_by,
    share_of_corner,
    shining,
)
from tests.scenes import scene_of, square

pytest.importorskip("embreex")
pytest.importorskip("xatlas")


@pytest.mark.parametrize("albedo", [0.0, 0.8])
def test_furnace(tmp_path, albedo):
    """All walls of a closed room shine alike: E = Le / (1 − a)."""
    room = lit_by(shining(box("room", (2.0, 3.0, 1.5), color=(albedo,) * 3, inwards=True), 0.7))
    _, found, (_, probes) = baked(tmp_path, room, texel_m=0.25, samples=16, bounces=60)
    expected = 0.7 / (1.0 - albedo)
    light = found.gathered[found.is_valid]
    assert len(light) > 100
    # rays aimed at walls and rays by the cosine weigh each other: a mean has little noise
    np.testing.assert_allclose(light.mean(axis=0), expected, rtol=0.02)
    np.testing.assert_allclose(np.median(light, axis=0), expected, rtol=0.03)
    level = probes["sh"][probes["valid"]][:, 0]
    np.testing.assert_allclose(level, expected, rtol=0.03)


@pytest.mark.parametrize("half_m", [0.2, 1.0])
def test_panel(tmp_path, half_m):
    """An emissive panel gives all of the floor below it what its form factor says."""
    panel = box("panel", (2.0 * half_m, 2.0 * half_m, 0.002), (0.0, 0.0, 1.001))
    room = black_room().added("panel", shining(panel, 5.0))
    bake, found = lit(tmp_path, room, texel_m=0.2, samples=64, bounces=0)
    surfaces = bake.surfaces(found.is_valid)
    places = surfaces.positions_m + bake.transport.center_m
    floor = found.is_valid & (surfaces.normals[:, 2] > 0.99) & (bake.patches.surfaces == 0)
    x, y, _ = places[floor].T
    expected = 5.0 * sum(
        share_of_corner((half_m + one * x) / 2.5, (half_m + other * y) / 2.5)
        for one in (-1.0, 1.0)
        for other in (-1.0, 1.0)
    )
    light = found.gathered[floor, 0]
    assert len(light) > 300
    assert light.mean() == pytest.approx(expected.mean(), rel=0.01)
    assert np.sqrt(np.mean((light / expected - 1.0) ** 2)) < 0.1  # the noise of 32 rays


def test_lamp_and_its_shadow(tmp_path):
    """A point lamp gives I cos θ / d², and nothing behind a crate."""
    lamp = Light(LightKind.POINT, (1.0, 0.5, 0.25), 8.0, position_m=np.array([0.0, 0.0, 0.5]))
    lighting = Lighting((0.0, 0.0, 0.0), (lamp,), exposure=0.5)
    crate = box("crate", (0.5, 0.5, 0.2), (1.0, 0.0, -0.4))
    room = black_room(lighting).added("crate", crate)
    bake, found, (_, probes) = baked(tmp_path, room, texel_m=0.1, samples=4, bounces=0)
    expected = 4.0 * np.array([1.0, 0.5, 0.25])
    np.testing.assert_allclose(at(bake, found.lamps, 0, (0, 0, -1.5)), expected / 4.0, rtol=0.01)
    slanted = expected * 2.0 / (4.0 + 1.0) ** 1.5
    np.testing.assert_allclose(at(bake, found.lamps, 0, (0, -1, -1.5)), slanted, rtol=0.02)
    assert not at(bake, found.lamps, 0, (1.8, 0.0, -1.5)).any()
    assert probes["valid"].mean() > 0.9


def test_a_mirrored_room_is_lit_where_it_is(tmp_path):
    """Second and third corners of its triangles change places."""
    lamp = Light(LightKind.POINT, (1.0, 1.0, 1.0), 8.0, position_m=np.array([1.0, 0.0, 0.5]))
    room = black_room(Lighting((0.0, 0.0, 0.0), (lamp,), exposure=0.5))
    (instance,) = room.instances
    mirrored = dataclasses.replace(instance, world_from_mesh=np.diag([-1.0, 1.0, 1.0, 1.0]))
    room = dataclasses.replace(room, instances=(mirrored,))
    bake, found = lit(tmp_path, room, texel_m=0.1, samples=2, bounces=0)
    for x_m, distance_m in ((1.0, 2.0), (0.0, 5.0**0.5)):
        expected = 4.0 * 2.0 / distance_m**3
        np.testing.assert_allclose(at(bake, found.lamps, 0, (x_m, 0, -1.5)), expected, rtol=0.02)


def test_sky_over_a_plain(tmp_path):
    plain = lit_by(box("plain", (6.0, 6.0, 0.2)), Lighting((0.2, 0.4, 0.6), ()), (0.0, 0.0, 1.0))
    bake, found, (_, probes) = baked(tmp_path, plain, texel_m=0.5, samples=16)
    top = at(bake, found.gathered, 0, (0.0, 0.0, 0.1), within_m=3.0)
    np.testing.assert_allclose(top, [0.2, 0.4, 0.6], rtol=1e-5)
    bottom = at(bake, found.gathered, 0, (0.0, 0.0, -0.1), (0.0, 0.0, -1.0), within_m=3.0)
    np.testing.assert_allclose(bottom, [0.2, 0.4, 0.6], rtol=1e-5)
    assert probes["sh"].shape[-2:] == (9, 3)


def test_foot_of_a_wall_is_not_darker(tmp_path):
    """Texels that a wall half covers have the light of their other half, and so have its pixels."""
    lighting = Lighting((0.0, 0.0, 0.0), (Light(LightKind.DIRECTIONAL, (1.0, 1.0, 1.0), 1.0),))
    floor = lit_by(box("floor", (4.0, 4.0, 0.1)), lighting, (1.0, 0.0, 1.0))
    scene = floor.added("wall", box("wall", (0.37, 3.1, 1.0), (0.01, 0.0, 0.55)))
    bake, found = lit(tmp_path, scene, texel_m=0.2, samples=8, bounces=0)
    places = bake.patches.places[found.is_valid & (bake.patches.surfaces == 0)]
    assert len(places) < (bake.patches.surfaces == 0).sum()  # those below the wall are none
    pixels = lightmap(bake.patches, bake.light(found), found.is_valid)
    left, top, wide, high = bake.atlas.rects_px[0]
    upper = found.lamps[found.is_valid & (bake.patches.surfaces == 0)][:, 0] > 0.0
    np.testing.assert_allclose(
        found.lamps[found.is_valid & (bake.patches.surfaces == 0)][upper], 1.0, rtol=1e-5
    )
    shown = pixels[top : top + high, left : left + wide]
    assert shown.max() == pytest.approx(1.0, rel=1e-3)


def test_both_sides_of_a_sheet_have_their_own_light(tmp_path):
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    sheet = Scene.from_arrays("sheet", corners, [(0, 1, 2), (0, 2, 3)], base_color=(0.5, 0.5, 0.5))
    lighting = Lighting((0.0, 0.0, 0.0), (Light(LightKind.DIRECTIONAL, (1.0, 1.0, 1.0), 1.0),))
    bake, found = lit(
        tmp_path, lit_by(sheet, lighting, (0, 0, 1)), texel_m=0.25, samples=4, bounces=0
    )
    assert list(bake.atlas.shares(bake.atlas.back_rects_px)) == [0]
    pixels = lightmap(bake.patches, found.lamps, found.is_valid)
    for rect, level in ((bake.atlas.rects_px[0], 1.0), (bake.atlas.back_rects_px[0], 0.0)):
        left, top, wide, high = rect
        middle = pixels[top + high // 2, left + wide // 2]
        np.testing.assert_allclose(middle, level, atol=1e-5)


def test_red_wall_colors_its_neighbor(tmp_path):
    """A floor lit from the ceiling reddens towards a red wall."""
    room = lit_by(box("room", (2.0, 2.0, 2.0), color=(0.7, 0.7, 0.7), inwards=True))
    red = box("red", (0.02, 1.9, 1.9), (-0.98, 0.0, 0.0), color=(0.7, 0.05, 0.05))
    panel = shining(box("panel", (0.5, 0.5, 0.02), (0.0, 0.0, 0.98)), 10.0)
    scene = room.added("red", red).added("panel", panel)
    bake, found = lit(tmp_path, scene, texel_m=0.1, samples=32, bounces=8)
    near, far = (at(bake, found.gathered, 0, (x, 0.0, -1.0), within_m=0.2) for x in (-0.7, 0.7))
    assert near[0] / near[1] > 1.15 * far[0] / far[1]
    assert bake.light(found)[found.is_valid].min() > 0.0


@pytest.mark.slow
def test_few_rays_are_enough_for_small_lamps(tmp_path):
    """Rays go to what gives light: a lamp's reflector, and not to a bright sky behind the walls."""
    room = lit_by(box("room", (2.0, 2.0, 2.0), color=(0.1, 0.1, 0.1), inwards=True))
    lamp = shining(box("lamp", (0.3, 0.3, 0.02), (0.0, 0.0, 0.6)), 50.0)
    shade = box("shade", (0.32, 0.32, 0.02), (0.0, 0.0, 0.5), color=(0.0, 0.0, 0.0))
    tray = box("tray", (0.6, 0.6, 0.02), (0.0, 0.0, 0.8), color=(0.8, 0.8, 0.8))
    outside = shining(box("outside", (20.0, 20.0, 20.0), inwards=True), 1.0)
    scene = room.added("lamp", lamp).added("shade", shade).added("tray", tray)
    scene = scene.added("outside", outside)
    bake, found = lit(tmp_path, scene, texel_m=0.2, samples=64, bounces=2)
    surfaces = bake.surfaces(found.is_valid)
    floor = found.is_valid & (surfaces.normals[:, 2] > 0.99) & (bake.patches.surfaces == 0)
    light = found.gathered[floor, 0]
    x, y, _ = surfaces.positions_m[floor].T
    terms = np.stack([x**i * y**j for i in (0, 2, 4, 6) for j in (0, 2, 4, 6)], axis=1)
    smooth = terms @ np.linalg.lstsq(terms, light, rcond=None)[0]
    # by texels of 0.1 m: 1.1 when the sky takes all of the rays that are aimed
    assert np.std(light - smooth) < 0.55 * light.mean()


def _ends_m(grid):
    reach = 0.5 * grid.spacing_m
    last = grid.origin_m + (np.array(grid.shape) - 1) * grid.spacing_m
    return grid.origin_m - reach, last + reach


@pytest.mark.parametrize("half_m", [4.0, 30.0])
def test_grid_is_in_the_bounds_of_a_flat_scene(half_m):
    grid = probe_grid(scene_of([square(half_m)]))
    assert grid.size <= PROBE_BUDGET
    low, high = scene_of([square(half_m)]).bounds_m()
    np.testing.assert_allclose(_ends_m(grid)[0], low, atol=1e-6)
    np.testing.assert_allclose(_ends_m(grid)[1], np.maximum(high, low + 1e-3), atol=1e-6)


@pytest.mark.parametrize("half_m", [400.0, 1e8])  # 1e8: the numbers of probes exceed int64
def test_grid_of_a_large_scene_is_around_the_start(half_m):
    scene = scene_of([square(half_m), square(half_m, z_m=half_m)])
    scene = dataclasses.replace(scene, start=StartPose((30.0, 10.0, 1.0), 0.0))
    grid = probe_grid(scene)
    low, high = _ends_m(grid)
    np.testing.assert_allclose(low, (22.0, 2.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(high, (38.0, 18.0, 5.0), atol=1e-6)
    assert grid.spacing_m.max() < 0.6
