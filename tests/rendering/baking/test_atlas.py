"""Unwrapping, packing and sizes of texels."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from omnisim.core.errors import SceneError
from omnisim.rendering.baking.bake import hollow_triangles, instances_of
from omnisim.rendering.baking.lightmap_atlas import (
    MAX_LENGTH,
    automatic_atlas,
    build_atlas,
    coarseness,
    pack,
    unwrap,
)
from omnisim.rendering.baking.patches import GRID, rasterize
from omnisim.scene import Scene, load_scene
from tests.rendering.baking.bakes import box, lit_by
from tests.scenes import scene_of
from tests.slow import slow_but

pytest.importorskip("xatlas")

NO_BACKS = np.zeros(1, dtype=np.bool_)


def test_unwrapping_keeps_triangles_in_their_order():
    (mesh,) = box("cube", (1.0, 2.0, 3.0)).meshes
    page = unwrap(mesh, 10.0 * np.eye(3))
    np.testing.assert_array_equal(page.vertex_of[page.triangles], mesh.triangles)
    assert page.uv.min() >= 0.0
    assert page.uv.max() <= 1.0
    assert page.triangles.dtype == page.vertex_of.dtype == np.int32


def test_samples_cover_triangles():
    corners = np.array([[[1.0, 1.0], [9.0, 1.0], [1.0, 9.0]]], dtype=np.float32)
    samples = rasterize(corners, np.arange(1), 16)
    assert len(samples.texels) == pytest.approx(32.0 * GRID**2, rel=0.15)
    placed = np.einsum("nk,kc->nc", samples.weights, corners[0])
    np.testing.assert_array_equal(
        np.floor(placed).astype(int), np.stack((samples.texels % 16, samples.texels // 16), 1)
    )


def test_charts_do_not_overlap_and_end_at_the_centers_of_their_rectangles_texels():
    (mesh,) = load_scene("rings").meshes[:1]
    page = unwrap(mesh, 8.0 * np.eye(3))
    places = page.uv * page.size_px
    corners = places[page.triangles].astype(np.float32)
    samples = rasterize(corners, np.arange(len(corners)), page.size_px[0])
    assert len(np.unique(samples.triangles)) == len(corners)
    used = np.zeros(page.size_px[::-1], dtype=int)
    found = np.zeros(len(places), dtype=bool)
    for left, top, wide, high in page.charts_px:
        used[top : top + high, left : left + wide] += 1
        low, last = np.array([left, top]), np.array([left + wide, top + high])
        mine = (np.abs(places - (low + last) / 2) < (last - low) / 2).all(axis=1)
        np.testing.assert_allclose(places[mine].min(axis=0), low + 0.5, atol=1e-3)
        np.testing.assert_allclose(places[mine].max(axis=0), last - 0.5, atol=1e-3)
        found |= mine
    assert used.max() == 1
    assert found.all()


def test_rectangles_do_not_overlap():
    sizes = np.random.default_rng(1).integers(0, 40, (60, 2))
    rects, (width, height) = pack(sizes)
    used = np.zeros((height, width), dtype=int)
    for (left, top, wide, high), size in zip(rects, sizes, strict=True):
        assert (wide, high) == (tuple(size) if size.min() else (0, 0))
        used[top : top + high, left : left + wide] += 1
    assert used.max() == 1
    assert used.mean() > 0.8


def test_texels_grow_with_the_distance():
    near = lit_by(box("near", (1.0, 1.0, 1.0)))
    scene = near.added("far", box("far", (1.0, 1.0, 1.0), (40.5, 0.0, 0.0)))
    np.testing.assert_allclose(coarseness(scene), [1.0, 10.0], rtol=1e-6)


def test_texels_too_small_are_refused(monkeypatch):
    monkeypatch.setattr("omnisim.rendering.baking.lightmap_atlas.MAX_SIDE_PX", 128)
    scene = lit_by(box("hall", (10.0, 10.0, 3.0)))
    with pytest.raises(SceneError, match=r"texel_m = 0.1: expected about .* or more, for an atlas"):
        build_atlas(scene, 0.1, NO_BACKS)
    assert max(build_atlas(scene, 0.4, NO_BACKS).size_px) <= 128


def test_a_needle_gets_wide_texels():
    """One vertex lies far away: its chart would be millions of texels long and two wide."""
    mesh = Scene.from_arrays("needle", [(0, 0, 0), (0, 1e-3, 0), (1e9, 0, 0)], [(0, 1, 2)])
    texel_m, atlas = automatic_atlas(lit_by(mesh), NO_BACKS, 1 << 16)
    assert atlas.texels_m[0] == pytest.approx(1e9 / MAX_LENGTH)
    assert texel_m < 1e6
    assert max(atlas.size_px) <= MAX_LENGTH


def test_many_needles_fit():
    """A fan around one far vertex: charts that no step of 5 % makes shorter for a long time."""
    near = [(0, np.cos(turn), np.sin(turn)) for turn in np.arange(12)]
    fan = [(index, (index + 5) % 12, 12) for index in range(12)]
    scene = lit_by(Scene.from_arrays("fan", [*near, (1e9, 0, 0)], fan))
    _, atlas = automatic_atlas(scene, NO_BACKS, 1 << 14)
    assert np.prod(atlas.size_px) <= 1 << 14


def test_texels_are_so_fine_that_they_fill_the_atlas():
    (mesh,) = box("crate", (1.0, 1.0, 1.0)).meshes
    crates = lit_by(scene_of([mesh] * 30))
    _, atlas = automatic_atlas(crates, np.zeros(30, dtype=np.bool_), 1 << 13)
    assert 0.9 * (1 << 13) < np.prod(atlas.size_px) <= 1 << 13


def _double_sided(scene):
    materials = [dataclasses.replace(material, double_sided=True) for material in scene.materials]
    return dataclasses.replace(scene, materials=tuple(materials))


def test_backs_are_seen_of_sheets_and_of_rooms_with_cameras():
    solid = box("solid", (1.0, 1.0, 1.0), (5.0, 0.0, 0.0))
    assert not hollow_triangles(lit_by(solid)).any()
    assert not hollow_triangles(lit_by(_double_sided(solid))).any()
    room = lit_by(_double_sided(box("room", (4.0, 4.0, 4.0))))
    assert hollow_triangles(room).all()
    (mesh,) = solid.meshes
    sheet = dataclasses.replace(
        solid, meshes=(dataclasses.replace(mesh, triangles=mesh.triangles[:2]),)
    )
    assert hollow_triangles(lit_by(_double_sided(sheet))).all()
    assert instances_of(room, hollow_triangles(room)).tolist() == [True]


def test_slim_triangles_have_samples_all_over_their_length():
    corners = np.array([[[1.2, 1.3], [30.0, 1.3], [30.0, 1.45]]], dtype=np.float32)
    samples = rasterize(corners, np.arange(1), 32)
    assert set(range(32 + 1, 32 + 30)) <= set(samples.texels.tolist())
    np.testing.assert_allclose(samples.weights.sum(axis=1), 1.0, rtol=1e-6)
    assert samples.weights.min() >= 0.0


MANY = """
from omnisim.rendering.baking.lightmap_atlas import atlas_of_sleeping_threads
for _ in range(COUNT):
    with atlas_of_sleeping_threads() as atlas:
        pass
    del atlas
"""


@pytest.mark.parametrize("count", slow_but([1_000, 5_000], 1_000))
def test_atlases_end_while_their_threads_start(count):
    """Without waiting for their threads, 1 of about 1600 never ended."""
    code = MANY.replace("COUNT", str(count))
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
