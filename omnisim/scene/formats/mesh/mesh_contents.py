"""Contents of OBJ, PLY, STL, OFF and COLLADA files, beside trimesh's reading of them.

OBJ and MTL text is brought into a normal form: UTF-8 with a single material file. Indices count
from the start, and either all or no corners have texture coordinates. Options of texture maps
become separate keys. Notices name the parts of a file that are left out. And since trimesh's
readers fail somewhere inside NumPy, the faulty line or number of a damaged file is found here.
"""

from __future__ import annotations

import itertools
import re
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from xml.etree import ElementTree

import numpy as np

from omnisim.scene.formats.features import Parts, part_notices, xml_parts

MATERIAL_FILES = "omnisim material files.mtl"  # placeholder for all material files
# Number of values of each texture map option (Wavefront's MTL specification).
_OPTION_VALUES = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-colorspace": 1,
    "-imfchan": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
NO_MATERIAL = {"None", "(null)", "null"}  # placeholders that exporters write
_OPTION_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
_BARE_CORNER = re.compile(r"^[ \t]*f[ \t][^\n]*?\d(?:[ \t]|$|//)", re.MULTILINE)


def decode_text(data: bytes) -> str:
    """Decode UTF-8, or else Latin-1, with line feeds as line ends."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def plain_obj(data: bytes) -> tuple[bytes, list[str], list[str]]:
    """Return a normalized OBJ, the argument of each `mtllib` line, and the names of its objects.

    An object is an `o`, each of its groups `g` apart: `o/g`. The `o` lines become its number.
    """
    text = decode_text(data).replace("\\\n", " ")
    text = re.sub(r"#[^\n]*", "", text)
    names = re.findall(r"^[ \t]*mtllib[ \t]+(\S[^\n]*?)[ \t]*$", text, re.MULTILINE)
    text = re.sub(r"^[ \t]*mtllib\b[^\n]*$", "", text, flags=re.MULTILINE)
    counted_back = re.search(r"^[ \t]*f[ \t][^\n]*-", text, re.MULTILINE)
    has_coordinates = re.search(r"^[ \t]*vt[ \t]", text, re.MULTILINE)
    if counted_back or (has_coordinates and _BARE_CORNER.search(text)):
        text = _plain_corners(text)
    if names:
        text = f"mtllib {MATERIAL_FILES}\n{text}"
    text, objects = _numbered_objects(text)
    return text.encode(), names, objects


def _numbered_objects(text: str) -> tuple[str, list[str]]:
    """Text whose `o` and `g` lines became `o :number`, and the objects' names by number."""
    numbers: dict[str, int] = {}
    parts = {"o": "", "g": ""}

    def number(line: re.Match[str]) -> str:
        parts["g"] = ""
        parts[line[1]] = "" if (line[1], line[2]) == ("g", "default") else (line[2] or "").strip()
        name = "/".join(dict.fromkeys(filter(None, parts.values()))) or "default"
        return f"o :{numbers.setdefault(name, len(numbers))}"

    text = re.sub(r"^[ \t]*([og])(?:[ \t]+([^\n]*?))?[ \t]*$", number, text, flags=re.MULTILINE)
    return text, list(numbers)


def _plain_corners(text: str) -> str:
    """Make indices absolute; corners without texture coordinates get (0, 0) if others have some."""
    counts = [0, 0, 0]
    columns = {"v": 0, "vt": 1, "vn": 2}
    lines = text.split("\n")
    total_coordinates = sum(line.lstrip().startswith(("vt ", "vt\t")) for line in lines)
    for number, line in enumerate(lines):
        words = line.split()
        if not words:
            continue
        if words[0] in columns:
            counts[columns[words[0]]] += 1
        elif words[0] == "f":
            for corner, word in enumerate(words[1:], start=1):
                parts = word.split("/")
                for column, part in enumerate(parts[:3]):
                    if part.startswith("-") and part[1:].isdigit():
                        parts[column] = str(counts[column] + 1 + int(part))
                if total_coordinates and (len(parts) < 2 or not parts[1]):
                    parts[1:2] = [str(total_coordinates + 1)]
                words[corner] = "/".join(parts)
            lines[number] = " ".join(words)
    if total_coordinates:
        lines.append("vt 0 0")
    return "\n".join(lines)


def undefined_materials(obj: bytes, mtl: bytes) -> list[str]:
    """Notice of the materials that a normalized OBJ uses but its MTL does not define."""
    if b"newmtl" not in mtl:  # reported for the file itself
        return []
    used, defined = (
        dict.fromkeys(
            re.findall(rf"^[ \t]*{key}[ \t]+(\S[^\n]*?)[ \t]*$", text.decode(), re.MULTILINE)
        )
        for key, text in (("usemtl", obj), ("newmtl", mtl))
    )
    lacking = [name for name in used if name not in defined and name not in NO_MATERIAL]
    if not lacking:
        return []
    names = ", ".join(map(repr, lacking[:3])) + (", …" if len(lacking) > 3 else "")
    return [f"no material file has {names}: drawn in plain gray"]


def plain_mtl(data: bytes) -> bytes:
    """Return a normalized MTL, without comments and quotes.

    Map options become keys, such as `map_kd-s 2 2 1`.
    """
    lines = []
    for line in decode_text(data).split("\n"):
        words = re.sub(r"(^|\s)#.*$", "", line).split()
        if not words:
            continue
        key = words[0].lower()
        if not key.startswith("map_"):
            lines.append(" ".join(words))
            continue
        options, name = _split_options(words[1:])
        lines += [f"{key}{option} {' '.join(values)}" for option, values in options]
        lines.append(f"{key} {name}")
    return "\n".join(lines).encode()


def _split_options(words: list[str]) -> tuple[list[tuple[str, list[str]]], str]:
    options = []
    while words and words[0].lower() in _OPTION_VALUES:
        option, words = words[0].lower(), words[1:]
        count = _OPTION_VALUES[option]
        if count == 3:  # up to three numbers
            count = next((i for i, w in enumerate(words[:3]) if not _OPTION_NUMBER.match(w)), 3)
        options.append((option, words[:count]))
        words = words[count:]
    return options, " ".join(words).strip('"')


# Parts of OBJ, MTL, PLY, STL, OFF and COLLADA files.

_WORDS = re.compile(r"^[ \t]*([A-Za-z_]+\w*)(?:[ \t]+([^\n]*))?", re.MULTILINE)


def mesh_notices(kind: str, data: bytes) -> list[str]:
    """Notices for parts of a file that are left out or unknown; MTL is in its normal form.

    The kind of a file is its suffix without the dot, here and below.
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
    with suppress(ElementTree.ParseError, ValueError, LookupError, RecursionError):
        return list(xml_parts(ElementTree.fromstring(data), "dae"))
    return []  # its reader has told the fault


_PARTS: dict[str, Callable[[bytes], Parts]] = {
    "obj": _text_parts, "mtl": _mtl_parts, "ply": _ply_parts, "stl": _stl_parts,
    "off": _off_parts, "dae": _collada_parts,
}  # fmt: skip


# Diagnosis of files that trimesh cannot read, at a cost that only damaged files incur.

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
    """First fault of a file that is unreadable or has no geometry; empty: no fault found."""
    return _FINDERS[kind](data) if kind in _FINDERS else ""


def early_end(kind: str, data: bytes) -> str:
    """Fault of a truncated file, which trimesh would read as a smaller one; empty: no fault."""
    find = {"ply": _ply_end, "off": _off_end}.get(kind)
    return find(data) if find else ""


def points_fault(kind: str, data: bytes) -> str:
    """Fault of a PLY without faces: its kind, and a remedy; empty: no points either."""
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
