"""Depth cameras on vehicles: the Kinect of 2010 and Intel's D435, with their noise and holes."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.files.image_files import write_numbers
from omnisim.core.files.parameters import AboveZero, Flag, Level, Number
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.sensors.calibration_file import CALIBRATION, calibration_json
from omnisim.sensors.depth_camera.depth_camera import (
    MAX_RANGE_M,
    DepthCamera,
    DepthRenderer,
    Size,
)
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


class DepthCameraMount(SensorMount):
    """Depth camera, looking along x; the drive's seed determines its errors."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedDepthCamera

    type: Literal["depth_camera"]
    device: Literal["kinect_v1", "d435"] = "kinect_v1"
    """Device that sets size, field of view, range and errors: "kinect_v1" or Intel's "d435"."""
    noise: Annotated[bool, Field(strict=True)] = True
    """True: the device's errors; false: depths exact to the millimeter, with holes."""
    width_px: Size | None = None
    """Image width in pixels. Default here and for all further keys: the device's value."""
    height_px: Size | None = None
    """Image height in pixels."""
    focal_length_px: AboveZero | None = None
    """Focal length in pixels; the optical axis passes through the image center."""
    baseline_m: AboveZero | None = None
    """Distance in meters to the projector or the second camera, to the right."""
    is_stereo: Annotated[bool, Field(strict=True)] | None = None
    """True: a second camera with the same image size; false: a projector that lights all of it."""
    range_min_m: AboveZero | None = None
    """Minimum depth along the optical axis in meters; nearer pixels are holes."""
    range_max_m: Annotated[Number, Field(gt=0.0, le=MAX_RANGE_M)] | None = None
    """Maximum depth along the optical axis in meters; farther pixels are holes."""
    max_incidence_deg: Annotated[Number, Field(gt=0.0, le=90.0)] | None = None
    """Maximum angle between ray and surface normal in degrees; steeper pixels are holes."""
    disparity_sigma_px: Level | None = None
    """Standard deviation of the disparity in pixels, including rounding."""
    disparity_step_px: Level | None = None
    """Step of the disparity in pixels; 0: no rounding."""
    specular: Flag | None = None
    """True: depths are those behind panes and in mirrors, in scenes with such materials; false:
    those of the first surface."""

    def parameters(self) -> DepthCamera:
        """Build the camera's parameters."""
        camera = self.overriding(DEVICES[self.device]())
        return camera if self.noise else camera.without_noise()
