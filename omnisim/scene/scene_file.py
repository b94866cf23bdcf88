"""The small TOML beside a mesh file: what the mesh file itself cannot say."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from omnisim.errors import SceneError
from omnisim.toml_file import Number, Table, read_toml

Level = Annotated[Number, Field(ge=0.0)]


class Start(Table):
    """Where to look from when nobody says."""

    position_m: tuple[Number, Number, Number]
    yaw_deg: Number = 0.0


class SceneFile(Table):
    """The keys of a scene's TOML.

    Attributes:
        file: mesh file, relative to the TOML.
        up_axis: the mesh file's axis that points up; by default the one its format has.
        meters_per_unit: size of the mesh file's unit; by default the one its format has.
        background: linear RGB where nothing is hit.
        start: where to look from when nobody says.
    """

    file: str
    up_axis: Literal["x", "y", "z"] | None = None
    meters_per_unit: Annotated[Number, Field(gt=0.0)] | None = None
    background: tuple[Level, Level, Level] | None = None
    start: Start | None = None


def read_scene_file(path: Path) -> SceneFile:
    """Read and check a scene's TOML.

    Raises:
        SceneError: naming file, key, value and what was wanted.
    """
    return read_toml(path, SceneFile, SceneError)
