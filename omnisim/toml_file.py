"""TOML files as checked tables, with errors that name file, key, value and what was expected."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omnisim.errors import OmnisimError
from omnisim.parameters import Model, parse_table


def read_toml(path: Path, model: type[Model], error: type[OmnisimError]) -> Model:
    """Read `path` as `model`.

    Raises:
        error: the file cannot be read, is not TOML, or does not fit the model; one line for each
            fault.
    """
    return parse_table(read_tables(path, error), model, error, str(path))


def read_tables(path: Path, error: type[OmnisimError]) -> dict[str, Any]:
    """Read all tables of `path`, unchecked.

    Raises:
        error: the file cannot be read, or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as reason:
        raise error(f"{path}: cannot be read: {reason.strerror}") from None
    except UnicodeDecodeError:
        raise error(f"{path}: not a text file: expected TOML in UTF-8") from None
    except tomllib.TOMLDecodeError as reason:
        raise error(f"{path}: not TOML: {reason}") from None
    except (ValueError, RecursionError):
        fault = "a number of thousands of digits, or too deep a nesting"
        raise error(f"{path}: not TOML: expected plain values, got {fault}") from None


def find_beside(folder: Path, name: str, key: str, error: type[OmnisimError]) -> Path:
    """Find a file that a TOML names; `key` names file and key in messages.

    Raises:
        error: it is not there, or cannot be read.
    """
    path = folder / name
    try:
        is_there = path.is_file()
    except OSError as reason:  # a name too long, a folder without permission
        raise error(f"{key} = {name!r}: cannot be read: {reason.strerror}") from None
    if not is_there:
        raise error(f"{key} = {name!r}: no such file beside it")
    return path


def toml_keys(values: Mapping[str, Any]) -> str:
    """Keys and plain values, a line each.

    Numbers, lists of numbers, words, true and false are written alike in JSON and in TOML.
    """
    return "".join(f"{key} = {_value(value)}\n" for key, value in values.items())


def toml_tables(values: Mapping[str, Any], prefix: str = "") -> tuple[str, str]:
    """Plain keys, and tables and lists of tables; `prefix` is before the names of these."""
    own, parts = {}, ""
    for key, value in values.items():
        if isinstance(value, Mapping):
            parts += f"\n[{prefix}{key}]\n{toml_keys(value)}"
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            parts += "".join(f"\n[[{prefix}{key}]]\n{toml_keys(table)}" for table in value)
        else:
            own[key] = value
    return toml_keys(own), parts


def _value(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
