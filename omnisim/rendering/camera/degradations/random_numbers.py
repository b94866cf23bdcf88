"""Random numbers as hashes of position and time, without a state.

The same bits come out of `shaders/common/random.glsl`, on every machine and in any order, so that
an image can be rendered again, and a drive resumed. 32-bit integers only.

Source: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020: pcg4d, which
passes TestU01's batteries as they report it. Box and Muller, 1958, for normal numbers.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import ArrayLike, NDArray


def key_of(*parts: int | str) -> int:
    """Key of 32 bits for one stream of numbers; any difference of the parts makes another key."""
    text = "\0".join(f"{type(part).__name__} {part}" for part in parts)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "little")


def pcg4d(x: ArrayLike, y: ArrayLike, z: ArrayLike, w: ArrayLike) -> NDArray[np.uint32]:
    """Four hashes (4, ...) uint32 of four coordinates (...), taken modulo 2³²."""
    parts = np.broadcast_arrays(*(np.asarray(part).astype(np.uint32) for part in (x, y, z, w)))
    v = [part * np.uint32(1664525) + np.uint32(1013904223) for part in map(np.atleast_1d, parts)]

    def mix() -> None:
        v[0] += v[1] * v[3]
        v[1] += v[2] * v[0]
        v[2] += v[0] * v[1]
        v[3] += v[1] * v[2]

    mix()
    v = [part ^ (part >> np.uint32(16)) for part in v]
    mix()
    return np.stack(v).reshape(4, *np.shape(parts[0]))


def uniform(hashes: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Numbers (...) in (0, 1), never the ends: 2²³ of them, each exact in float32."""
    return ((hashes >> np.uint32(9)).astype(np.float32) + np.float32(0.5)) * np.float32(2.0**-23)


def normal(first: NDArray[np.uint32], second: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Normal numbers (...), mean 0 and variance 1, from two hashes each; at most 5.77 in size."""
    radius = np.sqrt(np.float32(-2.0) * np.log(uniform(first)))
    numbers: NDArray[np.float32] = radius * np.cos(np.float32(2.0 * np.pi) * uniform(second))
    return numbers
