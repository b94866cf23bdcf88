"""TOML of a scene, beside its mesh file: start poses, routes, landmarks, labels."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from omnisim.errors import did_you_mean
from omnisim.parameters import Number, Table

Level = Annotated[Number, Field(ge=0.0)]
Positive = Annotated[Number, Field(gt=0.0)]
Name = Annotated[str, Field(min_length=1, strict=True)]
Point = tuple[Number, Number, Number]
Byte = Annotated[int, Field(ge=0, le=255, strict=True)]
LARGEST_CLASS = 60_000  # files have 16 bits; some are left for the unlabelled
LinearRgb = tuple[Level, Level, Level]


def _distinct(key: str) -> AfterValidator:
    """Refuses tables with the same value of a key."""

    def check(tables: tuple[Table, ...]) -> tuple[Table, ...]:
        values = [value for table in tables if (value := getattr(table, key)) is not None]
        for value in values:
            if values.count(value) > 1:
                raise ValueError(f"{key} = {value!r}: expected each {key} once")
        return tables

    return AfterValidator(check)


class StartTable(Table):
    """Default pose of the camera."""

    position_m: Point
    yaw_deg: Number = 0.0


class NamedStartTable(StartTable):
    """Start pose of a vehicle's base."""

    name: Name


class ColorBandTable(Table):
    """Colour of a landmark up to a height above its base."""

    color: Name
    top_m: Positive


class LandmarkTable(Table):
    """Object recognised by its colours: bands from bottom to top."""

    name: Name
    position_m: Point
    footprint_m: tuple[Positive, Positive]
    bands: Annotated[tuple[ColorBandTable, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _bands_rise(self) -> LandmarkTable:
        for lower, upper in itertools.pairwise(self.bands):
            if not lower.top_m < upper.top_m:
                raise ValueError(
                    f"top_m: expected more than {lower.top_m:g} below it, got {upper.top_m:g}"
                )
        return self


class ScenePathTable(Table):
    """Route of a vehicle: corners on the ground, in order."""

    name: Name
    waypoints_m: Annotated[tuple[tuple[Number, Number], ...], Field(min_length=2)]
    start_yaw_deg: Number | None = None


class LabelTable(Table):
    """Class of instances; `omnisim/scene/labels.py` explains the keys."""

    name: Name
    nodes: Annotated[tuple[Name, ...], Field(min_length=1)]
    color: tuple[Byte, Byte, Byte] | None = None
    id: Annotated[int, Field(ge=1, le=LARGEST_CLASS, strict=True)] | None = None


LabelTables = Annotated[tuple[LabelTable, ...], _distinct("name"), _distinct("id")]


class LabelFile(Table):
    """Label file: classes for a scene that has none, or others."""

    labels: Annotated[LabelTables, Field(min_length=1)]


class SceneFile(Table):
    """Keys of a scene's TOML.

    Attributes:
        file: mesh file, relative to the TOML.
        up_axis: the mesh file's axis that points up; by default the one its format has.
        meters_per_unit: size of the mesh file's unit; by default the one its format has.
        background: linear RGB where nothing is hit.
        start: default pose of the camera.
        starts: start poses of vehicles.
        paths: routes of vehicles.
        palette: linear RGB of the landmarks' colours, by name.
        landmarks: objects recognised by their colours.
        labels: classes of the instances.
    """

    file: str
    up_axis: Literal["x", "y", "z"] | None = None
    meters_per_unit: Positive | None = None
    background: LinearRgb | None = None
    start: StartTable | None = None
    starts: Annotated[tuple[NamedStartTable, ...], _distinct("name")] = ()
    paths: Annotated[tuple[ScenePathTable, ...], _distinct("name")] = ()
    palette: dict[Name, LinearRgb] = Field(default_factory=dict)
    landmarks: Annotated[tuple[LandmarkTable, ...], _distinct("name")] = ()
    labels: LabelTables = ()

    @field_validator("landmarks")
    @classmethod
    def _colors_known(
        cls, landmarks: tuple[LandmarkTable, ...], info: ValidationInfo
    ) -> tuple[LandmarkTable, ...]:
        palette = info.data.get("palette")
        if palette is None:  # faulty itself, which is reported
            return landmarks
        for landmark in landmarks:
            for band in landmark.bands:
                if band.color not in palette:
                    hint = did_you_mean(band.color, palette, "[palette] has")
                    raise ValueError(f"{landmark.name}: color = {band.color!r}: unknown; {hint}")
        return landmarks
