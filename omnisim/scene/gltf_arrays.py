"""The numbers of a glTF file: from buffers by views to the arrays that accessors describe."""

from __future__ import annotations

import base64
import struct
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.gltf_check import COMPONENT_TYPES, COMPONENTS

_BINARY_CHUNK = 0x004E4942
# What integers divide by to be the fractions that they stand for, where they are `normalized`.
_NORMALIZED_SCALE = {"u1": 255.0, "u2": 65535.0, "i1": 127.0, "i2": 32767.0}


class GltfArrays:
    """Looks up what an index means; nothing is read or decoded before somebody asks for it.

    Args:
        header: checked by `check_header`.
        rest: of a GLB, the chunks that follow its header.
        resolver: finds files beside it.
    """

    def __init__(self, header: dict[str, Any], rest: bytes, resolver: AssetResolver):
        self._header, self._rest, self._resolver = header, rest, resolver
        self._buffers: dict[int, bytes] = {}

    def bytes_of(self, uri: str, place: str) -> bytes:
        """What a data URI holds, or the file that a URI names.

        Raises:
            SceneError: naming `place`: it is not there, or cannot be read.
        """
        start = uri.find("base64,")
        try:
            if start >= 0:
                return base64.b64decode(uri[start + len("base64,") :])
            return self._resolver.get(uri)
        except FileNotFoundError:
            raise SceneError(f"{place}: {uri[:200]} is not there") from None
        except (OSError, ValueError) as reason:
            raise SceneError(f"{place}: cannot be read: {str(reason)[:200]}") from None

    def view(self, index: int) -> memoryview:
        """The bytes of a buffer view.

        Raises:
            SceneError: its buffer is missing or too short.
        """
        view = self._header["bufferViews"][index]
        buffer, start = self._buffer(view["buffer"]), view.get("byteOffset", 0)
        if start + view["byteLength"] > len(buffer):
            raise SceneError(
                f"buffers[{view['buffer']}]: cut short: has {len(buffer)} bytes, where "
                f"bufferViews[{index}] ends at {start + view['byteLength']}"
            )
        return memoryview(buffer)[start : start + view["byteLength"]]

    def array(self, index: int) -> NDArray[Any]:
        """The values (n, components) of an accessor in the type in which the file has them.

        Raises:
            SceneError: its buffer is missing or too short.
        """
        accessor = self._header["accessors"][index]
        kind = np.dtype(COMPONENT_TYPES[accessor["componentType"]])
        shape = (accessor["count"], COMPONENTS[accessor["type"]])
        if "bufferView" in accessor:
            bytes_a_value = kind.itemsize * shape[1]
            stride = self._header["bufferViews"][accessor["bufferView"]].get("byteStride")
            values = np.ndarray(
                shape,
                kind,
                self.view(accessor["bufferView"]),
                accessor.get("byteOffset", 0),
                (bytes_a_value if stride is None else stride, kind.itemsize),
            )
        else:
            values = np.zeros(shape, kind)
        return self._with_sparse(values, accessor["sparse"]) if "sparse" in accessor else values

    def floats(self, index: int, values: NDArray[Any]) -> NDArray[Any]:
        """The values of an accessor; its integers as fractions, where it says `normalized`."""
        kind = values.dtype.str[1:]
        if self._header["accessors"][index].get("normalized") and kind in _NORMALIZED_SCALE:
            return np.maximum(values / _NORMALIZED_SCALE[kind], -1.0)
        return values

    def _with_sparse(self, values: NDArray[Any], sparse: dict[str, Any]) -> NDArray[Any]:
        where, what, count = sparse["indices"], sparse["values"], sparse["count"]
        kind = COMPONENT_TYPES[where["componentType"]]
        start = where.get("byteOffset", 0)
        places = np.frombuffer(self.view(where["bufferView"]), kind, count, start)
        given = np.frombuffer(
            self.view(what["bufferView"]),
            values.dtype,
            count * values.shape[1],
            what.get("byteOffset", 0),
        )
        completed = values.copy()
        completed[places] = given.reshape(count, -1)
        return completed

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self._header["buffers"][index].get("uri")
            place = f"buffers[{index}]"
            self._buffers[index] = self._chunk if uri is None else self.bytes_of(uri, place)
        return self._buffers[index]

    @cached_property
    def _chunk(self) -> bytes:
        """The binary chunk of a GLB; empty where there is none. Others are passed over."""
        start = 0
        while start + 8 <= len(self._rest):
            length, kind = struct.unpack_from("<2I", self._rest, start)
            if kind == _BINARY_CHUNK:
                return self._rest[start + 8 : start + 8 + length]
            start += 8 + length
        return b""
