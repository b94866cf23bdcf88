"""Textures of materials in NumPy, filtered between texels and mip levels as on a GPU."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from omnisim.core.arrays import Bools, Bytes, Floats, Floats32, Indices
from omnisim.core.srgb import LINEAR_FROM_SRGB8
from omnisim.rendering.rays.geometry import Surface
from omnisim.scene.mipmaps import masked_mipmaps, mipmaps
from omnisim.scene.model import AlphaMode, Material, Texture, Wrap

_LINEAR = LINEAR_FROM_SRGB8.astype(np.float32)
_ALPHA = (np.arange(256) / 255.0).astype(np.float32)
_MAX_LEVELS = 32


def _base(material: Material) -> Texture | None:
    return material.texture


class TextureTable:
    """Texels of all mip levels of all textures in one array, so that one lookup serves every hit.

    Args:
        texture_of: function from a material to its texture, by default the base color's; all
            textures are linear, or all sRGB.

    Attributes:
        texture_of_surface: (n,) index of each surface's texture; −1: no texture.
    """

    def __init__(
        self, surfaces: Iterable[Surface], texture_of: Callable[[Material], Texture | None] = _base
    ):
        numbers: dict[tuple[int, float | None], int] = {}
        textures: list[tuple[Texture, float | None]] = []
        of_surface = []
        for surface in surfaces:
            texture = texture_of(surface.material)
            if texture is None or not surface.is_placed(texture):
                of_surface.append(-1)
                continue
            is_masked = texture_of is _base and surface.material.alpha_mode is AlphaMode.MASK
            cutoff = surface.material.alpha_cutoff if is_masked else None
            key = (id(texture), cutoff)
            if key not in numbers:
                numbers[key] = len(textures)
                textures.append((texture, cutoff))
            of_surface.append(numbers[key])
        self.texture_of_surface = np.array(of_surface, dtype=np.intp)
        self._first = np.zeros((len(textures), _MAX_LEVELS), dtype=np.intp)
        self._size = np.ones((len(textures), _MAX_LEVELS, 2), dtype=np.intp)  # width, height
        self._last_level = np.zeros(len(textures), dtype=np.float32)
        self._clamps = np.zeros((len(textures), 2), dtype=np.bool_)
        texels: list[Bytes] = [np.empty((0, 4), dtype=np.uint8)]
        count = 0
        for number, (texture, cutoff) in enumerate(textures):
            finer = mipmaps(texture.pixels, texture.is_linear) if cutoff is None else None
            levels = [
                texture.pixels,
                *(masked_mipmaps(texture.pixels, cutoff or 0.0) if finer is None else finer),
            ]
            for level, pixels in enumerate(levels):
                height, width = pixels.shape[:2]
                self._first[number, level], self._size[number, level] = count, (width, height)
                texels.append(pixels.reshape(-1, 4))
                count += width * height
            self._last_level[number] = len(levels) - 1
            self._clamps[number] = [
                wrap is Wrap.CLAMP_TO_EDGE for wrap in (texture.wrap_u, texture.wrap_v)
            ]
        is_linear = any(texture.is_linear for texture, _ in textures)
        self._decoded = _ALPHA if is_linear else _LINEAR
        self._uv_set = np.array([texture.uv_set for texture, _ in textures], dtype=np.intp)
        transforms = [texture.uv_transform for texture, _ in textures]
        self._transforms = np.array(transforms, dtype=np.float32).reshape(-1, 2, 3)
        self._has_transforms = bool(np.any(self._transforms != np.eye(2, 3, dtype=np.float32)))
        # one lookup of four bytes is faster
        self._texels = np.ascontiguousarray(np.concatenate(texels)).view(np.uint32).ravel()

    def sizes_px(self, textures: Indices) -> Floats32:
        """Widths and heights (n, 2) of the finest levels."""
        return self._size[textures, 0].astype(np.float32)

    def place(self, textures: Indices, first: Floats32, second: Floats32 | None) -> Floats32:
        """Coordinates (n, k, 2) of textures (n,), from both coordinate sets (n, k, 2)."""
        if second is not None:
            first = np.where((self._uv_set[textures] == 1)[:, None, None], second, first)
        if not self._has_transforms:
            return first
        matrices = self._transforms[textures, None]  # einsum would take six times as long
        u, v = first[..., :1], first[..., 1:]
        placed: Floats32 = u * matrices[..., 0] + v * matrices[..., 1] + matrices[..., 2]
        return placed

    def lookup(self, textures: Indices, coordinates: Floats32, levels: Floats32) -> Floats32:
        """Linear RGBA (n, 4) at coordinates (n, 2) of textures (n,), trilinear in levels (n,)."""
        levels = np.clip(levels, np.float32(0.0), self._last_level[textures])
        finer = np.floor(levels).astype(np.intp)
        share = (levels - finer).astype(np.float32)
        total = self._bilinear(textures, coordinates, finer)
        between = np.flatnonzero(share > 0.0)
        if len(between):
            coarse = self._bilinear(textures[between], coordinates[between], finer[between] + 1)
            total[between] += share[between, None] * (coarse - total[between])
        return total

    def _bilinear(self, textures: Indices, coordinates: Floats32, levels: Indices) -> Floats32:
        first, clamps = self._first[textures, levels], self._clamps[textures]
        size = self._size[textures, levels]
        position = coordinates.astype(np.float64) * size - 0.5
        low: Floats = np.floor(position)
        weights = (position - low).astype(np.float32)
        low_px = low.astype(np.intp)
        total = np.zeros((len(textures), 4), dtype=np.float32)
        for down in (0, 1):
            row = _wrapped(low_px[:, 1] + down, size[:, 1], clamps[:, 1])
            down_weight = weights[:, 1] if down else 1.0 - weights[:, 1]
            start = first + row * size[:, 0]
            for right in (0, 1):
                column = _wrapped(low_px[:, 0] + right, size[:, 0], clamps[:, 0])
                weight = down_weight * (weights[:, 0] if right else 1.0 - weights[:, 0])
                values = self._texels.take(start + column).view(np.uint8).reshape(-1, 4)
                colors = self._decoded.take(values)
                colors[:, 3] = _ALPHA.take(values[:, 3])
                colors *= weight[:, None]
                total += colors
        return total


def _wrapped(texels: Indices, sizes: Indices, clamps: Bools) -> Indices:
    if (texels >= 0).all() and (texels < sizes).all():  # the common case, and faster
        return texels
    return np.where(clamps, np.clip(texels, 0, sizes - 1), texels % sizes)
