"""Palette of vertices: colors, texture layers, alpha cutoffs and baked light."""

from types import SimpleNamespace

import numpy as np
import pytest

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_format import VertexPalette
from omnisim.scene.model import Material
from tests.rendering.opengl.cluster_readback import read_palette, read_vertices
from tests.rendering.opengl.sheets import sheet
from tests.scenes import scene_of

BASE_COLOR = (0.1, 1.0 / 3.0, 0.7, 0.9)


def _colors(count, seed):
    return np.random.default_rng(seed).uniform(0.0, 2.0, (count, 4)).astype(np.float32)


def test_entries_have_all_bits_of_color_layer_and_cutoff():
    colors, cutoff = _colors(50, seed=1), 1.0 / 7.0
    palette = VertexPalette()
    indices = palette.add(colors, BASE_COLOR, 2047, cutoff)
    halves = colors.astype(np.float16).astype(np.float32)
    expected = halves * np.array(BASE_COLOR, dtype=np.float32)
    np.testing.assert_array_equal(palette.texels[indices], expected)
    expected = np.broadcast_to(np.array((2047, cutoff), dtype=np.float32), (50, 2))
    np.testing.assert_array_equal(palette.texels[indices + 1, :2], expected)


def test_equal_vertices_share_an_entry_and_others_do_not():
    palette = VertexPalette()
    colors = np.repeat(np.eye(4, dtype=np.float32)[:2], 3, axis=0)
    added = [
        palette.add(None, BASE_COLOR, 0, 0.0), palette.add(None, BASE_COLOR, 1, 0.0),
        palette.add(None, BASE_COLOR, 0, 0.5), palette.add(colors, BASE_COLOR, 0, 0.0),
    ]  # fmt: skip
    assert [len(np.unique(one)) for one in added] == [1, 1, 1, 2]
    assert len(np.unique(np.concatenate(added))) == 5
    np.testing.assert_array_equal(palette.add(colors, BASE_COLOR, 0, 0.0), added[3])
    assert len(palette.texels) == 2 * 5


def test_light_multiplies_color_and_nothing_else():
    palette = VertexPalette()
    colors = _colors(4, seed=2)
    plain = palette.add(colors, BASE_COLOR, 5, 0.5)[[0, 1, 1, 2, 3, 0, 1, 1]]
    lights = _colors(3, seed=3)[[0, 0, 0, 0, 1, 0, 0, 2], :3]
    indices = palette.lit(plain, np.ascontiguousarray(lights))
    assert indices[0] == indices[5]
    assert indices[1] == indices[2] == indices[6]
    assert len(np.unique(indices)) == 5
    color, layer = palette.texels[plain], palette.texels[plain + 1]
    np.testing.assert_array_equal(palette.texels[indices], color)
    np.testing.assert_array_equal(palette.texels[indices + 1], layer)
    lit = palette.texels[indices + 2]
    np.testing.assert_array_equal(lit[:, :3], color[:, :3] * lights)
    np.testing.assert_array_equal(lit[:, 3], color[:, 3])
    none = palette.lit(plain[:0], np.zeros((0, 3), dtype=np.float32))
    assert len(none) == 0


def test_texture_has_the_texels_of_many_colors_in_order(context):
    palette = VertexPalette()
    palette.add(None, BASE_COLOR, 3, 0.25)
    palette.add(_colors(10_000, seed=4), BASE_COLOR, 4, 0.5)
    texels = np.frombuffer(palette.texture(context).read(), dtype=np.float32).reshape(-1, 4)
    np.testing.assert_array_equal(texels[: len(palette.texels)], palette.texels)


def test_a_palette_too_large_for_the_gpu_is_refused():
    """OpenGL refuses it silently, and the colors would be undefined."""
    context = SimpleNamespace(
        texture=lambda *arguments, dtype: SimpleNamespace(),
        error="GL_OUT_OF_MEMORY",
        info={"GL_MAX_TEXTURE_SIZE": 16384},
    )
    palette = VertexPalette()
    palette.add(None, BASE_COLOR, 0, 0.5)
    with pytest.raises(GraphicsError, match="a palette of 2 texels does not fit on this GPU"):
        palette.texture(context)


def test_materials_of_a_scene_are_those_of_its_vertices(context):
    materials = [Material(base_color=(*color, 1.0)) for color in np.eye(3).tolist()]
    meshes = [sheet(f"sheet {number}", number, side=3) for number in range(3)]
    geometry = SceneBuffers(context, scene_of(meshes, materials)).clustered_geometry
    corners = read_vertices(geometry)[geometry.triangles]
    colors = read_palette(geometry)[corners["in_material"], :3]
    for item in range(3):
        own = colors[geometry.item_of_triangle == item]
        assert len(own)
        np.testing.assert_array_equal(own, np.broadcast_to(np.eye(3)[item], own.shape))
