"""The primitives of a glTF file: the triangles of a mesh that share a material."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import SceneError
from omnisim.scene.gltf_arrays import GltfArrays

POINTS_AND_LINES = {0, 1, 2, 3}  # OpenGL's numbers, as the file states them
_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6
DRACO = "KHR_draco_mesh_compression"


class Primitive(NamedTuple):
    """Attributes (n, components) by name, normalised integers as floats; triangles (m, 3)."""

    attributes: dict[str, NDArray[Any]]
    triangles: NDArray[np.int64]


def read_primitive(arrays: GltfArrays, primitive: dict[str, Any]) -> Primitive | None:
    """Read a primitive, or None: it has points or lines.

    Raises:
        SceneError: damaged numbers.
    """
    mode = primitive.get("mode", _TRIANGLES)
    if mode not in (_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN):
        return None
    decoded, order = _decoded(arrays, primitive)
    attributes = {}
    for name, index in primitive["attributes"].items():
        values = decoded[name] if name in decoded else arrays.array(index)
        attributes[name] = arrays.floats(index, values)
    if order is not None:  # Draco has triangles, whatever they were before
        return Primitive(attributes, order.reshape(-1, 3))
    if "indices" in primitive:
        order = arrays.array(primitive["indices"]).ravel()
        if not np.issubdtype(order.dtype, np.integer):
            raise SceneError("its indices are not whole numbers")
    else:
        order = np.arange(len(attributes["POSITION"]))
    return Primitive(attributes, _triangles(order.astype(np.int64), mode))


def _triangles(order: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """The triangles (m, 3) that vertices (n,) in this order make.

    Source: glTF 2.0, section 3.7.2.1; every other triangle of a strip is turned round.
    """
    if mode == _TRIANGLE_STRIP:
        triangles = np.stack((order[:-2], order[1:-1], order[2:]), axis=1)
        triangles[1::2] = triangles[1::2, ::-1]
        return triangles
    if mode == _TRIANGLE_FAN:
        hub = np.full(max(len(order) - 2, 0), order[0] if len(order) else 0)
        return np.stack((hub, order[1:-1], order[2:]), axis=1)
    if len(order) % 3:
        raise SceneError(f"{len(order)} indices do not make triangles")
    return order.reshape(-1, 3)


def _decoded(
    arrays: GltfArrays, primitive: dict[str, Any]
) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64] | None]:
    """What Draco has compressed: attributes by name and the triangles; nothing where it has not.

    Source: KHR_draco_mesh_compression; one blob has all, its attributes go by numbers of their own.
    """
    about = primitive.get("extensions", {}).get(DRACO)
    if about is None:
        return {}, None
    import DracoPy  # optional; `read_header` has seen that it is there

    try:
        blob = DracoPy.decode(bytes(arrays.view(about["bufferView"])))
    except (DracoPy.FileTypeException, ValueError) as reason:
        raise SceneError(f"cannot be decoded by Draco: {reason}") from None
    name_of = {number: name for name, number in about["attributes"].items()}
    found = {
        name_of[attribute["unique_id"]]: np.asarray(attribute["data"])
        for attribute in blob.attributes
        if attribute["unique_id"] in name_of
    }
    return found, np.asarray(blob.faces, dtype=np.int64)
