"""Texture arrays: textures of one size as layers, each also usable as its own texture."""

from __future__ import annotations

import weakref
from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.gpu_textures import (
    RGBA8,
    SRGB8_ALPHA8,
    bind_texture,
    byte_textures,
    upload,
)
from omnisim.rendering.opengl.gl.memory import gpu_allocation

MAP_UNITS = 1, 2, 3, 4, 9, 14, 15  # in the order of `Material.maps`


class TextureArray:
    """Array of equally sized RGBA textures with mip levels, stored as sRGB or linear.

    Args:
        context: OpenGL context.
        layers: mip levels (height, width, 4) of each, from full size to one texel.
        repeats: repeat to the right and down; otherwise clamp to the edge.
        is_linear: linear values instead of sRGB colors.

    Attributes:
        array: texture array.
        layers: each layer as a texture view, without a copy.
    """

    def __init__(
        self,
        context: moderngl.Context,
        layers: Sequence[Sequence[NDArray[np.uint8]]],
        repeats: tuple[bool, bool],
        is_linear: bool = False,
    ):
        stored = RGBA8 if is_linear else SRGB8_ALPHA8
        height, width = layers[0][0].shape[:2]
        levels = len(layers[0])
        with gpu_allocation(
            f"{len(layers)} textures of {width} × {height} texels", "make the scene smaller"
        ):
            size = width, height, len(layers)
            self.array, self.layers = byte_textures(context, size, levels, stored)
        for layer, pixels in enumerate(layers):
            for level, texels in enumerate(pixels):
                upload(self.array.glo, level, texels, layer)
        textures: list[moderngl.Texture | moderngl.TextureArray] = [self.array, *self.layers]
        for texture in textures:
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            texture.repeat_x, texture.repeat_y = repeats
        # moderngl does not free the layers, and they hold the array's memory
        names = [layer.glo for layer in self.layers]
        dropped = weakref.finalize(self, context.extra.dropped_textures.extend, names)
        dropped.atexit = False  # the end of the process frees them


def bind_maps(maps: Sequence[TextureArray | None]) -> None:
    """Bind the arrays of a material's maps, after that of its base color."""
    for unit, one in zip(MAP_UNITS, maps, strict=True):
        if one is not None:
            bind_texture(unit, one.array.glo)
