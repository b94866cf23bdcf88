"""Robot files: kinematics, odometry, body and sensors of a robot, in TOML.

`scenes/p2at/robot.toml` has every table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field

from omnisim.core.errors import RobotFileError, TrajectoryError
from omnisim.core.files.extended_tables import extended
from omnisim.core.files.parameters import Coordinate, Length, Name, Number, Table, parse_table
from omnisim.core.files.toml_file import read_tables
from omnisim.core.short_repr import short_repr
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.robots.kinematics import DriveType, Kinematics
from omnisim.robots.robot_lookup import find_robot

# Default for robots without a stated clearance: a wheel of 0.2 m drives over a door sill.
DEFAULT_CLEARANCE_M = 0.05

Limit = Annotated[Number, Field(ge=1e-4, le=1e6)]
Noise = Annotated[Number, Field(ge=0.0, le=1000.0)]
Mass = Annotated[Number, Field(ge=1e-3, le=1e6)]
Friction = Annotated[Number, Field(ge=1e-3, le=10.0)]


class _KinematicsTable(Table):
    """Drive type and its limits; track and wheels matter with `--physics` only."""

    synonyms: ClassVar[Mapping[str, str]] = {
        "max_turn_rate_dps": "max_turn_rate_degps",
        "max_turn_acceleration_dps2": "max_turn_acceleration_degps2",
    }

    type: DriveType
    """Type of drive."""
    track_m: Length | None = None
    """Distance between the tires' centers in meters. Default: 0.8 of the footprint's width."""
    wheelbase_m: Length | None = None
    """Distance between a skid_steer's axles in meters. Default: half of the footprint's length."""
    wheel_diameter_m: Length | None = None
    """Wheel diameter in meters. Default: four times the clearance, at most the body's height."""
    max_speed_mps: Limit
    """Maximum speed in m/s."""
    max_turn_rate_degps: Limit
    """Maximum turn rate in °/s."""
    max_acceleration_mps2: Limit
    """Maximum acceleration in m/s²."""
    max_turn_acceleration_degps2: Limit
    """Maximum turn acceleration in °/s²."""


class _OdometryTable(Table):
    """Errors of the wheel odometry."""

    distance_scale: Length = 1.0
    """Reported meters per meter driven."""
    turn_scale: Length = 1.0
    """Reported radians per radian turned; above 1 if the wheels skid."""
    drift_deg_per_m: Coordinate = 0.0
    """Reported turn in degrees per meter driven straight, caused by wheels of unequal size."""
    distance_noise_m_per_sqrt_m: Noise = 0.0
    """Standard deviation of the distance after 1 m, in meters."""
    turn_noise_deg_per_sqrt_m: Noise = 0.0
    """Standard deviation of the heading after 1 m, in degrees."""
    turn_noise_deg_per_sqrt_rad: Noise = 0.0
    """Standard deviation of the heading after a turn of 1 rad, in degrees."""
    distance_tick_m: Noise = 0.0
    """Resolution of the distance counter in meters; 0: unlimited."""
    turn_tick_deg: Noise = 0.0
    """Resolution of the turn counter in degrees; 0: unlimited."""


class _FootprintTable(Table):
    """Footprint around the base."""

    length_m: Length
    """Length along x in meters."""
    width_m: Length
    """Width along y in meters."""
    height_m: Length
    """Height of the highest point in meters, sensors included."""
    clearance_m: Length | None = None
    """Height of the underside in meters: the wheels climb lower obstacles, the body hits higher
    ones. Default: 0.05, at most half of the height."""


class _PhysicsTable(Table):
    """Masses and friction, used with `--physics` only."""

    mass_kg: Mass | None = None
    """Total mass in kilograms. Default: 100 kg/m³ of the footprint's box."""
    center_height_m: Length | None = None
    """Height of the center of mass above the ground in meters. Default: a quarter of the height."""
    friction: Friction = 0.8
    """Coefficient of friction between tires and ground."""


class RobotFile(Table):
    """Keys of a robot file."""

    extends: Name | None = None
    """Robot that this one extends: a built-in name, or a file relative to this one. Keys here
    replace its keys, and sensors here are added to its sensors, or change that of their name."""
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
    kinematics: _KinematicsTable | None = None
    odometry: _OdometryTable = _OdometryTable()
    footprint: _FootprintTable | None = None
    physics: _PhysicsTable = _PhysicsTable()
    sensors: tuple[dict[str, Any], ...] = ()
    """Tables of the sensors; their keys depend on type."""


def default_clearance_m(height_m: float) -> float:
    """Default clearance of a robot of the given height."""
    return min(DEFAULT_CLEARANCE_M, 0.5 * height_m)


@dataclass(frozen=True)
class Footprint:
    """Footprint of a robot around its base.

    Attributes:
        length_m, width_m: extents along x and y.
        height_m: height of the highest point.
        clearance_m: height of the underside.

    Raises:
        TrajectoryError: the clearance is not below the height.
    """

    length_m: float
    width_m: float
    height_m: float
    clearance_m: float = DEFAULT_CLEARANCE_M

    def __post_init__(self) -> None:
        if not self.clearance_m < self.height_m:
            raise TrajectoryError(
                f"footprint.clearance_m = {self.clearance_m:g}: expected less than height_m, "
                f"{self.height_m:g}"
            )


@dataclass(frozen=True)
class Chassis:
    """Masses, wheels and friction of a robot; None: derived from the footprint.

    Attributes:
        mass_kg: total mass.
        center_height_m: height of the center of mass above the ground.
        friction: coefficient of friction between tires and ground.
        track_m: distance between the tires' centers.
        wheelbase_m: distance between the axles of a skid-steer robot.
        wheel_diameter_m: diameter of the driven wheels.
    """

    mass_kg: float | None = None
    center_height_m: float | None = None
    friction: float = 0.8
    track_m: float | None = None
    wheelbase_m: float | None = None
    wheel_diameter_m: float | None = None


@dataclass(frozen=True)
class Robot:
    """Contents of a robot file.

    Attributes:
        source: path of the file, or the name of the table in messages.
        folder: base folder of relative paths.
        name: short name for file names.
        title: display name.
        body: path of the body's mesh file; None: invisible.
        body_offset_m: offset from the base to the origin of the body's file.
        resources: folders of models and packages that the body references.
        kinematics: limits of the robot; None: unknown.
        odometry: errors of the wheel odometry.
        footprint: footprint around the base; None: unknown.
        chassis: masses, wheels and friction for physics.
        sensors: tables of the sensors; `omnisim.runs` builds the sensors from them.
    """

    source: str
    folder: Path
    name: str
    title: str
    body: str | None
    body_offset_m: tuple[float, float, float]
    resources: tuple[str, ...]
    kinematics: Kinematics | None
    odometry: OdometryErrors
    footprint: Footprint | None
    chassis: Chassis
    sensors: tuple[dict[str, Any], ...]

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
    return _robot(parse_table(whole, RobotFile, RobotFileError, source), source, folder)


def _robot(table: RobotFile, source: str, folder: Path) -> Robot:
    try:
        kinematics = None if table.kinematics is None else _kinematics(table.kinematics)
        odometry = _odometry(table.odometry)
        footprint = None if table.footprint is None else _footprint(table.footprint)
    except TrajectoryError as reason:  # such as a tick that is too small
        raise RobotFileError(f"{source}: {reason}") from None
    return Robot(
        source=source,
        folder=folder,
        name=table.name,
        title=table.title or table.name,
        body=table.body,
        body_offset_m=table.body_offset_m,
        resources=table.resources,
        kinematics=kinematics,
        odometry=odometry,
        footprint=footprint,
        chassis=_chassis(table),
        sensors=table.sensors,
    )


def _footprint(table: _FootprintTable) -> Footprint:
    clearance_m = table.clearance_m or default_clearance_m(table.height_m)
    return Footprint(table.length_m, table.width_m, table.height_m, clearance_m)


def _chassis(table: RobotFile) -> Chassis:
    chassis, wheels = Chassis(**dict(table.physics)), table.kinematics
    if wheels is None:
        return chassis
    return replace(
        chassis,
        track_m=wheels.track_m,
        wheelbase_m=wheels.wheelbase_m,
        wheel_diameter_m=wheels.wheel_diameter_m,
    )


def _kinematics(table: _KinematicsTable) -> Kinematics:
    return Kinematics(
        table.type,
        max_speed_mps=table.max_speed_mps,
        max_turn_rate_radps=math.radians(table.max_turn_rate_degps),
        max_acceleration_mps2=table.max_acceleration_mps2,
        max_turn_acceleration_radps2=math.radians(table.max_turn_acceleration_degps2),
    )


def _odometry(table: _OdometryTable) -> OdometryErrors:
    return OdometryErrors(
        distance_scale=table.distance_scale,
        turn_scale=table.turn_scale,
        drift_radpm=math.radians(table.drift_deg_per_m),
        distance_noise_m_per_sqrt_m=table.distance_noise_m_per_sqrt_m,
        turn_noise_rad_per_sqrt_m=math.radians(table.turn_noise_deg_per_sqrt_m),
        turn_noise_rad_per_sqrt_rad=math.radians(table.turn_noise_deg_per_sqrt_rad),
        distance_tick_m=table.distance_tick_m,
        turn_tick_rad=math.radians(table.turn_tick_deg),
    )
