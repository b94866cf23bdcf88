"""Optics files: a camera and the surfaces in front of it, in TOML."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, model_validator

from omnisim import poses
from omnisim.cameras import CentralCamera
from omnisim.cameras.camera_table import camera_from_table
from omnisim.errors import (
    CalibrationError,
    OmnisimError,
    OpticsError,
    SensorFileError,
)
from omnisim.frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    BASE_FROM_OPTICAL_LOOKING_DOWN,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.optics.profile_file import read_profile
from omnisim.optics.shapes import Asphere, Cone, Conic, Hyperbolic, Plane, Polynomial, Shape
from omnisim.optics.surface import Rod, Surface
from omnisim.optics.system import OpticalSystem
from omnisim.parameters import Number, Parameters, Table, described, parse_table, table_of
from omnisim.toml_file import read_toml

ORIENTATIONS = {
    "up": RIG_FROM_OPTICAL_LOOKING_UP,
    "ahead": BASE_FROM_OPTICAL_LOOKING_AHEAD,
    "down": BASE_FROM_OPTICAL_LOOKING_DOWN,
}
_Coordinate = Annotated[Number, Field(ge=-1e3, le=1e3)]
_Angle = Annotated[Number, Field(ge=-360.0, le=360.0)]
_Length = Annotated[Number, Field(gt=0.0, le=1e3)]
_Point = tuple[_Coordinate, _Coordinate, _Coordinate]
_Medium = Annotated[
    Literal["vacuum", "air", "water", "acrylic", "glass"]
    | Annotated[float, Field(strict=True, ge=1.0, le=5.0)],
    described("vacuum, air, water, acrylic, glass, or a refractive index from 1 to 5"),
]


class AlignmentTable(Table):
    """Pose of a part: where it should be, and how it is misaligned."""

    model_config = ConfigDict(extra="allow", frozen=True)

    position_m: _Point | None = None
    """Metres in the system's frame: x right, y down, z forward, from the camera where it is not
    misaligned. Left out: 0 for a camera, the pinhole in the focus for a hyperbolic mirror."""
    decenter_m: _Point = (0.0, 0.0, 0.0)
    """Metres, added to the position."""
    tilt_deg: tuple[_Angle, _Angle, _Angle] = (0.0, 0.0, 0.0)
    """Degrees about its own x, y and z axes, as roll, pitch and yaw."""

    def pose(self, position_m: _Point) -> NDArray[np.float64]:
        """Pose (4, 4) in the system's frame; `position_m`: where none is given."""
        at = np.add(self.position_m or position_m, self.decenter_m)
        return poses.pose(at, *self.tilt_deg)


class CameraTable(AlignmentTable):
    """The central camera behind the surfaces.

    Either a model with its own parameters as further keys, or a calibration file.
    """

    model: str | None = None
    """Name of the camera model; its parameters are further keys of this table."""
    calibration: str | None = None
    """Calibration file, relative to this file, in place of model."""
    camera: str | None = None
    """Name of a camera in the calibration file; left out: the first."""

    def make_camera(self, source: str) -> CentralCamera:
        """The camera.

        Raises:
            SensorFileError: naming the key and what was expected.
        """
        extra = dict(self.__pydantic_extra__ or {})
        if self.calibration is not None:
            if self.model is not None or extra:
                other = "model" if self.model is not None else min(extra)
                words = "calibration has it: expected one of them"
                raise SensorFileError(f"{source}: camera.{other}: {words}")
            from omnisim.calibration import load_calibration  # only who asks needs the formats

            try:
                found = load_calibration(Path(source).parent / self.calibration)
                return found.camera(self.camera).camera
            except CalibrationError as reason:
                raise SensorFileError(f"{source}: camera.calibration: {reason}") from None
        parameters = {"model": self.model, **extra}
        width, height = extra.get("width_px"), extra.get("height_px")
        if isinstance(width, int) and isinstance(height, int):
            middle = [0.5 * (width - 1), 0.5 * (height - 1)]
            parameters.setdefault("principal_point_px", middle)
        return camera_from_table(parameters, source, "camera")


class TableShape(Table):
    """A profile through the points of a CSV file, by a cubic spline."""

    file: str
    """CSV file with the columns r_m and z_m, relative to this file; r_m grows from 0."""
    tip: Literal["smooth", "pointed"] = "smooth"
    """Profile on the axis: level, or with a slope as a cone has."""


class SphereShape(Table):
    """A sphere."""

    radius_m: Annotated[Number, Field(ge=-1e3, le=1e3)]
    """Metres; more than 0: bulges towards the camera."""


class PortShape(Table):
    """A flat window: two boundaries. Its position is the middle of the side at the camera."""

    thickness_m: _Length
    """Metres."""
    wall: _Medium = "acrylic"
    """Medium of the window."""


class DomeShape(Table):
    """A spherical window: two concentric boundaries. Its position is its centre."""

    radius_m: _Length
    """Radius of the outer side in metres."""
    thickness_m: _Length
    """Metres, less than the radius."""
    wall: _Medium = "acrylic"
    """Medium of the window."""


_PARAMETRIC: dict[str, type[Parameters]] = {
    "conic": Conic,
    "hyperbolic": Hyperbolic,
    "cone": Cone,
    "plane": Plane,
    "polynomial": Polynomial,
    "asphere": Asphere,
}
SHAPE_TABLES: dict[str, type[Table]] = {
    "sphere": SphereShape,
    "table": TableShape,
    "port": PortShape,
    "dome": DomeShape,
}
ShapeName = Literal[
    "hyperbolic",
    "sphere",
    "conic",
    "cone",
    "plane",
    "polynomial",
    "asphere",
    "table",
    "port",
    "dome",
]


def shape_schemas() -> Iterator[tuple[str, type[Table], type]]:
    """Name of each shape, the table of its keys, and the class with their help."""
    for name, kind in _PARAMETRIC.items():
        yield name, table_of(kind), kind
    for name, table in SHAPE_TABLES.items():
        yield name, table, table


class SurfaceTable(AlignmentTable):
    """A mirror, or a boundary between media; in the order in which rays from the camera meet them.

    The keys of its shape are further keys of this table.
    """

    name: str | None = None
    """Name in messages; left out: its shape's."""
    shape: ShapeName
    """Its form, with further keys; its axis is z, its vertex the position."""
    medium: _Medium | None = None
    """Medium behind it, seen from the camera; left out: it is a mirror."""
    rim_radius_m: _Length | None = None
    """Radius of its rim in metres; left out: as far as its shape goes."""
    rim_center_m: tuple[_Coordinate, _Coordinate] = (0.0, 0.0)
    """(x, y) of the rim's middle from its axis in metres."""
    hole_radius_m: Annotated[Number, Field(ge=0.0, le=1e3)] = 0.0
    """Radius of a hole about its axis in metres."""

    def make_surfaces(self, source: str, number: int) -> list[Surface]:
        """The surface, or both boundaries of a window.

        Raises:
            SensorFileError: naming the key and what was expected.
        """
        key = f"surfaces.{number}"
        given = dict(self.__pydantic_extra__ or {})
        table = SHAPE_TABLES.get(self.shape) or table_of(_PARAMETRIC[self.shape])
        shape = parse_table(given, table, SensorFileError, source, key)
        if isinstance(shape, PortShape | DomeShape):
            if self.medium is None:
                words = f"medium: missing; a {self.shape} has one behind it"
                raise SensorFileError(f"{source}: {key}.{words}")
            return self._window(shape, self.medium, f"{source}: {key}")
        found = self._shape(shape, source, key)
        position_m = (0.0, 0.0, found.vertex_m if isinstance(found, Hyperbolic) else 0.0)
        if self.position_m is None and not isinstance(found, Hyperbolic):
            raise SensorFileError(f"{source}: {key}.position_m: missing")
        if self.rim_radius_m is None and isinstance(found, Polynomial | Asphere):
            raise SensorFileError(f"{source}: {key}.rim_radius_m: missing")
        return [self._surface(found, self.pose(position_m), self.medium)]

    def _shape(self, table: Table, source: str, key: str) -> Shape:
        if isinstance(table, TableShape):
            return read_profile(Path(source).parent / table.file, table.tip == "pointed")
        values = dict(table)
        kind = Conic if isinstance(table, SphereShape) else _PARAMETRIC[self.shape]
        try:
            made = kind(**values)
        except OpticsError as reason:
            words = str(reason).removeprefix("shape.")
            raise SensorFileError(f"{source}: {key}.{words}") from None
        assert isinstance(made, Shape)
        return made

    def _window(
        self, window: PortShape | DomeShape, medium: str | float, where: str
    ) -> list[Surface]:
        """Boundaries of a port or dome, the camera's side first."""
        if self.position_m is None:
            raise SensorFileError(f"{where}.position_m: missing")
        center = self.pose((0.0, 0.0, 0.0))
        if isinstance(window, PortShape):
            outer = center @ poses.pose((0.0, 0.0, window.thickness_m))
            shapes: list[Shape] = [Plane(), Plane()]
            placed = [center, outer]
        else:
            if window.thickness_m >= window.radius_m:
                raise SensorFileError(
                    f"{where}.thickness_m: expected less than radius_m = {window.radius_m:g}, "
                    f"got {window.thickness_m:g}"
                )
            radii_m = window.radius_m - window.thickness_m, window.radius_m
            shapes = [Conic(-radius_m) for radius_m in radii_m]
            placed = [center @ poses.pose((0.0, 0.0, radius_m)) for radius_m in radii_m]
        media = window.wall, medium
        return [self._surface(*part) for part in zip(shapes, placed, media, strict=True)]

    def _surface(
        self, shape: Shape, pose: NDArray[np.float64], medium: str | float | None
    ) -> Surface:
        return Surface(
            shape,
            pose,
            math.inf if self.rim_radius_m is None else self.rim_radius_m,
            self.rim_center_m,
            self.hole_radius_m,
            medium,
            self.name or self.shape,
        )


class ObstacleTable(Table):
    """An opaque cylinder in the rays' way: a stem, a needle, or the camera's own body."""

    name: str = "obstacle"
    """Name in messages."""
    begin_m: _Point
    """Middle of one end, metres in the system's frame."""
    end_m: _Point
    """Middle of the other end."""
    radius_m: _Length
    """Metres."""

    @model_validator(mode="after")
    def _has_length(self) -> ObstacleTable:
        if self.begin_m == self.end_m:
            raise ValueError(f"end_m: expected another point than begin_m, got {list(self.end_m)}")
        return self


class OpticsFile(Table):
    """A whole optics file."""

    medium: _Medium = "air"
    """Medium around the camera; a number is a refractive index."""
    looking: Literal["up", "ahead", "down"] | None = None
    """Direction of the camera's axis in a level rig; left out: up into a mirror, else ahead."""
    origin_m: _Point = (0.0, 0.0, 0.0)
    """Origin of the sensor's frame, metres in the system's; by default the camera's pinhole."""
    camera: CameraTable
    surfaces: Annotated[tuple[SurfaceTable, ...], Field(min_length=1, max_length=16)]
    obstacles: Annotated[tuple[ObstacleTable, ...], Field(max_length=64)] = ()


def read_optics_file(path: str | Path) -> OpticalSystem:
    """Read an optical system.

    Raises:
        SensorFileError: naming file, key, value and what was expected.
    """
    return _make_system(read_toml(Path(path), OpticsFile, SensorFileError), str(path))


def parse_optics(table: Mapping[str, Any], source: str = "optics") -> OpticalSystem:
    """Make the optical system of a table with the keys of an optics file.

    Raises:
        SensorFileError: naming `source`, key, value and what was expected.
    """
    return _make_system(parse_table(table, OpticsFile, SensorFileError, source), source)


def _make_system(file: OpticsFile, source: str) -> OpticalSystem:
    try:
        surfaces = [
            surface
            for number, table in enumerate(file.surfaces)
            for surface in table.make_surfaces(source, number)
        ]
        return OpticalSystem(
            file.camera.make_camera(source),
            tuple(surfaces),
            tuple(Rod(one.begin_m, one.end_m, one.radius_m, one.name) for one in file.obstacles),
            file.medium,
            file.camera.pose((0.0, 0.0, 0.0)),
            file.origin_m,
            orientation=None if file.looking is None else ORIENTATIONS[file.looking],
        )
    except SensorFileError:
        raise
    except OmnisimError as reason:
        raise SensorFileError(f"{source}: {reason}") from None
