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
| `/<lidar>/points` | PointCloud2 | stamp: the revolution's start; ring, `time` since then … |
| `/<imu>/data_raw` | Imu | at its own rate, without orientation |
| `/<sonar>/range` | Range | |
| `/odom` | Odometry | dead reckoning; absent for a rig |
| `/ground_truth/pose` | PoseStamped | true pose of the base in `map`, at the fastest rate |
| `/ground_truth/odom` | Odometry | the same, with true velocities in `base_link` |
| `/tf`, `/tf_static` | TFMessage | `map → odom → base_link → sensors`, `map → objects` |

Without odometry there is no frame `odom`: `map → base_link`.

Source: REP 103, 105, 117, 118; common_interfaces of Humble.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Literal

import numpy as np
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
from rosbags.typesys import Stores, get_typestore

from omnisim.core.errors import OutputError
from omnisim.core.poses import inverse
from omnisim.core.trajectories.odometry import Odometry
from omnisim.datasets.export.export_format import ExportFormat, ExportSettings, PrintNote
from omnisim.datasets.export.recording import Recording
from omnisim.datasets.export.ros2 import ros_messages as messages
from omnisim.datasets.export.ros2.streams import (
    BASE,
    LABELED,
    CameraStream,
    DepthStream,
    ImuStream,
    LidarStream,
    RangeStream,
    ScanStream,
    StampedMessage,
    Stream,
    ros_name,
)
from omnisim.rendering.sensor import SensorSettings
from omnisim.runs.run_folder import LABELS
from omnisim.sensors.depth_camera.depth_camera import DepthCamera
from omnisim.sensors.imu.imu import Imu
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar
from omnisim.sensors.range_sensor.range_sensor import RangeSensor

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
        motion = _Motion(recording, settings)
        stamps_ns = settings.stamps_ns(recording.truth.times_s, recording.run.path)
        for stream in streams:
            if isinstance(stream, CameraStream) and stream.lens is None:
                print_note(
                    f"{stream.name}: CameraInfo has no model of it: its calibration is on "
                    f"/{stream.topic}/calibration"
                )
        folder.rmdir()  # rosbags creates it
        with Bag(folder, self.storage) as bag:
            _write_latched(bag, streams, stamps_ns[0])
            if recording.run.has(LABELS):
                text = (recording.run.path / LABELS).read_text(encoding="utf-8")
                bag.write("/labels", stamps_ns[0], messages.text(text), is_latched=True)
            for step, stamp_ns in enumerate(stamps_ns):
                stamped = [one for stream in streams for one in stream.messages_of(step)]
                stamped += motion.between(step)
                for one in sorted(stamped, key=lambda one: one.stamp_ns):
                    bag.write(one.topic, one.stamp_ns, one.message)
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
                f"{recording.run.path}: expected a topic and frame of its own for {name}, got "
                f"{ros}, which is {taken[ros]}"
            )
        taken[ros] = name
    return streams


def _write_latched(bag: Bag, streams: list[Stream], stamp_ns: int) -> None:
    mounts = {(BASE, stream.frame): stream.base_from_frame() for stream in streams}
    if mounts:
        bag.write("/tf_static", stamp_ns, messages.transforms(stamp_ns, mounts), is_latched=True)
    for stream in streams:
        if isinstance(stream, CameraStream):
            text = messages.text(stream.calibration)
            bag.write(f"/{stream.topic}/calibration", stamp_ns, text, is_latched=True)


class _Motion:
    """Messages of a run's motion."""

    def __init__(self, recording: Recording, settings: ExportSettings):
        times_s = recording.state_times_s
        self._state_times_s, self._states = times_s, recording.states(times_s)
        self._stamps_ns = settings.stamps_ns(times_s, recording.run.path)
        self._truth = recording.truth
        self._odometry = recording.odometry
        self._reckoned = None if self._odometry is None else self._odometry.dead_reckoned()
        self._objects = recording.objects()

    def between(self, step: int) -> Iterator[StampedMessage]:
        """Messages of the true states after the previous step, up to a step's time."""
        steps_s, states = self._truth.times_s, self._states
        begin_s = steps_s[step - 1] if step > 0 else -np.inf
        end_s = steps_s[step] if step < len(steps_s) - 1 else np.inf
        first, last = np.searchsorted(self._state_times_s, (begin_s, end_s), side="right")
        for index in range(first, last):
            stamp_ns, pose = self._stamps_ns[index], states.world_from_base[index]
            truth = messages.pose_stamped(stamp_ns, MAP, pose)
            yield StampedMessage("/ground_truth/pose", stamp_ns, truth)
            velocity_mps = pose[:3, :3].T @ states.velocity_mps[index]
            rates = velocity_mps.tolist(), states.angular_rate_radps[index].tolist()
            odometry = messages.odometry(stamp_ns, (MAP, BASE), pose, *rates)
            yield StampedMessage("/ground_truth/odom", stamp_ns, odometry)

    def write(self, bag: Bag, step: int, stamp_ns: int) -> None:
        """Write the transforms and odometry of a step."""
        map_from_base = self._truth.world_from_base[step]
        poses = {(MAP, BASE): map_from_base}
        if self._odometry is not None and self._reckoned is not None:
            odom_from_base = self._reckoned.world_from_base[step]
            poses = {
                (MAP, ODOM): map_from_base @ inverse(odom_from_base),
                (ODOM, BASE): odom_from_base,
            }
            speed_mps, turn_rate_radps = self._rates(self._odometry, step)
            rates = (speed_mps, 0.0, 0.0), (0.0, 0.0, turn_rate_radps)
            reading = messages.odometry(stamp_ns, (ODOM, BASE), odom_from_base, *rates)
            bag.write("/odom", stamp_ns, reading)
        for name, motion in self._objects.items():
            poses[MAP, ros_name(name)] = motion.world_from_base[step]
        bag.write("/tf", stamp_ns, messages.transforms(stamp_ns, poses))

    @staticmethod
    def _rates(odometry: Odometry, step: int) -> tuple[float, float]:
        """Speed and turn rate since the previous step, as reported by the wheels."""
        if step == 0:
            return 0.0, 0.0
        duration_s = float(odometry.times_s[step] - odometry.times_s[step - 1])
        distance_m, turn_rad = odometry.distances_m[step - 1], odometry.turns_rad[step - 1]
        return float(distance_m) / duration_s, float(turn_rad) / duration_s


# ROS 2 bags: topics and messages in MCAP or SQLite files, by rosbags.


# Version 9 writes the quality of service in a form that older releases cannot read.
VERSION: Literal[8] = 8
STORAGE = {"mcap": StoragePlugin.MCAP, "sqlite": StoragePlugin.SQLITE3}
_UNLIMITED = QosTime(0, 0)


def _qos(durability: QosDurability) -> Qos:
    depth = 1 if durability is QosDurability.TRANSIENT_LOCAL else 10
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        QosReliability.RELIABLE,
        durability,
        _UNLIMITED,
        _UNLIMITED,
        QosLiveliness.AUTOMATIC,
        _UNLIMITED,
        False,
    )


class Bag:
    """Bag open for writing; a context manager.

    Args:
        folder: new folder of the bag.
        storage: key of `STORAGE`.
    """

    def __init__(self, folder: Path, storage: str):
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = Writer(folder, version=VERSION, storage_plugin=STORAGE[storage])
        self._connections: dict[str, Connection] = {}

    def __enter__(self) -> Bag:
        self._writer.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        reason: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._writer.close()
        else:
            self._writer.abort()

    def write(self, topic: str, stamp_ns: int, message: object, is_latched: bool = False) -> None:
        """Write a message of a type in `omnisim.datasets.export.ros2.ros_messages`.

        Args:
            topic: topic; all of its messages have the same type.
            stamp_ns: stamp of the message, nanoseconds since 1970.
            message: contents of the message.
            is_latched: True: late subscribers receive the topic's last message, too.
        """
        kind = type(message).__name__.replace("__", "/")
        if topic not in self._connections:
            durability = QosDurability.TRANSIENT_LOCAL if is_latched else QosDurability.VOLATILE
            self._connections[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store, offered_qos_profiles=[_qos(durability)]
            )
        self._writer.write(
            self._connections[topic], stamp_ns, self._store.serialize_cdr(message, kind)
        )
