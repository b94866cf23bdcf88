"""Random numbers as stateless hashes of position and time.

`shaders/common/random.glsl` produces the same bits, on every machine and in any order, so that an
image can be rendered again and a drive resumed. Only 32-bit integers are used.

Source: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020: pcg4d, which
passes TestU01's batteries according to the authors. Box and Muller, 1958, for normal numbers.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.arrays import Floats32


def key_of(*parts: int | str) -> int:
    """32-bit key of one stream of numbers; different parts give different keys."""
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


def uniform(hashes: NDArray[np.uint32]) -> Floats32:
    """Numbers (...) in (0, 1), without the ends: 2²³ values, each exact in float32."""
    return ((hashes >> np.uint32(9)).astype(np.float32) + np.float32(0.5)) * np.float32(2.0**-23)


def normal(first: NDArray[np.uint32], second: NDArray[np.uint32]) -> Floats32:
    """Normal numbers (...), mean 0 and variance 1, from two hashes each; magnitude ≤ 5.77."""
    radius = np.sqrt(np.float32(-2.0) * np.log(uniform(first)))
    return radius * np.cos(np.float32(2.0 * np.pi) * uniform(second))
