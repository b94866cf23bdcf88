"""The JSON of a glTF file: its container, and type-checked properties."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

from omnisim.core.errors import SceneError

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
