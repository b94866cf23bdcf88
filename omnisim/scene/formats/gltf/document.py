"""Content of a glTF file: its container, type-checked properties of its JSON, and its arrays."""

from __future__ import annotations

import base64
import json
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar
from urllib.parse import unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats, Ints
from omnisim.core.errors import SceneError, printable
from omnisim.core.extras import install_hint, is_installed
from omnisim.scene.formats.resources import AssetResolver

_JSON, _BIN = 0x4E4F534A, 0x004E4942


def read_container(data: bytes) -> tuple[JsonObject, memoryview]:
    """Top-level JSON object, and the binary chunk of a GLB file (otherwise empty).

    Source: glTF 2.0, section 4.4.
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


# JSON of a glTF file: type-checked properties, and errors that name their location.

Value = TypeVar("Value")
MAX_NUMBER = 1e15  # products of larger numbers overflow float32


class JsonObject:
    """Object in a glTF file, with properties that are checked on reading.

    Every method raises a SceneError for a property of the wrong type, or for a missing property
    without a default. Null counts as missing.

    Attributes:
        place: path in the JSON, such as `nodes[3]`.
    """

    def __init__(self, value: object, place: str):
        if not isinstance(value, dict):
            raise _error(place, "an object", value)
        self.place = place
        self._values: dict[str, object] = value

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def has(self, key: str) -> bool:
        """True if the property exists."""
        return self._values.get(key) is not None

    def error(self, key: str, expected: str) -> SceneError:
        """Error that names a property, the expected and the actual value."""
        return _error(self._path(key), expected, self._values.get(key))

    def integer(self, key: str, default: int | None = None) -> int:
        """Integer ≥ 0 of a property."""
        value = self._values[key] if self.has(key) else default
        if type(value) is not int or value < 0:
            raise self.error(key, "an integer ≥ 0")
        return value

    def index(self, key: str, entries: Sequence[object]) -> int:
        """Valid index into `entries`."""
        return _index(self._values.get(key), entries, self._path(key))

    def indices(self, key: str, entries: Sequence[object]) -> list[int]:
        """Valid indices into `entries`; empty if missing."""
        path = self._path(key)
        return [_index(v, entries, f"{path}[{i}]") for i, v in enumerate(self.array(key))]

    def number(self, key: str, default: float) -> float:
        """Finite number of a property."""
        value = self._values[key] if self.has(key) else default
        return _number(value, self._path(key))

    def numbers(self, key: str, count: int) -> tuple[float, ...] | None:
        """Tuple of `count` finite numbers; None: missing."""
        if not self.has(key):
            return None
        values = self.array(key)
        if len(values) != count:
            raise self.error(key, f"{count} numbers")
        return tuple(_number(value, f"{self._path(key)}[{i}]") for i, value in enumerate(values))

    def choice(self, key: str, choices: Mapping[int | str, Value]) -> Value:
        """Entry of `choices` selected by the property."""
        value = self._values.get(key)
        if not isinstance(value, int | str) or value not in choices:
            raise self.error(key, f"one of {', '.join(map(str, choices))}")
        return choices[value]

    def text(self, key: str, default: str) -> str:
        """Text of a property; numbers are converted to text."""
        return str(self._values[key]) if self.has(key) else default

    def flag(self, key: str) -> bool:
        """True if the property exists and is true."""
        return bool(self._values.get(key))

    def array(self, key: str) -> list[object]:
        """Array with elements of any type; empty if missing."""
        value = self._values.get(key) or []
        if not isinstance(value, list):
            raise self.error(key, "an array")
        return value

    def object(self, key: str) -> JsonObject:
        """Object of a property; empty if missing."""
        return JsonObject(self._values[key] if self.has(key) else {}, self._path(key))

    def objects(self, key: str) -> list[JsonObject]:
        """Array of objects; empty if missing."""
        path = self._path(key)
        return [JsonObject(value, f"{path}[{i}]") for i, value in enumerate(self.array(key))]

    def extension(self, name: str) -> JsonObject | None:
        """Object of an extension; None: missing."""
        extensions = self.object("extensions")
        return extensions.object(name) if extensions.has(name) else None

    def extension_or_empty(self, name: str) -> JsonObject:
        """Object of an extension; empty if missing."""
        return self.object("extensions").object(name)

    def _path(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key


def _index(value: object, entries: Sequence[object], place: str) -> int:
    if type(value) is not int or not 0 <= value < len(entries):
        raise _error(place, f"an index below {len(entries)}", value)
    return value


def _number(value: object, place: str) -> float:
    if not isinstance(value, int | float) or not abs(value) < MAX_NUMBER:  # rejects NaN as well
        raise _error(place, "a finite number", value)
    return float(value)


def _error(place: str, expected: str, value: object) -> SceneError:
    got = "nothing" if value is None else repr(value)[:80]
    return SceneError(f"{place}: expected {expected}, got {got}")


# Buffers, buffer views and accessors, decoded to arrays.

_INDEX_TYPES: dict[int | str, str] = {5121: "<u1", 5123: "<u2", 5125: "<u4"}
_COMPONENT_TYPES = {5120: "<i1", 5122: "<i2", 5126: "<f4"} | _INDEX_TYPES
_SHAPES: dict[int | str, tuple[int, ...]] = {
    "SCALAR": (1,), "VEC2": (2,), "VEC3": (3,), "VEC4": (4,),
    "MAT2": (2, 2), "MAT3": (3, 3), "MAT4": (4, 4),
}  # fmt: skip
# Element limit of an accessor without a bufferView: a short file must not exhaust the memory.
MAX_UNBACKED_ELEMENTS = 1 << 22


def read_uri(uri: str, assets: AssetResolver) -> bytes:
    """Bytes of a data URI, or of a file referenced by the scene.

    Raises:
        OSError, ValueError: a missing file or a damaged data URI.
    """
    if not uri.startswith("data:"):
        return assets[uri]
    media_type, _, payload = uri.partition(",")
    return base64.b64decode(payload) if ";base64" in media_type else unquote_to_bytes(payload)


class Accessors:
    """Arrays of a file, read on demand. All methods raise SceneErrors."""

    def __init__(self, root: JsonObject, chunk: memoryview, assets: AssetResolver):
        """Read all buffers; the first buffer, if it has no URI, is the GLB file's `chunk`."""
        self._accessors, self._views = root.objects("accessors"), root.objects("bufferViews")
        self._decoded: dict[int, NDArray[Any]] = {}
        self._decompressed: dict[int, memoryview] = {}
        self._buffers: list[memoryview] = []
        for index, buffer in enumerate(root.objects("buffers")):
            # the chunk is the first buffer; other buffers without a URI are empty
            data, uri = chunk if index == 0 else memoryview(b""), buffer.text("uri", "")
            if uri:
                try:
                    data = memoryview(read_uri(uri, assets))
                except OSError as reason:
                    raise SceneError(f"{buffer.place}.uri: {printable(uri, 80)} {reason}") from None
                except ValueError as reason:
                    raise SceneError(f"{buffer.place}: cannot be read: {reason!s:.80}") from None
            self._buffers.append(data[: buffer.integer("byteLength")])

    def view(self, owner: JsonObject) -> memoryview:
        """Bytes of the bufferView that an object references."""
        index = owner.index("bufferView", self._views)
        view = self._views[index]
        compressions = (each for name in EXTENSIONS if (each := view.extension(name)))
        compressed = next(compressions, None)
        end = view.integer("byteOffset", 0) + view.integer("byteLength")
        is_plain = end <= len(self._buffers[view.index("buffer", self._buffers)])
        if compressed is None or (is_plain and not can_decode_meshopt()):
            return self._slice(view)
        if index not in self._decompressed:
            self._decompressed[index] = decode_meshopt(compressed, self._slice(compressed))
        return self._decompressed[index]

    def _slice(self, view: JsonObject) -> memoryview:
        buffer = self._buffers[view.index("buffer", self._buffers)]
        start = view.integer("byteOffset", 0)
        end = start + view.integer("byteLength")
        if end > len(buffer):
            raise SceneError(f"{view.place}: expected {end} bytes in its buffer, got {len(buffer)}")
        return buffer[start:end]

    def replace(self, owner: JsonObject, key: str, values: NDArray[Any]) -> None:
        """Store decompressed values for the accessor that a property references."""
        self._decoded[owner.index(key, self._accessors)] = values

    def floats(self, owner: JsonObject, key: str) -> Floats:
        """Values (count, …) of the accessor that a property references.

        Source: glTF 2.0, section 3.6.2.2: normalized integers represent fractions.
        """
        values = self._values(owner, key)
        with np.errstate(invalid="ignore"):  # signaling NaNs
            floats = values.astype(np.float64)
        accessor = self._accessors[owner.index(key, self._accessors)]
        if accessor.flag("normalized") and values.dtype.kind in "iu":
            # use the accessor's component type, since Draco's decoder widens 16 bits to 32
            stored = np.dtype(accessor.choice("componentType", _COMPONENT_TYPES))
            if stored.kind in "iu":
                return np.maximum(floats / np.iinfo(stored).max, -1.0)
        return floats

    def integers(self, owner: JsonObject, key: str) -> Ints:
        """Values (count, …) of the integer accessor that a property references."""
        values = self._values(owner, key)
        if values.dtype.kind == "f":
            raise owner.error(key, "an accessor of integers")
        return values.astype(np.int64)

    def _values(self, owner: JsonObject, key: str) -> NDArray[Any]:
        index = owner.index(key, self._accessors)
        if index in self._decoded:
            return self._decoded[index]
        accessor = self._accessors[index]
        count, shape = accessor.integer("count"), accessor.choice("type", _SHAPES)
        dtype = accessor.choice("componentType", _COMPONENT_TYPES)
        if accessor.has("bufferView"):
            values = self._elements(accessor, count, dtype, shape)
        elif count <= MAX_UNBACKED_ELEMENTS:
            values = np.zeros((count, *shape), dtype)
        else:
            raise accessor.error("bufferView", f"one for {count} elements")
        if not accessor.has("sparse"):
            return values
        sparse = accessor.object("sparse")
        where, replaced = sparse.object("indices"), sparse.integer("count")
        index_type = where.choice("componentType", _INDEX_TYPES)
        indices = self._elements(where, replaced, index_type, ())
        if replaced and indices.max() >= count:
            raise SceneError(f"{where.place}: expected indices below {count}, got {indices.max()}")
        values = values.copy()
        values[indices] = self._elements(sparse.object("values"), replaced, dtype, shape)
        return values

    def _elements(
        self, owner: JsonObject, count: int, component: str, shape: tuple[int, ...]
    ) -> NDArray[Any]:
        """Elements (count, *shape) of an object's bufferView, without a copy."""
        data, offset, dtype = self.view(owner), owner.integer("byteOffset", 0), np.dtype(component)
        size = dtype.itemsize * math.prod(shape)
        view = self._views[owner.index("bufferView", self._views)]
        stride = view.integer("byteStride", size)
        if count == 0:
            return np.zeros((0, *shape), dtype)
        end = offset + (count - 1) * stride + size
        if end > len(data) or stride == 0:
            raise SceneError(f"{owner.place}: expected {end} bytes in a view of {len(data)}")
        strides = (stride, *np.empty(shape, dtype).strides)
        return np.ndarray((count, *shape), dtype, data, offset, strides)


# Decompression of buffer views with meshoptimizer.
#
# Source: EXT_meshopt_compression, succeeded by KHR_meshopt_compression.

EXTENSIONS = ("KHR_meshopt_compression", "EXT_meshopt_compression")
MODES: dict[int | str, str] = {mode: mode for mode in ("ATTRIBUTES", "TRIANGLES", "INDICES")}
# Valid strides in bytes per attribute filter; without a filter: multiples of 4.
STRIDES = {
    "NONE": range(4, 257, 4), "OCTAHEDRAL": (4, 8), "QUATERNION": (8,),
    "EXPONENTIAL": range(4, 257, 4),
}  # fmt: skip
_INDEX_STRIDES = (2, 4)
MAX_RATIO = 4096  # compression ratio: a short file must not exhaust the memory


def can_decode_meshopt() -> bool:
    """True if the decoder is installed."""
    return is_installed("meshoptimizer")


def decode_meshopt(entry: JsonObject, data: memoryview) -> memoryview:
    """Decoded bytes of a buffer view with a compression entry."""
    if not can_decode_meshopt():
        raise SceneError(f"is compressed with meshopt, which needs {install_hint('meshopt')}")
    mode, count = entry.choice("mode", MODES), entry.integer("count")
    stride, filtered = entry.integer("byteStride"), entry.text("filter", "NONE")
    if filtered not in STRIDES or (mode != "ATTRIBUTES" and filtered != "NONE"):
        raise entry.error("filter", f"one of {', '.join(STRIDES)}, for attributes")
    strides = STRIDES[filtered] if mode == "ATTRIBUTES" else _INDEX_STRIDES
    if stride not in strides:
        allowed = " or ".join(map(str, strides))
        raise entry.error(
            "byteStride", allowed if len(strides) < 3 else "a multiple of 4 up to 256"
        )
    if count * stride > MAX_RATIO * len(data) or (mode == "TRIANGLES" and count % 3):
        raise entry.error("count", f"a count that {len(data)} compressed bytes can hold")
    if not count:
        return memoryview(b"")
    try:
        import meshoptimizer

        values: NDArray[np.unsignedinteger]
        if mode == "ATTRIBUTES":
            values = meshoptimizer.decode_vertex_buffer(count, stride, bytes(data)).view(np.uint8)
            filters = {
                "OCTAHEDRAL": meshoptimizer.decode_filter_oct,
                "QUATERNION": meshoptimizer.decode_filter_quat,
                "EXPONENTIAL": meshoptimizer.decode_filter_exp,
            }
            if filtered in filters:
                values = filters[filtered](values, count, stride)
        else:
            triangles = meshoptimizer.decode_index_buffer
            decode = triangles if mode == "TRIANGLES" else meshoptimizer.decode_index_sequence
            # decoded to 32 bits for any stride: the package's array is 32-bit
            values = decode(count, 4, bytes(data)).astype("<u2" if stride == 2 else "<u4")
    except (RuntimeError, ValueError) as reason:
        raise SceneError(f"{entry.place}: cannot be decoded: {reason!s:.80}") from None
    return memoryview(values.tobytes())
