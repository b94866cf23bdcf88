"""Drive of a sweep: its settings, and the input files of `omnisim drive`."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from omnisim.core.files.atomic_file import write_text
from omnisim.core.files.fingerprint import fingerprint
from omnisim.core.files.toml_file import toml_text

ROBOT, SCENE = "robot.toml", "scene.toml"


@dataclass(frozen=True)
class SweptDrive:
    """Drive of a sweep."""

    scene: str  # absolute path of a scene file, or name of a built-in scene
    path: str  # absolute path of a file, or name of one of the scene's paths
    robot: Mapping[str, Any]  # tables of the robot file
    # options of `omnisim drive`, without their dashes
    options: Mapping[str, Any] = field(default_factory=dict)
    # tables of the changed sensor files, by their file names in `robot`
    files: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    # tables of a scene file that extends `scene`; empty: none
    scene_tables: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0  # seed of the drive

    @cached_property
    def name(self) -> str:
        """Folder name of the drive; equal drives, of equal files, have equal names."""
        robot = re.sub(r"[^A-Za-z0-9-]+", "-", str(self.robot.get("name", "robot")))[:30]
        given = (self.scene, self.path, self.robot, self.options, self.files, self.scene_tables)
        digest = fingerprint(json.dumps(_plain(given), sort_keys=True))
        return f"{robot}-seed{self.seed}-{digest[:8]}"

    def write(self, folder: Path) -> list[str]:
        """Write robot, scene and sensor files to a folder.

        Returns:
            Arguments of `omnisim drive` that record the drive.

        Raises:
            OutputError: a file cannot be written.
        """
        for name, tables in self.files.items():
            write_text(folder / name, toml_text(tables))
        write_text(folder / ROBOT, toml_text(self.robot))
        scene = self.scene
        if self.scene_tables:
            write_text(folder / SCENE, toml_text({"extends": scene, **self.scene_tables}))
            scene = str((folder / SCENE).absolute())
        arguments = [scene, "--robot", str((folder / ROBOT).absolute()), "--path", self.path]
        arguments += ["--seed", str(self.seed)]
        for key, value in self.options.items():
            flag = f"--{key.replace('_', '-')}"
            if value is not False:
                arguments += [flag] if value is True else [flag, str(value)]
        return arguments


def _plain(value: Any) -> Any:
    """JSON value with integers as floats, so that 1 and 1.0 give the same name.

    The absolute path of a file is followed by a hash of its contents.
    """
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, str) and value.startswith("/") and Path(value).is_file():
        return [value, fingerprint(Path(value).read_bytes().hex())]
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return float(value) if is_whole else value if _is_simple(value) else str(value)


def _is_simple(value: Any) -> bool:
    return value is None or isinstance(value, bool | float | str)
