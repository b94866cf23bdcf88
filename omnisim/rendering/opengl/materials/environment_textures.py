"""Textures of environment maps: the visible sky, and its filtered reflections."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.gpu_textures import texture_2d, upload
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.scene.light.environment import Environment

_MAX_HALF = 65504.0  # largest half float


def sky_texture(context: moderngl.Context, environment: Environment) -> moderngl.Texture:
    """Texture of the visible sky, with mip levels."""
    return _map(context, environment.pyramid)


def filtered_texture(context: moderngl.Context, environment: Environment) -> moderngl.Texture:
    """Texture of the filtered map, one mip level per roughness."""
    return _map(context, environment.filtered)


def _map(context: moderngl.Context, levels: tuple[NDArray[np.float32], ...]) -> moderngl.Texture:
    height, width = levels[0].shape[:2]
    with gpu_allocation(f"an environment map of {width} × {height} texels", "make it smaller"):
        texture = texture_2d(context, (width, height), 3, dtype="f2", levels=len(levels))
    for level, pixels in enumerate(levels):
        half = np.minimum(pixels, _MAX_HALF).astype(np.float16)
        upload(texture.glo, level, half)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x, texture.repeat_y = True, False
    return texture
