"""Plan of a data set, `plan.toml`: scenes, viewpoints, cameras, and their variation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, model_validator

from omnisim.core.errors import OmnisimError, PlanError
from omnisim.core.files.parameters import (
    MAX_NUMBER,
    Flag,
    Fraction,
    Name,
    NotNegative,
    Positive,
    Table,
)
from omnisim.core.files.toml_file import read_toml
from omnisim.datasets.generate.distributions import MAX_SEED, Distributed, Distribution, within
from omnisim.ground_truth import check_channels
from omnisim.ground_truth.boxes import BoxLimits

Weight = Annotated[float, Field(strict=True, gt=0.0, le=1e9)]
Where = Literal["free", "path", "around", "poses"]
MAX_SHARDS = 1_000_000  # per data set
MAX_IMAGES = 100_000  # per shard or setup
COLDEST_K, HOTTEST_K = 1667.0, 25_000.0  # range of the fit of black bodies' colors


def _channels(names: tuple[str, ...]) -> tuple[str, ...]:
    needs_others = [name for name in names if "flow" in name or "occluded" in name]
    if needs_others:
        raise ValueError(f"{needs_others[0]}: expected channels of single images")
    try:
        return check_channels(names)
    except OmnisimError as reason:
        raise ValueError(str(reason)) from None


def fixed(value: float) -> Distribution:
    """Distribution of one number."""
    return Distribution("constant", (value,))


class RecolorTable(Table):
    """Instances with an individual color in each image."""

    nodes: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Names of the instances; `*` and `?` stand for any letters."""
    hue_deg: Distributed = Distribution("uniform", (0.0, 360.0))
    """Hue of the color, degrees."""
    saturation: Annotated[Distributed, within(0.0, 1.0)] = Distribution("uniform", (0.0, 0.9))
    """Saturation, 0 to 1."""
    value: Annotated[Distributed, within(0.0, 1.0)] = Distribution("uniform", (0.2, 0.95))
    """Value in HSV, 0 to 1."""
    share: Fraction = 1.0
    """Share of the images with such a color."""


class VaryLightTable(Table):
    """Lamps and ambient light of the scenes, by setup; the sun of [vary.sky] stays as it is."""

    lamp_factor: Distributed = fixed(1.0)
    """Factor of each lamp's intensity, at least 0; drawn for each lamp."""
    lamp_temperature_k: Distributed | None = None
    """Color temperature of each lamp in kelvin; left out: the lamps' own colors."""
    ambient_factor: Distributed = fixed(1.0)
    """Factor of the ambient light, at least 0."""

    @model_validator(mode="after")
    def _is_light(self) -> VaryLightTable:
        for key in ("lamp_factor", "ambient_factor"):
            if (low := getattr(self, key).low) < 0.0:
                raise ValueError(f"{key}: expected factors of at least 0, got {low:g}")
        kelvin = self.lamp_temperature_k
        if kelvin is not None and not (kelvin.low >= COLDEST_K and kelvin.high <= HOTTEST_K):
            raise ValueError(
                f"lamp_temperature_k: expected {COLDEST_K:g} to {HOTTEST_K:g}, got {kelvin}"
            )
        return self


class VarySkyTable(Table):
    """Sky of the scenes, by setup, instead of their own sky and directional lamps.

    Environment maps, if there are files; otherwise a clear sky with its sun.
    """

    files: tuple[Name, ...] = ()
    """Environment maps, .hdr or .exr, relative to the plan; one per setup."""
    yaw_deg: Distributed = Distribution("uniform", (-180.0, 180.0))
    """Rotation of the map, or of north, in degrees, counter-clockwise seen from above."""
    brightness: Annotated[Distributed, within(0.0, MAX_NUMBER)] = fixed(0.8)
    """Brightness of a level white surface under sky and sun; 1 is white."""
    turbidity: Annotated[Distributed, within(2.0, 10.0)] = Distribution("uniform", (2.0, 6.0))
    """Haze of the clear sky: 2 very clear, 6 hazy."""
    hour: Annotated[Distributed, within(0.0, 24.0)] | None = None
    """Solar time in hours, at which the sun is above the horizon; left out: the sun's height and
    direction are drawn."""
    day: Annotated[Distributed, within(1.0, 366.0)] = fixed(172.0)
    """Day of the year, 1 to 365, for hour."""
    latitude_deg: Annotated[Distributed, within(-90.0, 90.0)] = fixed(50.0)
    """Latitude in degrees, for hour."""
    sun_elevation_deg: Annotated[Distributed, within(0.0, 90.0)] = Distribution(
        "uniform", (15.0, 75.0)
    )
    """Height of the sun above the horizon in degrees; without hour."""
    sun_azimuth_deg: Distributed = Distribution("uniform", (-180.0, 180.0))
    """Direction of the sun in degrees, counter-clockwise from the world's x; without hour."""

    @model_validator(mode="after")
    def _one_sky(self) -> VarySkyTable:
        given = self.model_fields_set
        clear = {"turbidity", "hour", "day", "latitude_deg", "sun_elevation_deg", "sun_azimuth_deg"}
        if self.files and (others := clear & given):
            raise ValueError(f"{min(others)}: expected a clear sky, got files")
        of_hour, of_sun = {"day", "latitude_deg"}, {"sun_elevation_deg", "sun_azimuth_deg"}
        if self.hour is not None and (others := of_sun & given):
            raise ValueError(f"{min(others)}: expected none with hour")
        if self.hour is None and (others := of_hour & given):
            raise ValueError(f"{min(others)}: requires hour")
        return self


class VaryTable(Table):
    """Attitude, time, light and colors of the images."""

    yaw_deg: Distributed = Distribution("uniform", (-180.0, 180.0))
    """Heading in degrees from the world's x; for `path`, `around` and `poses`, relative to the
    path, to the object's direction or to the pose, and 0 by default."""
    pitch_deg: Distributed = fixed(0.0)
    """Pitch of the vehicle in degrees: positive: front down."""
    roll_deg: Distributed = fixed(0.0)
    """Roll of the vehicle in degrees: positive: left side up."""
    shift_m: Distributed = fixed(0.0)
    """Shift of the camera on its vehicle along each axis in meters: errors of the mount."""
    time_s: Distributed = fixed(0.0)
    """Time of the world in seconds, for scenes with moving objects."""
    exposure_ev: Distributed = fixed(0.0)
    """Exposure of each image in stops, in addition to the camera's: 1 doubles the light."""
    images_per_setup: Annotated[int, Field(strict=True, ge=1, le=MAX_IMAGES)] = 25
    """Number of successive samples with the same setup: light, sky, and varying cameras; opening a
    new setup takes as long as several images."""
    light: VaryLightTable | None = None
    sky: VarySkyTable | None = None
    recolor: tuple[RecolorTable, ...] = ()
    """Colors of instances."""

    @property
    def lights(self) -> bool:
        """True if each setup has its own light."""
        return self.light is not None or self.sky is not None


class PlanSceneTable(Table):
    """Scene of the images."""

    file: Name
    """Scene file, relative to the plan; or the name of a built-in scene."""
    name: Name | None = None
    """Name in the data set; left out: the file's name."""
    weight: Weight = 1.0
    """Share of the images, relative to the other scenes' weights."""
    up_axis: Literal["x", "y", "z"] | None = None
    """Up axis of the file; left out: its format's."""
    meters_per_unit: Positive | None = None
    """Meters per unit of the file; left out: its format's."""
    labels: Name | None = None
    """Label file, relative to the plan, instead of the scene's own labels."""
    floor_m: Annotated[float, Field(strict=True, ge=-1e6, le=1e6)] | None = None
    """Height of the floor in meters; left out: of the floor below the scene's start."""

    @property
    def title(self) -> str:
        """Name in the data set."""
        return self.name or Path(self.file).stem


class PlanCameraTable(Table):
    """Camera or rig; without sensor, calibration and optics, the paper's camera."""

    name: Name | None = None
    """Unique name in the data set; left out: the file's name."""
    sensor: Name | None = None
    """Sensor file, relative to the plan."""
    calibration: Name | None = None
    """Calibration file, relative to the plan."""
    camera_name: Name | None = None
    """Name of a camera in the calibration file; "all": the whole rig, with an image by each camera
    at each pose; left out: the first camera."""
    mirrored: Flag | None = None
    """The camera looks into a mirror; left out: from the file's metadata."""
    optics: Name | None = None
    """Optics file, relative to the plan."""
    size_px: Annotated[int, Field(strict=True, ge=1, le=16384)] | None = None
    """Shorter side of the image in pixels; left out: the file's."""
    quality: Literal["fast", "default", "fine"] | None = None
    """Quality of the rendering."""
    preset: Name | None = None
    """Name of a degradation preset, or the path of its file; nothing moves during an exposure."""
    parameters: dict[Name, Distributed] = Field(default_factory=dict)
    """Offsets of the camera model's parameters, by their names and in their units in the camera's
    file; each number of a list gets its own offset."""
    degradation: dict[Name, dict[Name, Distributed]] = Field(default_factory=dict)
    """Drawn parameters of degradations, as in the sensor file's [degradation]."""
    mount_shift_m: Distributed = fixed(0.0)
    """Shift of each camera on its rig along each axis in meters: errors of the extrinsics."""
    mount_turn_deg: Distributed = fixed(0.0)
    """Rotation of each camera on its rig about each axis in degrees."""
    weight: Weight = 1.0
    """Share of the images, relative to the other cameras' weights."""

    @model_validator(mode="after")
    def _one_file(self) -> PlanCameraTable:
        files = [key for key in ("sensor", "calibration", "optics") if getattr(self, key)]
        if len(files) > 1:
            raise ValueError(f"expected one of sensor, calibration and optics, got {files}")
        for key in ("camera_name", "mirrored"):
            if getattr(self, key) is not None and self.calibration is None:
                raise ValueError(f"{key}: requires calibration")
        return self

    @property
    def title(self) -> str:
        """Name in the data set."""
        source = self.sensor or self.calibration or self.optics
        return self.name or ("paper" if source is None else Path(source).stem)

    @property
    def varies(self) -> bool:
        """True if each setup has its own camera parameters."""
        return not {"parameters", "degradation", "mount_shift_m", "mount_turn_deg"}.isdisjoint(
            _without_defaults(self)
        )


class ViewpointTable(Table):
    """Viewpoints of the images."""

    where: Where = "free"
    """`free`: on the free floor; `path`: along paths of the scene; `around`: around objects;
    `poses`: at the poses of a file."""
    height_m: Distributed = fixed(1.0)
    """Height of the viewpoint above the floor, meters."""
    radius_m: Positive = 0.25
    """Radius in meters of the free cylinder from the viewpoint down to the floor."""
    step_m: NotNegative = 0.1
    """Maximum step height in meters: lower surfaces are no obstacles."""
    region: Literal["start", "all"] = "start"
    """`start`: the free floor connected to the scene's start; `all`: all free floor."""
    paths: tuple[Name, ...] = ()
    """Names of the scene's paths; left out: all paths."""
    beside_m: Distributed = fixed(0.0)
    """Distance to the left of a path, meters."""
    nodes: tuple[Name, ...] = ()
    """Names of the objects for viewpoints around objects; `*` and `?` match any letters."""
    distance_m: Distributed = Distribution("uniform", (1.0, 3.0))
    """Distance from the object's middle on the floor plan in meters."""
    file: Name | None = None
    """File of poses, relative to the plan: TUM, KITTI, EuRoC or CSV; poses of the viewpoint on a
    level vehicle, x forward."""

    @model_validator(mode="after")
    def _complete(self) -> ViewpointTable:
        if self.where == "around" and not self.nodes:
            raise ValueError('nodes: expected names of objects with where = "around"')
        if (self.where == "poses") != (self.file is not None):
            raise ValueError('file: expected with where = "poses", and only with it')
        if self.height_m.low <= 0.0 and self.where != "poses":
            raise ValueError(f"height_m: expected heights above 0, got {self.height_m.low:g}")
        return self


class PlanObjectTable(Table):
    """Objects to place on the free floor, without contact."""

    file: Name
    """Scene file of the object, relative to the plan; or the name of a built-in scene."""
    name: Name | None = None
    """Name of its instances, before their number; left out: the file's name."""
    up_axis: Literal["x", "y", "z"] | None = None
    """Up axis of the file; left out: its format's."""
    meters_per_unit: Positive | None = None
    """Meters per unit of the file; left out: its format's."""
    count: tuple[
        Annotated[int, Field(strict=True, ge=0, le=100)],
        Annotated[int, Field(strict=True, ge=0, le=100)],
    ] = (1, 1)
    """Minimum and maximum number of such objects in an image."""
    yaw_deg: Distributed = Distribution("uniform", (-180.0, 180.0))
    """Heading in degrees."""
    distance_m: Distributed = Distribution("uniform", (0.5, 5.0))
    """Distance from the viewpoint on the floor plan in meters."""

    @model_validator(mode="after")
    def _ordered(self) -> PlanObjectTable:
        if self.count[0] > self.count[1]:
            raise ValueError(f"count: expected [least, most], got {list(self.count)}")
        return self

    @property
    def title(self) -> str:
        """Name of its instances."""
        return self.name or Path(self.file).stem


class RejectTable(Table):
    """Conditions for rejecting an image and drawing another."""

    synonyms: ClassVar[Mapping[str, str]] = {
        "least_hits": "min_hit_share",
        "most_near": "max_near_share",
    }

    min_hit_share: Fraction = 0.1
    """Minimum share of the rays that hit a surface."""
    near_m: NotNegative = 0.1
    """Range below which a surface is too near, in meters."""
    max_near_share: Fraction = 0.25
    """Maximum share of the rays that hit a surface nearer than `near_m`."""
    attempts: Annotated[int, Field(strict=True, ge=1, le=1000)] = 50
    """Maximum number of draws per image; then generation fails."""

    @property
    def is_needed(self) -> bool:
        """True if images can be rejected."""
        return self.min_hit_share > 0.0 or (self.near_m > 0.0 and self.max_near_share < 1.0)


class Plan(Table):
    """Data set: contents of its images, and their storage."""

    synonyms: ClassVar[Mapping[str, str]] = {
        "scene": "scenes",
        "camera": "cameras",
        "stand": "viewpoints",
        "pictures_per_shard": "images_per_shard",
    }

    scenes: Annotated[tuple[PlanSceneTable, ...], Field(min_length=1)]
    cameras: tuple[PlanCameraTable, ...] = (PlanCameraTable(),)
    viewpoints: ViewpointTable = ViewpointTable()
    vary: VaryTable = VaryTable()
    objects: tuple[PlanObjectTable, ...] = ()
    reject: RejectTable = RejectTable()
    channels: Annotated[tuple[Name, ...], AfterValidator(_channels)] = ()
    """Channels of ground truth besides the images."""
    min_area_px: Annotated[int, Field(strict=True, ge=1)] = 1
    """Minimum number of visible pixels of an annotated object; requires the channel instance."""
    min_visible: Fraction | None = None
    """Minimum visible share of an annotated object, relative to the pixels that it would cover
    if nothing hid it; requires the channel instance and the extra `rays`. Annotations then have a
    `visible_share`, even if the minimum is 0; left out: shares are not computed."""
    images_per_shard: Annotated[int, Field(strict=True, ge=1, le=MAX_IMAGES)] = 100
    """Samples per shard."""
    shards: Annotated[int, Field(strict=True, ge=1, le=MAX_SHARDS)] = 1
    """Number of shards."""
    seed: Annotated[int, Field(strict=True, ge=0, le=MAX_SEED)] = 0
    """Seed of all random numbers: another seed gives other images."""
    image_format: Literal["png", "jpg"] = "png"
    """File format of the images."""
    channel_format: Literal["auto", "npy"] = "auto"
    """`npy`: plain arrays, fast to load; `auto`: a common file format for each channel."""
    title: Name | None = None
    """Name of the data set; left out: the plan's file name."""
    license: Name | None = None
    """License of the data set, stated on its card."""

    @model_validator(mode="after")
    def _distinct(self) -> Plan:
        for key, tables in (("cameras", self.cameras), ("objects", self.objects)):
            titles = [table.title for table in tables]
            for title in titles:
                if titles.count(title) > 1:
                    raise ValueError(f"{key}: name = {title!r}: expected each name once")
        files: dict[str, str] = {}
        for scene in self.scenes:
            if files.setdefault(scene.title, scene.file) != scene.file:
                raise ValueError(
                    f"scenes: name = {scene.title!r}: expected a different name for each file, "
                    f"got it for {files[scene.title]!r} and {scene.file!r}"
                )
        return self

    @model_validator(mode="after")
    def _annotated(self) -> Plan:
        for key in ("min_area_px", "min_visible"):
            if key in self.model_fields_set and "instance" not in self.channels:
                raise ValueError(f"{key}: requires the channel instance")
        return self

    @property
    def box_limits(self) -> BoxLimits:
        """Limits of annotated objects."""
        return BoxLimits(self.min_area_px, self.min_visible)

    @property
    def images(self) -> int:
        """Number of samples in all shards."""
        return self.shards * self.images_per_shard

    @property
    def sky_files(self) -> tuple[str, ...]:
        """Environment maps, relative to the plan."""
        return () if self.vary.sky is None else self.vary.sky.files

    def content(self) -> dict[str, Any]:
        """Keys and values that determine the images, of JSON types, without defaults."""
        left_out = ("shards", "title", "license")
        content: dict[str, Any] = _plain(self)
        return {key: value for key, value in content.items() if key not in left_out}


def read_plan(path: Path) -> Plan:
    """Read a plan.

    Raises:
        PlanError: one line per fault, naming file, key, value and expected value.
    """
    return read_toml(path, Plan, PlanError)


def _plain(value: Any) -> Any:
    if isinstance(value, Distribution):
        return {value.kind: list(value.numbers)}
    if isinstance(value, Table):
        return {key: _plain(inner) for key, inner in _without_defaults(value).items()}
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    return [_plain(inner) for inner in value] if isinstance(value, tuple) else value


def _without_defaults(table: Table) -> dict[str, Any]:
    """Keys of a table with values other than their defaults."""
    fields = type(table).model_fields
    return {
        key: value
        for key, value in table
        if value != fields[key].get_default(call_default_factory=True)
    }
