"""Gray levels and noise of small blocks of one color, in a camera's image and in the twin's.

Source: Immerkær, "Fast noise variance estimation" (1996): its mask is 0 on planes and along rows
and columns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import convolve2d

Floats = NDArray[np.float64]
_T = TypeVar("_T", bound=np.generic)
BLOCK_PX = 8
BIN_LEVELS = 16
MIN_BLOCKS = 20  # of a bin, in the images and in the twin's
_UNEVEN = 3.0  # gray levels between quarters of a block, beyond those of its noise
_CLIPPED = 4.0  # gray levels from black or white
_MASK = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])


class NoiseLevel(NamedTuple):
    """Noise at one gray level.

    Attributes:
        level: middle of the bin of gray levels.
        blocks: number of blocks in the images.
        noise, twin_noise: median standard deviation in the images and in the twin's, gray levels.
    """

    level: float
    blocks: int
    noise: float
    twin_noise: float


def even_blocks(
    image: NDArray[np.uint8], twin: NDArray[np.uint8], field: NDArray[np.uint8]
) -> Floats:
    """Mean level and noise of blocks that are even in both images: (blocks, 2, 2).

    The second axis is image and twin, the third mean and standard deviation.

    Args:
        image, twin: (height, width) gray images.
        field: (height, width) mask of the blocks to use; 0: not used.
    """
    whole = _blocks(field > 0).all(axis=(2, 3))
    parts, is_even = [], whole
    for gray in (image, twin):
        levels = gray.astype(np.float64)
        blocks = _blocks(levels)
        mean = blocks.mean(axis=(2, 3))
        response = np.abs(convolve2d(levels, _MASK, mode="same", boundary="symm"))
        inner = _blocks(response)[..., 1:-1, 1:-1]  # of the block's own pixels only
        noise = math.sqrt(0.5 * math.pi) / 6.0 * inner.mean(axis=(2, 3))
        half = BLOCK_PX // 2
        quarters = blocks.reshape(*mean.shape, 2, half, 2, half).mean(axis=(3, 5))
        spread = quarters.max(axis=(2, 3)) - quarters.min(axis=(2, 3))
        is_even = is_even & (spread <= _UNEVEN + noise)
        is_even = is_even & (mean >= _CLIPPED) & (mean <= 255.0 - _CLIPPED)
        parts.append(np.stack((mean, noise), axis=-1))
    return np.stack(parts, axis=2)[is_even]


def noise_by_level(blocks: Sequence[Floats]) -> tuple[NoiseLevel, ...]:
    """Noise in bins of gray levels that have enough blocks.

    Args:
        blocks: blocks (n, 2, 2) of each image, from `even_blocks`.
    """
    both = np.concatenate([np.zeros((0, 2, 2)), *blocks])
    bins = np.floor(both[..., 0] / BIN_LEVELS).astype(np.int64)
    rows = []
    for index in range(math.ceil(256 / BIN_LEVELS)):
        noises = [both[bins[:, side] == index, side, 1] for side in (0, 1)]
        if min(map(len, noises)) >= MIN_BLOCKS:
            middle = BIN_LEVELS * (index + 0.5)
            medians = [float(np.median(one)) for one in noises]
            rows.append(NoiseLevel(middle, len(noises[0]), *medians))
    return tuple(rows)


def _blocks(values: NDArray[_T]) -> NDArray[_T]:
    """Blocks (rows, columns, BLOCK_PX, BLOCK_PX) of an image, without the rest at its edges."""
    rows, columns = (size // BLOCK_PX for size in values.shape)
    cut = values[: rows * BLOCK_PX, : columns * BLOCK_PX]
    return cut.reshape(rows, BLOCK_PX, columns, BLOCK_PX).swapaxes(1, 2)
