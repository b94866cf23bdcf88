"""Mip levels that we draw beside the driver's own."""

import moderngl
import numpy as np
import pytest

from omnisim.gpu.gl_functions import generate_mipmaps
from omnisim.gpu.scene.atlas_levels import AtlasLevels

LEVELS = 3


def _texels(texture, level, layers):
    width, height = (max(1, side >> level) for side in texture.size[:2])
    shape = (layers, height, width, 4)
    return np.frombuffer(texture.read(level=level), np.float16).reshape(shape)


@pytest.mark.parametrize("size", [(64, 48), (37, 21)])
def test_levels_are_the_drivers(context, size):
    """As those of glGenerateMipmap, to the rounding of a half float, and alike in arrays."""
    width, height = size
    texels = np.random.default_rng(3).random((2, height, width, 4)).astype(np.float16)
    one = context.texture(size, 4, texels[1].tobytes(), dtype="f2")
    both = context.texture_array((*size, 2), 4, texels.tobytes(), dtype="f2")
    levels = [AtlasLevels(texture, LEVELS) for texture in (one, both)]
    levels[0].draw()
    levels[1].draw(2)
    theirs = context.texture(size, 4, texels[1].tobytes(), dtype="f2")
    theirs.build_mipmaps(0, LEVELS)
    generate_mipmaps(theirs.glo)
    for level in range(1, LEVELS + 1):
        drawn, expected = _texels(one, level, 1)[0], _texels(theirs, level, 1)[0]
        np.testing.assert_allclose(drawn, expected, rtol=level * 2.0**-10)
        np.testing.assert_array_equal(drawn, _read_layer(context, both, level, 1))


def _read_layer(context, array, level, layer):
    """Texels of a layer's level, by a draw: moderngl reads no levels of arrays."""
    width, height = (max(1, side >> level) for side in array.size[:2])
    program = context.program(
        vertex_shader="#version 450\nvoid main() { gl_Position = vec4(vec2("
        "(gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0, 0.0, 1.0); }",
        fragment_shader="#version 450\nuniform sampler2DArray u_array; uniform ivec2 u_place;\n"
        "out vec4 o_color;\nvoid main() {"
        " o_color = texelFetch(u_array, ivec3(gl_FragCoord.xy, u_place.x), u_place.y); }",
    )
    program["u_place"] = layer, level
    array.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
    target = context.framebuffer([context.texture((width, height), 4, dtype="f2")])
    target.use()
    array.use(0)
    context.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    return np.frombuffer(target.read(components=4, dtype="f2"), np.float16).reshape(
        height, width, 4
    )
