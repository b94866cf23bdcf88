"""Vehicles: robots with their bodies and sensors, ready to drive through a scene."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import CalibrationError, RobotFileError, SceneError, did_you_mean
from omnisim.core.files.sources import SourceReader, fingerprint, recorded_sources, source_digest
from omnisim.core.files.toml_file import find_beside
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.core.short_repr import counted, point_text, short_repr
from omnisim.core.trajectories.odometry import OdometryErrors
from omnisim.rendering.camera.degradations import Degradation
from omnisim.rendering.camera.omnicamera import ExposureOption, OmniCamera, Polygons
from omnisim.rendering.sensor import Mount, SensorSettings, carries
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.robot_file import Footprint, Robot, default_clearance_m, load_robot
from omnisim.scene import Scene, read_scene
from omnisim.scene.files.readers import is_mjcf
from omnisim.scene.space.enclosure import enclosing_nodes
from omnisim.scene.space.floor import triangles_within
from omnisim.scene.space.start_pose import default_start
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.sensor_registry import parse_sensors, sensor_source
from omnisim.sensors.sensor_table import SensorTable, folder_name, sensor_rates

if TYPE_CHECKING:
    from omnisim.cameras.calibration.calibration import Rig


SensorT = TypeVar("SensorT", bound=SensorSettings)
# Keys that identify a robot, in this order; not the location of its file on this machine.
_IDENTITY = (
    "name", "title", "body", "body_offset_m", "resources", "kinematics", "odometry", "footprint",
    "chassis", "sensors",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Vehicle:
    """Robot with its body and sensors."""

    name: str  # short name for file names
    title: str  # display name
    body: Scene | None  # geometry in the base frame; None: invisible
    kinematics: Kinematics | None  # limits of the robot; None: unknown
    odometry: OdometryErrors  # errors of the wheel odometry
    footprint: Footprint | None  # footprint around the base; None: unknown
    sensors: tuple[Mount[SensorSettings], ...]  # mounted sensors in the order of the robot file
    # digest of the source files; None: identified by its own content
    given: str | None = field(default=None, init=False)

    def __repr__(self) -> str:
        sensors = (f"{mount.name}: {mount.summary()}" for mount in self.sensors)
        return short_repr(self, repr(self.name), *sensors)

    @classmethod
    def load(cls, source: str | Path) -> Vehicle:
        """Load the vehicle of a robot file, a folder with one, or a built-in name.

        Raises:
            RobotFileError: the robot file is invalid; names file, sensor or key, expected value.
            SensorFileError: a sensor file is invalid; names file, key, actual and expected value.
        """
        return cls.from_robot(load_robot(source))

    @classmethod
    def from_robot(cls, robot: Robot, cameras: Mapping[str, OmniCamera] = {}) -> Vehicle:
        """Build the vehicle that a robot file describes.

        `cameras`, by sensor name, replace those of sensor files.

        Raises:
            RobotFileError: a file is missing or is not a body, a sensor is invalid or inside the
                body, or a sensor hides a node that the body lacks.
            SensorFileError: a sensor file is invalid; names file, key, actual and expected value.
        """
        with recorded_sources() as sources:
            vehicle = cls._of(robot, cameras, sources)
        # the contents of the files are in the sources
        tables = {key: _without_folders(getattr(robot, key)) for key in _IDENTITY}
        return vehicle.identified(source_digest(fingerprint(tables), sources.digest(robot.folder)))

    @classmethod
    def _of(cls, robot: Robot, cameras: Mapping[str, OmniCamera], reader: SourceReader) -> Vehicle:
        body = _load_body(robot, reader)
        mounts: list[Mount[SensorSettings]] = []
        tables = parse_sensors(robot)
        sources = [
            sensor_source(robot, table.name if "name" in table.model_fields_set else index)
            for index, table in enumerate(tables)
        ]
        for (table, rate), where in zip(sensor_rates(tables, sources), sources, strict=True):
            _check_hidden(table, body, where)
            for built in table.mounts(robot.folder, where):
                mount = dataclasses.replace(built, rate=rate)
                if isinstance(mount.sensor, OmniCamera) and mount.name in cameras:
                    camera = cameras[mount.name].mounted(table.base_from_mount)
                    mount = dataclasses.replace(mount, sensor=camera)
                source = sensor_source(robot, mount.name)
                if any(mount.name == other.name for other in mounts):
                    raise RobotFileError(
                        f"{source}: a second sensor of this name: expected each name once"
                    )
                _check_outside(body, mount, source)
                mounts.append(mount)
        return cls(
            name=robot.name,
            title=robot.title,
            body=body,
            kinematics=robot.kinematics,
            odometry=robot.odometry,
            footprint=robot.footprint,
            sensors=tuple(mounts),
        )

    @property
    def cameras(self) -> tuple[Mount[OmniCamera], ...]:
        """Omnidirectional cameras of the vehicle."""
        return tuple(mount for mount in self.sensors if carries(mount, OmniCamera))

    @property
    def scanners(self) -> tuple[Mount[LaserScanner], ...]:
        """Planar laser scanners of the vehicle."""
        return tuple(mount for mount in self.sensors if carries(mount, LaserScanner))

    def camera(self, name: str | None = None) -> Mount[OmniCamera]:
        """Camera of the given name; without a name, the first.

        Raises:
            RobotFileError: the vehicle has no camera of this name, or none at all.
        """
        return _named(self.cameras, name, f"robot {self.name!r}: camera")

    def scanner(self, name: str | None = None) -> Mount[LaserScanner]:
        """Laser scanner of the given name; without a name, the first.

        Raises:
            RobotFileError: the vehicle has no scanner of this name, or none at all.
        """
        return _named(self.scanners, name, f"robot {self.name!r}: scanner")

    def with_cameras(
        self,
        *,
        size_px: int | None = None,
        polygons: Polygons | Literal["same"] = "same",
        degradation: Degradation | None = None,
        exposure: ExposureOption | None = None,
        quality: str | None = None,
    ) -> Vehicle:
        """Copy with other camera settings; settings that are left out keep their values.

        Args:
            size_px: length of the shorter image side, px; None: unchanged.
            polygons: polygon count of the mirror's mesh, or "auto"; None: exact mirror.
            degradation: degradation of all cameras; None: unchanged.
            exposure: fixed exposure, EV, or "auto"; None: unchanged.
            quality: "fast", "default" or "fine"; None: unchanged.

        Raises:
            OpticsError: an invalid size, polygon count or quality.
        """
        sensors: list[Mount[SensorSettings]] = []
        for mount in self.sensors:
            camera = mount.sensor
            if not isinstance(camera, OmniCamera):
                sensors.append(mount)
                continue
            if degradation is not None:
                camera = camera.with_degradation(degradation)
            if exposure is not None:
                camera = camera.with_exposure(exposure)
            if size_px is not None:
                camera = camera.resized(size_px)
            if quality is not None:
                camera = camera.with_quality(quality)
            if polygons != "same":
                camera = camera.with_polygons(polygons)
            sensors.append(dataclasses.replace(mount, sensor=camera))
        changed = dataclasses.replace(self, sensors=tuple(sensors))
        if self.given is None:
            return changed
        exposures = () if exposure is None else (exposure,)
        settings = fingerprint(size_px, polygons, degradation, quality, *exposures)
        return changed.identified(source_digest(self.given, settings))

    def identified(self, given: str) -> Vehicle:
        """Copy of the vehicle with `given`, the digest of its source files, as its identity."""
        vehicle = copy.copy(self)
        object.__setattr__(vehicle, "given", given)
        return vehicle


def _named(sensors: tuple[Mount[SensorT], ...], name: str | None, what: str) -> Mount[SensorT]:
    if name is None and sensors:
        return sensors[0]
    names = [sensor.name for sensor in sensors]
    if name in names:
        return sensors[names.index(name)]
    hint = did_you_mean(name or "", names, "it has")
    raise RobotFileError(f"{what}{'' if name is None else f' {name!r}'}: not found; {hint}")


def _without_folders(value: Any) -> Any:
    """Values in which absolute paths, which differ between machines, are names of files."""
    if isinstance(value, Mapping):
        return {key: _without_folders(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_folders(item) for item in value]
    return Path(value).name if isinstance(value, str) and Path(value).is_absolute() else value


def _load_body(robot: Robot, reader: SourceReader) -> Scene | None:
    if robot.body is None:
        return None
    path = find_beside(robot.folder, robot.body, f"{robot.source}: body", RobotFileError)
    try:
        folders = [robot.folder / name for name in robot.resources]
        read = read_scene(path, resources=folders, animation="none", reader=reader)
        if is_mjcf(path):
            from omnisim.scene.formats.mjcf.reader import without_world  # needs an extra

            read = without_world(read, path)
        body = _moved(read, robot.body_offset_m)
        # Fingerprints contain the body's name but not its path on this machine. A body needs no
        # start pose to look around from, so it starts at its center.
        start = default_start(body.bounds_m())
        return body.altered(name=robot.body, start=start)
    except SceneError as reason:
        message = str(reason).removeprefix(f"{path}: ")
        raise RobotFileError(f"{robot.source}: body = {robot.body!r}: {message}") from None


def _moved(body: Scene, offset_m: tuple[float, float, float]) -> Scene:
    """Translate a body by an offset."""
    if not any(offset_m):
        return body
    base_from_file = pose_from_rotation(np.eye(3), offset_m)
    instances = tuple(
        dataclasses.replace(
            instance,
            world_from_mesh=base_from_file @ instance.world_from_mesh,
            world_from_node=base_from_file @ instance.world_from_node,
        )
        for instance in body.instances
    )
    return body.altered(f"offset {offset_m}", instances=instances)


def _check_hidden(table: SensorTable, body: Scene | None, where: str) -> None:
    nodes = [] if body is None else list(dict.fromkeys(i.name for i in body.instances))
    for name in table.hides:
        if name not in nodes:
            hint = did_you_mean(name, nodes, "it has")
            raise RobotFileError(f"{where}: hides {name!r}: no such node in the body; {hint}")


def _check_outside(body: Scene | None, mount: Mount[SensorSettings], where: str) -> None:
    """Raise an error if a sensor is inside a part of the body that it does not hide."""
    if body is None:
        return
    sensor = mount.sensor
    if around := enclosing_nodes(body, mount.origin_m, sensor.near_m, mount.hides):
        place = point_text(mount.origin_m)
        raise RobotFileError(
            f"{where}: its {sensor.origin_noun} {place} m is inside the body's "
            f"{', '.join(around)}: move it, or name in hides what it does not see"
        )


# Rigs as vehicles: cameras on a body that follows given poses, without a robot.


def rig_vehicle(name: str, rig: Rig, sensors: Sequence[OmniCamera] | None = None) -> Vehicle:
    """Build the vehicle of a rig: invisible, without wheels; its base is the rig's body.

    `sensors` has one per camera; None: the rig's camera models with default settings.

    Raises:
        CalibrationError: two cameras have the same folder name.
    """
    if sensors is None:
        sensors = [OmniCamera(camera.model, polygons=None) for camera in rig.cameras]
    cameras = []
    for camera, sensor in zip(rig.cameras, sensors, strict=True):
        rig_from_optical = pose_from_rotation(camera.model.rig_from_optical, (0.0, 0.0, 0.0))
        base_from_rig = camera.body_from_camera @ inverse(rig_from_optical)
        mounted = dataclasses.replace(sensor, base_from_rig=base_from_rig)
        cameras.append(Mount(mounted, folder_name(camera.name), "omnicamera"))
    names = [camera.name for camera in cameras]
    for camera, folder in zip(rig.cameras, names, strict=True):
        if names.count(folder) > 1:
            raise CalibrationError(
                f"camera {camera.name!r}: expected a folder of its own, got {folder} for two"
            )
    return Vehicle(
        name=name,
        title=name,
        body=None,
        kinematics=None,
        odometry=OdometryErrors(),
        footprint=None,
        sensors=tuple(cameras),
    )


# Bounding boxes of a vehicle's body: one for the floor below it, several for contacts.


@dataclass(frozen=True, eq=False)
class BodyBoxes:
    """Bounding boxes of a vehicle in the base frame."""

    # low_m, high_m: (3,) corners of the box around the whole robot; its lower side is the ground
    low_m: Floats
    high_m: Floats
    clearance_m: float  # ground clearance; the wheels drive over lower obstacles
    # (n, 2, 3) corners of the boxes around the body's nodes, cut off below the clearance; without a
    # body, the footprint's box
    parts_m: Floats

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.parts_m), "part"))

    @classmethod
    def of(cls, vehicle: Vehicle) -> BodyBoxes | None:
        """Boxes of the footprint and the body; None if the vehicle has neither."""
        parts = np.zeros((0, 2, 3)) if vehicle.body is None else _node_bounds(vehicle.body)
        size = vehicle.footprint
        if size is not None:
            half = 0.5 * np.array((size.length_m, size.width_m))
            low, high = np.array((*-half, 0.0)), np.array((*half, size.height_m))
            clearance_m = size.clearance_m
        elif len(parts) and parts[:, 1, 2].max() > 0.0:
            low, high = parts[:, 0].min(axis=0), parts[:, 1].max(axis=0)
            low[2] = 0.0
            clearance_m = default_clearance_m(float(high[2]))
        else:
            return None
        if not len(parts):
            parts = np.stack((low, high))[None]
        parts = parts[parts[:, 1, 2] > clearance_m]
        parts[:, 0, 2] = np.maximum(parts[:, 0, 2], clearance_m)
        return cls(low, high, clearance_m, parts)

    @property
    def reach_m(self) -> float:
        """Distance from the base's origin to its farthest corner on the ground."""
        ends = np.maximum(np.abs(self.low_m[:2]), np.abs(self.high_m[:2]))
        return float(np.hypot(*ends))


def _node_bounds(body: Scene) -> Floats:
    """Corners (n, 2, 3) of the bounding boxes of a body's nodes that have triangles."""
    everywhere = np.full(3, np.inf)
    triangles = triangles_within(body, -everywhere, everywhere)
    names = np.array([instance.name for instance in body.instances])[triangles.instances]
    nodes = (triangles.corners_m[names == name].reshape(-1, 3) for name in np.unique(names))
    bounds = [(corners.min(axis=0), corners.max(axis=0)) for corners in nodes]
    return np.array(bounds).reshape(-1, 2, 3)
