"""Optics files: a camera and the surfaces in front of it, in TOML."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from omnisim.cameras import CAMERA_MODELS, CentralCamera
from omnisim.cameras.camera_table import camera_from_calibration, camera_from_table
from omnisim.cameras.optics import shapes
from omnisim.cameras.optics.profiles import read_profile
from omnisim.cameras.optics.shapes import Shape, TabulatedProfile
from omnisim.cameras.optics.surface import Medium, Place, Surface
from omnisim.cameras.optics.system import ORIENTATIONS, OpticalSystem
from omnisim.core import poses
from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError, OpticsError, SensorFileError, did_you_mean
from omnisim.core.files.parameters import (
    Coordinate,
    Length,
    Number,
    Parameters,
    Table,
    described,
    overriding,
    parse_table,
    table_of,
)
from omnisim.core.files.toml_file import extended, read_tables
from omnisim.core.poses import POSE_TOLERANCE, is_rotation

_Angle = Annotated[Number, Field(ge=-360.0, le=360.0)]
_Numbers = Annotated[tuple[Number, ...], Field(max_length=1_000_000)]
_Row = tuple[Coordinate, Coordinate, Coordinate, Coordinate]
_Pose = Annotated[tuple[_Row, _Row, _Row, _Row], described("a pose, a 4 × 4 matrix")]


class AlignmentTable(Table):
    """Pose of a part: nominal position and misalignment."""

    model_config = ConfigDict(extra="allow", frozen=True)

    position_m: Place | None = None
    """Meters in the system's frame: x right, y down, z forward, from the nominal camera. Default: 0
    for a camera; for a hyperbolic mirror, the pinhole is at the focus."""
    decenter_m: Place = (0.0, 0.0, 0.0)
    """Offset from the position in meters."""
    tilt_deg: tuple[_Angle, _Angle, _Angle] = (0.0, 0.0, 0.0)
    """Rotation in degrees about its own x, y and z axes, as roll, pitch and yaw."""
    pose: _Pose | None = None
    """Rows of its pose in the system's frame, instead of position_m, decenter_m and tilt_deg."""

    @model_validator(mode="after")
    def _pose_alone(self) -> AlignmentTable:
        if self.pose is not None:
            for key in ("position_m", "decenter_m", "tilt_deg"):
                if key in self.model_fields_set:
                    raise ValueError(f"{key}: expected none with pose, which states it")
            try:
                poses.check_pose(self.pose)
            except OmnisimError as reason:
                raise ValueError(str(reason)) from None
        return self

    @property
    def is_placed(self) -> bool:
        """True if a position or pose is given."""
        return self.position_m is not None or self.pose is not None

    def system_from_part(self, position_m: Place) -> Floats:
        """Pose (4, 4) in the system frame; `position_m` is the default position."""
        if self.pose is not None:
            return np.array(self.pose)
        at = np.add(self.position_m or position_m, self.decenter_m)
        roll_deg, pitch_deg, yaw_deg = self.tilt_deg
        return poses.pose(at, roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg)


class TableShape(Table):
    """Profile through the points of a CSV file or of the table itself, by a cubic spline."""

    file: str | None = None
    """CSV file with the columns r_m and z_m, relative to this file; r_m increases from 0."""
    r_m: _Numbers | None = None
    """Distances from the axis in meters, increasing from 0, instead of file."""
    z_m: _Numbers | None = None
    """Heights along the axis in meters, one per r_m."""
    tip: Literal["smooth", "pointed"] = "smooth"
    """Profile on the axis: level, or sloped as for a cone."""

    @model_validator(mode="after")
    def _file_or_points(self) -> TableShape:
        for key, value in (("r_m", self.r_m), ("z_m", self.z_m)):
            if self.file is not None and value is not None:
                raise ValueError(f"{key}: expected none with file, which states it")
            if self.file is None and value is None:
                raise ValueError(f"{key}: missing; expected file, or r_m and z_m")
        return self

    def make_profile(self, folder: Path, where: str) -> TabulatedProfile:
        """Build the profile; `where` names the table in messages.

        Raises:
            SensorFileError: the points do not make a profile.
        """
        is_pointed = self.tip == "pointed"
        if self.file is not None:
            return read_profile(folder / self.file, is_pointed)
        try:
            return TabulatedProfile(np.array(self.r_m), np.array(self.z_m), is_pointed)
        except OpticsError as reason:
            raise SensorFileError(f"{where}: {reason}") from None


class SphereShape(Table):
    """A sphere."""

    radius_m: Coordinate  # of a conic, any number
    """Radius in meters; positive: bulges toward the camera."""


class PortShape(Table):
    """Flat window: two boundaries. Its position is the center of the side facing the camera."""

    thickness_m: Length
    """Thickness of the window in meters."""
    wall: Medium = "acrylic"
    """Medium of the window."""


class DomeShape(Table):
    """Spherical window: two concentric boundaries. Its position is its center."""

    radius_m: Length
    """Radius of the outer side in meters."""
    thickness_m: Length
    """Thickness in meters, less than the radius."""
    wall: Medium = "acrylic"
    """Medium of the window."""


_PARAMETRIC: dict[str, type[Parameters]] = {
    "conic": shapes.Conic, "hyperbolic": shapes.Hyperbolic, "cone": shapes.Cone,
    "plane": shapes.Plane, "polynomial": shapes.Polynomial, "asphere": shapes.Asphere,
}  # fmt: skip
SHAPE_TABLES: dict[str, type[Table]] = {
    "sphere": SphereShape, "table": TableShape, "port": PortShape, "dome": DomeShape,
}  # fmt: skip
ShapeName = Literal[
    "hyperbolic", "sphere", "conic", "cone", "plane", "polynomial", "asphere", "table", "port",
    "dome",
]  # fmt: skip


def shape_schemas() -> dict[str, type[Table]]:
    """Tables of the shapes' keys, by name."""
    return {name: table_of(kind) for name, kind in _PARAMETRIC.items()} | SHAPE_TABLES


@overriding(
    Surface,
    defaults={"name": None, "rim_radius_m": None},
    order=("name", "shape", "medium", "rim_radius_m", "rim_center_m", "hole_radius_m"),
)
class OpticalSurfaceTable(AlignmentTable):
    """A mirror or a boundary between media; tables are in the order in which rays meet them.

    The keys of the shape are additional keys of this table.
    """

    if TYPE_CHECKING:
        name: str | None
        medium: Medium | None
    shape: ShapeName
    """Shape, which adds its own keys; its axis is z, its vertex the position."""

    def make_surfaces(self, source: str, key: str) -> list[Surface]:
        """Build the surface, or both boundaries of a window; `key` is the table's in the file.

        Raises:
            SensorFileError: the table is invalid; names the key and the expected value.
        """
        try:
            return self._make_surfaces(source, key)
        except OpticsError as reason:
            message = str(reason).removeprefix(f"{self.name or self.shape}: ")
            raise SensorFileError(f"{source}: {key}.{message}") from None

    def _make_surfaces(self, source: str, key: str) -> list[Surface]:
        given = dict(self.__pydantic_extra__ or {})
        table = SHAPE_TABLES.get(self.shape) or table_of(_PARAMETRIC[self.shape])
        for name in given:
            hint = did_you_mean(name, (*table.model_fields, *type(self).model_fields))
            if name not in table.model_fields and hint.startswith("did"):  # misspelled
                raise SensorFileError(f"{source}: {key}.{name}: unknown key; {hint}")
        shape = parse_table(given, table, SensorFileError, source, key)
        if isinstance(shape, PortShape | DomeShape):
            if self.medium is None:
                message = f"medium: missing; expected the medium behind the {self.shape}"
                raise SensorFileError(f"{source}: {key}.{message}")
            return self._window(shape, self.medium, f"{source}: {key}")
        surface_shape = self._shape(shape, source, key)
        vertex_m = 0.0
        if isinstance(surface_shape, shapes.Hyperbolic):
            vertex_m = surface_shape.vertex_m  # places the pinhole at the focus
        elif not self.is_placed:
            raise SensorFileError(f"{source}: {key}.position_m: missing")
        pose = self.system_from_part((0.0, 0.0, vertex_m))
        return [self._surface(surface_shape, pose, self.medium)]

    def _shape(self, table: Table, source: str, key: str) -> Shape:
        if isinstance(table, TableShape):
            return table.make_profile(Path(source).parent, f"{source}: {key}")
        kind = shapes.Conic if isinstance(table, SphereShape) else _PARAMETRIC[self.shape]
        try:
            shape = kind(**dict(table))
        except OpticsError as reason:
            message = str(reason).removeprefix("shape.")
            raise SensorFileError(f"{source}: {key}.{message}") from None
        assert isinstance(shape, Shape)
        return shape

    def _window(self, window: PortShape | DomeShape, medium: Medium, where: str) -> list[Surface]:
        """Boundaries of a port or dome, the camera's side first."""
        if not self.is_placed:
            raise SensorFileError(f"{where}.position_m: missing")
        center = self.system_from_part((0.0, 0.0, 0.0))
        if isinstance(window, PortShape):
            sides: list[Shape] = [shapes.Plane(), shapes.Plane()]
            placed = [center, center @ poses.pose((0.0, 0.0, window.thickness_m))]
        elif window.thickness_m < window.radius_m:
            radii_m = window.radius_m - window.thickness_m, window.radius_m
            sides = [shapes.Conic(-radius_m) for radius_m in radii_m]
            placed = [center @ poses.pose((0.0, 0.0, radius_m)) for radius_m in radii_m]
        else:
            raise SensorFileError(
                f"{where}.thickness_m: expected less than radius_m = {window.radius_m:g}, "
                f"got {window.thickness_m:g}"
            )
        parts = zip(sides, placed, (window.wall, medium), strict=True)
        return [self._surface(*part) for part in parts]

    def _surface(self, shape: Shape, pose: Floats, medium: Medium | None) -> Surface:
        name = self.name or self.shape
        return self.build(Surface, shape=shape, system_from_surface=pose, medium=medium, name=name)


_Direction = tuple[Number, Number, Number]
_Looking = Annotated[
    Literal["up", "ahead", "down"] | tuple[_Direction, _Direction, _Direction],
    described("up, ahead, down, or a rotation, a 3 × 3 matrix"),
]


class SystemCameraTable(AlignmentTable):
    """Central camera behind the surfaces.

    It is either a model with its parameters as additional keys, or a calibration file.
    """

    model: str | None = None
    """Name of the camera model; its parameters are additional keys of this table."""
    calibration: str | None = None
    """Calibration file, relative to this file, instead of model."""
    camera: str | None = None
    """Name of a camera in the calibration file; default: the first."""

    def make_camera(self, source: str, key: str) -> CentralCamera:
        """Build the camera; `key` is this table's in the file `source`, for messages.

        Raises:
            SensorFileError: the table is invalid; names the key and the expected value.
        """
        extra = dict(self.__pydantic_extra__ or {})
        if self.calibration is not None:
            keys = extra if self.model is None else {"model": self.model, **extra}
            return camera_from_calibration(self.calibration, self.camera, keys, source, key)
        parameters = {"model": self.model, **extra}
        model = CAMERA_MODELS.get(self.model or "")
        if model is not None and "principal_point_px" in model.__dataclass_fields__:
            sizes = extra.get("width_px"), extra.get("height_px")
            # a size that is missing or no number is reported with the other parameters
            middle = [0.5 * (size - 1) if isinstance(size, int) else 0.0 for size in sizes]
            parameters.setdefault("principal_point_px", middle)
        return camera_from_table(parameters, source, key)


@overriding(
    OpticalSystem,
    defaults={},
    order=("medium", "looking", "origin_m", "color", "chromatic", "camera", "surfaces"),
)
class OpticsFile(Table):
    """A complete optics file."""

    looking: _Looking | None = None
    """Direction of the camera's axis in a level rig, or the rotation from the system's frame to it;
    default: up into a mirror, else as the camera itself."""
    camera: SystemCameraTable
    surfaces: Annotated[tuple[OpticalSurfaceTable, ...], Field(min_length=1, max_length=16)]

    def orientation(self, where: str) -> Floats | None:
        """Rotation (3, 3) of `looking`, or None; `where` names the key in messages.

        Raises:
            SensorFileError: the matrix is not a rotation.
        """
        if self.looking is None or isinstance(self.looking, str):
            return None if self.looking is None else ORIENTATIONS[self.looking]
        matrix = np.array(self.looking)
        if not is_rotation(matrix, POSE_TOLERANCE):
            raise SensorFileError(f"{where}: expected a rotation, got {matrix.tolist()}")
        return matrix


_OF_SENSORS = ("mounting", "polygons")  # keys of a sensor file's [optics] beside the system's


class OpticsTables(NamedTuple):
    """Table of an optical system in a file."""

    table: dict[str, Any]  # keys of an optics file
    source: str  # file that has them, to which paths are relative
    at: str  # key of the table in the file; empty: the file itself


def read_optics_tables(path: str | Path) -> OpticsTables:
    """Read the table of an optics file or of a sensor file with `[optics]`, without validation.

    Raises:
        SensorFileError: a file cannot be read, or is not TOML.
    """
    if Path(path).suffix.lower() == ".csv":
        raise SensorFileError(
            f"{path}: a mirror's profile: expected an optics file, .toml, with a surface of "
            'shape = "table" that names it, as `omnisim optics design -o mirror.toml` writes'
        )
    table = extended(read_tables(Path(path), SensorFileError), str(path), SensorFileError)
    return _system_in(table, path)


def _system_in(table: dict[str, Any], path: str | Path) -> OpticsTables:
    """Table of the system in an optics file, or that of a sensor file, maybe in a further file."""
    in_sensor = table.get("optics")
    if "surfaces" in table or not isinstance(in_sensor, dict):
        return OpticsTables(table, str(path), "")
    if isinstance(in_sensor.get("file"), str):
        file = Path(path).parent / in_sensor["file"]
        return OpticsTables(read_tables(file, SensorFileError), str(file), "")
    own = {key: value for key, value in in_sensor.items() if key not in _OF_SENSORS}
    return OpticsTables(own, str(path), "optics")


def read_optics_file(path: str | Path) -> OpticalSystem:
    """Read an optical system from an optics file or from a sensor file with `[optics]`.

    Raises:
        SensorFileError: the file is invalid; names file, key, actual and expected value.
    """
    return parse_optics(*read_optics_tables(path))


def parse_optics(table: Mapping[str, Any], source: str = "optics", at: str = "") -> OpticalSystem:
    """Build the optical system from a table with the keys of an optics file.

    Args:
        table: a system's `parameters()`, or the content of an optics file.
        source: file name, for messages; paths are relative to its folder.
        at: key of the table in the file; empty: the file itself.

    Raises:
        SensorFileError: the table is invalid; names `source`, key, actual and expected value.
    """
    if table.get("model") == OpticalSystem.model_name:
        table = {key: value for key, value in table.items() if key != "model"}
    file = parse_table(table, OpticsFile, SensorFileError, source, at)
    below = f"{at}." if at else ""
    surfaces = [
        surface
        for number, table in enumerate(file.surfaces)
        for surface in table.make_surfaces(source, f"{below}surfaces.{number}")
    ]
    camera = file.camera.make_camera(source, f"{below}camera")
    orientation = file.orientation(f"{source}: {below}looking")
    try:
        return file.build(
            OpticalSystem,
            camera=camera,
            surfaces=tuple(surfaces),
            system_from_camera=file.camera.system_from_part((0.0, 0.0, 0.0)),
            orientation=orientation,
        )
    except OmnisimError as reason:
        raise SensorFileError(f"{source}: {below}{reason}") from None


def input_files(path: Path) -> dict[str, Path]:
    """Optics file and its profile files, by their names in messages.

    Raises:
        SensorFileError: the file cannot be read.
    """
    files = {"the optics file": path}
    system = _system_in(read_tables(path, SensorFileError), path)
    file = Path(system.source)
    if file != path:
        files["the sensor's optics file"] = file
    surfaces = system.table.get("surfaces")
    for number, surface in enumerate(surfaces if isinstance(surfaces, list) else []):
        if isinstance(surface, dict) and isinstance(surface.get("file"), str):
            files[f"the profile of surfaces.{number}"] = file.parent / surface["file"]
    return files
