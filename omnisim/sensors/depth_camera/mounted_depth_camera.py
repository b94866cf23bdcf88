"""Depth cameras on vehicles: the Kinect of 2010 and Intel's D435, with their noise and holes."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.image_files import write_numbers
from omnisim.core.files.parameters import Flag, overriding
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.sensors.calibration_file import CALIBRATION, calibration_json
from omnisim.sensors.depth_camera.depth_camera import DepthCamera, DepthRenderer
from omnisim.sensors.sensor import (
    DriveSettings,
    FileMeasurement,
    Moment,
    MountedSensor,
    RenderedSensor,
)
from omnisim.sensors.sensor_mount import SensorMount

DEPTH_SUFFIX = ".png"
STEPS_PER_M = 1000.0
DEVICES = {"kinect_v1": DepthCamera.kinect_v1, "d435": DepthCamera.d435}


class MountedDepthCamera(RenderedSensor):
    """Depth camera mounted on a vehicle."""

    sensor: DepthCamera
    noun: ClassVar[str] = "depth"
    origin_noun: ClassVar[str] = "viewpoint"
    suffixes: ClassVar[tuple[str, ...]] = (DEPTH_SUFFIX,)
    document_names: ClassVar[tuple[str, ...]] = (CALIBRATION,)

    @property
    def near_m(self) -> float:
        """Minimum distance of visible surfaces."""
        return self._camera.near_m

    def documents(self) -> dict[str, str]:
        """Text of the calibration file, by file name."""
        return {CALIBRATION: calibration_json(self._camera)}

    @property
    def _camera(self) -> OmniCamera:
        return OmniCamera(self.sensor.model, base_from_rig=self.base_from_sensor)

    def measure(
        self, renderer: DepthRenderer, settings: DriveSettings, moment: Moment
    ) -> FileMeasurement:
        """Measure the depths at a moment, with an instantaneous shutter."""
        depths_m = renderer.measure(moment.motion(moment.time_s), moment.number)
        return FileMeasurement(DEPTH_SUFFIX, partial(_write_depths, depths_m))


def _write_depths(depths_m: NDArray[np.float32], path: Path) -> None:
    """Write depths as 16-bit millimeters, 0 in holes. Source: ROS, REP 118."""
    steps = np.round(depths_m * STEPS_PER_M).astype(np.uint16)
    write_numbers(path, steps, {"unit_m": 1.0 / STEPS_PER_M})


@overriding(DepthCamera)
class DepthCameraMount(SensorMount):
    """Depth camera, looking along x; the drive's seed determines its errors."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedDepthCamera

    type: Literal["depth_camera"]
    device: Literal["kinect_v1", "d435"] = "kinect_v1"
    """Device that sets size, field of view, range and errors: "kinect_v1" or Intel's "d435"."""
    noise: Flag = True
    """True: the device's errors; false: depths exact to the millimeter, with holes."""

    def parameters(self) -> DepthCamera:
        """Build the camera's parameters."""
        camera = self.overriding(DEVICES[self.device]())
        return camera if self.noise else camera.without_noise()
