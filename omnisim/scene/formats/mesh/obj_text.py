"""Normalization of OBJ and MTL text for trimesh.

Normalized text is UTF-8 and uses a single material file. Indices count from the start, and either
all or no corners have texture coordinates. Options of texture maps become separate keys.
"""

from __future__ import annotations

import re

MATERIAL_FILES = "omnisim material files.mtl"  # placeholder for all material files
# Number of values of each texture map option (Wavefront's MTL specification).
_OPTION_VALUES = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-colorspace": 1,
    "-imfchan": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
NO_MATERIAL = {"None", "(null)", "null"}  # placeholders that exporters write
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")
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
    """Make relative indices absolute, and give corners without texture coordinates a zero pair
    if other corners have some."""  # fmt: skip
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
            corners = (_plain_corner(word, counts, total_coordinates) for word in words[1:])
            lines[number] = "f " + " ".join(corners)
    if total_coordinates:
        lines.append("vt 0 0")
    return "\n".join(lines)


def _plain_corner(word: str, counts: list[int], total_coordinates: int) -> str:
    parts = word.split("/")
    for column, part in enumerate(parts[:3]):
        if part.startswith("-") and part[1:].isdigit():
            parts[column] = str(counts[column] + 1 + int(part))
    if total_coordinates and (len(parts) < 2 or not parts[1]):
        parts[1:2] = [str(total_coordinates + 1)]
    return "/".join(parts)


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
            count = next((i for i, w in enumerate(words[:3]) if not _NUMBER.match(w)), 3)
        options.append((option, words[:count]))
        words = words[count:]
    return options, " ".join(words).strip('"')
