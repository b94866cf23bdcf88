"""Editable light of the live page's scene: tables of a TOML file that extends the scene."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnisim.core.errors import SceneError
from omnisim.core.files.toml_file import toml_text
from omnisim.scene import Scene

SCENE_FILE = "scene.toml"  # name of a saved scene
Table = dict[str, Any]
# Required keys of a table, with clearly visible values: indoor mist.
_COMPLETE = {"fog": {"color": [0.7, 0.75, 0.8], "visibility_m": 20.0}}
# Command-line options that the tables override.
_OVERRIDDEN_BY = {"--sky": {"sky"}, "--baked": {"sky", "light"}}


@dataclass(frozen=True)
class SceneInLight:
    """Scene that can be reloaded in another light.

    Attributes:
        source: name or path of the scene.
        read: function of a path and tables that reads a TOML file extending the scene. The tables
            take precedence over the command line's options.
    """

    source: str
    read: Callable[[Path, Mapping[str, Any]], Scene]

    def scene(self, tables: Mapping[str, Any]) -> Scene:
        """Load the scene in the light of the tables.

        Raises:
            SceneError: an invalid value; the message names key, actual and expected value.
        """
        path = Path(self.source)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / SCENE_FILE
            source = str(path.resolve()) if path.exists() else self.source
            file.write_text(scene_text(source, tables), encoding="utf-8")
            try:
                scene = self.read(file, tables)
            except SceneError as reason:
                raise SceneError(str(reason).replace(f"{file}: ", "scene.")) from None
        return dataclasses.replace(scene, name=self.source)


def completed(tables: Table) -> Table:
    """Copy of light tables with their required keys, without an empty `light` table."""
    complete = {name: {**_COMPLETE.get(name, {}), **table} for name, table in tables.items()}
    fog = complete.get("fog", {})
    if "attenuation_per_m" in fog:  # an alternative to the visibility
        fog.pop("visibility_m", None)
    return {name: table for name, table in complete.items() if table or name != "light"}


def scene_text(source: str, tables: Mapping[str, Any]) -> str:
    """Text of a TOML file that extends a scene with tables of light."""
    return toml_text({"extends": source, **tables})


def without_overridden(arguments: Sequence[str], tables: Mapping[str, Any]) -> tuple[str, ...]:
    """Arguments of a command line without the options that the tables override."""
    remaining: list[str] = []
    at = 0
    while at < len(arguments):
        if _OVERRIDDEN_BY.get(arguments[at], set()) & tables.keys():
            at += 1  # skips the option's value as well
        else:
            remaining.append(arguments[at])
        at += 1
    return tuple(remaining)
