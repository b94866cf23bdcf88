"""Palette of vertices: colors with texture layer and alpha cutoff, each combination once.

A vertex has an index of 4 bytes instead of 24 bytes of floats, and the same values to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.memory import gpu_allocation

# As in shaders/scene/vertex_material.glsl: texture unit, texels per entry, log2 of texels per row.
PALETTE_UNIT = 19
_TEXELS, _ROW_BITS = 2, 12
_ONE_COLOR = np.ones((1, 4), dtype=np.float16)


class VertexPalette:
    """Collects the entries of vertices, for one texture."""

    def __init__(self) -> None:
        self._entries: list[NDArray[np.float32]] = []
        self._count = 0
        self._indices: dict[tuple[object, ...], NDArray[np.uint32]] = {}

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
            found, indices = np.unique(halves.view(np.uint64).ravel(), return_inverse=True)
            entries = np.zeros((len(found), _TEXELS, 4), dtype=np.float32)
            entries[:, 0] = found.view(np.float16).reshape(-1, 4)
            entries[:, 0] *= np.array(base_color, dtype=np.float32)
            entries[:, 1, :2] = layer, cutoff
            self._indices[key] = (indices + self._count).astype(np.uint32)
            self._entries.append(entries)
            self._count += len(entries)
        return self._indices[key]

    def values(self) -> NDArray[np.float32]:
        """Entries (n, 2, 4): color times base color; layer and cutoff."""
        return np.concatenate([np.zeros((0, _TEXELS, 4), dtype=np.float32), *self._entries])

    def texture(self, context: moderngl.Context) -> moderngl.Texture:
        """Texture of the entries, row by row.

        Raises:
            GraphicsError: too many for the GPU.
        """
        texels = self.values().reshape(-1, 4)
        rows = max(1, -(-len(texels) >> _ROW_BITS))
        padded = np.zeros((rows << _ROW_BITS, 4), dtype=np.float32)
        padded[: len(texels)] = texels
        with gpu_allocation(f"{self._count} colors of vertices", "make the scene smaller"):
            texture = context.texture((1 << _ROW_BITS, rows), 4, padded, dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture
