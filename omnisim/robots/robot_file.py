"""Robot files: kinematics, odometry, body and sensors of a robot, in TOML.

`scenes/p2at/robot.toml` has every table. `RobotFile` has the keys; a `Robot` is made of them. Its
chassis joins the wheels of [kinematics] with [physics]: both matter with `--physics` only.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field

from omnisim.core.errors import RobotFileError, TrajectoryError, did_you_mean
from omnisim.core.files.parameters import (
    Coordinate,
    Length,
    Name,
    Number,
    Parameters,
    Table,
    parse_table,
)
from omnisim.core.files.toml_file import extended, read_tables
from omnisim.core.package_files import SCENES, built_in
from omnisim.core.short_repr import short_repr
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.robots.kinematics import Kinematics

# Default for robots without a stated clearance: a wheel of 0.2 m drives over a door sill.
DEFAULT_CLEARANCE_M = 0.05
PartT = TypeVar("PartT", bound=Parameters)

Mass = Annotated[Number, Field(ge=1e-3, le=1e6)]
Friction = Annotated[Number, Field(ge=1e-3, le=10.0)]


def default_clearance_m(height_m: float) -> float:
    """Default clearance of a robot of the given height."""
    return min(DEFAULT_CLEARANCE_M, 0.5 * height_m)


@dataclass(frozen=True)
class Footprint(Parameters, name="footprint", error=TrajectoryError):
    """Footprint around the base."""

    length_m: Length
    """Length along x in meters."""
    width_m: Length
    """Width along y in meters."""
    height_m: Length
    """Height of the highest point in meters, sensors included."""
    clearance_m: Length = None  # type: ignore[assignment]  # None only until it follows from height
    """Height of the underside in meters: the wheels climb lower obstacles, the body hits higher
    ones. Default: 0.05, at most half of the height."""

    def __post_init__(self) -> None:
        if self.clearance_m is None:
            object.__setattr__(self, "clearance_m", default_clearance_m(self.height_m))
        super().__post_init__()

    def _check(self) -> None:
        if not self.clearance_m < self.height_m:
            raise self._error("clearance_m", f"less than height_m = {self.height_m:g}")


@dataclass(frozen=True)
class Physics(Parameters, name="physics"):
    """Masses and friction, used with `--physics` only."""

    mass_kg: Mass | None = None
    """Total mass in kilograms. Default: 100 kg/m³ of the footprint's box."""
    center_height_m: Length | None = None
    """Height of the center of mass above the ground in meters. Default: a quarter of the height."""
    friction: Friction = 0.8
    """Coefficient of friction between tires and ground."""


@dataclass(frozen=True)
class Wheels(Parameters, name="kinematics"):
    """Positions and size of the wheels, used with `--physics` only."""

    track_m: Length | None = None
    """Distance between the tires' centers in meters. Default: 0.8 of the footprint's width."""
    wheelbase_m: Length | None = None
    """Distance between a skid_steer's axles in meters. Default: half of the footprint's length."""
    wheel_diameter_m: Length | None = None
    """Wheel diameter in meters. Default: four times the clearance, at most the body's height."""


@dataclass(frozen=True)
class Chassis(Wheels, Physics):
    """Masses, wheels and friction of a robot; None: derived from the footprint."""


@dataclass(frozen=True)
class WheeledDrive(Wheels, Kinematics):
    """Drive type and its limits; track and wheels matter with `--physics` only."""


class RobotFile(Table):
    """Keys of a robot file."""

    extends: Name | None = None
    """Robot that this one extends: a built-in name, or a file relative to this one. Keys here
    replace its keys; sensors here are added to its sensors, or change the sensor of that name."""
    name: Name
    """Short name for file names."""
    title: Name | None = None
    """Display name. Default: name."""
    body: Name | None = None
    """Mesh file of the body, relative to this file. Default: invisible."""
    body_offset_m: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    """Offset in meters from the base, on the ground, to the origin of the body's file."""
    resources: tuple[Name, ...] = ()
    """Folders of models and packages that the body references, relative to this file."""
    kinematics: WheeledDrive | None = None
    odometry: OdometryErrors = OdometryErrors()
    footprint: Footprint | None = None
    physics: Physics = Physics()
    sensors: tuple[dict[str, Any], ...] = ()
    """Tables of the sensors; their keys depend on type."""


class Robot(RobotFile):
    """Contents of a robot file, with those of the files that it extends."""

    source: str  # path of the file, or the name of the table in messages
    folder: Path  # base folder of relative paths
    title: str
    kinematics: Kinematics | None  # type: ignore[assignment]  # without its wheels
    chassis: Chassis  # masses, wheels and friction for physics

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), *self.sensor_names)

    @property
    def sensor_names(self) -> tuple[str, ...]:
        """Names of the robot's sensors."""
        return tuple(str(table.get("name")) for table in self.sensors)


def load_robot(source: str | Path) -> Robot:
    """Read the robot file at a path, in a folder, or of a built-in name.

    Raises:
        RobotFileError: the file is invalid; names file, key, actual and expected value.
    """
    return read_robot(find_robot(source))


def read_robot(path: Path) -> Robot:
    """Read and check a robot file.

    Raises:
        RobotFileError: the file is invalid; names file, key, actual and expected value.
    """
    return parse_robot(read_tables(path, RobotFileError), str(path), path.parent)


def robot_tables(path: Path) -> dict[str, Any]:
    """Tables of a robot file and of those that it extends, without validation.

    Raises:
        RobotFileError: a file is missing, or cannot be read.
    """
    return extended(read_tables(path, RobotFileError), str(path), RobotFileError, find_robot)


def parse_robot(table: dict[str, Any], source: str, folder: Path = Path()) -> Robot:
    """Check a table with the keys of a robot file; `source` names it in messages.

    Raises:
        RobotFileError: the table is invalid; names source, key, actual and expected value.
    """
    whole = extended(table, source, RobotFileError, find_robot)
    keys = parse_table(whole, RobotFile, RobotFileError, source)
    drive = keys.kinematics
    given = dict(keys) | {
        "source": source,
        "folder": folder,
        "title": keys.title or keys.name,
        "kinematics": None if drive is None else _part(Kinematics, drive),
        "chassis": _part(Chassis, keys.physics, drive or Wheels()),
    }
    return Robot.model_construct(**given)


def _part(kind: type[PartT], *sources: Parameters) -> PartT:
    """Settings of a class with values of others."""
    given = {name: value for source in sources for name, value in vars(source).items()}
    return kind(**{field.name: given[field.name] for field in fields(kind)})


# Lookup of robot files by path, folder or built-in name.


ROBOT_FILE = "robot.toml"


def builtin_robots() -> list[str]:
    """Names of the built-in robots, sorted."""
    return built_in(ROBOT_FILE)


def find_robot(source: str | Path) -> Path:
    """Find a robot file by its path, a folder with a `robot.toml`, or a built-in name.

    Raises:
        RobotFileError: no such robot file, or it cannot be read.
    """
    try:
        return _find(Path(source), str(source))
    except OSError as reason:  # such as a folder without permission or an overlong name
        raise RobotFileError(f"{source}: cannot be read: {reason.strerror}") from None


def _find(path: Path, name: str) -> Path:
    if path.is_dir() and (path / ROBOT_FILE).is_file():
        return path / ROBOT_FILE
    if path.is_file():
        return path
    names = builtin_robots()
    if name in names:
        return SCENES / name / ROBOT_FILE
    if path.is_dir():
        raise RobotFileError(f"{path}: is a folder without a {ROBOT_FILE}: expected a robot file")
    if path.exists():
        raise RobotFileError(f"{path}: is not a regular file")
    hint = did_you_mean(name, names, "built-in:")
    raise RobotFileError(f"{name}: no such robot file, and no built-in robot; {hint}")
