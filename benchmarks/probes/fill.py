"""Fill rate: pixels per second of a constant color and of texture lookups."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np

from benchmarks.probes.probe import CONSTANT, FULL_SCREEN, Probe, repeated

BYTES, HALVES_AND_DEPTH = "constant color, RGBA8", "constant color, RGBA16F, depth test"
SRGB, ATLAS = "sRGB texture", "RGBA16F atlas"
_SRGB8_ALPHA8 = 0x8C43
_TEXTURE_PX = 1024
# Texels per pixel, and the filter: one mip level, or two levels with equal weights.
_LOOKUPS = {
    "bilinear": (1.0, (moderngl.LINEAR, moderngl.LINEAR)),
    "trilinear": (2.0**0.5, (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)),
}
# Like scene textures: the level follows from the lookups of neighboring pixels.
_TEXTURE = """
#version 430 core
uniform sampler2D u_texture;
uniform float u_scale;  // texture coordinates a pixel
layout(location = 0) out vec4 out_color;
void main() { out_color = texture(u_texture, gl_FragCoord.xy * u_scale + 0.0003); }
"""
# Like a capture from the virtual cameras: the level is computed.
_ATLAS = """
#version 430 core
uniform sampler2D u_texture;
uniform float u_scale;
uniform float u_level;
layout(location = 0) out vec4 out_color;
void main() {
    out_color = textureLod(u_texture, gl_FragCoord.xy * u_scale + 0.0003, u_level);
}
"""


def lookup_name(texture: str, how: str) -> str:
    """Name of the probe that looks up a texture (`SRGB` or `ATLAS`) by a method of `_LOOKUPS`."""
    return f"{texture}, {how}"


def fill_probes(context: moderngl.Context, side_px: int) -> list[Probe]:
    """Probes of constant colors and lookups, in squares of `side_px` × `side_px`."""
    with context:
        constant = context.program(vertex_shader=FULL_SCREEN, fragment_shader=CONSTANT)
        works = {
            name: _filling(context, constant, _targets(context, side_px, dtype, depth), None)
            for name, dtype, depth in ((BYTES, "f1", False), (HALVES_AND_DEPTH, "f2", True))
        }
        for name, source, dtype in ((SRGB, _TEXTURE, "f1"), (ATLAS, _ATLAS, "f2")):
            targets = _targets(context, side_px, dtype, depth=False)
            for how, (texels, texture_filter) in _LOOKUPS.items():
                texture = _noise(context, name)
                texture.filter = texture_filter
                program = context.program(vertex_shader=FULL_SCREEN, fragment_shader=source)
                program["u_scale"] = texels / _TEXTURE_PX
                if "u_level" in program:
                    program["u_level"] = float(np.log2(texels))
                works[lookup_name(name, how)] = _filling(context, program, targets, texture)
    return [repeated(context, name, "px", side_px**2, work) for name, work in works.items()]


def _filling(
    context: moderngl.Context,
    program: moderngl.Program,
    targets: list[moderngl.Framebuffer],
    texture: moderngl.Texture | None,
) -> Callable[[int], None]:
    """Function that fills the targets in turn.

    A software renderer skips overdrawn pixels of one target; alternating targets prevents this.
    """
    vertex_array = context.vertex_array(program, [])

    def fill(number: int) -> None:
        target = targets[number % len(targets)]
        target.use()
        if target.depth_attachment is None:
            context.enable_only(moderngl.NOTHING)
        else:
            target.clear(depth=0.0)
            context.enable_only(moderngl.DEPTH_TEST)
            context.depth_func = ">"
        if texture is not None:
            texture.use(0)
        vertex_array.render(moderngl.TRIANGLES, vertices=3)

    return fill


def _targets(
    context: moderngl.Context, side_px: int, dtype: str, depth: bool
) -> list[moderngl.Framebuffer]:
    size = (side_px, side_px)
    return [
        context.framebuffer(
            [context.renderbuffer(size, 4, dtype=dtype)],
            context.depth_renderbuffer(size) if depth else None,
        )
        for _ in range(2)
    ]


def _noise(context: moderngl.Context, name: str) -> moderngl.Texture:
    """Texture of random numbers with mip levels."""
    size = (_TEXTURE_PX, _TEXTURE_PX)
    values = np.random.default_rng(7).integers(0, 256, (*size, 4), dtype=np.uint8)
    if name == SRGB:
        texture = context.texture(size, 4, values, internal_format=_SRGB8_ALPHA8)
    else:
        texture = context.texture(size, 4, (values / 255.0).astype("<f2"), dtype="f2")
    texture.build_mipmaps()
    return texture
