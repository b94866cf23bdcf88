"""TOML of a scene, beside its mesh file: start poses, routes, landmarks, labels."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from omnisim.errors import did_you_mean
from omnisim.parameters import Number, Signed, Table

Level = Annotated[Number, Field(ge=0.0)]
Positive = Annotated[Number, Field(gt=0.0)]
Name = Annotated[str, Field(min_length=1, strict=True)]
Point = tuple[Signed, Signed, Signed]
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
    """Metres in the world, z up."""
    yaw_deg: Number = 0.0
    """Heading in degrees, counter-clockwise from the world's x."""


class NamedStartTable(StartTable):
    """Start pose of a vehicle's base."""

    name: Name
    """Name of the start pose, distinct."""


class ColorBandTable(Table):
    """Colour of a landmark up to a height above its base."""

    color: Name
    """Name of a colour of [palette]."""
    top_m: Positive
    """Upper end of the band in metres above the landmark's base; it begins where the one below
    ends."""


class LandmarkTable(Table):
    """Object recognised by its colours: bands from bottom to top."""

    name: Name
    """Name of the landmark, distinct; names of its nodes begin with it."""
    position_m: Point
    """Middle of its base in the world, metres."""
    footprint_m: tuple[Positive, Positive]
    """Extents along the world's x and y, metres."""
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
    """Name of the path, distinct."""
    waypoints_m: Annotated[tuple[tuple[Signed, Signed], ...], Field(min_length=2)]
    """Corners [x, y] on the ground in order, metres in the world."""
    start_yaw_deg: Number | None = None
    """Heading at the first corner in degrees; left out: towards the second."""


class LabelTable(Table):
    """Class of instances; `omnisim/scene/labels.py` explains the keys."""

    name: Name
    """Name of the class, distinct."""
    nodes: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of nodes; `*` and `?` stand for any letters; the first table that matches is taken."""
    color: tuple[Byte, Byte, Byte] | None = None
    """8-bit sRGB in pictures; chosen where it is left out."""
    id: Annotated[int, Field(ge=1, le=LARGEST_CLASS, strict=True)] | None = None
    """ID of the class in the channel; the next free one where it is left out."""


LabelTables = Annotated[tuple[LabelTable, ...], _distinct("name"), _distinct("id")]


class LabelFile(Table):
    """Label file: classes for a scene that has none, or others."""

    labels: Annotated[LabelTables, Field(min_length=1)]


class SceneFile(Table):
    """Keys of a scene's TOML."""

    file: str
    """Mesh file, relative to this file."""
    up_axis: Literal["x", "y", "z"] | None = None
    """Axis of the mesh file that points up; left out: as its format has it."""
    meters_per_unit: Positive | None = None
    """Metres in a unit of the mesh file; left out: as its format has it."""
    background: LinearRgb | None = None
    """Linear RGB where nothing is hit; left out: a pale sky."""
    start: StartTable | None = None
    starts: Annotated[tuple[NamedStartTable, ...], _distinct("name")] = ()
    paths: Annotated[tuple[ScenePathTable, ...], _distinct("name")] = ()
    palette: dict[Name, LinearRgb] = Field(default_factory=dict)
    """Linear RGB of the landmarks' colours, by name."""
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
