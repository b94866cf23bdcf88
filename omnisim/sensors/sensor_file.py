"""The sensor file: the paper's three groups of USARBot.ini (section 2.4) in TOML.

`paper.toml` beside this file has every key, with its default and a comment.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from omnisim.cameras import CentralCamera, HyperbolicCamera, camera_from_parameters
from omnisim.errors import CalibrationError, OpticsError, SensorFileError, did_you_mean
from omnisim.mirrors import HyperbolicMirror
from omnisim.mirrors.hyperbolic import (
    DEFAULT_RIM_RAD,
    PAPER_C,
    PAPER_K,
    PAPER_METERS_PER_UNIT,
)
from omnisim.mirrors.tessellation import sectors_and_rings
from omnisim.parameters import Number, Table, keyword_or, parse_table
from omnisim.sensors.degradations.degradation import Degradation
from omnisim.sensors.degradations.degradation_file import parse_degradation
from omnisim.sensors.quality import (
    DEFAULT_QUALITY,
    MAX_DENSITY,
    MAX_SUPERSAMPLING,
    MIN_DENSITY,
    Quality,
    QualityName,
    quality_named,
)
from omnisim.toml_file import read_toml

DEFAULT_SENSOR_FILE = Path(__file__).with_name("paper.toml")
MAX_PICTURE_PX = 32768  # what any GPU of today allows; the one at hand may allow less


def _is_size(value: Any) -> bool:
    return type(value) is int and 1 <= value <= MAX_PICTURE_PX


def _is_positive(value: Any) -> bool:
    return type(value) in (int, float) and math.isfinite(value) and value > 0


def _is_point(value: Any) -> bool:
    return (
        isinstance(value, list | tuple)
        and len(value) == 2
        and all(type(part) in (int, float) and math.isfinite(part) for part in value)
    )


PolygonCount = Annotated[Any, keyword_or("exact", "a whole number", lambda v: type(v) is int)]
FaceSize = Annotated[Any, keyword_or("auto", f"1 to {MAX_PICTURE_PX}", _is_size)]
FocalLength = Annotated[Any, keyword_or("fit", "a number > 0", _is_positive)]
PrincipalPoint = Annotated[Any, keyword_or("centre", "[u, v] in pixels", _is_point)]
Size = Annotated[int, Field(ge=1, le=MAX_PICTURE_PX, strict=True)]
Positive = Annotated[Number, Field(gt=0.0)]


class Mounting(Table):
    """Where the effective viewpoint sits on the vehicle, and how the sensor is turned."""

    position_m: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    roll_deg: Number = 0.0
    pitch_deg: Number = 0.0
    yaw_deg: Number = 0.0


class Mirror(Table):
    """First group: the static mesh."""

    shape: Literal["hyperbolic"] = "hyperbolic"
    k: Annotated[Number, Field(ge=2.0)] = PAPER_K
    c: Positive = PAPER_C
    meters_per_unit: Positive = PAPER_METERS_PER_UNIT
    theta_max_deg: Number | None = None
    rim_radius_m: Positive | None = None
    polygons: PolygonCount = 1024
    mounting: Mounting = Field(default_factory=Mounting)

    @model_validator(mode="after")
    def _one_rim(self) -> Mirror:
        if self.theta_max_deg is not None and self.rim_radius_m is not None:
            raise ValueError("theta_max_deg and rim_radius_m both say where the rim is: want one")
        return self

    @property
    def polygon_count(self) -> int | None:
        """Polygons of the mesh, or None: exact."""
        return None if self.polygons == "exact" else self.polygons


class VirtualCameras(Table):
    """Second group: the cameras at the effective viewpoint."""

    size_px: FaceSize = "auto"
    texels_per_pixel: Annotated[Number, Field(ge=MIN_DENSITY, le=MAX_DENSITY)] | None = None
    near_m: Positive = 0.05
    far_m: Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=True)] = math.inf
    samples: Literal[1, 2, 4, 8] = 1

    @model_validator(mode="after")
    def _near_before_far(self) -> VirtualCameras:
        if not self.near_m < self.far_m:
            raise ValueError(f"far_m = {self.far_m:g}: want more than near_m = {self.near_m:g}")
        return self

    @property
    def face_size_px(self) -> int | None:
        """Texels across 90°, or None: as the picture needs."""
        return None if self.size_px == "auto" else self.size_px


class Camera(Table):
    """Third group: the camera that looks at the mirror."""

    width_px: Size = 360
    height_px: Size = 360
    focal_length_px: FocalLength = "fit"
    principal_point_px: PrincipalPoint = "centre"
    quality: QualityName = DEFAULT_QUALITY
    supersampling: Annotated[int, Field(ge=1, le=MAX_SUPERSAMPLING, strict=True)] | None = None


class Lens(Table):
    """Instead of the first and third group: a camera model by its own parameters, or a
    calibration file, whose path is beside the sensor file's, a camera's name in it, and whether it
    is mirrored.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    model: str | None = None
    calibration: str | None = None
    camera: str | None = None
    mounting: Mounting = Field(default_factory=Mounting)

    @model_validator(mode="after")
    def _model_or_calibration(self) -> Lens:
        if self.model is None and self.calibration is None:
            raise ValueError("model: missing; want it, or calibration with the name of a file")
        return self

    def make_camera(self, folder: Path) -> CentralCamera:
        """The camera of these parameters, or of the calibration file.

        Raises:
            OpticsError: naming the key and what was wanted.
            CalibrationError: the calibration file cannot be read.
        """
        others = sorted((self.__pydantic_extra__ or {}).keys() - {"mirrored"})
        if self.calibration is not None:
            if self.model is not None or others:
                other = "model" if self.model is not None else others[0]
                raise OpticsError(f"camera: {other}: calibration says it already: want one")
            mirrored = (self.__pydantic_extra__ or {}).get("mirrored")
            if mirrored is not None and type(mirrored) is not bool:
                raise OpticsError(f"camera: mirrored = {mirrored!r}: want true or false")
            # formats and fits are worth their time only to those who ask for them
            from omnisim.calibration import load_calibration

            found = load_calibration(folder / self.calibration, mirrored=mirrored)
            return found.camera(self.camera).camera
        if self.camera is not None:
            raise OpticsError("camera: camera: is a name in a calibration file: want calibration")
        parameters = {"model": self.model, **(self.__pydantic_extra__ or {})}
        camera = camera_from_parameters(parameters)
        known = camera.parameters()
        for key in parameters:
            if key not in known:
                hint = did_you_mean(key, known)
                raise OpticsError(f"camera: {key}: unknown key; {hint}")
        return camera


class SensorFile(Table):
    """A whole sensor file: either a mirror and the camera that looks at it, or a lens."""

    mirror: Mirror = Field(default_factory=Mirror)
    virtual_cameras: VirtualCameras = Field(default_factory=VirtualCameras)
    camera: Camera = Field(default_factory=Camera)
    lens: Lens | None = None
    degradation: dict[str, Any] = Field(default_factory=dict)
    _source: str = PrivateAttr("sensor")
    _folder: Path = PrivateAttr(Path())

    @model_validator(mode="after")
    def _mirror_or_lens(self) -> SensorFile:
        if self.lens is not None:
            if "mirror" in self.model_fields_set:
                raise ValueError("[lens] and [mirror] both say what camera it is: want one")
            extra = self.camera.model_fields_set - {"quality", "supersampling"}
            if extra:
                raise ValueError(f"camera.{min(extra)}: is a key of [lens], where there is one")
        return self

    @property
    def mounting(self) -> Mounting:
        """Where the effective viewpoint sits."""
        return self.mirror.mounting if self.lens is None else self.lens.mounting

    @property
    def quality(self) -> Quality:
        """How finely it is captured: as the name says, but for what has a key of its own."""
        named = quality_named(self.camera.quality)
        return Quality(
            self.camera.supersampling or named.supersampling,
            self.virtual_cameras.texels_per_pixel or named.texels_per_pixel,
        )

    @property
    def polygon_count(self) -> int | None:
        """Polygons of the mirror's mesh, or None: exact, as a lens is."""
        return self.mirror.polygon_count if self.lens is None else None

    def make_camera(self) -> CentralCamera:
        """The camera model, with its mirror if it has one.

        Raises:
            SensorFileError: what only the optics can refuse, with the key that asked for it.
        """
        if self.lens is not None:
            try:
                return self.lens.make_camera(Path(self._source).parent)
            except CalibrationError as reason:
                raise SensorFileError(f"{self._source}: lens.calibration: {reason}") from None
            except OpticsError as reason:
                words = str(reason).removeprefix("camera: ")
                raise SensorFileError(f"{self._source}: lens.{words}") from None
        mirror = self._make_mirror()
        camera = HyperbolicCamera.framed_on_rim(mirror, self.camera.width_px, self.camera.height_px)
        focal, centre = self.camera.focal_length_px, self.camera.principal_point_px
        if focal != "fit":
            camera = replace(camera, focal_length_px=float(focal))
        if centre != "centre":
            camera = replace(camera, principal_point_px=(float(centre[0]), float(centre[1])))
        return camera

    def make_degradation(self) -> Degradation:
        """What the camera lacks to be ideal.

        Raises:
            SensorFileError: an unknown preset, or values that do not fit each other.
        """
        return parse_degradation(self.degradation, self._source, self._folder)

    def _make_mirror(self) -> HyperbolicMirror:
        data = self.mirror
        shape = (data.k, data.c, data.meters_per_unit)
        key = "rim_radius_m" if data.rim_radius_m is not None else "theta_max_deg"
        try:
            if data.polygon_count is not None:
                sectors_and_rings(data.polygon_count)
        except OpticsError as reason:
            raise self._fault(f"mirror.polygons = {data.polygons}", reason) from None
        try:
            if data.rim_radius_m is not None:
                return HyperbolicMirror.with_rim_radius(data.rim_radius_m, *shape)
            rim = DEFAULT_RIM_RAD
            if data.theta_max_deg is not None:
                rim = math.radians(data.theta_max_deg)
            return HyperbolicMirror(*shape, rim)
        except OpticsError as reason:
            given = getattr(data, key)
            value = f"{math.degrees(DEFAULT_RIM_RAD):g} (default)" if given is None else given
            raise self._fault(f"mirror.{key} = {value}", reason) from None

    def _fault(self, key: str, reason: OpticsError) -> SensorFileError:
        words = str(reason).removeprefix("mirror: ")
        return SensorFileError(f"{self._source}: {key}: {words}")


def read_sensor_file(path: Path) -> SensorFile:
    """Read and check a sensor file.

    Raises:
        SensorFileError: naming file, key, value and what was wanted.
    """
    return _checked(read_toml(path, SensorFile, SensorFileError), str(path), path.parent)


def parse_sensor(table: dict[str, Any], source: str) -> SensorFile:
    """Check a table with the keys of a sensor file; `source` names it in messages.

    Raises:
        SensorFileError: naming source, key, value and what was wanted.
    """
    return _checked(parse_table(table, SensorFile, SensorFileError, source), source, Path())


def _checked(settings: SensorFile, source: str, folder: Path) -> SensorFile:
    settings._source, settings._folder = source, folder
    settings.make_camera()
    return settings
