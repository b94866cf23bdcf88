"""TOML files that extend another one: robot and sensor files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from omnisim.core.errors import OmnisimError
from omnisim.core.files.toml_file import read_tables

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
    lost = {one for key, others in rivals.items() if key in own.keys() - base for one in others}
    base = {key: value for key, value in base.items() if key not in lost}
    return _merged(with_absolute_files(base, path.parent), own)


def with_absolute_files(value: Any, folder: Path, key: str = "") -> Any:
    """Tables in which the names of existing files in a folder are absolute paths.

    Args:
        value: tables, or a value in them.
        folder: folder of their file.
        key: key of the value; `resources` are folders.
    """
    if isinstance(value, Mapping):
        return {name: with_absolute_files(one, folder, name) for name, one in value.items()}
    if isinstance(value, list):
        return [with_absolute_files(one, folder, key) for one in value]
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
        isinstance(one, Mapping) and isinstance(one.get("name"), str) for one in value
    )
