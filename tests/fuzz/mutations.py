"""Mutations of files by a seeded generator: the same state of it, the same bytes.

Bytes of any file are flipped, cut, doubled, spliced; text has words, numbers and lines replaced;
values of JSON, YAML, TOML, GLB and of an image's metadata are dropped, swapped or of another type.
"""

import copy
import io
import json
import struct
import tomllib
import zipfile
import zlib
from pathlib import Path
from random import Random

import numpy as np
import yaml

from omnisim.core.files.image_files import read_image, write_image
from tests.scene.gltf_builder import glb

NUMBERS = (
    "nan", "inf", "-inf", "NaN", "1e300", "-1e300", "1e-300", "1e30", "-1", "0", "-0.0", "0.5", "7",
    "65536", "2147483648", "4294967295", "9223372036854775808", "99999999999999999999999", "1e", "",
    "1" * 5000,
)  # fmt: skip
WORDS = (
    "''", '"1"', "null", "true", "[]", "{}", "abc", "[1, 2", "2026-99-99", "!!python/object:os.x y",
    "*a", "&a [*a]", "\u2028", "<x/>", "1 2 3", "0.0.0", "- 5", "\x1b[31m", "../..", "\u202e", "%s",
    "x" * 3000, "[" * 3000, "{a: " * 2000, "<a>" * 3000, "'", '"', "\\", "#", "=", "é",
)  # fmt: skip
VALUES = (
    None, True, -1, 0, 3, 9, 5121, 5126, 10**12, 2**63, 0.5, 1e14, 1e300, float("nan"), "", "x",
    float("inf"), "1.5", "VEC2", "MAT4", "../..", "data:;base64,AAA", "a" * 300, "\x1b[31m\n", [],
    [0], [[]], [1.0] * 4, [1.0] * 16, {}, {"index": 9}, [[[[[[[[[]]]]]]]]],
)  # fmt: skip
BYTES = (
    b"\xef\xbb\xbf", b"\xff\xfe", b"\0", b"\xe9", b"\x85", b"\r", b"\n\n", b"\xff" * 4,
    b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff\xff\xff\x7f", b"\xff\xff\x7f\x7f", b"\x80" * 40,
)  # fmt: skip
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def mutate(data: bytes, name: str, other: bytes, rng: Random) -> bytes:
    """File with one to three mutations, but for the few that leave it as it was.

    Args:
        data: of a valid file.
        name: of the file: its suffix says what values it has.
        other: another file, to splice.
        rng: decides.
    """
    kinds = [_mutate_bytes, _mutate_text]
    if (suffix := Path(name).suffix) in VALUES_OF:
        kinds += [VALUES_OF[suffix]] * 3
    kind = rng.choice(kinds)
    try:
        return kind(data, rng) if rng.random() < 0.95 else _splice(data, other, rng)
    except UnicodeDecodeError:  # no text
        return _mutate_bytes(data, rng)


def _span(size: int, rng: Random) -> slice:
    """Part of a file, short ones more often."""
    start = rng.randrange(size + 1)
    return slice(start, start + rng.choice((1, 2, 4, 20, rng.randrange(size + 1))))


def _splice(data: bytes, other: bytes, rng: Random) -> bytes:
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def _mutate_bytes(data: bytes, rng: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 3, 20))):
        span, kind = _span(len(changed), rng), rng.randrange(9)
        if kind <= 2 and changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
        elif kind == 3:
            del changed[span]
        elif kind == 4:
            changed[span.start : span.start] = changed[span]
        elif kind == 5:
            part = rng.choice(BYTES)
            changed[span.start : span.start + len(part)] = part
        elif kind == 6:
            start = rng.choice((0, span.start))
            changed[start:start] = rng.choice(BYTES)
        elif kind == 7:
            moved = changed[span]
            del changed[span]
            start = rng.randrange(len(changed) + 1)
            changed[start:start] = moved
        else:
            del changed[rng.randrange(len(changed) + 1) :]
    return bytes(changed)


def _mutate_text(data: bytes, rng: Random) -> bytes:
    text = data.decode()
    for _ in range(rng.choice((1, 1, 3))):
        text = _broken(text, rng)
    encoding = rng.choice(("utf-8",) * 20 + ("utf-8-sig", "utf-16", "latin-1"))
    return text.encode(encoding, "replace")


def _broken(text: str, rng: Random) -> str:
    """Text with one fault in its lines or words."""
    lines = text.splitlines(keepends=True)
    words = [(at, word) for at, line in enumerate(lines) for word in line.split()]
    if not words:
        return rng.choice(WORDS)
    at, word = rng.choice(words)
    kind = rng.randrange(9)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(rng.randrange(len(lines) + 1), lines[at])
    elif kind == 2:
        other = rng.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == 3:
        lines[at] = lines[at].replace(word, "", 1)
    elif kind == 4:
        lines[at] = lines[at].replace(word, rng.choice(words)[1], 1)
    else:
        core = word.strip(",[](){}:=\"'<>/")
        given = rng.choice(NUMBERS if any(map(str.isdigit, core)) else WORDS + NUMBERS[:8])
        lines[at] = lines[at].replace(core, given, 1) if core else given
    return "".join(lines)


def _entries(value: object) -> list[tuple[object, object]]:
    """(holder, key) of all values inside of a value, the nearer ones first."""
    found, level = [], [value]
    while level:
        new = []
        for holder in level:
            keys = list(holder) if isinstance(holder, dict) else range(len(holder))
            found += [(holder, key) for key in keys]
            new += [holder[key] for key in keys if isinstance(holder[key], dict | list)]
        level = new
    return found


def _mutate_tree(tree: object, rng: Random) -> None:
    """Drop, swap, double or replace values inside of a value of JSON's types."""
    for _ in range(rng.choice((1, 1, 1, 3))):
        entries = _entries(tree)
        if not entries:
            return
        holder, key = rng.choice(entries)
        kind = rng.random()
        if kind < 0.2:
            del holder[key]
        elif kind < 0.3:
            other, place = rng.choice(entries)
            try:
                held, value = copy.deepcopy(holder[key]), copy.deepcopy(other[place])
            except (KeyError, IndexError):
                continue
            holder[key], other[place] = value, held
        elif kind < 0.35 and isinstance(holder, list):
            holder.insert(key, copy.deepcopy(holder[key]))
        elif kind < 0.4 and isinstance(holder, dict):
            holder[f"{key}_"] = holder.pop(key)
        elif kind < 0.7 and type(holder[key]) in (int, float):
            holder[key] = rng.choice((-1, 1, 1000, -1e9, 1e-9, 0.5)) * (holder[key] or 1)
        elif kind < 0.8 and type(holder[key]) is int:
            holder[key] += rng.choice((-1, 1, 2, 1000))
        else:
            holder[key] = copy.deepcopy(rng.choice(VALUES))


def _json(data: bytes, rng: Random) -> bytes:
    tree = json.loads(data)
    _mutate_tree(tree, rng)
    return json.dumps(tree).encode()


def _yaml(data: bytes, rng: Random) -> bytes:
    text = data.decode().removeprefix("%YAML:1.0").replace("!!opencv-matrix", "")
    tree = yaml.safe_load(text)
    _mutate_tree(tree, rng)
    return yaml.safe_dump(tree).encode()


def _toml(data: bytes, rng: Random) -> bytes:
    tree = tomllib.loads(data.decode())
    _mutate_tree(tree, rng)
    return "".join(f"{json.dumps(key)} = {_inline(tree[key])}\n" for key in tree).encode()


def _inline(value: object) -> str:
    """TOML's text of a value; None, which TOML has not, is an empty table."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(key)} = {_inline(value[key])}' for key in value)}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, float):
        return repr(value)
    return "{}" if value is None else json.dumps(value, default=str)


def _glb(data: bytes, rng: Random) -> bytes:
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    tree = json.loads(data[20:end])
    _mutate_tree(tree, rng)
    return glb(tree, data[end + 8 :])


def _png(data: bytes, rng: Random) -> bytes:
    """Metadata, or one part with a right checksum."""
    if b"camera" in data and rng.random() < 0.5:
        return _image(data, ".png", rng)
    parts, start = [], len(PNG_SIGNATURE)
    while start < len(data):
        size = int.from_bytes(data[start : start + 4], "big")
        parts.append(data[start + 4 : start + 8 + size])
        start += size + 12
    at = rng.randrange(len(parts))
    parts[at] = parts[at][:4] + _mutate_bytes(parts[at][4:], rng)
    return PNG_SIGNATURE + b"".join(
        struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part))
        for part in parts
    )


def _image(data: bytes, suffix: str, rng: Random) -> bytes:
    """Image with other metadata."""
    path = Path("mutated").with_suffix(suffix).absolute()
    path.write_bytes(data)
    pixels, metadata = read_image(path)
    _mutate_tree(metadata, rng)
    write_image(path, pixels, metadata)
    changed = path.read_bytes()
    path.unlink()
    return changed


def _npz(data: bytes, rng: Random) -> bytes:
    """Arrays left out, of other values, or with other bytes, under right checksums."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name, kind = rng.choice(list(parts)), rng.random()
    if kind < 0.2:
        del parts[name]
    elif kind < 0.5:
        array = np.load(io.BytesIO(parts[name]))
        value = rng.choice(
            (np.nan, -1, 1e300, "x", [], [1, 2], array.ravel()[:1], array.astype("U9"))
        )
        written = io.BytesIO()
        np.save(written, np.asarray(value))
        parts[name] = written.getvalue()
    else:
        head = parts[name][:128]
        mutation = _mutate_text if rng.random() < 0.4 else _mutate_bytes
        try:
            head = mutation(head, rng)
        except UnicodeDecodeError:
            head = _mutate_bytes(head, rng)
        parts[name] = head + parts[name][128:]
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, part in parts.items():
            archive.writestr(zipfile.ZipInfo(name), part)
    return packed.getvalue()


VALUES_OF = {
    ".json": _json, ".gltf": _json, ".yaml": _yaml, ".toml": _toml, ".glb": _glb, ".png": _png,
    ".npz": _npz,
}  # fmt: skip
