"""Primitives: vertex attributes and triangles, Draco-compressed or not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.core.extras import install_hint
from omnisim.scene.formats.gltf.accessors import Accessors
from omnisim.scene.formats.gltf.document import JsonObject

# OpenGL constants for `mode`
TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6
POINTS_AND_LINES = {0, 1, 2, 3}


class Primitive:
    """Triangle primitive with its arrays. All methods raise SceneErrors.

    Attributes:
        entry: JSON of the primitive.
    """

    def __init__(self, entry: JsonObject, accessors: Accessors):
        """Decompress the primitive if necessary."""
        self.entry = entry
        self._accessors, self._attributes = accessors, entry.object("attributes")
        if draco := entry.extension("KHR_draco_mesh_compression"):
            self._decode_draco(draco)

    @property
    def targets(self) -> list[JsonObject]:
        """Morph targets of the primitive."""
        return self.entry.objects("targets")

    def offsets(
        self, name: str, targets: NDArray[np.intp], count: int
    ) -> NDArray[np.float64] | None:
        """Offsets (targets, count, 3) of an attribute in the given targets; None: no offsets."""
        entries = self.targets
        target_objects = [entries[number] for number in targets.tolist()]
        if not any(target.has(name) for target in target_objects):
            return None
        offsets = np.zeros((len(target_objects), count, 3))
        for values, target in zip(offsets, target_objects, strict=True):
            if target.has(name):
                stored = self._accessors.floats(target, name)
                if stored.shape != values.shape:
                    raise target.error(name, f"an accessor of {count} VEC3")
                values[:] = stored
        return offsets

    def has(self, attribute: str) -> bool:
        """True if the primitive has an attribute."""
        return self._attributes.has(attribute)

    def attribute(self, name: str) -> NDArray[np.float64] | None:
        """Vertex attribute (n, components); None: missing."""
        if not self.has(name):
            return None
        values = self._accessors.floats(self._attributes, name)
        if values.ndim != 2:
            raise self._attributes.error(name, "an accessor of vectors")
        return values

    def required(self, name: str, components: int) -> NDArray[np.float64]:
        """Vertex attribute (n, components) that must exist."""
        values = self.attribute(name)
        if values is None or values.shape[1] != components:
            raise self._attributes.error(name, f"an accessor of VEC{components}")
        return values

    def triangles(self, vertex_count: int) -> NDArray[np.int64]:
        """Vertex indices (m, 3) of the triangles.

        Source: glTF 2.0, section 3.7.2.1.
        """
        order = np.arange(vertex_count)
        if self.entry.has("indices"):
            order = self._accessors.integers(self.entry, "indices").ravel()
        mode = self.entry.integer("mode", TRIANGLES)
        if mode == TRIANGLES and len(order) % 3 == 0:
            return order.reshape(-1, 3)
        if mode == TRIANGLE_FAN:
            hub = np.repeat(order[:1], max(len(order) - 2, 0))
            return np.stack((hub, order[1:-1], order[2:]), axis=1)
        if mode == TRIANGLE_STRIP:
            strip = np.stack((order[:-2], order[1:-1], order[2:]), axis=1)
            strip[1::2] = strip[1::2, ::-1]  # every other triangle of a strip is wound in reverse
            return strip
        raise self.entry.error("mode", f"0 to 6, and triangles of 3 of the {len(order)} indices")

    def _decode_draco(self, draco: JsonObject) -> None:
        try:
            import DracoPy
        except ImportError:
            raise SceneError(
                f"is compressed with Draco, which needs {install_hint('draco')}"
            ) from None
        try:
            mesh = DracoPy.decode(bytes(self._accessors.view(draco)))
        except Exception as reason:  # DracoPy documents no exceptions
            raise SceneError(f"{draco.place}: cannot be decoded: {reason!s:.80}") from None
        values = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
        ids = draco.object("attributes")
        for name in ids:
            if self._attributes.has(name) and ids.integer(name) in values:
                self._accessors.replace(self._attributes, name, values[ids.integer(name)])
        faces: NDArray[np.uint32] | None = getattr(mesh, "faces", None)  # not in point clouds
        if faces is not None and self.entry.has("indices"):
            self._accessors.replace(self.entry, "indices", faces)
