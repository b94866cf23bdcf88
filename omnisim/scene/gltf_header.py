"""The JSON part of a glTF file: read, and rewritten so that trimesh hands on all that we draw.

trimesh decodes buffers, meshes, pictures and the node tree. What it leaves out (exact colour
factors, samplers, texture transforms, normalised integers, lights) stands in the JSON, which is
read here. Each primitive gets the marker extension `OMNISIM_primitive`, on which
`omnisim.scene.gltf` hooks a handler in trimesh's extension registry.
"""

from __future__ import annotations

import copy
import json
import struct
from pathlib import Path
from typing import Any

from omnisim.errors import SceneError

MARKER = "OMNISIM_primitive"
_GLB_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A

# Extensions without which a file cannot be drawn right, and that something here reads.
READABLE_EXTENSIONS = {
    "KHR_draco_mesh_compression",  # trimesh, where DracoPy is installed
    "KHR_lights_punctual",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "EXT_texture_webp",
}


def read_header(path: Path, data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON header and, for GLB, the chunks that follow it.

    Raises:
        SceneError: neither glTF JSON nor a GLB of version 2, or cut short.
    """
    rest = b""
    try:
        if path.suffix.lower() == ".glb":
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
        return header, rest
    except (struct.error, ValueError) as reason:  # JSON and UTF-8 errors are ValueErrors
        raise SceneError(f"{path}: not glTF: {reason}") from None


def check_extensions(path: Path, header: dict[str, Any]) -> None:
    """Refuse a file that requires what nothing here reads.

    Raises:
        SceneError: naming the extension.
    """
    unknown = sorted(set(header.get("extensionsRequired", [])) - READABLE_EXTENSIONS)
    if unknown:
        raise SceneError(
            f"{path}: requires the glTF extension {', '.join(unknown)}, which omnisim does not "
            "read: export the scene without it"
        )
    if "KHR_draco_mesh_compression" in header.get("extensionsRequired", []):
        try:
            import DracoPy  # noqa: F401
        except ImportError:
            raise SceneError(
                f"{path}: is compressed with Draco: pip install DracoPy, or export without it"
            ) from None


def marked_file(path: Path, header: dict[str, Any], rest: bytes) -> bytes:
    """Return the file again, its primitives marked and what trimesh stumbles over taken out.

    Cameras go, because trimesh drops the children of camera nodes; vertex colours go, because
    they reach us by the marker unrounded.
    """
    marked = copy.deepcopy(header)
    for mesh_index, mesh in enumerate(marked.get("meshes", [])):
        for primitive in mesh.get("primitives", []):
            attributes = primitive.get("attributes", {})
            primitive.setdefault("extensions", {})[MARKER] = {
                "mesh": mesh_index,
                "material": primitive.get("material"),
                "attributes": dict(attributes),
            }
            attributes.pop("COLOR_0", None)
    for node in marked.get("nodes", []):
        node.pop("camera", None)
    text = json.dumps(marked).encode()
    if path.suffix.lower() != ".glb":
        return text
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + len(rest)
    return struct.pack("<5I", _GLB_MAGIC, 2, size, len(text), _JSON_CHUNK) + text + rest
