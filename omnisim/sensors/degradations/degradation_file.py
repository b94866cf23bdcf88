"""The `[degradation]` table of a sensor file, and presets.

[degradation]
preset = "dragonfly2"     # a name, or a file of such tables without `degradation.` before them

[degradation.noise]       # on top of the preset, key by key
read_noise_e = 20.0

[degradation.jpeg]
enabled = false           # off, whatever the preset says
"""

from __future__ import annotations

import dataclasses
import difflib
from pathlib import Path
from typing import Any, get_args, get_type_hints

from pydantic import create_model

from omnisim.errors import OpticsError, SensorFileError
from omnisim.parameters import Table, parse_table
from omnisim.sensors.degradations.degradation import Degradation
from omnisim.sensors.degradations.parameters import Parameters, table_of
from omnisim.toml_file import read_toml

PRESETS = Path(__file__).resolve().parents[1] / "presets"


def _parts() -> dict[str, type[Parameters]]:
    hints = get_type_hints(Degradation)
    return {field.name: get_args(hints[field.name])[0] for field in dataclasses.fields(Degradation)}


PARTS = _parts()  # the parameter class of each table
PresetTable = create_model(
    "PresetTable",
    __base__=Table,
    **{
        name: (
            create_model(f"{kind.__name__}Table", __base__=table_of(kind), enabled=(bool, True))
            | None,
            None,
        )
        for name, kind in PARTS.items()
    },
)
DegradationTable = create_model("DegradationTable", __base__=PresetTable, preset=(str | None, None))


def preset_names() -> list[str]:
    """Names of the presets that ship with omnisim."""
    return sorted(path.stem for path in PRESETS.glob("*.toml"))


def preset(name: str, folder: Path = Path()) -> Degradation:
    """The degradations of a preset.

    Args:
        name: of one that ships with omnisim, or a file that ends in .toml.
        folder: where such a file is looked for.

    Raises:
        SensorFileError: there is none, or it has a fault: naming file, key, value and what was
            wanted.
    """
    path, tables = _preset_tables(name, folder, "")
    return _made(tables, str(path), "")


def from_table(table: Table, source: str, folder: Path) -> Degradation:
    """The degradations of a checked `[degradation]` table, on top of its preset.

    Args:
        table: a `DegradationTable`.
        source: names the file in messages.
        folder: where the file is: a preset's file is looked for there.

    Raises:
        SensorFileError: naming file, key, value and what was wanted.
    """
    given = table.model_dump(exclude_unset=True)
    name = given.pop("preset", None)
    tables: dict[str, Any] = {}
    if name is not None:
        _, tables = _preset_tables(name, folder, f"{source}: degradation.preset = {name!r}: ")
    for key, values in given.items():
        if values is not None:
            tables[key] = {**tables.get(key, {}), **values}
    return _made(tables, source, "degradation.")


def _preset_tables(name: str, folder: Path, where: str) -> tuple[Path, dict[str, Any]]:
    if name.endswith(".toml"):
        path = folder / name
    elif name in preset_names():
        path = PRESETS / f"{name}.toml"
    else:
        near = difflib.get_close_matches(name, preset_names(), n=1, cutoff=0.4)
        hint = f"did you mean {near[0]!r}? " if near else ""
        wanted = f"{hint}want one of {', '.join(preset_names())}, or a file that ends in .toml"
        raise SensorFileError(f"{where or f'preset {name!r}: '}unknown preset; {wanted}")
    return path, read_toml(path, PresetTable, SensorFileError).model_dump(exclude_unset=True)


def _made(tables: dict[str, Any], source: str, prefix: str) -> Degradation:
    """The degradations of tables whose names have the prefix in their file."""
    checked = parse_table(tables, PresetTable, SensorFileError, source)
    try:
        parts = {}
        for name, kind in PARTS.items():
            values = getattr(checked, name)
            if values is not None and values.enabled:
                parts[name] = kind(**values.model_dump(exclude={"enabled"}))
        return Degradation(**parts)
    except OpticsError as reason:
        told = str(reason).replace("degradation.", prefix)
        raise SensorFileError(f"{source}: {told}") from None
