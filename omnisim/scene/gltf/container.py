"""GLB container: JSON and binary chunk."""

from __future__ import annotations

import struct

from omnisim.errors import SceneError

_JSON, _BIN = 0x4E4F534A, 0x004E4942


def split_chunks(data: bytes) -> tuple[bytes, memoryview]:
    """JSON text and binary chunk of a GLB file; of a glTF file, which is all JSON, (data, empty).

    Raises:
        SceneError: a GLB file of another version, or one cut short.

    Source: glTF 2.0, section 4.4.
    """
    if not data.startswith(b"glTF"):
        return data, memoryview(b"")
    if len(data) < 20:
        raise SceneError(f"not glTF 2.0: expected a header of 20 bytes, got {len(data)}")
    _, version, length, json_length, kind = struct.unpack_from("<5I", data)
    if version != 2 or kind != _JSON:
        raise SceneError(f"not glTF 2.0: expected GLB version 2 with JSON first, got {version}")
    if length > len(data):
        raise SceneError(f"not glTF 2.0: expected {length} bytes, got {len(data)}: cut short")
    start = 20 + json_length
    text = data[20:start]
    while start + 8 <= length:
        size, kind = struct.unpack_from("<2I", data, start)
        if kind == _BIN:
            return text, memoryview(data)[start + 8 : start + 8 + size]
        start += 8 + size  # a chunk of another kind
    return text, memoryview(b"")
