"""Diagnosis of OBJ, PLY, STL, OFF and COLLADA files that trimesh cannot read.

trimesh's readers fail somewhere inside NumPy. This module finds the faulty line or number, at a
cost that only damaged files incur.
"""

from __future__ import annotations

import itertools
import re
import struct
from collections.abc import Callable, Iterator
from xml.etree import ElementTree

from omnisim.scene.formats.mesh.obj_text import decode_text

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|nan|[-+]?inf", re.IGNORECASE)
_CORNER = re.compile(r"(-?\d{1,18})(/-?\d*){0,2}", re.ASCII)
_PLY_BYTES = {
    "char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2,
    "int": 4, "uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4, "double": 8,
    "float64": 8,
}  # fmt: skip
_COUNT = re.compile(r"\d{1,18}", re.ASCII)
_HEAD = 4096  # bytes that contain the header of an OFF file
_STL_HEADER, _STL_TRIANGLE = 84, 50  # bytes


def mesh_fault(kind: str, data: bytes) -> str:
    """First fault of a file that is unreadable or has no geometry; empty: no fault found.

    Args:
        kind: suffix without its dot.
        data: content of the file.
    """
    find = _FINDERS.get(kind)
    return find(data) if find else ""


def early_end(kind: str, data: bytes) -> str:
    """Fault of a truncated file, which trimesh would read as a smaller one; empty: no fault.

    Args:
        kind: suffix without its dot.
        data: content of the file.
    """
    return {"ply": _ply_end, "off": _off_end}[kind](data) if kind in ("ply", "off") else ""


def points_fault(kind: str, data: bytes) -> str:
    """Fault of a PLY without faces: what it is, and the way on; empty: no points either."""
    head = data.partition(b"end_header")[0]
    if kind != "ply" or not re.search(rb"element vertex [1-9]", head):
        return ""
    if b" f_dc_0" in head and b" opacity" in head:
        return (
            "is a Gaussian splat, whose points have no surface: reconstruct a mesh from its images,"
            " such as with 2DGS or SuGaR"
        )
    return (
        "is a point cloud without surfaces: make a mesh of it, with CloudCompare or Open3D, and "
        "save that as PLY"
    )


def _numbered(data: bytes) -> Iterator[tuple[int, list[str]]]:
    """Words of each non-empty line with its number from 1; comments are dropped."""
    for number, line in enumerate(decode_text(data).split("\n"), start=1):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def _bad_number(words: list[str]) -> str:
    """First word that is not a number; empty: all are numbers."""
    return next((word for word in words if not _NUMBER.fullmatch(word)), "")


def _obj(data: bytes) -> str:
    lines = list(_numbered(data))
    vertices = sum(words[0] == "v" for _, words in lines)
    for number, (key, *values) in lines:
        if key in ("v", "vt", "vn") and (bad := _bad_number(values)):
            return f"line {number}: {key}: expected numbers, got {bad!r}"
        if key == "v" and len(values) < 3:
            return f"line {number}: v: expected 3 numbers, got {len(values)}"
        if key != "f":
            continue
        for word in values:
            corner = _CORNER.fullmatch(word)
            if corner is None:
                return f"line {number}: f: expected corners such as 1/1/1, got {word!r}"
            if not 1 <= abs(int(corner[1])) <= vertices:
                return f"line {number}: f: expected vertices from 1 to {vertices}, got {corner[1]}"
    return ""


def _ply(data: bytes) -> str:
    head, end, body = data.partition(b"end_header")
    if not data.startswith(b"ply"):
        return "expected 'ply' in its first line"
    if not end:
        return "its header has no end: expected end_header"
    if fault := _ply_elements(head)[1] or _ply_end(data):
        return fault
    is_text = re.search(rb"format\s+ascii", head)
    if is_text and (bad := _bad_number(decode_text(body).split())):
        return f"expected numbers after its header, got {bad!r}"
    return ""


def _ply_elements(head: bytes) -> tuple[list[tuple[int, int]], str]:
    """Counts and minimum sizes in bytes of the elements, and the header's fault, or empty."""
    elements: list[tuple[int, int]] = []
    for _, (key, *values) in _numbered(head):
        if key == "element":
            if len(values) != 2 or not _COUNT.fullmatch(values[1]):
                return [], f"element: expected a name and a count, got {' '.join(values)!r}"
            elements.append((int(values[1]), 0))
        elif key == "property":
            kind = (values[1:] if values[:1] == ["list"] else values)[:1]  # for a list: count type
            if not kind or kind[0] not in _PLY_BYTES or not elements:
                return [], f"property: expected a type and a name, got {' '.join(values)!r}"
            count, size = elements[-1]
            elements[-1] = (count, size + _PLY_BYTES[kind[0]])
    return elements, ""


def _ply_end(data: bytes) -> str:
    """Fault of a file with less data than its header states."""
    head, _, body = data.partition(b"end_header")
    is_text = re.search(rb"format\s+ascii", head) is not None
    body = body.partition(b"\n")[2]
    elements, _ = _ply_elements(head)
    expected = sum(count if is_text else count * size for count, size in elements)
    got = _line_count(body) if is_text else len(body)
    return "" if got >= expected else _cut(expected, "lines" if is_text else "bytes", got)


def _line_count(data: bytes) -> int:
    """Number of non-blank lines."""
    return sum(1 for line in data.split(b"\n") if line.strip())


def _cut(expected: int, unit: str, got: int) -> str:
    return f"is cut short: expected {expected} {unit} or more after its header, got {got}"


def _stl(data: bytes) -> str:
    if data.lstrip().startswith(b"solid"):
        for number, (key, *values) in _numbered(data):
            if key == "vertex" and (len(values) != 3 or _bad_number(values)):
                return f"line {number}: vertex: expected 3 numbers, got {' '.join(values)!r}"
        return "" if b"endsolid" in data else "is cut short: expected endsolid at its end"
    if len(data) < _STL_HEADER:
        return f"is cut short: expected a header of {_STL_HEADER} bytes, got {len(data)}"
    (count,) = struct.unpack_from("<I", data, 80)
    expected = _STL_HEADER + count * _STL_TRIANGLE
    if expected != len(data):
        return f"expected {expected} bytes for {count} triangles, got {len(data)}"
    return ""


def _off(data: bytes) -> str:
    lines = list(_numbered(data))
    if not lines or not lines[0][1][0].upper().endswith("OFF"):
        return "expected 'OFF' in its first line"
    for number, words in lines[1:]:
        if bad := _bad_number(words):
            return f"line {number}: expected numbers, got {bad!r}"
    first, counts = _off_counts(data)
    if not counts:
        return "expected the counts of vertices and faces after OFF"
    vertices, faces = counts
    for number, (count, *corners) in lines[first + vertices :][:faces]:
        for word in corners[: int(count) if _COUNT.fullmatch(count) else None]:
            if not (_COUNT.fullmatch(word) and int(word) < vertices):
                return f"line {number}: expected vertices below {vertices}, got {word}"
    return _off_end(data)


def _off_counts(data: bytes) -> tuple[int, tuple[int, int] | None]:
    """Number of lines before the first vertex, and the counts of vertices and faces, if any."""
    heads = [words for _, words in itertools.islice(_numbered(data[:_HEAD]), 2)]
    if not heads or not heads[0][0].upper().endswith("OFF"):
        return 0, None
    first, words = (1, heads[0][1:]) if heads[0][1:] else (2, heads[-1])
    if len(words) < 2 or not all(map(_COUNT.fullmatch, words[:2])):
        return first, None
    return first, (int(words[0]), int(words[1]))


def _off_end(data: bytes) -> str:
    """Fault of a file with fewer lines than its counts state."""
    first, counts = _off_counts(data)
    expected, got = sum(counts or ()), _line_count(data) - first
    return "" if got >= expected else _cut(expected, "lines", got)


def _dae(data: bytes) -> str:
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as reason:
        return f"not XML: {reason}"
    tags = {element.tag.rpartition("}")[2] for element in root.iter()}
    if root.tag.rpartition("}")[2] != "COLLADA":
        return f"expected a <COLLADA> element, got <{root.tag}>"
    for tag in ("asset", "library_geometries", "library_visual_scenes", "scene"):
        if tag not in tags:
            return f"has no <{tag}>"
    return ""


_FINDERS: dict[str, Callable[[bytes], str]] = {
    "obj": _obj, "ply": _ply, "stl": _stl, "off": _off, "dae": _dae,
}  # fmt: skip
