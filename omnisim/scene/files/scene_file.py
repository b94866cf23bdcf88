"""TOML file of a scene, next to its mesh file: start poses, routes, landmarks, labels."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from omnisim.core.errors import did_you_mean
from omnisim.core.files.parameters import AboveZero, Flag, Name, Number, Point, Table, overriding
from omnisim.scene import parts
from omnisim.scene.light.light_tables import FogTable, LampTable, LightTable, SkyTable, SunTable
from omnisim.scene.motion.object_motion import FreeBody, Orbit, Shuttle


def _distinct(key: str) -> AfterValidator:
    """Validator that rejects tables with equal values of a key."""

    def check(tables: tuple[Any, ...]) -> tuple[Any, ...]:
        values = [value for table in tables if (value := getattr(table, key)) is not None]
        for value in values:
            if values.count(value) > 1:
                raise ValueError(f"{key} = {value!r}: expected each {key} once")
        return tables

    return AfterValidator(check)


@overriding(parts.StartPose, defaults={})
class StartTable(Table):
    """Default camera pose. If omitted, it is near the middle of the scene, clear of surfaces."""


@overriding(parts.ColorBand, "color", "top_m", defaults={})
class ColorBandTable(Table):
    """Color of a landmark, in [palette], up to a height above its base.

    Each band starts at the top of the previous one.
    """

    if TYPE_CHECKING:
        color: str
        top_m: float


@overriding(parts.Landmark, defaults={})
class LandmarkTable(Table):
    """Object recognized by its colors: bands from bottom to top."""

    if TYPE_CHECKING:
        name: str
        position_m: Point
        footprint_m: tuple[float, float]
    bands: Annotated[tuple[ColorBandTable, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _bands_rise(self) -> LandmarkTable:
        for lower, upper in itertools.pairwise(self.bands):
            if not lower.top_m < upper.top_m:
                raise ValueError(
                    f"top_m: expected more than {lower.top_m:g} below it, got {upper.top_m:g}"
                )
        return self


class ObjectPathTable(Table):
    """Motion along straight legs, at rest before the first time and after the last."""

    times_s: Annotated[tuple[Number, ...], Field(min_length=1)]
    """Times of the positions, s, increasing."""
    positions_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    """Positions of the object's origin at these times, world frame, m."""
    yaw_deg: tuple[Number, ...] | None = None
    """Headings at these times, degrees. Default: 0."""
    repeats: Flag = False
    """Restart the motion at its last time."""


class ObjectTrajectoryTable(Table):
    """Motion along the poses of a trajectory file."""

    file: Name
    """Trajectory file with times, relative to this file."""
    repeats: Flag = False
    """Restart the motion at its last time."""


MotionTable = ObjectPathTable | ObjectTrajectoryTable | Orbit | Shuttle


@overriding(
    FreeBody, order=("name", "file", "up_axis", "animation", "position_m", "yaw_deg", "mass_kg")
)
class ObjectTable(Table):
    """Dynamic object, moved by one of path, trajectory, orbit and shuttle; static without them."""

    if TYPE_CHECKING:
        position_m: Point | None
        yaw_deg: float | None
        mass_kg: float | None
    name: Name
    """Name of the object, unique."""
    file: Name
    """Mesh file or scene TOML file, relative to this file."""
    up_axis: Literal["x", "y", "z"] | None = None
    """Up axis of the mesh file. Default: that of its format."""
    animation: Name | None = None
    """Name of the glTF animation that deforms the object's meshes. Default: no animation."""
    rolling_radius_m: AboveZero | None = None
    """Radius of a ball that rolls along its motion without slipping. Default: no rolling."""
    path: ObjectPathTable | None = None
    trajectory: ObjectTrajectoryTable | None = None
    orbit: Orbit | None = None
    shuttle: Shuttle | None = None

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
            raise ValueError("rolling_radius_m: requires a motion")
        return self

    @property
    def motion(self) -> MotionTable | None:
        """Table of the object's motion; None: static."""
        return next((value for _, value in self if isinstance(value, MotionTable)), None)


@overriding(parts.LabelRule, defaults={"color": None, "id": None}, order=("name", "nodes", "color"))
class LabelTable(Table):
    """Class of instances; `omnisim/scene/labels.py` explains the keys."""

    if TYPE_CHECKING:
        id: int | None
        color: tuple[int, int, int] | None


LabelTables = Annotated[tuple[LabelTable, ...], _distinct("name"), _distinct("id")]


class LabelFile(Table):
    """Label file: classes for a scene without any, or in place of its own."""

    labels: Annotated[LabelTables, Field(min_length=1)]


KEYS = (
    "metallic", "roughness", "specular", "specular_color", "ior", "clearcoat",
    "clearcoat_roughness", "transmission", "thickness_m", "attenuation_color",
    "attenuation_distance_m", "dispersion", "emissive",
)  # fmt: skip


@overriding(parts.Material, *KEYS)
class MaterialTable(Table):
    """Change of materials of the mesh file or of the base scene.

    Values replace the file's factors, and multiply its maps and vertex colors, as in glTF. Of
    several tables that match a material, each is applied, in their order.
    """

    names: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Patterns of material names with the wildcards `*` and `?`."""
    base_color: parts.Shares | None = None
    """Linear RGB; multiplied with the texture."""

    @property
    def changes(self) -> dict[str, Any]:
        """Values of the keys that are given, by the names of `Material`'s attributes."""
        return self.model_dump(exclude={"names"}, exclude_none=True)

    @model_validator(mode="after")
    def _has_changes(self) -> MaterialTable:
        if not self.changes:
            raise ValueError("expected a key besides names, such as roughness")
        return self


class SceneFile(Table):
    """Keys of a scene's TOML file."""

    synonyms: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("scale", "unit", "units", "unit_scale"), "meters_per_unit"),
        **dict.fromkeys(("up", "axis_up", "upAxis"), "up_axis"),
        **dict.fromkeys(("mesh", "model", "scene"), "file"),
    }
    file: str | None = None
    """Mesh file, relative to this file."""
    extends: Name | None = None
    """Base scene that this one extends, instead of a mesh file: a built-in name, or a file relative
    to this one."""
    up_axis: Literal["x", "y", "z"] | None = None
    """Up axis of the mesh file. Default: that of its format."""
    meters_per_unit: AboveZero | None = None
    """Unit of the mesh file in meters. Default: that of its format."""
    animation: Name | None = None
    """Name of the glTF animation to play in a loop; "none": no animation. Default: the first
    animation."""
    urdf_materials: Literal["robot", "mesh"] | None = None
    """Materials of a URDF's meshes: those of the robot, or the meshes' own where they have some, as
    in RViz. Default: robot, with a note."""
    background: parts.LinearRgb | None = None
    """Linear RGB of rays without a hit. Default: a pale sky."""
    light: LightTable = Field(default_factory=LightTable)
    lamps: tuple[LampTable, ...] = ()
    sun: SunTable | None = None
    sky: SkyTable | None = None
    fog: FogTable | None = None
    materials: tuple[MaterialTable, ...] = ()
    start: StartTable | None = None
    starts: Annotated[tuple[parts.NamedStart, ...], _distinct("name")] = ()
    paths: Annotated[tuple[parts.ScenePath, ...], _distinct("name")] = ()
    palette: dict[Name, parts.LinearRgb] = Field(default_factory=dict)
    """Linear RGB of the landmarks' colors, by name."""
    landmarks: Annotated[tuple[LandmarkTable, ...], _distinct("name")] = ()
    labels: LabelTables = ()
    objects: Annotated[tuple[ObjectTable, ...], _distinct("name")] = ()

    @property
    def has_own_light(self) -> bool:
        """True if the scene sets light of its own, rather than that of its base scene."""
        tables = (self.lamps, self.sun, self.sky, self.light.baked)
        return any(tables) or self.light.has_own_light

    @property
    def has_own_sky(self) -> bool:
        """True if the scene sets a sky or sun of its own, rather than those of its base scene."""
        return any((self.sun, self.sky, self.light.sky))

    @model_validator(mode="after")
    def _one_source(self) -> SceneFile:
        if self.file is None and self.extends is None:
            raise ValueError("missing; expected a mesh file, or extends with a base scene")
        if self.file is not None and self.extends is not None:
            raise ValueError("expected either file or extends, got both")
        if self.extends is not None and (self.up_axis or self.meters_per_unit):
            raise ValueError("expected no up_axis and no meters_per_unit with extends")
        if self.extends is not None and self.animation is not None:
            raise ValueError("expected no animation with extends")
        if self.light.sky is not None and (self.sun or self.sky):
            raise ValueError("light.sky: expected no sun and no sky with it")
        return self

    @field_validator("landmarks")
    @classmethod
    def _colors_known(
        cls, landmarks: tuple[LandmarkTable, ...], info: ValidationInfo
    ) -> tuple[LandmarkTable, ...]:
        palette = info.data.get("palette")
        if palette is None:  # the palette itself is faulty, which is reported
            return landmarks
        for landmark in landmarks:
            for band in landmark.bands:
                if band.color not in palette:
                    hint = did_you_mean(band.color, palette, "[palette] has")
                    raise ValueError(f"{landmark.name}: color = {band.color!r}: unknown; {hint}")
        return landmarks
