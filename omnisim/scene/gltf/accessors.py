"""Buffers, buffer views and accessors: typed arrays out of bytes."""

from __future__ import annotations

import base64
import math
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.gltf import schema

_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_SHAPES: dict[str, tuple[int, ...]] = {
    "SCALAR": (1,), "VEC2": (2,), "VEC3": (3,), "VEC4": (4,),
    "MAT2": (2, 2), "MAT3": (3, 3), "MAT4": (4, 4),
}  # fmt: skip
# Elements of an accessor without a buffer view: a short file must not ask for all memory.
MAX_UNBACKED_ELEMENTS = 1 << 22


def read_uri(uri: str, resolver: AssetResolver) -> bytes:
    """Bytes of a data URI or of a file beside the scene.

    Raises:
        OSError, ValueError: there is no such file, or the data URI is damaged.
    """
    if not uri.startswith("data:"):
        return resolver.read(uri)
    header, _, payload = uri.partition(",")
    return base64.b64decode(payload) if ";base64" in header else unquote_to_bytes(payload)


def to_floats(values: NDArray[Any], normalized: bool) -> NDArray[np.float64]:
    """Values as floats; normalized integers as the fractions that they stand for.

    Source: glTF 2.0, section 3.6.2.2.
    """
    with np.errstate(invalid="ignore"):  # signalling NaNs
        floats = values.astype(np.float64)
    if normalized and values.dtype.kind in "iu":
        return np.maximum(floats / np.iinfo(values.dtype).max, -1.0)
    return floats


class Accessors:
    """Arrays of a document, read when asked for."""

    def __init__(self, document: schema.Document, chunk: memoryview, resolver: AssetResolver):
        """Read all buffers; `chunk` is the one in the GLB file.

        Raises:
            SceneError: a buffer cannot be read.
        """
        self._document = document
        self._buffers: list[memoryview] = []
        for index, buffer in enumerate(document.buffers):
            try:
                data = chunk if buffer.uri is None else memoryview(read_uri(buffer.uri, resolver))
            except (OSError, ValueError) as reason:
                raise SceneError(f"buffers[{index}]: cannot be read: {str(reason)[:80]}") from None
            self._buffers.append(data[: buffer.byte_length])

    def view(self, index: int, place: str) -> memoryview:
        """Bytes of a buffer view.

        Raises:
            SceneError: it does not lie within its buffer.
        """
        view = schema.lookup(self._document.buffer_views, index, place)
        place = f"bufferViews[{index}]"
        buffer = schema.lookup(self._buffers, view.buffer, f"{place}.buffer")
        end = view.byte_offset + view.byte_length
        if end > len(buffer):
            raise SceneError(f"{place}: expected {end} bytes in its buffer, got {len(buffer)}")
        return buffer[view.byte_offset : end]

    def floats(self, index: int, place: str) -> NDArray[np.float64]:
        """Values of an accessor (count, *shape); normalized integers as fractions.

        Raises:
            SceneError: damaged.
        """
        values = self._values(index, place)
        return to_floats(values, self._document.accessors[index].normalized)

    def integers(self, index: int, place: str) -> NDArray[np.int64]:
        """Values of an accessor of integers (count, *shape).

        Raises:
            SceneError: damaged, or of floats.
        """
        values = self._values(index, place)
        if values.dtype.kind == "f":
            raise SceneError(f"{place}: expected integers, got floats")
        return values.astype(np.int64)

    def is_normalized(self, index: int, place: str) -> bool:
        """`normalized` of an accessor."""
        return schema.lookup(self._document.accessors, index, place).normalized

    def _values(self, index: int, place: str) -> NDArray[Any]:
        accessor = schema.lookup(self._document.accessors, index, place)
        place, count = f"accessors[{index}]", accessor.count
        dtype, shape = np.dtype(_DTYPES[accessor.component_type]), _SHAPES[accessor.type]
        if accessor.buffer_view is not None:
            values = self._elements(
                accessor.buffer_view, accessor.byte_offset, count, dtype, shape, place
            )
        elif count <= MAX_UNBACKED_ELEMENTS:
            values = np.zeros((count, *shape), dtype)
        else:
            raise SceneError(f"{place}.count: expected a bufferView for {count} elements")
        if accessor.sparse is None:
            return values
        sparse, place = accessor.sparse, f"{place}.sparse"
        where, new = sparse.indices, sparse.values
        indices = self._elements(
            where.buffer_view, where.byte_offset, sparse.count,
            np.dtype(_DTYPES[where.component_type]), (), place,
        )  # fmt: skip
        if sparse.count and indices.max() >= count:
            raise SceneError(f"{place}: expected indices below {count}, got {indices.max()}")
        values = values.copy()
        values[indices] = self._elements(
            new.buffer_view, new.byte_offset, sparse.count, dtype, shape, place
        )
        return values

    def _elements(
        self,
        view: int,
        offset: int,
        count: int,
        dtype: np.dtype[Any],
        shape: tuple[int, ...],
        place: str,
    ) -> NDArray[Any]:
        """Elements (count, *shape) in a buffer view, without a copy."""
        data = self.view(view, f"{place}.bufferView")
        size = dtype.itemsize * math.prod(shape)
        stride = self._document.buffer_views[view].byte_stride or size
        end = offset + (count - 1) * stride + size
        if count == 0:
            return np.zeros((0, *shape), dtype)
        if end > len(data):
            raise SceneError(f"{place}: expected {end} bytes in its bufferView, got {len(data)}")
        inner = np.empty(shape, dtype).strides
        return np.ndarray((count, *shape), dtype, data, offset, (stride, *inner))
