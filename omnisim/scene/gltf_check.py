"""Does a glTF header hold together? Asked before anything relies on it, answered in one line."""

from __future__ import annotations

from typing import Any

from omnisim.errors import SceneError

_LISTS = (
    "accessors", "animations", "buffers", "bufferViews", "cameras", "images", "materials",
    "meshes", "nodes", "samplers", "scenes", "skins", "textures",
)  # fmt: skip
_POSE_LENGTHS = {"matrix": 16, "translation": 3, "rotation": 4, "scale": 3}
_COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


def check_header(header: dict[str, Any]) -> None:
    """Check version, shapes and indices of a header.

    Raises:
        SceneError: the first fault, with its place in the JSON.
    """
    version = header["asset"].get("version") if isinstance(header["asset"], dict) else None
    if not isinstance(version, str) or not version.startswith("2."):
        raise SceneError(f"asset.version = {version!r}: want glTF 2.0")
    for key in _LISTS:
        entries = header.get(key, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise SceneError(f"{key}: want a list of objects")
    for key in ("extensionsUsed", "extensionsRequired"):
        if not isinstance(header.get(key, []), list):
            raise SceneError(f"{key}: want a list of names")
    _check_buffers(header)
    _check_meshes(header)
    _check_materials(header)
    _check_nodes(header)


def _index(header: dict[str, Any], owner: dict[str, Any], key: str, into: str, place: str) -> None:
    """Where `owner` has `key`, it must be an index into the header's list `into`."""
    if key not in owner:
        return
    value, count = owner[key], len(header.get(into, []))
    if type(value) is not int or not 0 <= value < count:
        raise SceneError(f"{place}.{key} = {value!r}: want an index into {into}, which has {count}")


def _whole(owner: dict[str, Any], key: str, place: str, default: int | None = None) -> int:
    value = owner.get(key, default)
    if type(value) is not int or value < 0:
        raise SceneError(f"{place}.{key} = {value!r}: want a whole number")
    return value


def _numbers(owner: dict[str, Any], key: str, length: int, place: str) -> None:
    """Where `owner` has `key`, it must be so many finite numbers."""
    values = owner.get(key)
    if values is None:
        return
    good = isinstance(values, list) and len(values) == length
    if not good or not all(type(v) in (int, float) and abs(v) < 1e15 for v in values):
        raise SceneError(f"{place}.{key} = {str(values)[:80]}: want {length} finite numbers")


def _check_buffers(header: dict[str, Any]) -> None:
    for i, view in enumerate(header.get("bufferViews", [])):
        place = f"bufferViews[{i}]"
        _index(header, view, "buffer", "buffers", place)
        end = _whole(view, "byteOffset", place, 0) + _whole(view, "byteLength", place)
        length = _whole(header["buffers"][view.get("buffer", 0)], "byteLength", "buffers[]")
        if end > length:
            raise SceneError(f"{place}: ends at byte {end} of a buffer of {length}")
    for i, accessor in enumerate(header.get("accessors", [])):
        place = f"accessors[{i}]"
        _index(header, accessor, "bufferView", "bufferViews", place)
        if accessor.get("componentType") not in _COMPONENT_BYTES:
            raise SceneError(f"{place}.componentType = {accessor.get('componentType')!r}: unknown")
        if accessor.get("type") not in _COMPONENTS:
            raise SceneError(f"{place}.type = {accessor.get('type')!r}: unknown")
        count = _whole(accessor, "count", place)
        if "bufferView" in accessor:
            view = header["bufferViews"][accessor["bufferView"]]
            size = _COMPONENT_BYTES[accessor["componentType"]] * _COMPONENTS[accessor["type"]]
            stride = view.get("byteStride", size)
            start = _whole(accessor, "byteOffset", place, 0)
            if count and start + (count - 1) * stride + size > view["byteLength"]:
                raise SceneError(f"{place}: {count} values do not fit into its bufferView")


def _check_meshes(header: dict[str, Any]) -> None:
    for i, mesh in enumerate(header.get("meshes", [])):
        primitives = mesh.get("primitives")
        if not isinstance(primitives, list) or not all(isinstance(p, dict) for p in primitives):
            raise SceneError(f"meshes[{i}].primitives: want a list of objects")
        for j, primitive in enumerate(primitives):
            place = f"meshes[{i}].primitives[{j}]"
            attributes = primitive.get("attributes")
            if not isinstance(attributes, dict) or "POSITION" not in attributes:
                raise SceneError(f"{place}: has no POSITION")
            for key in attributes:
                _index(header, attributes, key, "accessors", f"{place}.attributes")
            if header["accessors"][attributes["POSITION"]]["type"] != "VEC3":
                raise SceneError(f"{place}.attributes.POSITION: want VEC3")
            _index(header, primitive, "indices", "accessors", place)
            _index(header, primitive, "material", "materials", place)


def _check_materials(header: dict[str, Any]) -> None:
    for i, texture in enumerate(header.get("textures", [])):
        _index(header, texture, "source", "images", f"textures[{i}]")
        _index(header, texture, "sampler", "samplers", f"textures[{i}]")
    for i, image in enumerate(header.get("images", [])):
        _index(header, image, "bufferView", "bufferViews", f"images[{i}]")
    for i, material in enumerate(header.get("materials", [])):
        base = material.get("pbrMetallicRoughness", {})
        if not isinstance(base, dict) or not isinstance(base.get("baseColorTexture", {}), dict):
            raise SceneError(f"materials[{i}].pbrMetallicRoughness: want objects")
        place = f"materials[{i}].pbrMetallicRoughness.baseColorTexture"
        _index(header, base.get("baseColorTexture", {}), "index", "textures", place)


def _check_nodes(header: dict[str, Any]) -> None:
    nodes = header.get("nodes", [])
    parents: dict[int, int] = {}
    for i, node in enumerate(nodes):
        place = f"nodes[{i}]"
        _index(header, node, "mesh", "meshes", place)
        _index(header, node, "skin", "skins", place)
        for key, length in _POSE_LENGTHS.items():
            _numbers(node, key, length, place)
        for child in node.get("children", []):
            _index(header, {"children": child}, "children", "nodes", place)
            if child in parents:
                raise SceneError(f"nodes[{child}]: is a child of two nodes")
            parents[child] = i
    for i in range(len(nodes)):
        seen, above = 0, i
        while above in parents and seen <= len(nodes):
            above, seen = parents[above], seen + 1
        if seen > len(nodes):
            raise SceneError(f"nodes[{i}]: is its own ancestor")
    for i, skin in enumerate(header.get("skins", [])):
        _index(header, skin, "inverseBindMatrices", "accessors", f"skins[{i}]")
    for i, scene in enumerate(header.get("scenes", [])):
        for root in scene.get("nodes", []):
            _index(header, {"nodes": root}, "nodes", "nodes", f"scenes[{i}]")
    _index(header, header, "scene", "scenes", "header")
