"""Streams: the ROS 2 messages of a run's sensors, on the topics of each sensor."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.calibration import CalibratedCamera
from omnisim.cameras.calibration.encode import encode_exactly
from omnisim.cameras.calibration.formats.camera_info import CameraInfoLens
from omnisim.cameras.calibration.formats.ros import Ros
from omnisim.core.files.image_files import read_image
from omnisim.datasets.export.export_format import NANOSECONDS, ExportSettings
from omnisim.datasets.export.recorded_camera import RecordedCamera
from omnisim.datasets.export.recording import ImuReadings, Recording
from omnisim.datasets.export.ros2 import ros_messages as messages
from omnisim.datasets.export.stored_clouds import read_table
from omnisim.rendering.camera.omnicamera import CALIBRATION

BASE = "base_link"
CLOUD_COLORS = "rgb"
LABELED = ("semantic", "instance")  # channels with numbers of the run's labels


class StampedMessage(NamedTuple):
    """Message to write to a bag."""

    topic: str
    stamp_ns: int
    message: object


class Stream(ABC):
    """Stream of one sensor.

    Args:
        recording: run to export.
        name: name of the sensor.
        settings: settings of the export.

    Attributes:
        frame: name of the sensor's frame.
    """

    def __init__(self, recording: Recording, name: str, settings: ExportSettings):
        self.recording, self.name, self.settings = recording, name, settings
        self.topic = ros_name(name)
        self.frame = self.topic

    @abstractmethod
    def base_from_frame(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the sensor's frame on the base."""

    @abstractmethod
    def messages_at(self, step: int, stamp_ns: int) -> Iterator[StampedMessage]:
        """Messages of a measurement, by its number `step` from 0."""

    def messages_of(self, step: int) -> Iterator[StampedMessage]:
        """Messages of all measurements after the previous step, up to a step's time."""
        for index in self.recording.indices_at(self.name, step):
            yield from self.messages_at(index, self._stamps_ns[index])

    @cached_property
    def _stamps_ns(self) -> list[int]:
        times_s = self.recording.times_s(self.name)
        return self.settings.stamps_ns(times_s, self.recording.run.path)

    def _mount(self, world_from_sensor: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose (4, 4) of the sensor on the base, from its world pose at the first measurement."""
        first_s = float(self.recording.times_s(self.name)[0])
        return self.recording.mount(world_from_sensor, first_s)

    def _first_file(self, suffix: str) -> Path:
        return self.recording.run.file(self.name, 0, suffix)


class CameraStream(Stream):
    """Images, ranges and points of a camera."""

    def __init__(self, recording: Recording, camera: RecordedCamera, settings: ExportSettings):
        super().__init__(recording, camera.name, settings)
        self.camera = camera
        self.frame = f"{self.topic}_optical_frame"
        self.lens = true_lens(camera)

    @property
    def calibration(self) -> str:
        """Text of the calibration, omnisim's JSON."""
        return (self.camera.run.path / self.name / CALIBRATION).read_text(encoding="utf-8")

    def base_from_frame(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the optical frame on the base."""
        return self.camera.mount.base_from_optical

    def messages_at(self, step: int, stamp_ns: int) -> Iterator[StampedMessage]:
        """Image, calibration if ROS has the model, labels, ranges, and points if requested."""
        needs_image = not self.settings.compressed or self.settings.with_points
        image = self.camera.image(step) if needs_image else None
        if self.settings.compressed:
            png = self.camera.image_file(step).read_bytes()
            compressed = messages.compressed_image(stamp_ns, self.frame, png)
            yield StampedMessage(f"/{self.topic}/image_raw/compressed", stamp_ns, compressed)
        else:
            yield self._image("image_raw", stamp_ns, image)
        if self.lens is not None:
            info = messages.camera_info_message(stamp_ns, self.frame, self.lens)
            yield StampedMessage(f"/{self.topic}/camera_info", stamp_ns, info)
        for name in LABELED:
            if self.camera.has(name):
                yield self._image(name, stamp_ns, self.camera.channel(step, name))
        if not self.camera.has("range"):
            return
        ranges_m = self.camera.channel(step, "range")
        yield self._image("range", stamp_ns, ranges_m)
        if self.settings.with_points:
            points_m, hit = self.camera.points_m(ranges_m)
            cloud = colored_points(points_m, None if image is None else image[hit])
            message = messages.point_cloud(stamp_ns, self.frame, cloud)
            yield StampedMessage(f"/{self.topic}/points", stamp_ns, message)

    def _image(self, topic: str, stamp_ns: int, pixels: Any) -> StampedMessage:
        message = messages.image(stamp_ns, self.frame, pixels)
        return StampedMessage(f"/{self.topic}/{topic}", stamp_ns, message)


class DepthStream(Stream):
    """Depths of a depth camera."""

    def __init__(self, recording: Recording, name: str, settings: ExportSettings):
        super().__init__(recording, name, settings)
        self.camera = recording.depth_camera(name)
        self.frame = f"{self.topic}_optical_frame"
        self.lens = true_lens(self.camera)

    def base_from_frame(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the optical frame on the base."""
        return self.camera.mount.base_from_optical

    def messages_at(self, step: int, stamp_ns: int) -> Iterator[StampedMessage]:
        """Depths in millimeters, the calibration, and points if requested."""
        depths = read_image(self.camera.image_file(step))[0][..., 0].astype(np.uint16)
        image = messages.image(stamp_ns, self.frame, depths)
        yield StampedMessage(f"/{self.topic}/depth/image_rect", stamp_ns, image)
        if self.lens is not None:
            info = messages.camera_info_message(stamp_ns, self.frame, self.lens)
            yield StampedMessage(f"/{self.topic}/depth/camera_info", stamp_ns, info)
        if self.settings.with_points:
            with np.errstate(divide="ignore"):
                ranges_m = 1e-3 * np.where(depths, depths, np.inf) / self.camera.directions[..., 2]
            points_m, _ = self.camera.points_m(ranges_m)
            message = messages.point_cloud(stamp_ns, self.frame, colored_points(points_m, None))
            yield StampedMessage(f"/{self.topic}/depth/points", stamp_ns, message)


class ScanStream(Stream):
    """Scans of a laser scanner."""

    def base_from_frame(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the scanner on the base."""
        scan = read_table(self._first_file(".csv"), "beam", "angle_deg", "range_m").header
        return self._mount(scan.pose("world_from_scanner"))

    def messages_at(self, step: int, stamp_ns: int) -> Iterator[StampedMessage]:
        """Message of one scan."""
        path = self.recording.run.file(self.name, step, ".csv")
        scan = read_table(path, "beam", "angle_deg", "range_m")
        limits_m = scan.header.number("range_min_m"), scan.header.number("range_max_m")
        angles_rad = np.radians(scan.columns["angle_deg"])
        message = messages.laser_scan(
            stamp_ns, self.frame, angles_rad, scan.columns["range_m"], limits_m
        )
        yield StampedMessage(f"/{self.topic}/scan", stamp_ns, message)


class RangeStream(Stream):
    """Ranges of a sonar or infrared sensor."""

    def base_from_frame(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the sensor on the base."""
        header = read_table(self._first_file(".csv"), "range_m").header
        return self._mount(header.pose("world_from_sensor"))

    def messages_at(self, step: int, stamp_ns: int) -> Iterator[StampedMessage]:
        """Message of one range."""
        table = read_table(self.recording.run.file(self.name, step, ".csv"), "range_m")
        header = table.header
        message = messages.range_message(
            stamp_ns,
            self.frame,
            math.radians(header.number("beam_angle_deg")),
            (header.number("range_min_m"), header.number("range_max_m")),
            float(table.columns["range_m"][0]),
        )
        yield StampedMessage(f"/{self.topic}/range", stamp_ns, message)


class LidarStream(Stream):
    """Point clouds of a lidar."""

    def base_from_frame(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the lidar on the base."""
        return self.recording.base_from_lidar(self.name)

    def messages_at(self, step: int, stamp_ns: int) -> Iterator[StampedMessage]:
        """Point cloud with all fields, stamped with the start of the revolution.

        As drivers publish it, at the revolution's end: a point's time is stamp + `time`, which may
        be negative, since no stamp is before 1970.
        """
        cloud = self.recording.cloud(self.name, step)
        period_ns = round(NANOSECONDS / cloud.header.number("rate_hz"))
        start_ns = max(0, stamp_ns - period_ns)
        points = cloud.points.copy()
        points["time"] -= 1e-9 * (start_ns - (stamp_ns - period_ns))
        message = messages.point_cloud(start_ns, self.frame, points)
        yield StampedMessage(f"/{self.topic}/points", stamp_ns, message)


class ImuStream(Stream):
    """Readings of an IMU."""

    def base_from_frame(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the IMU on the base."""
        return self.recording.base_from_imu(self.name)

    def messages_at(self, step: int, stamp_ns: int) -> Iterator[StampedMessage]:
        """Message of one reading."""
        values = self._readings.values[step].tolist()
        message = messages.imu(stamp_ns, self.frame, values[:3], values[3:])
        yield StampedMessage(f"/{self.topic}/data_raw", stamp_ns, message)

    def messages_of(self, step: int) -> Iterator[StampedMessage]:
        """Messages of the readings after the previous step, up to a step's time."""
        steps_s, times_s = self.recording.truth.times_s, self._readings.times_s
        begin_s = steps_s[step - 1] if step > 0 else -np.inf
        end_s = steps_s[step] if step < len(steps_s) - 1 else np.inf
        first, last = np.searchsorted(times_s, (begin_s, end_s), side="right")
        for index in range(first, last):
            yield from self.messages_at(index, self._stamps_ns[index])

    @cached_property
    def _readings(self) -> ImuReadings:
        return self.recording.imu_readings(self.name)

    @cached_property
    def _stamps_ns(self) -> list[int]:
        return self.settings.stamps_ns(self._readings.times_s, self.recording.run.path)


def ros_name(name: str) -> str:
    """Nearest valid ROS name: ASCII letters, digits and _, no digit first."""
    safe = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return f"_{safe}" if safe[0].isdigit() else safe


def true_lens(camera: RecordedCamera) -> CameraInfoLens | None:
    """CameraInfo lens that represents the camera exactly; None: ROS has no such model."""
    if not camera.has_one_viewpoint:
        return None
    calibrated = CalibratedCamera(camera.name, camera.mount.camera)
    encoded = encode_exactly(calibrated, Ros(), camera.name)
    return None if encoded is None or encoded.metadata.mirrored else encoded.lens


def colored_points(
    points_m: NDArray[np.float64], colors: NDArray[np.uint8] | None
) -> NDArray[np.void]:
    """Records (n,) of points with x, y, z; and with colors, rgb as ROS viewers expect."""
    xyz = points_m.astype(np.float32)
    columns: list[tuple[str, NDArray[Any]]] = [
        (axis, xyz[:, index]) for index, axis in enumerate("xyz")
    ]
    if colors is not None:
        bgra = np.zeros((len(colors), 4), dtype=np.uint8)
        bgra[:, :3] = colors[:, ::-1]
        columns.append((CLOUD_COLORS, bgra.view(np.float32)[:, 0]))
    return messages.point_fields(columns)
