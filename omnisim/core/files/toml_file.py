"""TOML files as validated tables; errors name file, key, value and the expected value."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Mapping
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
        fault = "a number of thousands of digits, or too deep a nesting"
        raise error(f"{path}: not TOML: expected plain values, got {fault}") from None
    note_table(path, tables)
    return tables


def find_beside(folder: Path, name: str, key: str, error: type[OmnisimError]) -> Path:
    """Find a file named in a TOML file; `key` names file and key in messages.

    Args:
        folder: folder of the TOML file.
        name: path relative to the folder, or absolute.
        key: file and key, for messages.
        error: exception class to raise.

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
    """Table as TOML text: values first, then nested tables and lists of tables.

    Args:
        table: strings, numbers, booleans, lists, tables and comments; a key with None is left out.
        path: path of the table in its file.
    """
    given = {key: value for key, value in table.items() if value is not None}
    inner = {key: value for key, value in given.items() if _tables_in(value)}
    lines = [_line(key, value) for key, value in given.items() if key not in inner]
    parts = ["".join(lines)] if lines else []
    for key, value in inner.items():
        below = f"{path}.{_key(key)}" if path else _key(key)
        is_list = not isinstance(value, Mapping)
        header = f"[[{below}]]\n" if is_list else f"[{below}]\n"
        for one in _tables_in(value):
            has_own = is_list or not one or any(not _tables_in(each) for each in one.values())
            parts.append((header if has_own else "") + toml_text(one, below))
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
        return f"[{', '.join(_value(one) for one in value)}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {_value(one)}' for key, one in value.items())} }}"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else ("inf" if value > 0.0 else "-inf")
    return json.dumps(value)
