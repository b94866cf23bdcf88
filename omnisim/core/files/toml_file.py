"""TOML files as validated tables, and files that extend another one: robot and sensor files.

Errors name file, key, value and the expected value.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from omnisim.core.errors import OmnisimError
from omnisim.core.files.parameters import Model, parse_table
from omnisim.core.files.sources import note_table


def read_toml(path: Path, model: type[Model], error: type[OmnisimError]) -> Model:
    """Read `path` and validate it against `model`.

    Raises:
        error: the file cannot be read, is not TOML, or does not fit the model; one line per error.
    """
    return parse_table(read_tables(path, error), model, error, str(path))


def read_tables(path: Path, error: type[OmnisimError]) -> dict[str, Any]:
    """Read all tables of `path` without validation.

    Raises:
        error: the file cannot be read, or is not TOML.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as reason:
        raise error(f"{path}: cannot be read: {reason.strerror}") from None
    except UnicodeDecodeError:
        raise error(f"{path}: not a text file: expected TOML in UTF-8") from None
    except tomllib.TOMLDecodeError as reason:
        raise error(f"{path}: not TOML: {reason}") from None
    except (ValueError, RecursionError):
        fault = "a number of thousands of digits, or values nested too deeply"
        raise error(f"{path}: not TOML: expected plain values, got {fault}") from None
    note_table(path, tables)
    return tables


def find_beside(folder: Path, name: str, key: str, error: type[OmnisimError]) -> Path:
    """Find a file named in a TOML file of a folder; `key` names file and key in messages.

    Raises:
        error: the file is missing, or cannot be read.
    """
    path = folder / name
    try:
        is_there = path.is_file()
    except OSError as reason:  # the name is too long, or permission is missing
        raise error(f"{key} = {name!r}: cannot be read: {reason.strerror}") from None
    if not is_there:
        raise error(f"{key} = {name!r}: no such file beside it")
    return path


class Comment(str):
    """Comment among the values of a table to write; its key is ignored."""

    __slots__ = ()


_BARE = re.compile(r"[A-Za-z0-9_-]+")
_CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")


def toml_text(table: Mapping[str, Any], path: str = "") -> str:
    """Table as TOML text: values and comments, then nested tables and lists of tables.

    A key with None is left out; `path` is that of the table in its file.
    """
    given = {key: value for key, value in table.items() if value is not None}
    inner = {key: value for key, value in given.items() if _tables_in(value)}
    lines = [_line(key, value) for key, value in given.items() if key not in inner]
    parts = ["".join(lines)] if lines else []
    for key, value in inner.items():
        below = f"{path}.{_key(key)}" if path else _key(key)
        is_list = not isinstance(value, Mapping)
        header = f"[[{below}]]\n" if is_list else f"[{below}]\n"
        for child in _tables_in(value):
            has_own = is_list or not child or any(not _tables_in(each) for each in child.values())
            parts.append((header if has_own else "") + toml_text(child, below))
    return "\n".join(parts)


def _line(key: str, value: Any) -> str:
    if isinstance(value, Comment):
        return f"# {_CONTROL.sub(' ', value)}\n"
    return f"{_key(key)} = {_value(value)}\n"


def _tables_in(value: Any) -> list[Mapping[str, Any]]:
    if isinstance(value, Mapping):
        return [value]
    if isinstance(value, list | tuple) and value and all(isinstance(x, Mapping) for x in value):
        return list(value)
    return []


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _quoted(key)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {_value(item)}' for key, item in value.items())} }}"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else ("inf" if value > 0.0 else "-inf")
    return json.dumps(value)


# TOML files that extend another one: robot and sensor files.


Tables = Mapping[str, Any]
_KINDS = ("model", "calibration")  # keys that decide which other keys their table has


def base_source(folder: Path, name: str) -> Path | str:
    """Path of a base file relative to the folder of the file that extends it, else its name."""
    beside = folder / name
    try:
        return beside if beside.exists() else name
    except OSError:  # a name too long, which is no file's
        return name


def extended(
    table: Tables,
    source: str,
    error: type[OmnisimError],
    find: Callable[[str | Path], Path] | None = None,
    rivals: Mapping[str, Sequence[str]] = {},
    outer: tuple[Path, ...] = (),
) -> dict[str, Any]:
    """Table merged over that of the file which its key `extends` names, if it has one.

    Keys replace those of the base, tables are merged key by key, and lists of named tables, such as
    sensors, by name. Files of the base keep their place: their names become absolute.

    Args:
        table: table as read.
        source: path of its file, or a name for messages.
        error: exception class to raise.
        find: lookup of a base file by path or built-in name; None: there are no such names.
        rivals: keys that a key excludes; the base loses them if only this file has the key.
        outer: files that are being read.

    Raises:
        error: the base is missing, cannot be read, or extends itself.
    """
    own = {key: value for key, value in table.items() if key != "extends"}
    if "extends" not in table:
        return own
    name, here = table["extends"], (*outer, Path(source).resolve())
    if not isinstance(name, str):
        raise error(f"{source}: extends: expected text, got {name!r}")
    try:
        beside = base_source(Path(source).parent, name)
        path = Path(source).parent / name if find is None else find(beside)
        if path.resolve() in here:
            raise error(f"{path} extends itself")
        base = extended(read_tables(path, error), str(path), error, find, rivals, here)
    except OmnisimError as reason:
        raise error(f"{source}: extends = {name!r}: {reason}") from None
    lost = {other for key, others in rivals.items() if key in own.keys() - base for other in others}
    base = {key: value for key, value in base.items() if key not in lost}
    return _merged(with_absolute_files(base, path.parent), own)


def with_absolute_files(value: Any, folder: Path, key: str = "") -> Any:
    """Tables, or a value in them, in which names of existing files in a folder are absolute.

    `key` is that of the value; `resources` are folders.
    """
    if isinstance(value, Mapping):
        return {name: with_absolute_files(item, folder, name) for name, item in value.items()}
    if isinstance(value, list):
        return [with_absolute_files(item, folder, key) for item in value]
    if not isinstance(value, str):
        return value
    path = folder / value
    try:
        is_there = path.is_dir() if key == "resources" else "." in value and path.is_file()
    except OSError:  # a text too long for a name
        return value
    return str(path.absolute()) if is_there else value


def _merged(base: Any, own: Any) -> Any:
    if isinstance(base, Mapping) and isinstance(own, Mapping):
        if any(key in own and own[key] != base.get(key) for key in _KINDS):
            return dict(own)
        return {**base, **{key: _merged(base.get(key), value) for key, value in own.items()}}
    if not (_are_named(base) and _are_named(own)):
        return own
    added = {table["name"]: table for table in own}
    merged = [_merged(table, added.pop(table["name"], {})) for table in base]
    return merged + [table for table in own if table["name"] in added]


def _are_named(value: Any) -> bool:
    """True for a list of tables that have names."""
    return isinstance(value, list) and all(
        isinstance(item, Mapping) and isinstance(item.get("name"), str) for item in value
    )
