"""Mip levels of alpha-masked textures that preserve the coverage at every level."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.core.srgb import linear_from_srgb8, srgb_from_linear

_SEARCH_STEPS = 12  # bisections of [0, 16], down to 4/1000: one 8-bit step


def masked_mipmaps(pixels: NDArray[np.uint8], cutoff: float) -> list[NDArray[np.uint8]]:
    """Mip levels 1, 2, … down to one texel, for a texture (height, width, 4) uint8 sRGB.

    With plain averages of alpha, a fence vanishes once no texel reaches the cutoff, and the gaps of
    a hedge close. Each level's alpha is therefore scaled until the same share of texels passes the
    cutoff as at the first level. Colors are averaged in linear light and weighted by alpha.

    Source: Castaño, "Computing alpha mipmaps", 2010.
    """
    alpha = pixels[..., 3].astype(np.float32) / 255.0
    color = linear_from_srgb8(pixels[..., :3]) * alpha[..., None]
    plain = linear_from_srgb8(pixels[..., :3])  # for blocks without any coverage
    covered = float((alpha >= cutoff).mean())
    levels = []
    while max(alpha.shape) > 1:
        alpha, color, plain = _halved(alpha), _halved(color), _halved(plain)
        weight = alpha[..., None]
        seen = np.where(weight > 1e-4, color / np.maximum(weight, 1e-4), plain)
        scaled = np.clip(alpha * _alpha_scale(alpha, cutoff, covered), 0.0, 1.0)
        level = np.concatenate((srgb_from_linear(seen), scaled[..., None]), axis=-1)
        levels.append(np.rint(255.0 * level).astype(np.uint8))
    return levels


def _halved(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Averages of 2 × 2 blocks. A side of one texel is kept; an odd last row or column is dropped,
    as in OpenGL's level sizes."""  # fmt: skip
    for axis in (0, 1):
        if values.shape[axis] > 1:
            even = np.take(values, range(0, values.shape[axis] - 1, 2), axis)
            values = 0.5 * (even + np.take(values, range(1, values.shape[axis], 2), axis))
    return values


def _alpha_scale(alpha: NDArray[np.float32], cutoff: float, covered: float) -> float:
    low, high = 0.0, 16.0
    for _ in range(_SEARCH_STEPS):
        middle = 0.5 * (low + high)
        if float((alpha * middle >= cutoff).mean()) < covered:
            low = middle
        else:
            high = middle
    return high
