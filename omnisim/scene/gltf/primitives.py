"""Primitives: vertex attributes and triangles, Draco-compressed or not."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.gltf import schema
from omnisim.scene.gltf.accessors import Accessors, to_floats
from omnisim.scene.gltf.schema import Mode

NOT_DRAWN = {Mode.POINTS, Mode.LINES, Mode.LINE_LOOP, Mode.LINE_STRIP}


class Primitive:
    """Arrays of a primitive of triangles."""

    def __init__(self, entry: schema.Primitive, accessors: Accessors, place: str):
        """Decompress it where needed; `place` is the primitive's in the JSON.

        Raises:
            SceneError: it cannot be decompressed.
        """
        self.material = entry.material
        self._entry, self._accessors, self._place = entry, accessors, place
        self._decoded: dict[str, NDArray[Any]] = {}
        self._faces: NDArray[Any] | None = None
        if entry.draco is not None:
            data = accessors.view(entry.draco.buffer_view, f"{place}.extensions.bufferView")
            self._decoded, self._faces = _decode_draco(entry.draco, data, place)

    def has(self, attribute: str) -> bool:
        """True where the primitive has an attribute."""
        return attribute in self._entry.attributes

    def floats(self, attribute: str) -> NDArray[np.float64] | None:
        """Attribute (n, components), if any.

        Raises:
            SceneError: its accessor is damaged.
        """
        if not self.has(attribute):
            return None
        index, place = self._entry.attributes[attribute], f"{self._place}.attributes.{attribute}"
        if attribute in self._decoded:
            normalized = self._accessors.is_normalized(index, place)
            values = to_floats(self._decoded[attribute], normalized)
        else:
            values = self._accessors.floats(index, place)
        if values.ndim != 2:
            raise SceneError(f"{place}: expected vectors, got matrices")
        return values

    def required(self, attribute: str, components: int) -> NDArray[np.float64]:
        """Attribute (n, components).

        Raises:
            SceneError: missing, damaged or of another shape.
        """
        values = self.floats(attribute)
        if values is None or values.shape[1:] != (components,):
            got = "none" if values is None else f"elements of shape {values.shape[1:]}"
            raise SceneError(
                f"{self._place}.attributes.{attribute}: expected VEC{components}, got {got}"
            )
        return values

    def triangles(self, vertex_count: int) -> NDArray[np.int64]:
        """Vertices (m, 3) of the triangles.

        Raises:
            SceneError: damaged indices.

        Source: glTF 2.0, section 3.7.2.1.
        """
        place = f"{self._place}.indices"
        if self._entry.indices is None:
            order = np.arange(vertex_count)
        elif self._faces is not None:
            order = self._faces.astype(np.int64).ravel()
        else:
            order = self._accessors.integers(self._entry.indices, place).ravel()
        if self._entry.mode is Mode.TRIANGLES:
            if len(order) % 3:
                raise SceneError(f"{place}: expected three for each triangle, got {len(order)}")
            return order.reshape(-1, 3)
        if self._entry.mode is Mode.TRIANGLE_FAN:
            hub = np.repeat(order[:1], max(len(order) - 2, 0))
            return np.stack((hub, order[1:-1], order[2:]), axis=1)
        strip = np.stack((order[:-2], order[1:-1], order[2:]), axis=1)
        strip[1::2] = strip[1::2, ::-1]  # every other triangle is wound the other way round
        return strip


def _decode_draco(
    draco: schema.Draco, data: memoryview, place: str
) -> tuple[dict[str, NDArray[Any]], NDArray[Any] | None]:
    """Attributes by name, and faces (m, 3), if any."""
    try:
        import DracoPy
    except ImportError:
        raise SceneError(
            "is compressed with Draco: pip install DracoPy, or export without it"
        ) from None
    try:
        mesh = DracoPy.decode(bytes(data))
    except Exception as reason:  # of a library of its own kinds
        raise SceneError(f"{place}: Draco data cannot be decoded: {reason}") from None
    arrays = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
    named = {name: arrays[key] for name, key in draco.attributes.items() if key in arrays}
    faces: NDArray[Any] | None = getattr(mesh, "faces", None)  # a point cloud has none
    return named, faces
