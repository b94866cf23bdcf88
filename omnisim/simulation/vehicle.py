"""Vehicles: robots with their bodies and sensors, ready to be driven through a scene."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import summary
from omnisim.errors import OpticsError, RobotFileError, SceneError, did_you_mean
from omnisim.robot.kinematics import Kinematics
from omnisim.robot.odometry import OdometryErrors
from omnisim.robot.robot_file import Footprint, Robot, load_robot
from omnisim.robot.sensor_mounts import (
    Lms200Mount,
    OmniCameraMount,
    RangeScannerMount,
    SensorMount,
)
from omnisim.scene import Scene, load_scene
from omnisim.scene.enclosure import enclosing_nodes
from omnisim.sensors import LaserScanner, OmniCamera
from omnisim.sensors.degradations import Degradation
from omnisim.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class MountedCamera:
    """Camera on its vehicle.

    Attributes:
        name: no two sensors of a vehicle have the same.
        sensor: whose `base_from_rig` is the robot file's mount and the sensor file's, composed.
        hides: nodes of the body that it does not see.
    """

    name: str
    sensor: OmniCamera
    hides: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), summary(self.sensor.model))

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Effective viewpoint (3,), base."""
        return self.sensor.base_from_rig[:3, 3]


@dataclass(frozen=True, eq=False)
class MountedScanner:
    """Laser scanner on its vehicle.

    Attributes:
        name: no two sensors of a vehicle have the same.
        scanner: what it measures.
        base_from_scanner: (4, 4).
        hides: nodes of the body that it does not see.
    """

    name: str
    scanner: LaserScanner
    base_from_scanner: NDArray[np.float64]
    hides: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), repr(self.scanner))

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Origin of its beams (3,), base."""
        return self.base_from_scanner[:3, 3]


Mounted = TypeVar("Mounted", MountedCamera, MountedScanner)


@dataclass(frozen=True, eq=False)
class Vehicle:
    """Robot with its body and its sensors.

    Attributes:
        name: short, as in file names.
        title: what people call it.
        body: in the base frame, or None: invisible.
        kinematics: its limits, or None: unknown.
        odometry: the errors of its wheels.
        footprint: about its base, or None: unknown.
        cameras, scanners: its sensors, in the order of the robot file.
    """

    name: str
    title: str
    body: Scene | None
    kinematics: Kinematics | None
    odometry: OdometryErrors
    footprint: Footprint | None
    cameras: tuple[MountedCamera, ...]
    scanners: tuple[MountedScanner, ...]

    def __repr__(self) -> str:
        cameras = [f"{camera.name}: {summary(camera.sensor.model)}" for camera in self.cameras]
        return short_repr(self, repr(self.name), *cameras, *(one.name for one in self.scanners))

    @classmethod
    def load(cls, source: str | Path) -> Vehicle:
        """Load the vehicle of a robot file, of a folder with one, or of a built-in name.

        Raises:
            RobotFileError: naming file, sensor or key, and what was expected.
            SensorFileError: naming the sensor file, key, value and what was expected.
        """
        return cls.from_robot(load_robot(source))

    @classmethod
    def from_robot(cls, robot: Robot) -> Vehicle:
        """Build what a robot file describes.

        Raises:
            RobotFileError: a file that is missing or no body, a sensor that cannot be, that stands
                inside the body, or that hides what the body does not have.
            SensorFileError: naming the sensor file, key, value and what was expected.
        """
        body = _load_body(robot)
        cameras, scanners = [], []
        for mount in robot.mounts:
            where = f"{robot.source}: sensor {mount.name!r}"
            _check_hidden(mount, body, where)
            if isinstance(mount, OmniCameraMount):
                camera = _mounted_camera(mount, robot.folder, where)
                _check_outside(body, camera, where)
                cameras.append(camera)
            else:
                scanner = _mounted_scanner(mount, where)
                _check_outside(body, scanner, where)
                scanners.append(scanner)
        return cls(
            name=robot.name,
            title=robot.title,
            body=body,
            kinematics=robot.kinematics,
            odometry=robot.odometry,
            footprint=robot.footprint,
            cameras=tuple(cameras),
            scanners=tuple(scanners),
        )

    def camera(self, name: str | None = None) -> MountedCamera:
        """Camera of a name; without one, the first.

        Raises:
            RobotFileError: there is none.
        """
        return _named(self.cameras, name, f"robot {self.name!r}: camera")

    def scanner(self, name: str | None = None) -> MountedScanner:
        """Laser scanner of a name; without one, the first.

        Raises:
            RobotFileError: there is none.
        """
        return _named(self.scanners, name, f"robot {self.name!r}: scanner")

    def with_cameras(
        self,
        *,
        size_px: int | None = None,
        polygons: int | Literal["same"] | None = "same",
        degradation: Degradation | None = None,
        quality: str | None = None,
    ) -> Vehicle:
        """Copy with other camera settings; by default they stay as they are.

        Args:
            size_px: pixels of the shorter side.
            polygons: of the mirror's mesh; None: exact.
            degradation: of all cameras.
            quality: "fast", "default" or "fine".

        Raises:
            OpticsError: an impossible size, polygon count or quality.
        """
        cameras = []
        for camera in self.cameras:
            sensor = camera.sensor
            if degradation is not None:
                sensor = sensor.with_degradation(degradation)
            if size_px is not None:
                sensor = sensor.resized(size_px)
            if quality is not None:
                sensor = sensor.with_quality(quality)
            if polygons != "same":
                sensor = sensor.with_polygons(polygons)
            cameras.append(dataclasses.replace(camera, sensor=sensor))
        return dataclasses.replace(self, cameras=tuple(cameras))


def _named(sensors: tuple[Mounted, ...], name: str | None, what: str) -> Mounted:
    if name is None and sensors:
        return sensors[0]
    names = [sensor.name for sensor in sensors]
    if name in names:
        return sensors[names.index(name)]
    hint = did_you_mean(name or "", names, "it has")
    raise RobotFileError(f"{what}{'' if name is None else f' {name!r}'}: not there; {hint}")


def _load_body(robot: Robot) -> Scene | None:
    if robot.body is None:
        return None
    path = _beside(robot.folder, robot.body, f"{robot.source}: body")
    try:
        # pictures and fingerprints name the body: not by where this machine has it
        return dataclasses.replace(load_scene(path), name=robot.body)
    except SceneError as reason:
        words = str(reason).removeprefix(f"{path}: ")
        raise RobotFileError(f"{robot.source}: body = {robot.body!r}: {words}") from None


def _beside(folder: Path, name: str, key: str) -> Path:
    path = folder / name
    try:
        is_there = path.is_file()
    except OSError as reason:  # a name too long, a folder without permission
        raise RobotFileError(f"{key} = {name!r}: cannot be read: {reason.strerror}") from None
    if not is_there:
        raise RobotFileError(f"{key} = {name!r}: no such file beside it")
    return path


def _mounted_camera(mount: OmniCameraMount, folder: Path, where: str) -> MountedCamera:
    sensor = OmniCamera()
    if mount.file is not None:
        sensor = OmniCamera.from_file(_beside(folder, mount.file, f"{where}: file"))
    base_from_rig = mount.base_from_mount @ sensor.base_from_rig
    return MountedCamera(
        mount.name, dataclasses.replace(sensor, base_from_rig=base_from_rig), mount.hides
    )


def _mounted_scanner(mount: SensorMount, where: str) -> MountedScanner:
    try:
        scanner = _scanner(mount)
    except OpticsError as reason:
        raise RobotFileError(f"{where}: {str(reason).removeprefix('scanner.')}") from None
    return MountedScanner(mount.name, scanner, mount.base_from_mount, mount.hides)


def _scanner(mount: SensorMount) -> LaserScanner:
    if isinstance(mount, Lms200Mount):
        scanner = LaserScanner.lms200(mount.resolution_deg, mount.mode, mount.seed)
        return scanner if mount.noise else scanner.without_noise()
    if isinstance(mount, RangeScannerMount):
        return LaserScanner.usarsim(
            # a turn, whose last digit is rounded up
            scan_fov_rad=min(mount.scan_fov_rad, 2.0 * math.pi),
            resolution_rad=mount.resolution_rad,
            max_range_m=mount.max_range_m,
            min_range_m=mount.min_range_m,
            noise=mount.noise_share,
            seed=mount.seed,
        )
    raise TypeError(f"no scanner is made of a {type(mount).__name__}")


def _check_hidden(mount: SensorMount, body: Scene | None, where: str) -> None:
    nodes = [] if body is None else list(dict.fromkeys(i.name for i in body.instances))
    for name in mount.hides:
        if name not in nodes:
            hint = did_you_mean(name, nodes, "it has")
            raise RobotFileError(f"{where}: hides {name!r}: no such node in the body; {hint}")


def _check_outside(body: Scene | None, mounted: MountedCamera | MountedScanner, where: str) -> None:
    """Refuse a sensor inside a part that it does not hide."""
    if body is None:
        return
    if isinstance(mounted, MountedCamera):
        near_m, what = mounted.sensor.near_m, "effective viewpoint"
    else:
        near_m, what = 0.0, "origin"
    around = enclosing_nodes(body, mounted.origin_m, near_m, mounted.hides)
    if around:
        x, y, z = mounted.origin_m.tolist()
        raise RobotFileError(
            f"{where}: its {what} ({x:g}, {y:g}, {z:g}) m is inside of the body's "
            f"{', '.join(around)}: move it, or name in hides what it does not see"
        )
