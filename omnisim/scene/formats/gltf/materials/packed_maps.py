"""Maps that a file may split over several images, packed into one texture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Texture

# Texture and its used channels; None: all channels are 1.
Part = tuple[Texture | None, tuple[int, ...]]


class PackedMaps:
    """Textures packed from several maps, each packed once for all materials."""

    def __init__(self) -> None:
        self._found: dict[tuple[object, ...], tuple[Texture, list[Part]]] = {}

    def pack(self, parts: Sequence[Part]) -> Texture | None:
        """Texture with the channels of all parts; None: no part has a texture.

        Raises:
            ValueError: maps with different placements.
        """
        given = [texture for texture, _ in parts if texture is not None]
        if not given:
            return None
        places = {(one.uv_set, one.uv_transform, one.wrap_u, one.wrap_v) for one in given}
        if len(places) > 1:
            raise ValueError
        if len(given) == len(parts) and len({id(one.pixels) for one in given}) == 1:
            return given[0]
        key = (*(None if one is None else id(one.pixels) for one, _ in parts), places.pop())
        if key not in self._found:  # storing the parts keeps their ids from being reused
            self._found[key] = replace(given[0], pixels=_packed(parts, given)), list(parts)
        return self._found[key][0]


def _packed(parts: Sequence[Part], given: Sequence[Texture]) -> NDArray[np.uint8]:
    from PIL import Image  # slow to import

    height, width = np.max([one.pixels.shape[:2] for one in given], axis=0).tolist()
    pixels = np.full((height, width, 4), 255, dtype=np.uint8)
    for texture, channels in parts:
        for channel in channels if texture is not None else ():
            assert texture is not None
            plane = Image.fromarray(np.ascontiguousarray(texture.pixels[..., channel]))
            pixels[..., channel] = plane.resize((width, height), Image.Resampling.BILINEAR)
    return pixels
