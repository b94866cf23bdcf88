"""The small TOML beside a mesh file: what the mesh file itself cannot say."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from omnisim.errors import SceneError, did_you_mean
from omnisim.parameters import Number, Table
from omnisim.toml_file import read_toml

Level = Annotated[Number, Field(ge=0.0)]
Positive = Annotated[Number, Field(gt=0.0)]
Name = Annotated[str, Field(min_length=1, strict=True)]
Point = tuple[Number, Number, Number]
Byte = Annotated[int, Field(ge=0, le=255, strict=True)]
LARGEST_CLASS = 60_000  # of the 16 bits that files have, some are left for what nobody labels
LinearRgb = tuple[Level, Level, Level]


class StartTable(Table):
    """Where to look from when nobody says."""

    position_m: Point
    yaw_deg: Number = 0.0


class NamedStartTable(Table):
    """Where a vehicle may start: its base."""

    name: Name
    position_m: Point
    yaw_deg: Number = 0.0


class ColorBandTable(Table):
    """A landmark's colour up to a height above its base."""

    color: Name
    top_m: Positive


class LandmarkTable(Table):
    """Something that can be recognised by its colours: bands from bottom to top."""

    name: Name
    position_m: Point
    footprint_m: tuple[Positive, Positive]
    bands: Annotated[tuple[ColorBandTable, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _bands_rise(self) -> LandmarkTable:
        for lower, upper in itertools.pairwise(self.bands):
            if not lower.top_m < upper.top_m:
                raise ValueError(
                    f"top_m = {upper.top_m:g}: want more than {lower.top_m:g} below it"
                )
        return self


class ScenePathTable(Table):
    """Where a vehicle may drive: corners on the ground, one after the other."""

    name: Name
    waypoints_m: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=2)]
    start_yaw_deg: Number | None = None


class LabelTable(Table):
    """A class of things: `omnisim/scene/labels.py` says what the keys mean."""

    name: Name
    nodes: Annotated[tuple[Name, ...], Field(min_length=1)]
    color: tuple[Byte, Byte, Byte] | None = None
    id: Annotated[int, Field(ge=1, le=LARGEST_CLASS, strict=True)] | None = None


def _labels_once(tables: tuple[LabelTable, ...]) -> tuple[LabelTable, ...]:
    names = [table.name for table in tables]
    numbers = [table.id for table in tables if table.id is not None]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"name = {name!r}: want each name once")
    for number in numbers:
        if numbers.count(number) > 1:
            raise ValueError(f"id = {number}: want each id once")
    return tables


LabelTables = Annotated[tuple[LabelTable, ...], AfterValidator(_labels_once)]


class LabelFile(Table):
    """A file of labels for a scene that has none, or others."""

    labels: Annotated[LabelTables, Field(min_length=1)]


class SceneFile(Table):
    """The keys of a scene's TOML.

    Attributes:
        file: mesh file, relative to the TOML.
        up_axis: the mesh file's axis that points up; by default the one its format has.
        meters_per_unit: size of the mesh file's unit; by default the one its format has.
        background: linear RGB where nothing is hit.
        start: where to look from when nobody says.
        starts: where vehicles may start, by name.
        paths: where vehicles may drive, by name.
        palette: linear RGB of the colours that landmarks name.
        landmarks: what can be recognised by its colours.
        labels: classes of the instances.
    """

    file: str
    up_axis: Literal["x", "y", "z"] | None = None
    meters_per_unit: Positive | None = None
    background: LinearRgb | None = None
    start: StartTable | None = None
    starts: tuple[NamedStartTable, ...] = ()
    paths: tuple[ScenePathTable, ...] = ()
    palette: dict[Name, LinearRgb] = Field(default_factory=dict)
    landmarks: tuple[LandmarkTable, ...] = ()
    labels: LabelTables = ()

    @field_validator("starts", "paths", "landmarks")
    @classmethod
    def _names_once(
        cls, tables: tuple[NamedStartTable | ScenePathTable | LandmarkTable, ...]
    ) -> tuple[NamedStartTable | ScenePathTable | LandmarkTable, ...]:
        names = [table.name for table in tables]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"name = {name!r}: want each name once")
        return tables

    @field_validator("landmarks")
    @classmethod
    def _colors_known(
        cls, landmarks: tuple[LandmarkTable, ...], info: ValidationInfo
    ) -> tuple[LandmarkTable, ...]:
        palette = info.data.get("palette")
        if palette is None:  # it is wrong itself, which is being said
            return landmarks
        for landmark in landmarks:
            for band in landmark.bands:
                if band.color not in palette:
                    hint = did_you_mean(band.color, palette, "[palette] has")
                    raise ValueError(f"{landmark.name}: color = {band.color!r}: unknown; {hint}")
        return landmarks


def read_scene_file(path: Path) -> SceneFile:
    """Read and check a scene's TOML.

    Raises:
        SceneError: naming file, key, value and what was wanted.
    """
    return read_toml(path, SceneFile, SceneError)
