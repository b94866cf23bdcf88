"""Palette of vertex colors, texture layers and alpha cutoffs."""

import numpy as np

from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.geometry.vertex_palette import VertexPalette
from omnisim.rendering.opengl.geometry.vertex_records import CLUSTER_VERTEX
from omnisim.scene.model import Material
from tests.rendering.opengl.sheets import sheet
from tests.scenes import scene_of

BASE_COLOR = (0.1, 1.0 / 3.0, 0.7, 0.9)


def test_entries_have_all_bits_of_color_layer_and_cutoff():
    colors = np.random.default_rng(1).uniform(0.0, 2.0, (50, 4)).astype(np.float32)
    palette = VertexPalette()
    cutoff = 1.0 / 7.0
    indices = palette.add(colors, BASE_COLOR, 2047, cutoff)
    entries = palette.values()[indices]
    halves = colors.astype(np.float16).astype(np.float32)
    np.testing.assert_array_equal(entries[:, 0], halves * np.array(BASE_COLOR, dtype=np.float32))
    np.testing.assert_array_equal(entries[:, 1, 0], 2047)
    np.testing.assert_array_equal(entries[:, 1, 1], np.float32(cutoff))


def test_equal_vertices_share_an_entry_and_others_do_not():
    palette = VertexPalette()
    colors = np.repeat(np.eye(4, dtype=np.float32)[:2], 3, axis=0)
    added = [
        palette.add(None, BASE_COLOR, 0, 0.0), palette.add(None, BASE_COLOR, 1, 0.0),
        palette.add(None, BASE_COLOR, 0, 0.5), palette.add(colors, BASE_COLOR, 0, 0.0),
    ]  # fmt: skip
    assert [len(np.unique(one)) for one in added] == [1, 1, 1, 2]
    assert len(np.unique(np.concatenate(added))) == len(palette.values()) == 5
    np.testing.assert_array_equal(palette.add(colors, BASE_COLOR, 0, 0.0), added[3])
    assert len(palette.values()) == 5


def test_texture_has_the_entries_of_many_colors_in_order(context):
    generator = np.random.default_rng(2)
    colors = generator.uniform(0.0, 1.0, (10_000, 4)).astype(np.float32)
    palette = VertexPalette()
    palette.add(None, BASE_COLOR, 3, 0.25)
    palette.add(colors, BASE_COLOR, 4, 0.5)
    texels = np.frombuffer(palette.texture(context).read(), dtype=np.float32).reshape(-1, 4)
    expected = palette.values().reshape(-1, 4)
    np.testing.assert_array_equal(texels[: len(expected)], expected)


def test_materials_of_a_scene_are_those_of_its_vertices(context):
    materials = [Material(base_color=(*color, 1.0)) for color in np.eye(3).tolist()]
    meshes = [sheet(f"sheet {number}", number, side=3) for number in range(3)]
    geometry = SceneBuffers(context, scene_of(meshes, materials)).clustered_geometry
    vertices = np.frombuffer(geometry.vertices.read(), dtype=CLUSTER_VERTEX)
    palette = np.frombuffer(geometry.palette.read(), dtype=np.float32).reshape(-1, 2, 4)
    colors = palette[vertices["in_material"][geometry.triangles], 0, :3]
    for item in range(3):
        own = colors[geometry.item_of_triangle == item]
        assert len(own)
        np.testing.assert_array_equal(own, np.broadcast_to(np.eye(3)[item], own.shape))
