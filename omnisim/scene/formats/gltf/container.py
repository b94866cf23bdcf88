"""File containers: plain JSON, or a GLB file with JSON and binary data."""

from __future__ import annotations

import json
import struct

from omnisim.core.errors import SceneError
from omnisim.scene.formats.gltf.json_object import JsonObject

_JSON, _BIN = 0x4E4F534A, 0x004E4942


def read_container(data: bytes) -> tuple[JsonObject, memoryview]:
    """Top-level JSON object, and the binary chunk of a GLB file (otherwise empty).

    Source: glTF 2.0, section 4.4.

    Raises:
        SceneError: the data is damaged, or is not glTF 2.0.
    """
    chunk = memoryview(b"")
    try:
        if data.startswith(b"glTF"):
            data, chunk = _split(data)
        root = JsonObject(json.loads(data.decode("utf-8-sig")), "")
    except (ValueError, RecursionError, struct.error) as reason:  # ValueErrors of JSON and UTF-8
        raise SceneError(f"not glTF: {reason}") from None
    version = root.object("asset").text("version", "none")
    if not version.startswith("2."):
        raise SceneError(f"not glTF 2.0: asset.version: expected '2.0', got {version!r:.80}")
    return root, chunk


def _split(data: bytes) -> tuple[bytes, memoryview]:
    _, version, length, text_length, kind = struct.unpack_from("<5I", data)
    if version != 2 or kind != _JSON:
        raise ValueError(f"expected GLB version 2 with JSON first, got version {version}")
    if length > len(data):
        raise ValueError(f"expected {length} bytes, got {len(data)}: cut short")
    start = 20 + text_length
    text = data[20:start]
    while start + 8 <= length:
        size, kind = struct.unpack_from("<2I", data, start)
        if kind == _BIN:
            return text, memoryview(data)[start + 8 : start + 8 + size]
        start += 8 + size  # skips a chunk of another type
    return text, memoryview(b"")
