"""What trimesh's glTF reader leaves out of a primitive, by handlers in its extension registry."""

from __future__ import annotations

from typing import Any

import numpy as np
from trimesh.exchange.gltf.extensions import register_handler

from omnisim.scene.gltf_header import MARKER

_TRIANGLES, _TRIANGLE_FAN = 4, 6  # OpenGL's numbers, as the file states them
_INDEX_TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4"}


@register_handler(MARKER, scope="primitive_preprocess")
def _complete(context: dict[str, Any]) -> None:
    """Put sparse values into their accessors, and turn a fan into triangles."""
    accessors, primitive = context["accessors"], context["primitive"]
    for index, sparse in context["data"]["sparse"].items():
        accessors[int(index)] = _with_sparse(accessors[int(index)], sparse, context["views"])
    if primitive.get("mode") == _TRIANGLE_FAN:
        if "indices" in primitive:
            order = np.ravel(accessors[primitive["indices"]])
        else:
            order = np.arange(len(accessors[primitive["attributes"]["POSITION"]]))
        hub = np.full(max(len(order) - 2, 0), order[0])
        accessors.append(np.stack((hub, order[1:-1], order[2:]), axis=1))
        primitive["indices"], primitive["mode"] = len(accessors) - 1, _TRIANGLES


def _with_sparse(values: Any, sparse: dict[str, Any], views: list[bytes]) -> Any:
    where, what, count = sparse["indices"], sparse["values"], sparse["count"]
    places = np.frombuffer(
        views[where["bufferView"]],
        _INDEX_TYPES[where["componentType"]],
        count,
        where.get("byteOffset", 0),
    )
    width = values[0].size
    given = np.frombuffer(
        views[what["bufferView"]], values.dtype, count * width, what.get("byteOffset", 0)
    )
    completed = np.array(values)
    completed[places] = given.reshape(count, *values.shape[1:])
    return completed


@register_handler(MARKER, scope="primitive")
def _keep_raw_attributes(context: dict[str, Any]) -> dict[str, Any]:
    """Keep the accessors' own arrays, before trimesh turns them into its types."""
    data, accessors = context["data"], context["accessors"]
    raw = {name: accessors[index] for name, index in data["attributes"].items()}
    # matrices are stored column after column
    binds = {skin: np.swapaxes(accessors[index], 1, 2) for skin, index in data["binds"].items()}
    kept = {"raw": raw, "accessors": data["attributes"], "material": data["material"]}
    return {"metadata": {MARKER: kept | {"binds": binds}}}
