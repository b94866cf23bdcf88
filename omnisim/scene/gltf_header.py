"""The JSON part of a glTF file: read, and rewritten so that trimesh hands on all that we draw.

trimesh decodes buffers, meshes, pictures and the node tree. What it leaves out (exact colour
factors, samplers, texture transforms, normalised integers, sparse values, fans, lights, skins)
stands in the JSON, which is read here. Each primitive gets the marker extension
`OMNISIM_primitive`, on which `omnisim.scene.gltf_primitives` hooks handlers in trimesh's
extension registry; each node is named by its index.
"""

from __future__ import annotations

import copy
import json
import struct
from pathlib import Path
from typing import Any

from omnisim.errors import SceneError
from omnisim.scene.gltf_check import check_header

MARKER = "OMNISIM_primitive"
_GLB_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A
_DRACO = "KHR_draco_mesh_compression"
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"

# Extensions without which a file cannot be drawn right, and that something here reads.
READABLE_EXTENSIONS = {
    _DRACO,  # trimesh, where DracoPy is installed
    "KHR_lights_punctual",
    _GLOSSY,
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
}


def read_header(path: Path, data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the checked JSON header and, for GLB, the chunks that follow it.

    Raises:
        SceneError: neither glTF JSON nor a GLB of version 2, cut short, or a header that does not
            hold together or requires what nothing here reads.
    """
    rest = b""
    try:
        if path.suffix.lower() == ".glb":
            if len(data) < 20:
                raise ValueError("cut short")
            magic, version, length, json_length, kind = struct.unpack_from("<5I", data)
            if magic != _GLB_MAGIC or version != 2 or kind != _JSON_CHUNK:
                raise ValueError("want a GLB file of version 2")
            if length > len(data):
                raise ValueError(f"cut short: {len(data)} of {length} bytes are there")
            text, rest = data[20 : 20 + json_length], data[20 + json_length : length]
        else:
            text = data
        header = json.loads(text.decode("utf-8-sig"))
        if not isinstance(header, dict) or "asset" not in header:
            raise ValueError("its JSON has no 'asset'")
    except (ValueError, RecursionError) as reason:  # JSON and UTF-8 errors are ValueErrors
        raise SceneError(f"not glTF: {reason}") from None
    check_header(header)
    _check_extensions(header)
    return header, rest


def _check_extensions(header: dict[str, Any]) -> None:
    unknown = sorted(map(str, set(header.get("extensionsRequired", [])) - READABLE_EXTENSIONS))
    if unknown:
        raise SceneError(
            f"requires the glTF extension {', '.join(unknown)}, which omnisim does not read: "
            "export the scene without it"
        )
    primitives = [p for mesh in header.get("meshes", []) for p in mesh["primitives"]]
    if any(_DRACO in primitive.get("extensions", {}) for primitive in primitives):
        try:
            import DracoPy  # noqa: F401
        except ImportError:
            raise SceneError(
                "is compressed with Draco: pip install DracoPy, or export without it"
            ) from None


def marked_file(path: Path, header: dict[str, Any], rest: bytes) -> bytes:
    """Return the file again, marked, and without what trimesh stumbles over.

    Cameras go, because trimesh drops the children of camera nodes; vertex colours go, because
    they reach us by the marker unrounded; specular-glossiness goes, because trimesh repaints its
    texture; a file without scenes gets one of all its roots.
    """
    marked = copy.deepcopy(header)
    sparse = {i: a["sparse"] for i, a in enumerate(header.get("accessors", [])) if "sparse" in a}
    skins_of: dict[int, set[int]] = {}
    for node in header.get("nodes", []):
        if "mesh" in node and "skin" in node:
            skins_of.setdefault(node["mesh"], set()).add(node["skin"])
    binds = {
        index: skin["inverseBindMatrices"]
        for index, skin in enumerate(header.get("skins", []))
        if "inverseBindMatrices" in skin
    }
    for mesh_index, mesh in enumerate(marked.get("meshes", [])):
        mesh["name"] = str(mesh.get("name", f"mesh {mesh_index}"))
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            used = {*attributes.values(), primitive.get("indices")}
            primitive.setdefault("extensions", {})[MARKER] = {
                "mesh": mesh_index,
                "material": primitive.get("material"),
                "attributes": dict(attributes),
                "binds": {
                    str(skin): binds[skin] for skin in skins_of.get(mesh_index, ()) if skin in binds
                },
                "sparse": {str(i): sparse[i] for i in used if i in sparse},
            }
            attributes.pop("COLOR_0", None)
    for material in marked.get("materials", []):
        glossy = material.get("extensions", {}).pop(_GLOSSY, None)
        if glossy is not None:
            texture = glossy.get("diffuseTexture")
            material["pbrMetallicRoughness"] = {} if texture is None else {
                "baseColorTexture": texture
            }  # fmt: skip
    for index, node in enumerate(marked.get("nodes", [])):
        node.pop("camera", None)
        node["name"] = str(index)
    if not marked.get("scenes"):
        children = {child for node in header.get("nodes", []) for child in node.get("children", [])}
        roots = [index for index in range(len(header.get("nodes", []))) if index not in children]
        marked["scenes"], marked["scene"] = [{"nodes": roots}], 0
    text = json.dumps(marked).encode()
    if path.suffix.lower() != ".glb":
        return text
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + len(rest)
    return struct.pack("<5I", _GLB_MAGIC, 2, size, len(text), _JSON_CHUNK) + text + rest
