"""Light of the live page's scene: tables of a scene's TOML that extends it."""

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

SCENE_FILE = "scene.toml"  # of a saved scene
Table = dict[str, Any]
# Keys that a table must have, at values that show: mist of a room.
_COMPLETE = {"fog": {"color": [0.7, 0.75, 0.8], "visibility_m": 20.0}}
# Options of the command line that tables take the place of.
_OVERRULED = {"--sky": {"sky"}, "--baked": {"sky", "light"}}


@dataclass(frozen=True)
class SceneInLight:
    """Scene that can be read again, in another light.

    Attributes:
        source: name or path of the scene.
        read: reads a TOML that extends it, with those of the options that tables leave.
    """

    source: str
    read: Callable[[Path, Mapping[str, Any]], Scene]

    def scene(self, tables: Mapping[str, Any]) -> Scene:
        """Scene in the light of some tables.

        Raises:
            SceneError: naming key, value and what was expected.
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
    """Tables with the keys that they must have, and without empty light."""
    complete = {name: {**_COMPLETE.get(name, {}), **table} for name, table in tables.items()}
    fog = complete.get("fog", {})
    if "attenuation_per_m" in fog:  # the other measure of the same
        fog.pop("visibility_m", None)
    return {name: table for name, table in complete.items() if table or name != "light"}


def scene_text(source: str, tables: Mapping[str, Any]) -> str:
    """Text of a scene's TOML in the light of some tables, which extends another scene."""
    return toml_text({"extends": source, **tables})


def without_overruled(words: Sequence[str], tables: Mapping[str, Any]) -> tuple[str, ...]:
    """Words of a command line without the options that tables take the place of."""
    kept: list[str] = []
    at = 0
    while at < len(words):
        if _OVERRULED.get(words[at], set()) & tables.keys():
            at += 1  # and its value
        else:
            kept.append(words[at])
        at += 1
    return tuple(kept)
