"""Mip levels beside the driver's own, and beside averages in floating point."""

import moderngl
import numpy as np
import pytest

from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.rendering.opengl.world.scene_textures import SRGB8_ALPHA8, TextureArray
from omnisim.scene.mipmaps import mipmaps


def _noise(height, width):
    return np.random.default_rng(7).integers(0, 256, (height, width, 4), dtype=np.uint8)


def _texture(context, pixels):
    height, width = pixels.shape[:2]
    return context.texture((width, height), 4, pixels.copy(), internal_format=SRGB8_ALPHA8)


def _level(texture, number, shape):
    return np.frombuffer(texture.read(level=number), np.uint8).reshape(shape)


def test_levels_are_the_drivers(context):
    """Levels of exactly half the size have one right answer: all drivers' within 1."""
    pixels = _noise(64, 32)
    theirs = _texture(context, pixels)
    theirs.build_mipmaps()
    levels = mipmaps(pixels)
    assert [level.shape[:2] for level in levels] == [
        (32, 16), (16, 8), (8, 4), (4, 2), (2, 1), (1, 1)
    ]  # fmt: skip
    for number, level in enumerate(levels[:3], start=1):
        expected = _level(theirs, number, level.shape).astype(int)
        # the driver rounds each level to 8 bits before it makes the next
        assert np.abs(level.astype(int) - expected).max() <= number
    theirs.release()


def test_uploaded_levels_are_sampled(context):
    pixels = _noise(5, 3)
    levels = mipmaps(pixels)
    other = _noise(5, 3)[::-1]
    array = TextureArray(context, [[other, *mipmaps(other)], [pixels, *levels]], (True, True))
    ours = array.layers[1]
    ours.filter = (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
    program = context.program(
        vertex_shader="#version 450\nvoid main() { gl_Position = vec4(0, 0, 0, 1); }",
        fragment_shader="#version 450\nuniform sampler2D u_texture; uniform float u_level;\n"
        "out vec4 out_color;\nvoid main() { out_color = textureLod(u_texture, vec2(0.5), u_level);"
        " }",
    )
    target = context.simple_framebuffer((1, 1), components=4, dtype="f4")
    target.use()
    ours.use(0)
    triangle = context.vertex_array(program, [])
    for number, level in enumerate(levels, start=1):
        program["u_level"] = float(number)
        triangle.render(moderngl.POINTS, vertices=1)
        sampled = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
        texel = level[level.shape[0] // 2, level.shape[1] // 2] / 255.0
        expected = (*linear_from_srgb(texel[:3]), texel[3])
        # drivers decode sRGB by tables of their own
        np.testing.assert_allclose(sampled, expected, atol=1e-3)


@pytest.mark.parametrize("shape", [(7, 7), (9, 4), (1, 6), (576, 37)])
def test_every_texel_counts_alike_at_odd_sizes(shape):
    """A level's mean is the image's, to a step of 8 bits at most; nothing is cut off."""
    pixels = _noise(*shape)
    linear = pixels / 255.0
    linear[..., :3] = linear_from_srgb(linear[..., :3])
    last = mipmaps(pixels)[-1]
    assert last.shape == (1, 1, 4)
    mean = linear.mean(axis=(0, 1))
    mean[:3] = srgb_from_linear(mean[:3])
    assert np.abs(last[0, 0] / 255.0 - mean).max() <= 1.0 / 255.0


def test_single_texel_has_no_levels():
    assert mipmaps(_noise(1, 1)) == []
