"""TOML files as checked tables, with errors that name file, key, value and what was expected."""

from __future__ import annotations

import tomllib
from pathlib import Path

from omnisim.errors import OmnisimError
from omnisim.parameters import Model, parse_table


def read_toml(path: Path, model: type[Model], error: type[OmnisimError]) -> Model:
    """Read `path` as `model`.

    Raises:
        error: the file cannot be read, is not TOML, or does not fit the model; one line for each
            fault.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as reason:
        raise error(f"{path}: cannot be read: {reason.strerror}") from None
    except UnicodeDecodeError:
        raise error(f"{path}: not a text file: expected TOML in UTF-8") from None
    except tomllib.TOMLDecodeError as reason:
        raise error(f"{path}: not TOML: {reason}") from None
    except (ValueError, RecursionError):
        fault = "a number of thousands of digits, or too deep a nesting"
        raise error(f"{path}: not TOML: expected plain values, got {fault}") from None
    return parse_table(data, model, error, str(path))


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
