"""Mip levels that we draw beside the driver's own."""

import moderngl
import numpy as np
import pytest

from omnisim.rendering.opengl.capture.image_pass import AtlasLevels
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d, texture_array

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
