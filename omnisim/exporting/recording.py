"""Recorded runs as exporters read them: whole, with poses, odometry and sensors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.calibration.documents import parse_yaml, read_text
from omnisim.errors import OmnisimError, RunError
from omnisim.exporting.recorded_camera import RecordedCamera
from omnisim.exporting.stored_clouds import StoredCloud, read_cloud
from omnisim.poses import check_pose, inverse
from omnisim.robot import read_odometry
from omnisim.robot.odometry import Odometry
from omnisim.simulation.run_folder import GROUND_TRUTH, OBJECTS, ODOMETRY, RunFolder
from omnisim.simulation.sensors import MountedSensor
from omnisim.simulation.sensors.imu import PARAMETERS
from omnisim.trajectories import Trajectory, read_trajectory


@dataclass(frozen=True, eq=False)
class Recording:
    """Finished run.

    Attributes:
        run: its folder.
        truth: poses of the base.
        odometry: readings of the wheels, or None: it has none.
        cameras: those that are exported.
    """

    run: RunFolder
    truth: Trajectory
    odometry: Odometry | None
    cameras: tuple[RecordedCamera, ...]

    @classmethod
    def read(cls, path: Path, camera_name: str | None = None) -> Recording:
        """Read a run.

        Args:
            path: its folder.
            camera_name: the only camera to export; None: all.

        Raises:
            OmnisimError: no run, one that is not finished, no such camera, or a damaged file.
        """
        run = RunFolder.read(path)
        for step in range(run.manifest.steps):
            if (missing := run.missing_file(step)) is not None:
                raise RunError(
                    f"{missing}: is missing: expected a finished run: its command goes on with it"
                )
        names = run.manifest.cameras if camera_name is None else [run.camera(camera_name)]
        truth = read_trajectory(path / GROUND_TRUTH)
        run.check_steps(GROUND_TRUTH, len(truth))
        odometry = None
        if not run.manifest.is_rig:
            odometry = read_odometry(path / ODOMETRY)
            run.check_steps(ODOMETRY, len(odometry.times_s))
        return cls(run, truth, odometry, tuple(RecordedCamera.read(run, name) for name in names))

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.run.manifest.steps

    def sensors(self, kind: type[MountedSensor]) -> list[str]:
        """Names of the sensors of a class."""
        manifest = self.run.manifest
        return [name for name in manifest.sensors if issubclass(manifest.sensor_class(name), kind)]

    def objects(self) -> dict[str, Trajectory]:
        """Poses of other vehicles and dynamic objects by name.

        Raises:
            TrajectoryError: a file is damaged.
        """
        files = sorted((self.run.path / OBJECTS).glob("*.tum"))
        return {file.stem: read_trajectory(file) for file in files}

    def mount(self, world_from_sensor: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose (4, 4) on the base of a sensor by its pose at the first step."""
        pose: NDArray[np.float64] = inverse(self.truth.world_from_base[0]) @ world_from_sensor
        return pose

    def cloud(self, name: str, step: int) -> StoredCloud:
        """Point cloud of a lidar.

        Raises:
            RunError: its file cannot be read, or is damaged.
        """
        table = self.run.manifest.sensors[name].model_extra or {}
        return read_cloud(self.run.file(name, step, f".{table['file_format']}"))

    def depth_camera(self, name: str) -> RecordedCamera:
        """Depth camera, whose pictures are depths.

        Raises:
            RunError: its calibration cannot be read.
        """
        return RecordedCamera.read(self.run, name)

    def base_from_lidar(self, name: str) -> NDArray[np.float64]:
        """Pose (4, 4) of a lidar.

        Raises:
            RunError: its first file cannot be read.
        """
        return self.mount(self.cloud(name, 0).header.pose("world_from_lidar"))

    def base_from_imu(self, name: str) -> NDArray[np.float64]:
        """Pose (4, 4) of an IMU.

        Raises:
            RunError: its parameters cannot be read.
        """
        path = self.run.path / name / PARAMETERS
        try:
            numbers = np.array(parse_yaml(read_text(path), str(path))["T_BS"]["data"])
            return check_pose(numbers.astype(np.float64).reshape(4, 4))
        except (KeyError, TypeError, ValueError, OmnisimError):
            raise RunError(f"{path}: T_BS: expected the 16 numbers of a pose") from None

    def imu_parameters(self, name: str) -> str:
        """Text of an IMU's parameters, in EuRoC's keys.

        Raises:
            CalibrationError: the file cannot be read.
        """
        return read_text(self.run.path / name / PARAMETERS)
