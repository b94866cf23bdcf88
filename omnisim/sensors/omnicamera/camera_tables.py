"""Omnidirectional cameras in a robot file: of a sensor file, or of a calibration file.

A calibration file has several cameras: models, extrinsics and time shifts in one table. The mount
then positions the body frame that the file defines beside its cameras, such as Kalibr's IMU. A file
without such a frame mounts its first camera, looking along x.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

from omnisim.core.errors import CalibrationError, RobotFileError
from omnisim.core.files.parameters import Coordinate, Name
from omnisim.core.files.toml_file import find_beside
from omnisim.core.poses import inverse, pose_from_rotation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.sensor import Mount, SensorSettings
from omnisim.sensors.sensor_table import SensorName, SensorTable, folder_name


class OmniCameraTable(SensorTable):
    """Camera of a sensor file."""

    sensor_class: ClassVar[type[SensorSettings]] = OmniCamera

    type: Literal["omnicamera"]
    file: Name | None = None
    """Sensor file, relative to this file. Default: the paper's camera."""

    def mounts(self, folder: Path, source: str) -> tuple[Mount[SensorSettings], ...]:
        """Read the sensor file and mount its camera."""
        camera = OmniCamera()
        if self.file is not None:
            camera = OmniCamera.from_file(
                find_beside(folder, self.file, f"{source}: file", RobotFileError)
            )
        mounted = camera.mounted(self.base_from_mount)
        return (Mount(mounted, self.name, self.type, hides=self.hides),)


class CalibratedCamerasTable(SensorTable):
    """Cameras of a calibration file."""

    sensor_class: ClassVar[type[SensorSettings]] = OmniCamera

    type: Literal["omnicamera"]
    name: SensorName = "cameras"
    """Name of a single camera, or prefix for several: "rig" makes rig_cam0. Default: the names in
    the file."""
    position_m: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    """Position in the base frame in meters: of the file's IMU or base, or of its first camera."""
    file: Name
    """Calibration file in any supported format, such as Kalibr's camchain-imucam.yaml, relative to
    this file."""
    camera: Name | None = None
    """Name in the file of the only camera to use. Default: all cameras."""

    def mounts(self, folder: Path, source: str) -> tuple[Mount[SensorSettings], ...]:
        """Read the calibration and mount its cameras."""
        # only robots with a calibration pay the import time of the formats and their parsers
        from omnisim.cameras.calibration import load_calibration
        from omnisim.cameras.calibration.calibration import Rig

        path = find_beside(folder, self.file, f"{source}: file", RobotFileError)
        try:
            rig = Rig.of(load_calibration(path), self.camera)
            selected_rig = rig if self.camera is None else rig.only(self.camera)
        except CalibrationError as reason:
            fault = str(reason).partition("\n")[0].replace("--camera-name ", "camera ")
            raise RobotFileError(f"{source}: {fault}") from None
        base_from_body = self.base_from_mount
        if not rig.has_body:
            ahead = rig.cameras[0].model.rig_from_optical
            base_from_body = base_from_body @ pose_from_rotation(ahead, (0.0, 0.0, 0.0))
        cameras: list[Mount[SensorSettings]] = []
        for camera in selected_rig.cameras:
            upright = pose_from_rotation(camera.model.rig_from_optical, (0.0, 0.0, 0.0))
            sensor = OmniCamera(
                camera.model,
                polygons=None,
                base_from_rig=base_from_body @ camera.body_from_camera @ inverse(upright),
            )
            name = folder_name(camera.name)
            if "name" in self.model_fields_set:
                is_only = len(selected_rig.cameras) == 1
                name = self.name if is_only else folder_name(f"{self.name}_{camera.name}")
            cameras.append(
                Mount(sensor, name, self.type, hides=self.hides, time_shift_s=camera.time_shift_s)
            )
        return tuple(cameras)
