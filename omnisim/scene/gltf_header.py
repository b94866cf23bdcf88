"""The JSON part of a glTF file, checked, and whether something here reads what it requires."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

from omnisim.errors import SceneError
from omnisim.scene.gltf_check import check_header
from omnisim.scene.gltf_primitives import DRACO

_GLB_MAGIC, _JSON_CHUNK = 0x46546C67, 0x4E4F534A
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"

# Extensions without which a file cannot be drawn right, and that something here reads.
READABLE_EXTENSIONS = {
    DRACO,  # where DracoPy is installed
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
    if any(DRACO in primitive.get("extensions", {}) for primitive in primitives):
        try:
            import DracoPy  # noqa: F401
        except ImportError:
            raise SceneError(
                "is compressed with Draco: pip install DracoPy, or export without it"
            ) from None
