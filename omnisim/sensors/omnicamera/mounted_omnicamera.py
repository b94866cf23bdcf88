"""Omnidirectional cameras on vehicles: images with channels of ground truth.

A camera moves during the exposure, has its own noise, and its auto-exposure depends on the previous
image. That image's metadata, also in its file, has the two required numbers, so an interrupted
drive resumes with the same bytes.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import NonCentralCamera
from omnisim.core.errors import OmnisimError, RobotFileError, RunError
from omnisim.core.extras import missing_packages
from omnisim.core.files.atomic_file import is_written
from omnisim.core.files.image_files import read_image
from omnisim.core.files.toml_file import find_beside
from omnisim.core.trajectories import Trajectory
from omnisim.core.world import WorldState
from omnisim.ground_truth.boxes_3d import boxes_json
from omnisim.ground_truth.channel_files import BOXES_3D, write_sidecars
from omnisim.ground_truth.coco import coco_image, write_json
from omnisim.ground_truth.exr import write_exr
from omnisim.ground_truth.frame import Frame
from omnisim.ground_truth.npy import ChannelFormat
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_toml import sensor_toml
from omnisim.rendering.readback import Pending
from omnisim.rendering.renderer import Renderer
from omnisim.sensors.calibration_file import CALIBRATION, calibration_json
from omnisim.sensors.sensor import (
    DriveSettings,
    Measurement,
    Moment,
    MountedSensor,
    RenderedSensor,
    StepContent,
)
from omnisim.sensors.sensor_mount import SensorMount
from omnisim.sensors.sensor_names import Name

IMAGE_SUFFIX, CHANNELS_SUFFIX, BOXES_SUFFIX = ".png", ".channels.exr", ".coco.json"
DESCRIPTION_SUFFIX, BOXES_3D_SUFFIX = ".channels.json", f".{BOXES_3D}"
CAMERA_POSES = "poses.tum"  # poses of a rig's camera
VIEWPOINT_GRID = 33  # maximum number of rays per image side that define the viewpoint


@dataclass(frozen=True, eq=False, repr=False)
class MountedCamera(RenderedSensor):
    """Omnidirectional camera mounted on a vehicle.

    Attributes:
        sensor: camera; its `base_from_rig` composes the mounts of the robot file and the sensor
            file.
        time_shift_s: offset from an image's stamp to its capture time.
    """

    sensor: OmniCamera
    time_shift_s: float = 0.0
    noun: ClassVar[str] = "camera"
    origin_noun: ClassVar[str] = "effective viewpoint"
    suffixes: ClassVar[tuple[str, ...]] = (
        IMAGE_SUFFIX,
        CHANNELS_SUFFIX,
        DESCRIPTION_SUFFIX,
        ".*.npy",
        BOXES_SUFFIX,
        BOXES_3D_SUFFIX,
    )
    document_names: ClassVar[tuple[str, ...]] = ("sensor.toml", CALIBRATION, CAMERA_POSES)
    has_ground_truth: ClassVar[bool] = True

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Effective viewpoint (3,), base; for non-central optics, the point nearest the rays."""
        model, base_from_optical = self.sensor.model, self.sensor.base_from_optical
        if not isinstance(model, NonCentralCamera):
            return base_from_optical[:3, 3]
        from omnisim.cameras.optics.centrality import common_point  # needed by few cameras

        sizes = model.width_px, model.height_px
        u, v = (np.linspace(0.0, size - 1.0, min(size, VIEWPOINT_GRID)) for size in sizes)
        rays = model.ray_from_pixel(np.stack(np.meshgrid(u, v), axis=-1))
        if rays.origins_m is None or not rays.valid.any():
            return base_from_optical[:3, 3]
        nearest_m = common_point(rays.origins_m[rays.valid], rays.directions[rays.valid])
        nearest_from_origin_m: NDArray[np.float64] = base_from_optical[:3, :3] @ nearest_m
        return nearest_from_origin_m + base_from_optical[:3, 3]

    @property
    def near_m(self) -> float:
        """Minimum distance of visible surfaces."""
        return self.sensor.near_m

    @classmethod
    def suffixes_of(cls, content: StepContent) -> tuple[str, ...]:
        """Suffixes of an image, its channels, and its instances' bounding boxes."""
        channels, channel_format, boxes_3d, _ = content
        suffixes = [IMAGE_SUFFIX]
        if channels and channel_format is not ChannelFormat.NPY:
            suffixes.append(CHANNELS_SUFFIX)
        if channels and channel_format is not ChannelFormat.AUTO:
            suffixes += [*(f".{name}.npy" for name in channels), DESCRIPTION_SUFFIX]
        if "instance" in channels:
            suffixes.append(BOXES_SUFFIX)
        if boxes_3d:
            suffixes.append(BOXES_3D_SUFFIX)
        return tuple(suffixes)

    def settings(self) -> dict[str, Any]:
        """Settings of degradation and quality, and all parameters of an optical system.

        The optics are included because their files may change. Ray casting of unreliable samples is
        recorded because it depends on installed packages.
        """
        model, optics = self.sensor.model, {}
        if isinstance(model, NonCentralCamera):
            optics = {"optics": model.parameters(), "casts_rays": not missing_packages("rays")}
        return {
            **optics,
            **({"time_shift_s": self.time_shift_s} if self.time_shift_s else {}),
            "degradation": self.sensor.degradation.tables(),
            "quality": {
                "supersampling": self.sensor.supersampling,
                "texels_per_pixel": self.sensor.texels_per_pixel,
            },
        }

    def documents(self) -> dict[str, str]:
        """Texts of the sensor file and the calibration file, by file name."""
        return {
            "sensor.toml": sensor_toml(self.sensor),
            CALIBRATION: calibration_json(self.sensor),
        }

    def check_trajectory(self, truth: Trajectory, times_s: NDArray[np.float64]) -> None:
        """Raise an error if an exposure lasts longer than the time to the next image.

        Raises:
            RunError: an exposure is too long; names camera, step, exposure and limit.
        """
        exposure_s = self.sensor.degradation.exposure_s
        periods_s = np.diff(times_s)
        if np.any(periods_s < exposure_s):
            step = int(np.argmin(periods_s))
            what = "step" if self.rate is None else "image"
            raise RunError(
                f"camera {self.name!r}: degradation.shutter.exposure_s: expected at most "
                f"{periods_s[step]:g} s, the time from {what} {step} to {step + 1}, got "
                f"{exposure_s:g}"
            )

    def measure(self, renderer: Renderer, settings: DriveSettings, moment: Moment) -> Measurement:
        """Render the image at a moment; auto-exposure follows the previous image's."""
        return self.begin(renderer, settings, moment).result()

    def begin(
        self, renderer: Renderer, settings: DriveSettings, moment: Moment
    ) -> Pending[Measurement]:
        """Begin to render the image at a moment."""
        is_ideal = self.sensor.degradation.is_ideal

        def motion(time_s: float) -> WorldState | NDArray[np.float64]:
            return moment.motion(time_s + self.time_shift_s)

        pending = renderer.submit(
            motion(moment.time_s),
            also=moment.channels,
            boxes_3d=settings.boxes_3d,
            next_state=None if moment.next_s is None else motion(moment.next_s),
            previous_state=None if moment.previous_s is None else motion(moment.previous_s),
            motion=None if is_ideal else motion,
            frame_number=moment.number,
            exposure_ev=self._exposure_ev(moment),
        )
        return Pending(
            lambda: CameraMeasurement(pending.result(), moment.number, settings.channel_format)
        )

    def _exposure_ev(self, moment: Moment) -> float | None:
        """Exposure reached by auto-exposure, EV; None: the image itself determines it."""
        degradation = self.sensor.degradation
        if degradation.exposure is None or not degradation.is_metered:
            return None
        if moment.previous_stem is None or moment.previous_s is None:
            return None
        path = moment.previous_stem.with_suffix(IMAGE_SUFFIX)
        previous = None if moment.previous is None else moment.previous.result().frame.metadata
        ev, metered_ev = _exposure(path, previous)
        return degradation.exposure.next_ev(ev, metered_ev, moment.time_s - moment.previous_s)


class OmniCameraMount(SensorMount):
    """Camera of a sensor file."""

    sensor_class: ClassVar[type[MountedSensor]] = MountedCamera

    type: Literal["omnicamera"]
    file: Name | None = None
    """Sensor file, relative to this file. Default: the paper's camera."""

    def sensor(self, folder: Path, source: str) -> MountedSensor:
        """Read the sensor file and mount its camera."""
        camera = OmniCamera()
        if self.file is not None:
            camera = OmniCamera.from_file(
                find_beside(folder, self.file, f"{source}: file", RobotFileError)
            )
        return MountedCamera(self.type, self.name, self.hides, camera.mounted(self.base_from_mount))


@dataclass(frozen=True, eq=False)
class CameraMeasurement(Measurement):
    """Image of a camera with channels of ground truth.

    Attributes:
        frame: rendered image with its channels.
        number: index of the step.
        channel_format: file format of the ground truth.
    """

    frame: Frame
    number: int
    channel_format: ChannelFormat

    def save(self, stem: Path) -> None:
        """Write the missing files: channels, boxes, and finally the image.

        Raises:
            OutputError: a file cannot be written.
        """
        frame, files = self.frame, self.channel_format
        image = stem.with_suffix(IMAGE_SUFFIX)
        target = stem.with_suffix(CHANNELS_SUFFIX)
        if frame.channels and files is not ChannelFormat.NPY and not is_written(target):
            write_exr(target, frame.channels, None, frame.metadata)
        if frame.channels and files is not ChannelFormat.AUTO:
            has_ray = frame.valid if frame.has_ray is None else frame.has_ray
            write_sidecars(image, frame.channels, None, frame.metadata, has_ray, ChannelFormat.NPY)
        target = stem.with_suffix(BOXES_SUFFIX)
        instances, labels = frame.channels.get("instance"), frame.labels
        if instances is not None and labels is not None and not is_written(target):
            write_json(target, coco_image(instances, labels, image.name, self.number))
        target = stem.with_suffix(BOXES_3D_SUFFIX)
        if frame.boxes_3d is not None and labels is not None and not is_written(target):
            write_json(target, boxes_json(frame.boxes_3d, labels, image.name, frame.metadata))
        if not is_written(image):
            dataclasses.replace(frame, channels={}, boxes_3d=None).save(image)


def _exposure(path: Path, metadata: dict[str, Any] | None) -> tuple[float, float]:
    """Exposure and metered exposure, EV, from the metadata of an image; None: read its file."""
    try:
        if metadata is None:
            _, metadata = read_image(path)
        exposure = (metadata or {})["degradation"]["exposure"]
        return float(exposure["ev"]), float(exposure["metered_ev"])
    except (OmnisimError, KeyError, TypeError, ValueError):
        raise RunError(
            f"{path}: has no exposure, which the next image's follows from: remove it, and it "
            "is taken again"
        ) from None
