"""The pictures of a glTF file, and which one a texture shows."""

from __future__ import annotations

import io
from typing import Any

from PIL import Image

from omnisim.errors import SceneError
from omnisim.scene.gltf_arrays import GltfArrays


def open_pictures(header: dict[str, Any], arrays: GltfArrays) -> list[Image.Image | None]:
    """All pictures, opened and not yet decoded; None where one is missing or no picture."""
    return [
        _opened(data, f"images[{index}]", arrays)
        for index, data in enumerate(header.get("images", []))
    ]


def _opened(data: dict[str, Any], place: str, arrays: GltfArrays) -> Image.Image | None:
    try:
        if "bufferView" in data:
            return Image.open(io.BytesIO(arrays.view(data["bufferView"])))
        if "uri" in data:
            return Image.open(io.BytesIO(arrays.bytes_of(data["uri"], place)))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, SceneError):
        return None  # whoever draws it says so
    return None


def picture_of(texture: dict[str, Any]) -> int | None:
    """Index of the picture of a texture, or None: it has none.

    Source: EXT_texture_webp goes before the texture's own, which is for those who cannot read it.
    """
    webp = texture.get("extensions", {}).get("EXT_texture_webp", {}).get("source")
    return texture.get("source") if webp is None else webp
