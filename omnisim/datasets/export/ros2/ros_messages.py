"""ROS 2 messages of arrays, and their bytes; `sensor_messages` has those of sensors, by topic.

Frames follow REP 103: x forward, y left, z up; in names that end in `_optical_frame`, x right, y
down, z forward. Missing ranges are ±inf (REP 117), missing depths 0 (REP 118).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.stores.ros2_humble import builtin_interfaces__msg__Time as Time
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__Point as Point
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__Pose as Pose
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__PoseStamped as PoseStamped
from rosbags.typesys.stores.ros2_humble import (
    geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance,
)
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__Quaternion as Quaternion
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__Transform as Transform
from rosbags.typesys.stores.ros2_humble import (
    geometry_msgs__msg__TransformStamped as TransformStamped,
)
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__Twist as Twist
from rosbags.typesys.stores.ros2_humble import (
    geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance,
)
from rosbags.typesys.stores.ros2_humble import geometry_msgs__msg__Vector3 as Vector3
from rosbags.typesys.stores.ros2_humble import nav_msgs__msg__MapMetaData as MapMetaData
from rosbags.typesys.stores.ros2_humble import nav_msgs__msg__OccupancyGrid as OccupancyGrid
from rosbags.typesys.stores.ros2_humble import nav_msgs__msg__Odometry as Odometry
from rosbags.typesys.stores.ros2_humble import rosgraph_msgs__msg__Clock as Clock
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__CameraInfo as CameraInfo
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__CompressedImage as CompressedImage
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__Image as Image
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__Imu as Imu
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__LaserScan as LaserScan
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__PointField as PointField
from rosbags.typesys.stores.ros2_humble import sensor_msgs__msg__Range as Range
from rosbags.typesys.stores.ros2_humble import (
    sensor_msgs__msg__RegionOfInterest as RegionOfInterest,
)
from rosbags.typesys.stores.ros2_humble import std_msgs__msg__Header as Header
from rosbags.typesys.stores.ros2_humble import std_msgs__msg__String as String
from rosbags.typesys.stores.ros2_humble import tf2_msgs__msg__TFMessage as TFMessage

from omnisim.cameras.calibration.formats.ros import IDENTITY, CameraInfoLens, camera_info
from omnisim.core.arrays import Floats
from omnisim.core.poses import pose as pose_at
from omnisim.core.poses import quaternion_from_rotation
from omnisim.datasets.export.export_format import NANOSECONDS

# Type numbers of sensor_msgs/PointField.
_POINT_TYPES = {"u1": 2, "u2": 4, "u4": 6, "f4": 7, "f8": 8}
_ENCODINGS = {
    ("uint8", 3): "rgb8",
    ("uint16", 1): "16UC1",
    ("uint32", 1): "32SC1",  # ROS has no unsigned type
    ("float32", 1): "32FC1",
}
UNKNOWN = np.zeros(36)  # covariance


def header(stamp_ns: int, frame: str) -> Header:
    """Header of a message."""
    return Header(Time(*divmod(stamp_ns, NANOSECONDS)), frame)


def clock(stamp_ns: int) -> Clock:
    """Message of the simulated time, for nodes with `use_sim_time`."""
    return Clock(Time(*divmod(stamp_ns, NANOSECONDS)))


def image(stamp_ns: int, frame: str, pixels: NDArray[Any]) -> Image:
    """Image message of pixels (height, width, 3) uint8, or depths or labels (height, width)."""
    height, width = pixels.shape[:2]
    kind = pixels.dtype.name, 1 if pixels.ndim == 2 else pixels.shape[2]
    data = np.ascontiguousarray(pixels).reshape(-1).view(np.uint8)
    return Image(
        header(stamp_ns, frame), height, width, _ENCODINGS[kind], 0, len(data) // height, data
    )


def compressed_image(
    stamp_ns: int, frame: str, content: bytes, kind: str = "png"
) -> CompressedImage:
    """Image message with the bytes of a PNG file, or of another kind of file."""
    return CompressedImage(header(stamp_ns, frame), kind, np.frombuffer(content, dtype=np.uint8))


def occupancy_grid(
    stamp_ns: int, frame: str, cells: NDArray[np.int8], low_m: Floats, cell_m: float
) -> OccupancyGrid:
    """Map message of cells (rows, columns), rows along y; `low_m` (2,) is its lower corner."""
    height, width = cells.shape
    origin = _pose(pose_at((*low_m.tolist(), 0.0)))
    about = MapMetaData(Time(*divmod(stamp_ns, NANOSECONDS)), cell_m, width, height, origin)
    return OccupancyGrid(header(stamp_ns, frame), about, cells.ravel())


def camera_info_message(stamp_ns: int, frame: str, lens: CameraInfoLens) -> CameraInfo:
    """CameraInfo message with the calibration of a lens."""
    model, d, k, _, p = camera_info(lens)
    return CameraInfo(
        header(stamp_ns, frame), lens.height_px, lens.width_px, model,
        np.array(d), np.array(k), np.array(IDENTITY), np.array(p),
        0, 0, RegionOfInterest(0, 0, 0, 0, False),
    )  # fmt: skip


def point_cloud(stamp_ns: int, frame: str, points: NDArray[np.void]) -> PointCloud2:
    """Point cloud message; its fields are the fields of the structured array."""
    fields = []
    for name in points.dtype.names or ():
        values = points[name]
        offset = int(points.dtype.fields[name][1]) if points.dtype.fields else 0
        fields.append(PointField(name, offset, _POINT_TYPES[values.dtype.str[1:]], 1))
    size, count = points.dtype.itemsize, len(points)
    data = np.frombuffer(points.tobytes(), dtype=np.uint8)
    return PointCloud2(
        header(stamp_ns, frame), 1, count, fields, False, size, size * count, data, True
    )


def livox_cloud(stamp_ns: int, frame: str, points: NDArray[np.void]) -> object:
    """CustomMsg of livox_ros_driver2 with points of the layout `livox-custom`."""
    cloud, reserved = STORE.types[LIVOX_CLOUD], np.zeros(3, dtype=np.uint8)
    records = points.view(np.recarray)
    return cloud(header(stamp_ns, frame), stamp_ns, len(points), 0, reserved, records)


def laser_scan(
    stamp_ns: int,
    frame: str,
    angles_rad: Floats,
    ranges_m: Floats,
    limits_m: tuple[float, float],
    period_s: float = 0.0,
) -> LaserScan:
    """Scan message of evenly spaced beams that fire at once, counter-clockwise.

    `limits_m` are the minimum and maximum range, `period_s` the time between scans, 0 if unknown.
    """
    first, last = float(angles_rad[0]), float(angles_rad[-1])
    step = (last - first) / max(1, len(angles_rad) - 1)
    ranges, none = ranges_m.astype(np.float32), np.zeros(0, dtype=np.float32)
    return LaserScan(
        header(stamp_ns, frame), first, last, step, 0.0, period_s, *limits_m, ranges, none
    )


def range_message(
    stamp_ns: int, frame: str, cone_rad: float, limits_m: tuple[float, float], range_m: float
) -> Range:
    """Range message of a sonar, or with `cone_rad` = 0 of an infrared sensor, which has one ray."""
    kind = Range.ULTRASOUND if cone_rad else Range.INFRARED
    return Range(header(stamp_ns, frame), kind, cone_rad, *limits_m, range_m)


def imu(
    stamp_ns: int, frame: str, rates_radps: Sequence[float], forces_mps2: Sequence[float]
) -> Imu:
    """IMU message without orientation: angular rates (3,) and specific forces (3,)."""
    return Imu(
        header(stamp_ns, frame), Quaternion(0.0, 0.0, 0.0, 1.0), np.array([-1.0, *[0.0] * 8]),
        Vector3(*rates_radps), UNKNOWN[:9], Vector3(*forces_mps2), UNKNOWN[:9],
    )  # fmt: skip


def odometry(
    stamp_ns: int,
    frames: tuple[str, str],
    pose: Floats,
    velocity_mps: Sequence[float],
    angular_rate_radps: Sequence[float],
) -> Odometry:
    """Odometry message with the pose (4, 4) parent_from_child of two named frames.

    Velocity (3,) and angular rate (3,) are in the child frame.
    """
    parent, child = frames
    twist = Twist(Vector3(*velocity_mps), Vector3(*angular_rate_radps))
    placed = PoseWithCovariance(_pose(pose), UNKNOWN)
    moving = TwistWithCovariance(twist, UNKNOWN)
    return Odometry(header(stamp_ns, parent), child, placed, moving)


def pose_stamped(stamp_ns: int, frame: str, pose: Floats) -> PoseStamped:
    """Message of a pose (4, 4) in a frame."""
    return PoseStamped(header(stamp_ns, frame), _pose(pose))


def transforms(stamp_ns: int, poses: Mapping[tuple[str, str], Floats]) -> TFMessage:
    """Transform message of the poses (4, 4) of child frames, by names of parent and child."""
    stamped = []
    for (parent, child), pose in poses.items():
        transform = Transform(Vector3(*pose[:3, 3].tolist()), _quaternion(pose))
        stamped.append(TransformStamped(header(stamp_ns, parent), child, transform))
    return TFMessage(stamped)


def text(content: str) -> String:
    """Text message."""
    return String(content)


def point_fields(columns: Iterable[tuple[str, NDArray[Any]]]) -> NDArray[np.void]:
    """Packed records (n,) of columns (n,), by name."""
    named = list(columns)
    records = np.empty(len(named[0][1]), dtype=[(name, values.dtype.str) for name, values in named])
    for name, values in named:
        records[name] = values
    return records


# Bytes of messages, and the types that ROS itself lacks. Source: livox_ros_driver2/msg.


LIVOX = "livox_ros_driver2/msg/"
LIVOX_POINT, LIVOX_CLOUD = f"{LIVOX}CustomPoint", f"{LIVOX}CustomMsg"
_LIVOX_FIELDS = {
    LIVOX_POINT: "uint32 offset_time, float32 x, float32 y, float32 z, uint8 reflectivity, "
    "uint8 tag, uint8 line",
    LIVOX_CLOUD: "std_msgs/Header header, uint64 timebase, uint32 point_num, uint8 lidar_id, "
    "uint8[3] rsvd, livox_ros_driver2/CustomPoint[] points",
}
STORE = get_typestore(Stores.ROS2_HUMBLE)
for _kind, _fields in _LIVOX_FIELDS.items():
    STORE.register(get_types_from_msg(_fields.replace(", ", "\n"), _kind))


def message_type(message: object) -> str:
    """Type of a message, such as `sensor_msgs/msg/Imu`."""
    return type(message).__name__.replace("__", "/")


def serialized(message: object) -> bytes:
    """Bytes of a message: CDR, little-endian, with its header of 4 bytes."""
    kind = message_type(message)
    if kind != LIVOX_CLOUD:
        return bytes(STORE.serialize_cdr(message, kind))
    # Points are the last bytes, the last one without its padding: as objects they take 1 s.
    points = message.points  # type: ignore[attr-defined]
    empty = STORE.types[kind](**{**vars(message), "points": []})
    count = len(points).to_bytes(4, "little")
    return bytes(STORE.serialize_cdr(empty, kind))[:-4] + count + points.tobytes()[:-1]


def definition(kind: str) -> str:
    """Definition of a message type and of the types within, as in MCAP's schema `ros2msg`."""
    return STORE.generate_msgdef(kind, ros_version=2)[0]


def type_hash(kind: str) -> str:
    """RIHS01 hash of a message type, by which nodes of ROS 2 from Iron on match topics."""
    return STORE.hash_rihs01(kind)


def _pose(pose: Floats) -> Pose:
    return Pose(Point(*pose[:3, 3].tolist()), _quaternion(pose))


def _quaternion(pose: Floats) -> Quaternion:
    return Quaternion(*quaternion_from_rotation(pose[None, :3, :3])[0].tolist())
