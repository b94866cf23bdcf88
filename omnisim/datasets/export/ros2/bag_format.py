"""ROS 2 bags of runs.

| topic | type | |
| --- | --- | --- |
| `/<camera>/image_raw` | Image, rgb8 | `--compressed`: `/<camera>/image_raw/compressed`, PNG |
| `/<camera>/camera_info` | CameraInfo | only if CameraInfo represents the camera exactly |
| `/<camera>/calibration` | String, latched | omnisim's calibration, JSON: any model |
| `/<camera>/range` | Image, 32FC1 | meters along the ray, inf: nothing |
| `/<camera>/semantic`, `/<camera>/instance` | Image, 16UC1, 32SC1 | IDs in `/labels` |
| `/labels` | String, latched | table of classes and instances, JSON |
| `/<camera>/points` | PointCloud2 | `--points`: points from the ranges, with colors |
| `/<depth>/depth/image_rect`, `…/camera_info` | Image, 16UC1 | millimeters, 0: none (REP 118) |
| `/<scanner>/scan` | LaserScan | |
| `/<lidar>/points` | PointCloud2 | stamp: the revolution's start; fields: `cloud_layouts` |
| `/<imu>/data_raw` | Imu | at its own rate, without orientation |
| `/<sonar>/range` | Range | |
| `/odom` | Odometry | dead reckoning; absent for a rig |
| `/ground_truth/pose` | PoseStamped | true pose of the base in `map`, at the fastest rate |
| `/ground_truth/odom` | Odometry | the same, with true velocities in `base_link` |
| `/clock` | Clock | before the messages of each moment |
| `/tf`, `/tf_static` | TFMessage | `map → odom → base_link → sensors`, `map → objects` |

Without odometry there is no frame `odom`: `map → base_link`.

Source: REP 103, 105, 117, 118; common_interfaces of Humble.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import inverse
from omnisim.datasets.export.export_format import (
    ExportFormat,
    ExportSettings,
    PrintNote,
)
from omnisim.datasets.export.recording import ImuReadings, RecordedCamera, Recording, read_table
from omnisim.datasets.export.ros2 import ros_messages as messages
from omnisim.datasets.export.ros2 import sensor_messages as of_sensors
from omnisim.datasets.export.ros2.sensor_messages import LABELED, Messages, ros_name
from omnisim.rendering.camera.omnicamera import CALIBRATION
from omnisim.rendering.sensor import SensorSettings
from omnisim.runs.run_folder import LABELS
from omnisim.sensors.depth_camera.depth_camera import DepthCamera
from omnisim.sensors.imu.imu import Imu
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from omnisim.sensors.range_sensor.range_sensor import RangeSensor

# Streams: the ROS 2 messages of a run's sensors, on the topics of each sensor.


BASE, CLOCK = "base_link", "/clock"
CLOUD_COLORS = "rgb"
SCAN_COLUMNS = ("beam", "angle_deg", "range_m")


class StampedMessage(NamedTuple):
    """Message to write to a bag."""

    topic: str
    stamp_ns: int
    message: object


class Stream(ABC):
    """Stream of one sensor of a run, by name, in the frame `frame`."""

    def __init__(self, recording: Recording, name: str, settings: ExportSettings):
        self.recording, self.name, self.settings = recording, name, settings
        self.topic = ros_name(name)
        self.frame = self.topic

    @abstractmethod
    def base_from_frame(self) -> Floats:
        """Pose (4, 4) of the sensor's frame on the base."""

    @abstractmethod
    def messages_at(self, step: int, stamp_ns: int) -> Messages:
        """Messages of a measurement by topic, by its number `step` from 0."""

    def messages_of(self, step: int) -> Iterator[StampedMessage]:
        """Messages of all measurements after the previous step, up to a step's time."""
        for index in self._indices_of(step):
            stamp_ns = self._stamps_ns[index]
            for topic, message in self.messages_at(index, stamp_ns).items():
                yield StampedMessage(topic, stamp_ns, message)

    def _indices_of(self, step: int) -> Sequence[int]:
        return self.recording.indices_at(self.name, step)

    @cached_property
    def _stamps_ns(self) -> list[int]:
        times_s = self.recording.times_s(self.name)
        return self.settings.stamps_ns(times_s, self.recording.run.path)

    def _mount(self, world_from_sensor: Floats) -> Floats:
        """Pose (4, 4) of the sensor on the base, from its world pose at the first measurement."""
        first_s = float(self.recording.times_s(self.name)[0])
        return self.recording.mount(world_from_sensor, first_s)

    def _file(self, step: int) -> Path:
        """Table of a measurement."""
        return self.recording.run.file(self.name, step, ".csv")


class OpticalStream(Stream):
    """Base of the streams of cameras, in their optical frames."""

    def __init__(self, recording: Recording, camera: RecordedCamera, settings: ExportSettings):
        super().__init__(recording, camera.name, settings)
        self.camera = camera
        self.frame = of_sensors.optical_frame(camera.name)
        self.lens = of_sensors.true_lens(camera.name, camera.mount.camera)

    def base_from_frame(self) -> Floats:
        """Pose (4, 4) of the optical frame on the base."""
        return self.camera.mount.base_from_optical

    def _points(self, stamp_ns: int, points_m: Floats, colors: Bytes | None) -> object:
        """Point cloud with x, y, z; and with colors, rgb as ROS viewers expect."""
        xyz = points_m.astype(np.float32)
        columns: list[tuple[str, NDArray[Any]]] = list(zip("xyz", xyz.T, strict=True))
        if colors is not None:
            bgra = np.zeros((len(colors), 4), dtype=np.uint8)
            bgra[:, :3] = colors[:, ::-1]
            columns.append((CLOUD_COLORS, bgra.view(np.float32)[:, 0]))
        return messages.point_cloud(stamp_ns, self.frame, messages.point_fields(columns))


class CameraStream(OpticalStream):
    """Images, ranges and points of a camera."""

    def messages_at(self, step: int, stamp_ns: int) -> Messages:
        """Image, calibration if ROS has the model, labels, ranges, and points if requested."""
        compressed, with_points = self.settings.compressed, self.settings.with_points
        image = self.camera.image(step) if with_points or not compressed else None
        names = [name for name in (*LABELED, "range") if self.camera.has(name)]
        channels = {name: self.camera.channel(step, name) for name in names}
        raw = None if compressed else image
        found = of_sensors.camera_messages(self.name, stamp_ns, raw, channels, self.lens)
        if compressed:
            png = self.camera.image_file(step).read_bytes()
            topic = f"/{self.topic}/image_raw/compressed"
            found = {topic: messages.compressed_image(stamp_ns, self.frame, png), **found}
        if with_points and "range" in channels:
            points_m, hit = self.camera.points_m(channels["range"])
            colors = None if image is None else image[hit]
            found[f"/{self.topic}/points"] = self._points(stamp_ns, points_m, colors)
        return found


class DepthStream(OpticalStream):
    """Depths of a depth camera."""

    def __init__(self, recording: Recording, name: str, settings: ExportSettings):
        super().__init__(recording, recording.depth_camera(name), settings)

    def messages_at(self, step: int, stamp_ns: int) -> Messages:
        """Depths in millimeters, the calibration, and points if requested."""
        depths = read_image(self.camera.image_file(step))[0][..., 0].astype(np.uint16)
        found = of_sensors.depth_messages(self.name, stamp_ns, depths, self.lens)
        if self.settings.with_points:
            with np.errstate(divide="ignore"):
                ranges_m = 1e-3 * np.where(depths, depths, np.inf) / self.camera.directions[..., 2]
            points_m, _ = self.camera.points_m(ranges_m)
            found[f"/{self.topic}/depth/points"] = self._points(stamp_ns, points_m, None)
        return found


class ScanStream(Stream):
    """Scans of a laser scanner."""

    def base_from_frame(self) -> Floats:
        """Pose (4, 4) of the scanner on the base."""
        scan = read_table(self._file(0), *SCAN_COLUMNS).header
        return self._mount(scan.pose("world_from_scanner"))

    def messages_at(self, step: int, stamp_ns: int) -> Messages:
        """Message of one scan."""
        scan = read_table(self._file(step), *SCAN_COLUMNS)
        limits_m = scan.header.number("range_min_m"), scan.header.number("range_max_m")
        angles_rad, ranges_m = np.radians(scan.columns["angle_deg"]), scan.columns["range_m"]
        return of_sensors.scan_messages(
            self.name, stamp_ns, angles_rad, ranges_m, limits_m, self._period_s
        )

    @cached_property
    def _period_s(self) -> float:
        """Time between scans; 0 for a single one."""
        times_s = self.recording.times_s(self.name)
        return float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0


class RangeStream(Stream):
    """Ranges of a sonar or infrared sensor."""

    def base_from_frame(self) -> Floats:
        """Pose (4, 4) of the sensor on the base."""
        header = read_table(self._file(0), "range_m").header
        return self._mount(header.pose("world_from_sensor"))

    def messages_at(self, step: int, stamp_ns: int) -> Messages:
        """Message of one range."""
        table = read_table(self._file(step), "range_m")
        header, (range_m,) = table.header, table.columns["range_m"][:1].tolist()
        limits_m = header.number("range_min_m"), header.number("range_max_m")
        cone_deg = header.number("beam_angle_deg")
        return of_sensors.range_messages(self.name, stamp_ns, cone_deg, limits_m, range_m)


class LidarStream(Stream):
    """Point clouds of a lidar."""

    def base_from_frame(self) -> Floats:
        """Pose (4, 4) of the lidar on the base."""
        return self.recording.base_from_lidar(self.name)

    def messages_at(self, step: int, stamp_ns: int) -> Messages:
        """Point cloud in the chosen layout, stamped with the start of the revolution."""
        cloud = self.recording.cloud(self.name, step)
        turn = cloud.header.count("elevations_deg"), cloud.header.number("rate_hz")
        layout = self.settings.cloud_layout
        return of_sensors.cloud_messages(self.name, stamp_ns, cloud.points, *turn, layout)


class ImuStream(Stream):
    """Readings of an IMU."""

    def base_from_frame(self) -> Floats:
        """Pose (4, 4) of the IMU on the base."""
        return self.recording.base_from_imu(self.name)

    def messages_at(self, step: int, stamp_ns: int) -> Messages:
        """Message of one reading."""
        return of_sensors.imu_messages(self.name, stamp_ns, self._readings.values[step].tolist())

    def _indices_of(self, step: int) -> Sequence[int]:
        return _since(self.recording.truth.times_s, step, self._readings.times_s)

    @cached_property
    def _readings(self) -> ImuReadings:
        return self.recording.imu_readings(self.name)

    @cached_property
    def _stamps_ns(self) -> list[int]:
        return self.settings.stamps_ns(self._readings.times_s, self.recording.run.path)


def _since(steps_s: Floats, step: int, times_s: Floats) -> range:
    """Indices of the times (n,) after the previous step, up to a step's time."""
    begin_s = steps_s[step - 1] if step > 0 else -np.inf
    end_s = steps_s[step] if step < len(steps_s) - 1 else np.inf
    return range(*np.searchsorted(times_s, (begin_s, end_s), side="right").tolist())


class MessageWriter(Protocol):
    """Receiver of the messages of a run, such as a bag."""

    def write(self, topic: str, stamp_ns: int, message: object, is_latched: bool = False) -> None:
        """Take a message, see `Bag.write`."""


OpenStream = Callable[[Recording, str, ExportSettings], Stream]
MAP, ODOM = "map", "odom"
STREAMS: tuple[tuple[type[SensorSettings], OpenStream], ...] = (
    (DepthCamera, DepthStream),
    (LaserScanner, ScanStream),
    (SpinningLidar, LidarStream),
    (Imu, ImuStream),
    (RangeSensor, RangeStream),
)


class Ros2Bag(ExportFormat):
    """Base of the ROS 2 bag formats; subclasses set the storage."""

    has_messages = True
    holds_motion = True
    has_clocks = True
    channels = ("range", *LABELED)
    sensors = tuple(kind for kind, _ in STREAMS)
    storage: ClassVar[str]

    def write(
        self, recording: Recording, folder: Path, settings: ExportSettings, print_note: PrintNote
    ) -> Iterator[int]:
        """Write the bag, step by step."""
        streams = open_streams(recording, settings)
        for stream in streams:
            if isinstance(stream, CameraStream) and stream.lens is None:
                print_note(
                    f"{stream.name}: CameraInfo has no model for it: its calibration is on "
                    f"/{stream.topic}/calibration"
                )
        folder.rmdir()  # rosbags creates it
        with Bag.open(folder, self.storage) as bag:
            yield from write_messages(recording, streams, settings, bag)


def write_messages(
    recording: Recording, streams: Sequence[Stream], settings: ExportSettings, bag: MessageWriter
) -> Iterator[int]:
    """Write all messages of a run, step by step; yields the number of finished steps.

    Raises:
        OmnisimError: a file of the run is damaged.
    """
    motion = _Motion(recording, settings)
    stamps_ns = settings.stamps_ns(recording.truth.times_s, recording.run.path)
    first_ns = stamps_ns[0]
    mounts = {(BASE, stream.frame): stream.base_from_frame() for stream in streams}
    if mounts:
        bag.write("/tf_static", first_ns, messages.transforms(first_ns, mounts), is_latched=True)
    for stream in streams:
        if isinstance(stream, CameraStream):
            file = recording.run.path / stream.name / CALIBRATION
            content = messages.text(file.read_text(encoding="utf-8"))
            bag.write(f"/{stream.topic}/calibration", first_ns, content, is_latched=True)
    if recording.run.has(LABELS):
        text = (recording.run.path / LABELS).read_text(encoding="utf-8")
        bag.write("/labels", first_ns, messages.text(text), is_latched=True)
    for step, stamp_ns in enumerate(stamps_ns):
        stamped = [message for stream in streams for message in stream.messages_of(step)]
        stamped += motion.between(step)
        times_ns = {message.stamp_ns for message in stamped} | {stamp_ns}
        clock = [StampedMessage(CLOCK, at_ns, messages.clock(at_ns)) for at_ns in times_ns]
        for message in sorted(clock + stamped, key=lambda message: message.stamp_ns):
            bag.write(*message)
        motion.write(bag, step, stamp_ns)
        yield step + 1


class Ros2Mcap(Ros2Bag):
    """Bag in an MCAP file."""

    name = "ros2-mcap"
    storage = "mcap"


class Ros2Sqlite(Ros2Bag):
    """Bag in an SQLite file."""

    name = "ros2-sqlite"
    storage = "sqlite"


def open_streams(recording: Recording, settings: ExportSettings) -> list[Stream]:
    """Streams of all sensors.

    Raises:
        OutputError: two streams with equal names of topics or frames.
    """
    streams: list[Stream] = [
        CameraStream(recording, camera, settings) for camera in recording.cameras
    ]
    for kind, open_stream in STREAMS:
        streams += [open_stream(recording, name, settings) for name in recording.sensors(kind)]
    sources = [(stream.topic, stream.name) for stream in streams]
    sources += [(ros_name(name), name) for name in recording.objects()]
    taken = {MAP: "the world", ODOM: "the odometry", BASE: "the vehicle", "labels": "the labels"}
    for ros, name in sources:
        if ros in taken:
            raise OutputError(
                f"{recording.run.path}: expected a unique topic and frame for {name}, got "
                f"{ros}, which is that of {taken[ros]}"
            )
        taken[ros] = name
    return streams


class _Motion:
    """Messages of a run's motion."""

    def __init__(self, recording: Recording, settings: ExportSettings):
        times_s = recording.state_times_s
        self._state_times_s, self._states = times_s, recording.states(times_s)
        self._stamps_ns = settings.stamps_ns(times_s, recording.run.path)
        self._truth = recording.truth
        self._odometry = recording.odometry
        self._reckoned = None if self._odometry is None else self._odometry.dead_reckoned()
        self._objects, self._with_map = recording.objects(), settings.with_map

    def between(self, step: int) -> Iterator[StampedMessage]:
        """Messages of the true states after the previous step, up to a step's time."""
        states = self._states
        for index in _since(self._truth.times_s, step, self._state_times_s):
            stamp_ns, pose = self._stamps_ns[index], states.world_from_base[index]
            truth = messages.pose_stamped(stamp_ns, MAP, pose)
            yield StampedMessage("/ground_truth/pose", stamp_ns, truth)
            velocity_mps = pose[:3, :3].T @ states.velocity_mps[index]
            rates = velocity_mps.tolist(), states.angular_rate_radps[index].tolist()
            odometry = messages.odometry(stamp_ns, (MAP, BASE), pose, *rates)
            yield StampedMessage("/ground_truth/odom", stamp_ns, odometry)

    def write(self, bag: MessageWriter, step: int, stamp_ns: int) -> None:
        """Write the transforms and odometry of a step."""
        map_from_base = self._truth.world_from_base[step]
        poses = {(MAP, BASE): map_from_base}
        if self._odometry is not None and self._reckoned is not None:
            odom_from_base = self._reckoned.world_from_base[step]
            poses = {
                (MAP, ODOM): map_from_base @ inverse(odom_from_base),
                (ODOM, BASE): odom_from_base,
            }
            speed_mps = turn_rate_radps = 0.0  # since the previous step, by the wheels
            if step > 0:
                wheels, before = self._odometry, step - 1
                duration_s = float(wheels.times_s[step] - wheels.times_s[before])
                speed_mps = float(wheels.distances_m[before]) / duration_s
                turn_rate_radps = float(wheels.turns_rad[before]) / duration_s
            rates = (speed_mps, 0.0, 0.0), (0.0, 0.0, turn_rate_radps)
            reading = messages.odometry(stamp_ns, (ODOM, BASE), odom_from_base, *rates)
            bag.write("/odom", stamp_ns, reading)
        for name, motion in self._objects.items():
            poses[MAP, ros_name(name)] = motion.world_from_base[step]
        if not self._with_map:
            poses = {frames: pose for frames, pose in poses.items() if MAP not in frames}
        bag.write("/tf", stamp_ns, messages.transforms(stamp_ns, poses))


# ROS 2 bags: topics and messages in MCAP or SQLite files, by rosbags.


# Version 9 writes the quality of service in a form that older releases cannot read.
VERSION: Literal[8] = 8
STORAGE = {"mcap": StoragePlugin.MCAP, "sqlite": StoragePlugin.SQLITE3}
_UNLIMITED = QosTime(0, 0)


class Bag:
    """Bag open for writing."""

    def __init__(self, writer: Writer):
        self._writer = writer
        self._connections: dict[str, Connection] = {}

    @classmethod
    @contextmanager
    def open(cls, folder: Path, storage: str) -> Iterator[Bag]:
        """Bag in a new folder, in a storage of `STORAGE`; for a `with` block."""
        writer = Writer(folder, version=VERSION, storage_plugin=STORAGE[storage])
        writer.open()
        try:
            yield cls(writer)
        except BaseException:
            writer.abort()
            raise
        writer.close()

    def write(self, topic: str, stamp_ns: int, message: object, is_latched: bool = False) -> None:
        """Write a message of a type in `omnisim.datasets.export.ros2.ros_messages`.

        All messages of a topic have the same type. Late subscribers receive a latched topic's last
        message, too. Stamps are nanoseconds since 1970.
        """
        if topic not in self._connections:
            kind = messages.message_type(message)
            durability = QosDurability.TRANSIENT_LOCAL if is_latched else QosDurability.VOLATILE
            quality = Qos(
                QosHistory.KEEP_LAST, 1 if is_latched else 10, QosReliability.RELIABLE, durability,
                _UNLIMITED, _UNLIMITED, QosLiveliness.AUTOMATIC, _UNLIMITED, False,
            )  # fmt: skip
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=messages.STORE, offered_qos_profiles=[quality]
            )
        self._writer.write(self._connections[topic], stamp_ns, messages.serialized(message))
