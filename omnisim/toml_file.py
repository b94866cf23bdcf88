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
