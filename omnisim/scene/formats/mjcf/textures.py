"""Textures of a MuJoCo model: flat images, and the six faces of cubes."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.srgb import linear_from_srgb8
from omnisim.scene.parts import Texture, Wrap


class Textures:
    """Textures of a model, each created once."""

    def __init__(self, model: mujoco.MjModel):
        self._model = model
        self._made: dict[tuple[int, int | None, bool], Texture] = {}
        self._plain: dict[int, tuple[float, float, float] | None] = {}

    def is_cube(self, texture: int) -> bool:
        """True for a cube with six faces, false for a flat image."""
        return int(self._model.tex_type[texture]) != mujoco.mjtTexture.mjTEXTURE_2D

    def image(self, texture: int, is_linear: bool = False) -> Texture:
        """Flat image, which repeats."""
        return self._make(texture, None, is_linear)

    def face(self, texture: int, face: int) -> Texture:
        """Face of a cube, in OpenGL's order (+x, −x, +y, …); a square image serves all six."""
        is_square = self._model.tex_height[texture] == self._model.tex_width[texture]
        return self._make(texture, 0 if is_square else face, False)

    def plain_color(self, texture: int) -> tuple[float, float, float] | None:
        """Linear RGB of a single-color texture; None: several colors."""
        if texture not in self._plain:
            pixels = texture_pixels(self._model, texture).reshape(-1, 4)
            is_plain = bool((pixels == pixels[0]).all())
            self._plain[texture] = self.mean_color(texture) if is_plain else None
        return self._plain[texture]

    def mean_color(self, texture: int) -> tuple[float, float, float]:
        """Mean linear RGB of a texture."""
        pixels = texture_pixels(self._model, texture)[..., :3]
        red, green, blue = linear_from_srgb8(pixels).mean(axis=(0, 1)).tolist()
        return red, green, blue

    def _make(self, texture: int, face: int | None, is_linear: bool) -> Texture:
        key = (texture, face, is_linear)
        if key not in self._made:
            pixels, wrap = texture_pixels(self._model, texture), Wrap.REPEAT
            if face is not None:
                side = pixels.shape[1]
                pixels, wrap = pixels[face * side : (face + 1) * side], Wrap.CLAMP_TO_EDGE
            self._made[key] = Texture(np.ascontiguousarray(pixels), wrap, wrap, is_linear=is_linear)
        return self._made[key]


def texture_pixels(model: mujoco.MjModel, texture: int) -> NDArray[np.uint8]:
    """Pixels (height, width, 4) of a texture; the faces of a cube are stacked vertically."""
    height, width = int(model.tex_height[texture]), int(model.tex_width[texture])
    channels, start = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    flat = model.tex_data[start : start + height * width * channels]
    pixels = flat.reshape(height, width, channels)
    rgba = np.full((height, width, 4), 255, dtype=np.uint8)
    rgba[..., : min(channels, 4)] = pixels[..., :4]
    if channels < 3:  # gray, copied to all three channels
        rgba[..., :3] = pixels[..., :1]
    return rgba
