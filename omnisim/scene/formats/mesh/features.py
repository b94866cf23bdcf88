"""Parts of OBJ, MTL, PLY, STL, OFF and COLLADA files."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from xml.etree import ElementTree

import numpy as np

from omnisim.scene.formats.features import Parts, part_notices, xml_parts
from omnisim.scene.formats.mesh.obj_text import decode_text

_WORDS = re.compile(r"^[ \t]*([A-Za-z_]+\w*)(?:[ \t]+([^\n]*))?", re.MULTILINE)


def mesh_notices(kind: str, data: bytes) -> list[str]:
    """Notices for parts of a file that are left out or unknown.

    Args:
        kind: suffix without its dot, or "mtl".
        data: content of the file; of MTL in its normalized form.
    """
    if kind not in _PARTS or (kind == "mtl" and b"newmtl" not in data):
        return []
    return part_notices(kind, _PARTS[kind](data))


def _text_parts(data: bytes) -> Iterator[tuple[str, str]]:
    """First words of the lines; vertices and faces, the many, are not looked at."""
    text = re.sub(r"#[^\n]*", "", decode_text(data))
    text = re.sub(r"^[ \t]*(v|vt|vn|f)[ \t][^\n]*$", "", text, flags=re.MULTILINE)
    has_normals = re.search(rb"^[ \t]*vn[ \t]", data, re.MULTILINE) is not None
    for match in _WORDS.finditer(text):
        if not (has_normals and match[1] == "s"):
            yield match[1], match[2] or ""


def _mtl_parts(data: bytes) -> Iterator[tuple[str, str]]:
    """Keys in lower case, each once a material."""
    seen: set[str] = set()
    for line in decode_text(data).split("\n"):
        key, _, value = line.partition(" ")
        key = key.lower()
        seen = set() if key == "newmtl" else seen
        if key and key not in seen:
            seen.add(key)
            yield key, value


def _ply_parts(data: bytes) -> Iterator[tuple[str, str]]:
    element = ""
    for line in data.partition(b"end_header")[0].decode("latin-1").split("\n"):
        words = line.split()
        if words[:1] == ["element"] and len(words) > 1:
            element = words[1]
        elif words[:1] == ["property"]:
            yield f"{element}.{words[-1]}", line


def _stl_parts(data: bytes) -> Iterator[tuple[str, str]]:
    is_text = data.lstrip().startswith(b"solid") and b"endsolid" in data
    if is_text or len(data) <= 84 or (len(data) - 84) % 50:
        return
    triangles = np.frombuffer(data, np.uint8, offset=84).reshape(-1, 50)
    for _ in range(int(triangles[:, 48:].any(axis=1).sum())):
        yield "attributes", ""
    if b"COLOR=" in data[:80]:
        yield "COLOR", ""


def _off_parts(data: bytes) -> Iterator[tuple[str, str]]:
    lines = [line for line in decode_text(data).split("\n") if line.partition("#")[0].strip()]
    head = re.match(r"\s*(ST)?(C)?(N)?(4?n?OFF)", lines[0]) if lines else None
    yield from ((name, "") for name in (head.groups() if head else ()) if name)
    last = lines[-1].split() if lines else []
    if last and last[0].isdigit() and len(last) > int(last[0]) + 2:
        yield "face colors", ""


def _collada_parts(data: bytes) -> Parts:
    try:
        return list(xml_parts(ElementTree.fromstring(data), "dae"))
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError):
        return []  # its reader has told the fault


_PARTS: dict[str, Callable[[bytes], Parts]] = {
    "obj": _text_parts, "mtl": _mtl_parts, "ply": _ply_parts, "stl": _stl_parts,
    "off": _off_parts, "dae": _collada_parts,
}  # fmt: skip
