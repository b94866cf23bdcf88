"""Textures of environment maps: the visible sky, and its filtered reflections."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.functions import (
    allocate_half_floats,
    limit_levels,
    upload_half_floats,
)
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
        texture = context.texture((width, height), 3, dtype="f2")
        texture.use()
        allocate_half_floats((width, height), len(levels), components=3)
    for level, pixels in enumerate(levels):
        half = np.minimum(pixels, _MAX_HALF).astype(np.float16)
        upload_half_floats(texture.glo, level, np.ascontiguousarray(half))
    limit_levels(texture.glo, 0, len(levels) - 1)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x, texture.repeat_y = True, False
    return texture
