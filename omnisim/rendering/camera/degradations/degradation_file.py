"""The `[degradation]` table of a sensor file, and presets.

[degradation]
preset = "dragonfly2"     # a name, or a file of such tables without `degradation.` before them

[degradation.noise]       # on top of the preset, key by key
read_noise_e = 20.0

[degradation.jpeg]
enabled = false           # off, whatever the preset says
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import create_model

from omnisim.core.errors import OpticsError, SensorFileError, did_you_mean
from omnisim.core.files.parameters import Table, parse_table, table_of
from omnisim.core.files.toml_file import find_beside, read_toml
from omnisim.core.package_files import PRESETS, preset_names
from omnisim.rendering.camera.degradations.degradation import EFFECT_MODULES, Degradation
from omnisim.rendering.camera.degradations.effect import Effect

# Effects by table name, in the order of the light path.
EFFECTS: dict[str, type[Effect]] = {
    module: getattr(import_module(f"{__package__}.{module}"), name)
    for name, module in EFFECT_MODULES.items()
}
_Tables = dict[str, dict[str, Any]]  # values by key, by effect


@cache
def _preset_table() -> type[Table]:
    """Table of a preset file: one table per effect, with the key `enabled`."""
    fields: dict[str, Any] = {}
    for name, kind in EFFECTS.items():
        table = create_model(f"{kind.__name__}Table", __base__=table_of(kind), enabled=(bool, True))
        fields[name] = (table | None, None)
    return create_model("PresetTable", __base__=Table, **fields)


@cache
def degradation_table() -> type[Table]:
    """Table `[degradation]` of a sensor file."""
    return create_model("DegradationTable", __base__=_preset_table(), preset=(str | None, None))


def preset(name: str, folder: Path = Path()) -> Degradation:
    """Degradation of a preset.

    Args:
        name: name of a preset of omnisim, or a file that ends in .toml.
        folder: base folder of a relative file path.

    Raises:
        SensorFileError: the preset does not exist or is faulty; names file, key, value and the
            expected value.
    """
    tables, source = _read_preset(name, folder, f"preset {name!r}: ")
    return _build(tables, source, "")


def parse_degradation(table: Mapping[str, Any], source: str, folder: Path) -> Degradation:
    """Degradation of a `[degradation]` table: its effects override its preset's, key by key.

    Args:
        table: table as read from TOML.
        source: name of the file in messages.
        folder: base folder of a relative preset file path.

    Raises:
        SensorFileError: names file, key, value and the expected value.
    """
    checked = parse_table(table, degradation_table(), SensorFileError, source, "degradation")
    given = checked.model_dump(exclude_unset=True)
    name, tables = given.pop("preset", None), _Tables()
    if name is not None:
        where = f"{source}: degradation.preset = {name!r}: "
        tables, _ = _read_preset(name, folder, where)
    _find_files(given, source, "degradation.", folder)
    for key, values in given.items():
        tables[key] = {**tables.get(key, {}), **values}
    return _build(tables, source, "degradation.")


def _read_preset(name: str, folder: Path, where: str) -> tuple[_Tables, str]:
    """Tables of a preset and its file; `where` begins the message about an unknown one."""
    names = preset_names()
    if name.endswith(".toml"):
        path = folder / name
    elif name in names:
        path = PRESETS / f"{name}.toml"
    else:
        hint = did_you_mean(name, [*names, "a file that ends in .toml"])
        raise SensorFileError(f"{where}unknown preset; {hint}")
    tables = read_toml(path, _preset_table(), SensorFileError).model_dump(exclude_unset=True)
    _find_files(tables, str(path), "", path.parent)
    return tables, str(path)


def _find_files(tables: _Tables, source: str, prefix: str, folder: Path) -> None:
    """Resolve file names in tables against the folder of their TOML file."""
    for name, values in tables.items():
        for key in EFFECTS[name].files:
            if values.get(key) is not None:
                where = f"{source}: {prefix}{name}.{key}"
                values[key] = str(find_beside(folder, values[key], where, SensorFileError))


def _build(tables: _Tables, source: str, prefix: str) -> Degradation:
    """Degradation of checked tables, whose names have the prefix in their file."""
    parts: dict[str, Any] = {}
    try:
        for name, values in tables.items():
            if values.pop("enabled", True):
                parts[name] = EFFECTS[name](**values)
        return Degradation(**parts)
    except OpticsError as reason:
        message = str(reason).replace("degradation.", prefix)
        raise SensorFileError(f"{source}: {message}") from None
