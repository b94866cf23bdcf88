"""TOML of a scene, beside its mesh file: start poses, routes, landmarks, labels."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from omnisim.core.errors import did_you_mean
from omnisim.core.files.parameters import AboveZero, Flag, Level, Name, Number, Point, Signed, Table
from omnisim.scene.light.light_tables import FogTable, LampTable, LightTable, SkyTable, SunTable

Byte = Annotated[int, Field(ge=0, le=255, strict=True)]
MAX_CLASS = 60_000  # files have 16 bits; some are left for the unlabeled
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


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("expected a number other than 0")
    return value


class StartTable(Table):
    """Default pose of the camera; left out: near the middle, clear of surfaces."""

    position_m: Point
    """Meters in the world, z up."""
    yaw_deg: Number = 0.0
    """Heading in degrees, counter-clockwise from the world's x."""


class NamedStartTable(StartTable):
    """Start pose of a vehicle's base."""

    name: Name
    """Name of the start pose, distinct."""


class ColorBandTable(Table):
    """Color of a landmark up to a height above its base."""

    color: Name
    """Name of a color of [palette]."""
    top_m: AboveZero
    """Upper end of the band in meters above the landmark's base; it begins where the one below
    ends."""


class LandmarkTable(Table):
    """Object recognized by its colors: bands from bottom to top."""

    name: Name
    """Name of the landmark, distinct; names of its nodes begin with it."""
    position_m: Point
    """Middle of its base in the world, meters."""
    footprint_m: tuple[AboveZero, AboveZero]
    """Extents along the world's x and y, meters."""
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
    """Corners [x, y] on the ground in order, meters in the world."""
    start_yaw_deg: Number | None = None
    """Heading at the first corner in degrees; left out: towards the second."""


class ObjectPathTable(Table):
    """Motion along straight legs; at rest before the first time and after the last."""

    times_s: Annotated[tuple[Number, ...], Field(min_length=1)]
    """Times of the positions in seconds, increasing."""
    positions_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    """Positions of the object's origin at these times, meters in the world."""
    yaw_deg: tuple[Number, ...] | None = None
    """Headings at these times, degrees; left out: 0."""
    repeats: Flag = False
    """True: it begins again at its last time."""


class ObjectTrajectoryTable(Table):
    """Motion along the poses of a trajectory file."""

    file: Name
    """Trajectory file with times, relative to this file."""
    repeats: Flag = False
    """True: it begins again at its last time."""


class OrbitTable(Table):
    """Motion around a level circle, facing ahead."""

    center_m: Point
    """Center of the circle, meters in the world."""
    radius_m: AboveZero
    """Radius of the circle in meters."""
    period_s: Annotated[Number, AfterValidator(_not_zero)]
    """Seconds of a turn; less than 0: clockwise."""
    start_deg: Number = 0.0
    """Direction from the center at 0 s, degrees from the world's x."""


class ShuttleTable(Table):
    """Motion to a point and back, slow at both ends."""

    from_m: Point
    """Start at 0 s, meters in the world."""
    to_m: Point
    """Other end, which it faces."""
    period_s: AboveZero
    """Seconds of the way there and back."""


MotionTable = ObjectPathTable | ObjectTrajectoryTable | OrbitTable | ShuttleTable


class ObjectTable(Table):
    """Object that moves by the world's time: one of path, trajectory, orbit and shuttle; without
    them it rests."""

    name: Name
    """Name of the object, distinct."""
    file: Name
    """Mesh file, or a scene's TOML, relative to this file."""
    up_axis: Literal["x", "y", "z"] | None = None
    """Axis of the mesh file that points up; left out: as its format has it."""
    animation: Name | None = None
    """Name of the animation of a glTF file that deforms its meshes; left out: none."""
    position_m: Point | None = None
    """Position of its origin where it rests, meters in the world; left out: the origin."""
    yaw_deg: Number | None = None
    """Heading where it rests, degrees; left out: 0."""
    mass_kg: Annotated[Number, Field(ge=1e-3, le=1e6)] | None = None
    """Kilograms of an object at rest that robots push with `--physics`; left out: they cannot."""
    rolling_radius_m: AboveZero | None = None
    """Radius of a ball that rolls along its motion without slipping; left out: it does not."""
    path: ObjectPathTable | None = None
    trajectory: ObjectTrajectoryTable | None = None
    orbit: OrbitTable | None = None
    shuttle: ShuttleTable | None = None

    @model_validator(mode="after")
    def _one_motion(self) -> ObjectTable:
        given = [key for key, value in self if isinstance(value, MotionTable)]
        if len(given) > 1:
            raise ValueError(f"expected one motion, got {' and '.join(given)}")
        if given and (self.position_m is not None or self.yaw_deg is not None):
            raise ValueError(f"expected position_m and yaw_deg without a motion, got {given[0]}")
        if given and self.mass_kg is not None:
            raise ValueError(f"mass_kg: expected no motion, got {given[0]}")
        if not given and self.rolling_radius_m is not None:
            raise ValueError("rolling_radius_m: expected a motion")
        return self

    @property
    def motion(self) -> MotionTable | None:
        """Table of its motion; None: it rests."""
        return next((value for _, value in self if isinstance(value, MotionTable)), None)


class LabelTable(Table):
    """Class of instances; `omnisim/scene/labels.py` explains the keys."""

    name: Name
    """Name of the class, distinct."""
    nodes: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of nodes; `*` and `?` stand for any letters; the first table that matches is taken."""
    color: tuple[Byte, Byte, Byte] | None = None
    """8-bit sRGB in images; chosen where it is left out."""
    id: Annotated[int, Field(ge=1, le=MAX_CLASS, strict=True)] | None = None
    """ID of the class in the channel; the next free one where it is left out."""


LabelTables = Annotated[tuple[LabelTable, ...], _distinct("name"), _distinct("id")]


class LabelFile(Table):
    """Label file: classes for a scene that has none, or others."""

    labels: Annotated[LabelTables, Field(min_length=1)]


class SceneFile(Table):
    """Keys of a scene's TOML."""

    synonyms: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("scale", "unit", "units", "unit_scale"), "meters_per_unit"),
        **dict.fromkeys(("up", "axis_up", "upAxis"), "up_axis"),
        **dict.fromkeys(("mesh", "model", "scene"), "file"),
    }
    file: str | None = None
    """Mesh file, relative to this file."""
    extends: Name | None = None
    """Scene that this one adds to, instead of a mesh file: a built-in name, or a file relative to
    this one."""
    up_axis: Literal["x", "y", "z"] | None = None
    """Axis of the mesh file that points up; left out: as its format has it."""
    meters_per_unit: AboveZero | None = None
    """Meters in a unit of the mesh file; left out: as its format has it."""
    animation: Name | None = None
    """Name of the animation of a glTF file that is played, over and over; "none": none; left out:
    the first."""
    background: LinearRgb | None = None
    """Linear RGB where nothing is hit; left out: a pale sky."""
    light: LightTable = Field(default_factory=LightTable)
    lamps: tuple[LampTable, ...] = ()
    sun: SunTable | None = None
    sky: SkyTable | None = None
    fog: FogTable | None = None
    start: StartTable | None = None
    starts: Annotated[tuple[NamedStartTable, ...], _distinct("name")] = ()
    paths: Annotated[tuple[ScenePathTable, ...], _distinct("name")] = ()
    palette: dict[Name, LinearRgb] = Field(default_factory=dict)
    """Linear RGB of the landmarks' colors, by name."""
    landmarks: Annotated[tuple[LandmarkTable, ...], _distinct("name")] = ()
    labels: LabelTables = ()
    objects: Annotated[tuple[ObjectTable, ...], _distinct("name")] = ()

    @property
    def has_own_light(self) -> bool:
        """Light on surfaces is not that of a scene that it extends."""
        tables = (self.lamps, self.sun, self.sky, self.light.baked)
        return any(tables) or self.light.has_own_light

    @property
    def has_own_sky(self) -> bool:
        """Sky and sun are not those of a scene that it extends."""
        return any((self.sun, self.sky, self.light.sky))

    @model_validator(mode="after")
    def _one_source(self) -> SceneFile:
        if self.file is None and self.extends is None:
            raise ValueError("missing; expected a mesh file, or in extends a scene")
        if self.file is not None and self.extends is not None:
            raise ValueError("expected either file or extends, got both")
        if self.extends is not None and (self.up_axis or self.meters_per_unit):
            raise ValueError("expected no up_axis and no meters_per_unit with extends")
        if self.extends is not None and self.animation is not None:
            raise ValueError("expected no animation with extends")
        if self.light.sky is not None and (self.sun or self.sky):
            raise ValueError("light.sky: expected no sun and no sky beside it")
        return self

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
