"""Mip levels of textures, averaged in linear light.

Software drivers also generate levels, but first compile a program per class of texture sizes. That
takes longer than averaging all textures of a scene here.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core import srgb
from omnisim.core.arrays import Bytes, Floats32

# Linear light in 14 bits: the step is a fifth of the finest step of 8-bit sRGB, and the sum of two
# values fits in 16 bits.
_MAX_LINEAR = 2**14 - 1
_SHADES = np.linspace(0.0, 1.0, 256)
_LEVELS = np.linspace(0.0, 1.0, _MAX_LINEAR + 1)
_LINEAR = np.rint(_MAX_LINEAR * srgb.linear_from_srgb(_SHADES)).astype(np.uint16)
_SRGB = srgb.srgb8_from_linear(_LEVELS)
_WIDE_ALPHA = np.rint(_MAX_LINEAR * _SHADES).astype(np.uint16)  # alpha is linear already
_ALPHA = np.rint(255.0 * _LEVELS).astype(np.uint8)
_ONES, _BITS = np.uint64(0x0001_0001_0001_0001), np.uint64(0x7FFF_7FFF_7FFF_7FFF)  # per channel
_BLOCK = 1 << 16  # values per lookup: NumPy's temporary 64-bit indices then fit in a cache


def mipmaps(pixels: Bytes, is_linear: bool = False) -> list[Bytes]:
    """Mip levels 1, 2, … down to one texel, for a texture (height, width, 4) uint8 sRGB or linear.

    Colors are averaged in linear light.
    """
    wide, narrow = (_WIDE_ALPHA, _ALPHA) if is_linear else (_LINEAR, _SRGB)
    values = _looked_up(wide, _WIDE_ALPHA, pixels)
    levels = []
    while max(values.shape[:2]) > 1:
        values = _halved(_halved(values, 0), 1)
        levels.append(_looked_up(narrow, _ALPHA, values))
    return levels


def _looked_up(
    of_color: NDArray[Any], of_alpha: NDArray[Any], values: NDArray[np.unsignedinteger]
) -> NDArray[Any]:
    """Table lookup of RGBA values (height, width, 4), with a separate table for alpha."""
    entries = np.empty(values.shape, of_color.dtype)
    given, taken = values.reshape(-1), entries.reshape(-1)
    for start in range(0, given.size, _BLOCK):
        # indices are always valid, but with mode="clip" NumPy writes to `out` directly
        part = slice(start, start + _BLOCK)
        np.take(of_color, given[part], out=taken[part], mode="clip")
    entries[..., 3] = np.take(of_alpha, values[..., 3], mode="clip")
    return entries


def _halved(values: NDArray[np.uint16], axis: int) -> NDArray[np.uint16]:
    """Averages of two values along an axis; of three, suitably weighted, if the count is odd.

    Source: Guthe and Heckbert, "Non-power-of-two mipmapping", 2005.
    """
    count = values.shape[axis]
    if count == 1:
        return values
    if count % 2 == 0:
        return _mean_of_pairs(values, axis)
    rows = np.moveaxis(values, axis, 0)
    half = count // 2
    first, second = rows[0 : 2 * half : 2], rows[1 : 2 * half : 2]
    index = np.arange(half, dtype=np.uint32).reshape(-1, *(1,) * (rows.ndim - 1))
    total = first * (half - index) + second * np.uint32(half) + rows[2::2] * (index + 1)
    mean = ((total + count // 2) // count).astype(np.uint16)
    return np.ascontiguousarray(np.moveaxis(mean, 0, axis))


def _mean_of_pairs(values: NDArray[np.uint16], axis: int) -> NDArray[np.uint16]:
    """Averages of two values along an axis of an even size, a texel of 64 bits at a time."""
    texels = np.moveaxis(values.view(np.uint64), axis, 0)
    mean = texels[0::2] + texels[1::2]  # of 15 bits each
    mean += _ONES
    mean >>= np.uint64(1)
    mean &= _BITS  # without the lowest bit of the next channel
    return np.ascontiguousarray(np.moveaxis(mean, 0, axis)).view(np.uint16)


# Mip levels of alpha-masked textures that preserve the coverage at every level.

_SEARCH_STEPS = 12  # bisections of [0, 16], down to 4/1000: one 8-bit step


def masked_mipmaps(pixels: Bytes, cutoff: float) -> list[Bytes]:
    """Mip levels 1, 2, … down to one texel, for a texture (height, width, 4) uint8 sRGB.

    With plain averages of alpha, a fence vanishes once no texel reaches the cutoff, and the gaps of
    a hedge close. Each level's alpha is therefore scaled until the same share of texels passes the
    cutoff as at the first level. Colors are averaged in linear light and weighted by alpha.

    Source: Castaño, "Computing alpha mipmaps", 2010.
    """
    alpha = pixels[..., 3].astype(np.float32) / 255.0
    color = srgb.linear_from_srgb8(pixels[..., :3]) * alpha[..., None]
    plain = srgb.linear_from_srgb8(pixels[..., :3])  # for blocks without any coverage
    covered = float((alpha >= cutoff).mean())
    levels = []
    while max(alpha.shape) > 1:
        alpha, color, plain = _mean_of_blocks(alpha), _mean_of_blocks(color), _mean_of_blocks(plain)
        weight = alpha[..., None]
        seen = np.where(weight > 1e-4, color / np.maximum(weight, 1e-4), plain)
        scaled = np.clip(alpha * _alpha_scale(alpha, cutoff, covered), 0.0, 1.0)
        level = np.concatenate((srgb.srgb_from_linear(seen), scaled[..., None]), axis=-1)
        levels.append(np.rint(255.0 * level).astype(np.uint8))
    return levels


def _mean_of_blocks(values: Floats32) -> Floats32:
    """Averages of 2 × 2 blocks. A side of one texel is kept; an odd last row or column is dropped,
    as in OpenGL's level sizes."""  # fmt: skip
    for axis in (0, 1):
        if values.shape[axis] > 1:
            even = np.take(values, range(0, values.shape[axis] - 1, 2), axis)
            values = 0.5 * (even + np.take(values, range(1, values.shape[axis], 2), axis))
    return values


def _alpha_scale(alpha: Floats32, cutoff: float, covered: float) -> float:
    low, high = 0.0, 16.0
    for _ in range(_SEARCH_STEPS):
        middle = 0.5 * (low + high)
        if float((alpha * middle >= cutoff).mean()) < covered:
            low = middle
        else:
            high = middle
    return high
