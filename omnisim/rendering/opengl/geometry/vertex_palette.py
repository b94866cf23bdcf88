"""Palette of vertices: color, texture layer, alpha cutoff and baked light, each combination once.

A vertex has an index of 4 bytes instead of 36 bytes of floats, and the same values to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation

PALETTE_UNIT = 19  # as in shaders/scene/vertex_material.glsl, and so is the layout
_ROW_BITS = 14  # log2 of the texels per row: as many as all drivers allow, for many entries
_ONE_COLOR = np.ones((1, 4), dtype=np.float16)


class VertexPalette:
    """Collects the entries of vertices, for one texture.

    An entry begins with two texels: color, then layer and cutoff. A third one follows if light is
    baked into it: the color times the light. The index of an entry is that of its first texel.
    """

    def __init__(self) -> None:
        self._texels = np.zeros((1 << _ROW_BITS, 4), dtype=np.float32)
        self._used = 0
        self._indices: dict[tuple[object, ...], NDArray[np.uint32]] = {}

    @property
    def texels(self) -> NDArray[np.float32]:
        """Texels (n, 4) of all entries."""
        return self._texels[: self._used]

    def add(
        self,
        colors: NDArray[np.float32] | None,
        base_color: Sequence[float],
        layer: int,
        cutoff: float,
    ) -> NDArray[np.uint32]:
        """Indices of the vertices of a mesh with one material.

        Args:
            colors: (n, 4) linear vertex colors, kept alive by the caller; None: white.
            base_color: RGBA that multiplies them.
            layer: layer of the texture array.
            cutoff: alpha cutoff, or the kind of a blended material.

        Returns:
            Indices (n,), or (1,) for all vertices without colors of their own.
        """
        key = (id(colors), tuple(base_color), layer, cutoff)
        if key not in self._indices:
            # vertex colors are half floats, as in the scene's vertex buffer
            halves = _ONE_COLOR if colors is None else colors.astype(np.float16)
            found, entry = np.unique(halves.view(np.uint64).ravel(), return_inverse=True)
            entries = np.zeros((len(found), 2, 4), dtype=np.float32)
            entries[:, 0] = found.view(np.float16).reshape(-1, 4)
            entries[:, 0] *= np.array(base_color, dtype=np.float32)
            entries[:, 1, :2] = layer, cutoff
            self._indices[key] = self._append(entries)[entry]
        return self._indices[key]

    def lit(self, indices: NDArray[np.uint32], lights: NDArray[np.float32]) -> NDArray[np.uint32]:
        """Indices (n,) of entries like others (n,), with lights (n, 3), linear RGB, baked in."""
        if not len(indices):
            return indices
        rows = np.column_stack((indices, lights.view(np.uint32)))
        # neighbors have mostly the same
        starts = np.append(True, (rows[1:] != rows[:-1]).any(axis=1))
        first, entry = _distinct(rows[starts])
        at = np.flatnonzero(starts)[first]
        entries = np.empty((len(at), 3, 4), dtype=np.float32)
        entries[:, 0], entries[:, 1] = self._texels[indices[at]], self._texels[indices[at] + 1]
        entries[:, 2] = entries[:, 0]
        entries[:, 2, :3] *= lights[at]
        return self._append(entries)[entry[np.cumsum(starts) - 1]]

    def texture(self, context: moderngl.Context) -> moderngl.Texture:
        """Texture of the entries, row by row.

        Raises:
            GraphicsError: too many for the GPU.
        """
        rows = max(1, -(-self._used >> _ROW_BITS))
        padded = np.zeros((rows << _ROW_BITS, 4), dtype=np.float32)
        padded[: self._used] = self.texels
        with gpu_allocation(f"a palette of {self._used} texels", "make the scene smaller"):
            return texture_2d(context, (1 << _ROW_BITS, rows), 4, padded)

    def _append(self, entries: NDArray[np.float32]) -> NDArray[np.uint32]:
        """Append entries (n, texels, 4), and return their indices (n,)."""
        count, texels, _ = entries.shape
        first, self._used = self._used, self._used + count * texels
        if self._used > len(self._texels):
            more = np.zeros((self._used, 4), dtype=np.float32)
            self._texels = np.concatenate((self._texels, more))
        self._texels[first : self._used] = entries.reshape(-1, 4)
        return np.arange(first, self._used, texels, dtype=np.uint32)


def _distinct(rows: NDArray[np.uint32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Position of each distinct row of four among rows (n, 4), and the number (n,) of each row."""
    numbers = [
        np.unique(half, return_inverse=True)[1].astype(np.uint64)
        for half in np.ascontiguousarray(rows).view(np.uint64).T
    ]
    pairs = numbers[0] << np.uint64(32) | numbers[1]
    return np.unique(pairs, return_index=True, return_inverse=True)[1:]
