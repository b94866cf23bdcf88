"""Lookups in textures beside OpenGL's own sampler."""

import moderngl
import numpy as np
import pytest

from omnisim.rendering.opengl.world.scene_textures import MaterialTextures
from omnisim.rendering.rays.geometry import PlacedSurface
from omnisim.rendering.rays.shading.surface_table import TextureTable
from omnisim.scene.model import AlphaMode, Material, Texture, Wrap
from omnisim.scene.parts import IDENTITY_UV
from tests.scenes import square

FRAGMENT = """#version 430 core
uniform sampler2D u_texture;
uniform sampler2D u_lookups;  // coordinates and level
out vec4 out_color;
void main() {
    vec3 lookup = texelFetch(u_lookups, ivec2(gl_FragCoord.xy), 0).xyz;
    out_color = textureLod(u_texture, lookup.xy, lookup.z);
}"""
VERTEX = """#version 430 core
void main() {
    gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0);
}"""
COUNT = 4096


def _sampled(context, texture, lookups):
    """Colors (n, 4) of lookups (n, 3) by a shader."""
    program = context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
    program["u_texture"], program["u_lookups"] = 0, 1
    where = context.texture((COUNT, 1), 3, lookups.astype("f4").tobytes(), dtype="f4")
    where.filter = (moderngl.NEAREST, moderngl.NEAREST)
    target = context.framebuffer([context.renderbuffer((COUNT, 1), 4, dtype="f4")])
    target.use()
    texture.use(0)
    where.use(1)
    context.vertex_array(program, []).render(vertices=3)
    return np.frombuffer(target.read(components=4, dtype="f4"), np.float32).reshape(-1, 4)


@pytest.mark.parametrize(
    ("mode", "size", "wrap"),
    [
        (AlphaMode.OPAQUE, (64, 32), Wrap.REPEAT),
        (AlphaMode.MASK, (37, 5), Wrap.REPEAT),
        (AlphaMode.OPAQUE, (37, 5), Wrap.CLAMP_TO_EDGE),
    ],
)
def test_lookups_are_those_of_the_sampler(context, mode, size, wrap):
    random = np.random.default_rng(3)
    pixels = random.integers(0, 256, (*size, 4), dtype=np.uint8)
    other = Texture(random.integers(0, 256, (8, 8, 4), dtype=np.uint8))
    material = Material(texture=Texture(pixels, wrap, wrap), alpha_mode=mode)
    mesh = square(texture_coordinates=np.zeros((4, 2), dtype=np.float32))
    table = TextureTable(
        PlacedSurface("", None, one, True) for one in (Material(texture=other), material, material)
    )
    assert table.texture_of_surface.tolist() == [0, 1, 1]
    lookups = np.column_stack(
        (random.uniform(-2.0, 2.0, (COUNT, 2)), random.uniform(-1.0, 8.0, COUNT))
    ).astype(np.float32)
    expected = _sampled(context, MaterialTextures(context).find(material, mesh).texture, lookups)
    found = table.lookup(np.ones(COUNT, dtype=np.intp), lookups[:, :2], lookups[:, 2])
    # OpenGL counts positions between texels and between levels in 256ths; llvmpipe decodes sRGB
    # by a polynomial
    assert np.abs(found - expected).max() < 3.0 / 256.0
    assert np.abs(found - expected).mean() < 0.5 / 256.0


def test_surfaces_without_textures_have_none():
    textured = Material(texture=Texture(np.zeros((2, 2, 4), np.uint8)))
    table = TextureTable(
        [PlacedSurface("", None, Material(), True), PlacedSurface("", None, textured, False)]
    )
    assert table.texture_of_surface.tolist() == [-1, -1]


@pytest.mark.parametrize("is_turned", [False, True])
def test_coordinates_are_those_of_the_set_after_the_transform(is_turned):
    transforms = IDENTITY_UV, ((0.5, -2.0, 0.25), (1.5, 0.0, -3.0)) if is_turned else IDENTITY_UV
    textures = [
        Texture(np.zeros((2, 2, 4), np.uint8), uv_set=uv_set, uv_transform=transform)
        for uv_set, transform in enumerate(transforms)
    ]
    surfaces = (
        PlacedSurface("", None, Material(texture=texture), True, True) for texture in textures
    )
    table = TextureTable(surfaces)
    first, second = np.random.default_rng(4).normal(size=(2, 5, 3, 2)).astype(np.float32)
    numbers = np.array([0, 1, 0, 1, 1])
    placed = table.place(numbers, first, second)
    given = np.where((numbers == 1)[:, None, None], second, first)
    matrix = np.array(transforms, np.float32)[numbers]
    expected = np.einsum("nkj,nij->nki", given, matrix[:, :, :2]) + matrix[:, None, :, 2]
    np.testing.assert_array_equal(placed, expected)
