"""Mip levels beside the driver's own, and bounds of the depth beside NumPy's."""

import math

import moderngl
import numpy as np
import pytest

from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.image_pass import AtlasLevels
from omnisim.rendering.opengl.capture.parallax_pass import DepthPyramid
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d, texture_array
from tests.rendering.opengl.depths import drawn_depth

LEVELS = 3


@pytest.mark.parametrize("size", [(64, 48), (37, 21)])
def test_levels_are_the_drivers(context, size):
    """As those of glGenerateMipmap, where that has one answer, and alike in arrays."""
    width, height = size
    texels = np.random.default_rng(3).random((2, height, width, 4)).astype(np.float16)
    one = texture_2d(context, size, 4, dtype="f2", levels=1 + LEVELS)
    both = texture_array(context, (*size, 2), 4, levels=1 + LEVELS)
    drawn = [AtlasLevels(texture, LEVELS) for texture in (one, both)]
    one.write(texels[1].tobytes())
    both.write(texels.tobytes())
    drawn[0].draw()
    drawn[1].draw(2)
    theirs = context.texture(size, 4, texels[1].tobytes(), dtype="f2")
    theirs.build_mipmaps(0, LEVELS)
    for level in range(1, LEVELS + 1):
        ours = _read_level(context, one, level)
        expected = _read_level(context, theirs, level)
        if all(side % 2**level == 0 for side in size):
            np.testing.assert_allclose(ours, expected, rtol=level * 2.0**-10)
        np.testing.assert_array_equal(ours, _read_level(context, both, level))


def _read_level(context, texture, level):
    """Texels of a level, of the second layer of an array."""
    width, height = (max(1, side >> level) for side in texture.size[:2])
    is_array = isinstance(texture, moderngl.TextureArray)
    kind, place = ("2DArray", "ivec3(at, 1)") if is_array else ("2D", "at")
    program = context.program(
        vertex_shader="#version 450\nvoid main() { gl_Position = vec4(vec2("
        "(gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0, 0.0, 1.0); }",
        fragment_shader=f"#version 450\nuniform sampler{kind} u_texture; uniform int u_level;\n"
        "out vec4 o_color;\nvoid main() { ivec2 at = ivec2(gl_FragCoord.xy);\n"
        f"o_color = texelFetch(u_texture, {place}, u_level); }}",
    )
    program["u_level"] = level
    texture.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
    target = context.framebuffer([context.texture((width, height), 4, dtype="f2")])
    target.use()
    texture.use(0)
    context.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    texels = np.frombuffer(target.read(components=4, dtype="f2"), np.float16)
    return texels.reshape(height, width, 4)


BLOCK, BLOCKS_PER_GROUP = 8, 8
NEAR_M = 0.05
LONGEST_M = 0.17  # largest distance of a ray's origin from the viewpoint


def _largest(values, side):
    """Maximum of each square of `side` × `side` values, smaller at the far edges."""
    rows = np.maximum.reduceat(values, range(0, values.shape[0], side), axis=0)
    return np.maximum.reduceat(rows, range(0, values.shape[1], side), axis=1)


def _dilated(blocks):
    """Maximum over each value and its eight neighbors."""
    height, width = blocks.shape
    padded = np.pad(blocks, 1, mode="edge")
    parts = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.max(parts, axis=0)


def _expected(depth, far_m):
    """Bounds (rows, columns, 2) of blocks and of their groups, and the largest nearness."""
    share = NEAR_M / (far_m - NEAR_M)
    scale = 1.0 / (NEAR_M * (1.0 + share))
    blocks = _largest(depth, BLOCK)
    inverse_z = np.float32(scale) * blocks + np.float32(share * scale)
    inverse_z[blocks == 0.0] = 0.0
    groups = _dilated(_largest(inverse_z, BLOCKS_PER_GROUP))
    height, width = inverse_z.shape
    of_group = groups.repeat(BLOCKS_PER_GROUP, axis=0).repeat(BLOCKS_PER_GROUP, axis=1)
    nearest = float(inverse_z.max())
    if nearest > 0.0:  # seen from any ray's beginning, not before the near plane
        distance_m = max(1.0 / nearest - LONGEST_M, NEAR_M)
        nearest = 1.0 / distance_m
    bounds = np.stack((_dilated(inverse_z), of_group[:height, :width]), axis=-1)
    return bounds, np.float32(nearest)


@pytest.mark.parametrize(
    ("shape", "far_m"),
    [((64, 128), math.inf), ((61, 83), 20.0), ((130, 7), 20.0), ((3, 3), math.inf)],
)
def test_bounds_are_those_of_numpy(context, shape, far_m):
    plan = TilePlan((), 0, 0.0, shape[1], shape[0])
    pyramid = DepthPyramid(context, plan, NEAR_M, far_m, LONGEST_M)
    generator = np.random.default_rng(shape)
    far_away = np.zeros(shape, dtype=np.float32)
    far_away[-1, -1] = 0.01
    surfaces = generator.uniform(0.0, 0.6, shape).astype(np.float32) ** 4
    surfaces[generator.random(shape) < 0.5] = 0.0
    # the nearest surfaces of an image do not count in the next one
    for depth in (surfaces, far_away, np.zeros_like(surfaces)):
        pyramid.update(drawn_depth(context, depth))
        bounds, nearest = _expected(depth, far_m)
        values = np.frombuffer(pyramid._bounds.read(), dtype="<f4")
        values = values.reshape(bounds.shape[0] + 1, -1, 2)
        np.testing.assert_array_equal(values[:-1], bounds)
        assert values[-1, 0, 0] == nearest
