"""Depth cameras on vehicles: the Kinect of 2010 and Intel's D435, with their noise and holes."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.core.errors import OpticsError, RobotFileError
from omnisim.core.files.image_files import write_numbers
from omnisim.core.files.parameters import Number
from omnisim.core.files.written_files import is_written
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import Stage
from omnisim.sensors.calibration_file import CALIBRATION, calibration_json
from omnisim.sensors.depth_camera.depth_camera import MAX_RANGE_M, DepthCamera, Size
from omnisim.sensors.depth_camera.depth_renderer import DepthRenderer
from omnisim.sensors.sensor import (
    DriveSettings,
    Instrument,
    Measurement,
    Moment,
    MountedSensor,
    RendererInstrument,
)
from omnisim.sensors.sensor_mount import Level, Positive, SensorMount

DEPTH_SUFFIX = ".png"
STEPS_PER_M = 1000.0
DEVICES = {"kinect_v1": DepthCamera.kinect_v1, "d435": DepthCamera.d435}


@dataclass(frozen=True, eq=False, repr=False)
class MountedDepthCamera(MountedSensor):
    """Depth camera on its vehicle.

    Attributes:
        camera: geometry and error model.
        base_from_camera: (4, 4); it looks along x.
    """

    camera: DepthCamera
    base_from_camera: NDArray[np.float64]
    noun: ClassVar[str] = "depth"
    origin_noun: ClassVar[str] = "viewpoint"
    suffixes: ClassVar[tuple[str, ...]] = (DEPTH_SUFFIX,)
    document_names: ClassVar[tuple[str, ...]] = (CALIBRATION,)

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Viewpoint (3,), base."""
        return self.base_from_camera[:3, 3]

    @property
    def near_m(self) -> float:
        """Distance below which nothing is seen."""
        return self._as_sensor.near_m

    def summary(self) -> str:
        """Size and range."""
        camera = self.camera
        return (
            f"{camera.width_px} × {camera.height_px} px, "
            f"{camera.range_min_m:.3g} to {camera.range_max_m:g} m"
        )

    def documents(self) -> dict[str, str]:
        """Calibration."""
        return {CALIBRATION: calibration_json(self._as_sensor)}

    def open(self, stage: Stage, settings: DriveSettings) -> Instrument:
        """Open a renderer of depths; no two cameras of a vehicle share the seed of their noise."""
        renderer = DepthRenderer(
            stage,
            self.camera,
            base_from_camera=self.base_from_camera,
            hidden=self.hides,
            seed=f"{settings.seed} {self.name}",
            vehicle=settings.vehicle,
        )
        return DepthInstrument(renderer)

    @property
    def _as_sensor(self) -> OmniCamera:
        return OmniCamera(self.camera.model, base_from_rig=self.base_from_camera)


class DepthCameraMount(SensorMount):
    """Depth camera, looking along x; its errors follow from the drive's seed."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedDepthCamera

    type: Literal["depth_camera"]
    device: Literal["kinect_v1", "d435"] = "kinect_v1"
    """Size, field of view, range and errors: "kinect_v1" or Intel's "d435"."""
    noise: Annotated[bool, Field(strict=True)] = True
    """True: with the device's errors; false: depths are exact to the millimeter, holes stay."""
    width_px: Size | None = None
    """Width of the image; left out, as all that follows: the device's."""
    height_px: Size | None = None
    """Height of the image."""
    focal_length_px: Positive | None = None
    """Focal length; the optical axis is in the middle of the image."""
    baseline_m: Positive | None = None
    """Meters to the right, to the projector or the second camera."""
    is_stereo: Annotated[bool, Field(strict=True)] | None = None
    """True: a second camera with the same image; false: a projector that lights all of it."""
    range_min_m: Positive | None = None
    """Meters along the optical axis; nearer are holes."""
    range_max_m: Annotated[Number, Field(gt=0.0, le=MAX_RANGE_M)] | None = None
    """Meters along the optical axis; farther are holes."""
    max_incidence_deg: Annotated[Number, Field(gt=0.0, le=90.0)] | None = None
    """Degrees between ray and normal; beyond are holes."""
    disparity_sigma_px: Level | None = None
    """Standard deviation of the disparity, rounding included."""
    disparity_step_px: Level | None = None
    """Step of the disparity; 0: none."""

    def sensor(self, folder: Path, source: str) -> MountedSensor:
        """Mount the camera."""
        names = [field.name for field in dataclasses.fields(DepthCamera)]
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        try:
            camera = dataclasses.replace(DEVICES[self.device](), **given)
        except OpticsError as reason:
            raise RobotFileError(f"{source}: {str(reason).removeprefix('depth_camera.')}") from None
        camera = camera if self.noise else camera.without_noise()
        return MountedDepthCamera(self.type, self.name, self.hides, camera, self.base_from_mount)


class DepthInstrument(RendererInstrument[DepthRenderer]):
    """Takes a depth camera's images."""

    def measure(self, moment: Moment) -> DepthMeasurement:
        """Take the depths of a moment: a shutter that takes no time."""
        depths_m = self._renderer.measure(moment.motion(moment.time_s), moment.number)
        return DepthMeasurement(depths_m)


@dataclass(frozen=True, eq=False)
class DepthMeasurement(Measurement):
    """Depths of a depth camera.

    Attributes:
        depths_m: (height, width) along the optical axis, 0 in holes.
    """

    depths_m: NDArray[np.float32]

    def save(self, stem: Path) -> None:
        """Write millimeters in 16 bits, 0 in holes (ROS, REP 118), where they are missing.

        Raises:
            OutputError: the file cannot be written.
        """
        target = stem.with_suffix(DEPTH_SUFFIX)
        if not is_written(target):
            steps = np.round(self.depths_m * STEPS_PER_M).astype(np.uint16)
            write_numbers(target, steps, {"unit_m": 1.0 / STEPS_PER_M})
