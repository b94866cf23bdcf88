"""Mip levels, texture arrays, and textures of more sizes than a shader has samplers."""

import ctypes
import gc

import moderngl
import numpy as np
import pytest

from omnisim.core.poses import pose as make_pose
from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.context import collect_garbage
from omnisim.rendering.opengl.world.scene_textures import (
    SRGB8_ALPHA8,
    MaterialTextures,
    TextureArray,
)
from omnisim.rendering.stage import Stage
from omnisim.scene.mipmaps import mipmaps
from omnisim.scene.model import AlphaMode, Lighting, Material, Texture, Wrap
from tests.rendering.opengl.sheets import SUN, sheet
from tests.rendering.opengl.surfaces.test_cluster_drawer import assert_same, reference_stage
from tests.scenes import room, scene_of


def _exists(name):
    is_texture = ctypes.CDLL("libGL.so.1").glIsTexture
    is_texture.restype = ctypes.c_ubyte
    return bool(is_texture(name))


def test_layers_go_with_their_array(context):
    pixels = np.zeros((4, 4, 4), dtype=np.uint8)
    array = TextureArray(context, [[pixels], [pixels]], (True, True))
    names = [layer.glo for layer in array.layers]
    collect_garbage(context)
    assert [_exists(name) for name in names] == [True, True]
    del array
    gc.collect()
    collect_garbage(context)
    assert [_exists(name) for name in names] == [False, False]


def test_white_stays_as_long_as_the_textures(context):
    textures = MaterialTextures(context)
    name = textures._white.texture.glo
    gc.collect()
    collect_garbage(context)
    assert _exists(name)


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


CAMERA = OmniCamera().with_quality("fast").resized(160)
COUNT = 40
CHANNELS = ("range", "instance", "albedo")
POSES = [make_pose((0.1 * n, 0.2 - 0.2 * n, -0.3), yaw_deg=80.0 * n) for n in range(3)]


def _texture_of_own_size(number):
    """Texture of a size that no other has."""
    shape = (5 + number, 70 - number, 4)
    pixels = np.random.default_rng(number).integers(40, 256, shape, dtype=np.uint8)
    wrap = (Wrap.REPEAT, Wrap.CLAMP_TO_EDGE)[number % 2]
    return Texture(pixels, wrap, wrap)


def _masked(number):
    texture = _texture_of_own_size(number)
    texture.pixels[..., 3] = 255
    texture.pixels[: len(texture.pixels) // 3, :, 3] = 0
    return Material(texture=texture, alpha_mode=AlphaMode.MASK, double_sided=True)


def _blended(number):
    return Material(
        (0.8, 0.8, 0.9, 0.7), texture=_texture_of_own_size(number), alpha_mode=AlphaMode.BLEND,
        double_sided=True, unlit=number % 3 == 0,
    )  # fmt: skip


def _forty_sheets(make_material):
    """Sheets about the camera, each with a texture of its own size."""
    generator = np.random.default_rng(3)
    meshes, poses = [room()], [np.eye(4)]
    for number in range(COUNT):
        meshes.append(sheet(f"sheet {number}", 1 + number, side=4, seed=number, up=0.8))
        at = generator.uniform((-2.5, -1.6, -1.2), (2.5, 1.6, 0.6))
        at *= max(1.0, 1.0 / np.linalg.norm(at))
        roll_deg, pitch_deg, yaw_deg = generator.uniform(0.0, 360.0, 3)
        poses.append(make_pose(at, roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg))
    materials = [Material("room", double_sided=True), *map(make_material, range(COUNT))]
    lighting = Lighting((0.2, 0.2, 0.3), (SUN,))
    return scene_of(meshes, materials, poses, lighting=lighting)


@pytest.mark.parametrize("make_material", [_masked, _blended])
def test_forty_sizes_look_as_if_drawn_one_by_one(make_material, monkeypatch, needs_opengl):
    scene = _forty_sheets(make_material)
    poses = np.stack([one @ np.linalg.inv(CAMERA.base_from_rig) for one in POSES])
    with (
        Stage(scene) as stage,
        reference_stage(monkeypatch, scene) as reference,
        stage.open(CAMERA) as renderer,
        reference.open(CAMERA) as one_by_one,
    ):
        frames = [renderer.render(one, also=CHANNELS) for one in poses]
        batch = renderer.render_batch(poses, channels=("rgba", *CHANNELS))
        for frame, pose in zip(frames, poses, strict=True):
            assert_same(frame.rgba, one_by_one.render(pose).rgba)
    np.testing.assert_array_equal(batch["rgba"], [frame.rgba for frame in frames])
    for name in CHANNELS:
        np.testing.assert_array_equal(batch[name], [frame.channels[name] for frame in frames])
    assert len(np.unique(batch["instance"])) > COUNT // 2
