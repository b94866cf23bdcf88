"""Decompression of buffer views with meshoptimizer.

Source: EXT_meshopt_compression, succeeded by KHR_meshopt_compression.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.extras import install_hint, is_installed
from omnisim.scene.formats.gltf.json_object import JsonObject

EXTENSIONS = ("KHR_meshopt_compression", "EXT_meshopt_compression")
MODES: dict[int | str, str] = {mode: mode for mode in ("ATTRIBUTES", "TRIANGLES", "INDICES")}
# Valid strides in bytes per attribute filter; without a filter: multiples of 4.
STRIDES = {
    "NONE": range(4, 257, 4),
    "OCTAHEDRAL": (4, 8),
    "QUATERNION": (8,),
    "EXPONENTIAL": range(4, 257, 4),
}
_INDEX_STRIDES = (2, 4)
MAX_RATIO = 4096  # compression ratio: a short file must not exhaust the memory


def compression(view: JsonObject) -> JsonObject | None:
    """Compression of a buffer view; None: uncompressed."""
    return next((each for name in EXTENSIONS if (each := view.extension(name))), None)


def is_readable() -> bool:
    """True if the decoder is installed."""
    return is_installed("meshoptimizer")


def decode(entry: JsonObject, data: memoryview) -> memoryview:
    """Decoded bytes of a buffer view.

    Args:
        entry: compression entry of the view.
        data: compressed bytes.

    Raises:
        SceneError: the decoder is not installed, or the data is damaged.
    """
    if not is_readable():
        raise SceneError(f"is compressed with meshopt, which needs {install_hint('meshopt')}")
    mode, count = entry.choice("mode", MODES), entry.integer("count")
    stride, filtered = entry.integer("byteStride"), entry.text("filter", "NONE")
    if filtered not in STRIDES or (mode != "ATTRIBUTES" and filtered != "NONE"):
        raise entry.error("filter", f"one of {', '.join(STRIDES)}, of attributes")
    strides = STRIDES[filtered] if mode == "ATTRIBUTES" else _INDEX_STRIDES
    if stride not in strides:
        allowed = " or ".join(map(str, strides))
        raise entry.error(
            "byteStride", allowed if len(strides) < 3 else "a multiple of 4 up to 256"
        )
    if count * stride > MAX_RATIO * len(data) or (mode == "TRIANGLES" and count % 3):
        raise entry.error("count", f"that of {len(data)} compressed bytes")
    if not count:
        return memoryview(b"")
    try:
        if mode == "ATTRIBUTES":
            values = _attributes(bytes(data), count, stride, filtered)
        else:
            values = _indices(bytes(data), count, stride, mode)
    except (RuntimeError, ValueError) as reason:
        raise SceneError(f"{entry.place}: cannot be decoded: {reason!s:.80}") from None
    return memoryview(values.tobytes())


def _attributes(data: bytes, count: int, stride: int, filtered: str) -> NDArray[np.uint8]:
    import meshoptimizer

    values = meshoptimizer.decode_vertex_buffer(count, stride, data).view(np.uint8)
    filters: dict[str, Callable[[NDArray[np.uint8], int, int], NDArray[np.uint8]]] = {
        "OCTAHEDRAL": meshoptimizer.decode_filter_oct,
        "QUATERNION": meshoptimizer.decode_filter_quat,
        "EXPONENTIAL": meshoptimizer.decode_filter_exp,
    }
    return filters[filtered](values, count, stride) if filtered in filters else values


def _indices(data: bytes, count: int, stride: int, mode: str) -> NDArray[np.unsignedinteger]:
    import meshoptimizer

    triangles = mode == "TRIANGLES"
    read = meshoptimizer.decode_index_buffer if triangles else meshoptimizer.decode_index_sequence
    # decoded to 32 bits for any stride: the package's array is 32-bit
    return read(count, 4, data).astype("<u2" if stride == 2 else "<u4")
