"""Messages of ROS 2 as Foxglove's own schemas.

| ROS 2 | Foxglove |
| --- | --- |
| Image, CompressedImage | RawImage, CompressedImage |
| CameraInfo | CameraCalibration: `equidistant` is called `kannala_brandt` |
| PointCloud2 | PointCloud, with the same fields |
| LaserScan | LaserScan |
| TFMessage | FrameTransforms |
| Odometry, PoseStamped | PoseInFrame: Foxglove and Lichtblick show it, but it has no velocities |
| OccupancyGrid | Grid of gray levels, which are shown without settings |
| others, such as Imu, Range and String | unchanged, in CDR: for them, Foxglove reads ROS's types |

Source: https://docs.foxglove.dev/docs/sdk/schemas, foxglove-sdk 0.30.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np

from omnisim.core.errors import ServeError
from omnisim.core.extras import require_extra
from omnisim.serve.publisher import Topic

require_extra("serve", "omnisim serve for Foxglove", ServeError)
from foxglove import Channel, Context, Schema, channels  # noqa: E402  # after what is missing
from foxglove import messages as fox  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402
from rosbags.typesys.store import Typestore  # noqa: E402

for _name in ("foxglove", "foxglove_py"):  # what clients send wrongly would fill the terminal
    logging.getLogger(_name).addHandler(logging.NullHandler())

_SCHEMAS = {
    "sensor_msgs/msg/Image": "RawImage",
    "sensor_msgs/msg/CompressedImage": "CompressedImage",
    "sensor_msgs/msg/CameraInfo": "CameraCalibration",
    "sensor_msgs/msg/PointCloud2": "PointCloud",
    "sensor_msgs/msg/LaserScan": "LaserScan",
    "tf2_msgs/msg/TFMessage": "FrameTransforms",
    "nav_msgs/msg/Odometry": "PoseInFrame",
    "geometry_msgs/msg/PoseStamped": "PoseInFrame",
    "nav_msgs/msg/OccupancyGrid": "Grid",
}
_CLOCK = "rosgraph_msgs/msg/Clock"
# By the type numbers of sensor_msgs/PointField, from 1.
_FIELD_TYPES = ("Int8", "Uint8", "Int16", "Uint16", "Int32", "Uint32", "Float32", "Float64")
_UNKNOWN_GRAY = 205  # of unexplored cells, as ROS's map files have it
_IDENTITY = fox.Pose(position=fox.Vector3(), orientation=fox.Quaternion(w=1.0))


@cache
def ros_types() -> Typestore:
    """Message types of ROS 2."""
    return get_typestore(Stores.ROS2_HUMBLE)


class Channels:
    """Channels of topics in a context of their own: that of a server, or of a recording.

    The last message of each latched topic is kept for late subscribers.
    """

    def __init__(self, topics: Sequence[Topic]):
        self.context = Context()
        self._clocks = {topic.name for topic in topics if topic.type == _CLOCK}
        topics = [topic for topic in topics if topic.type != _CLOCK]
        self._latched: dict[str, tuple[Any, int]] = {}
        self._is_latched = {topic.name: topic.is_latched for topic in topics}
        self._channels = {topic.name: _channel(topic, self.context) for topic in topics}
        self.topics = {channel.id(): name for name, channel in self._channels.items()}

    def is_clock(self, topic: str) -> bool:
        """True for a clock, which has no channel: it is the time of a server or recording."""
        return topic in self._clocks

    def wants(self, topic: str) -> bool:
        """True if a client or a file receives the topic, or may ask for its last message later."""
        return self._is_latched[topic] or self._channels[topic].has_sinks()

    def log(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Convert and send a message, unless nobody wants the topic."""
        if self.wants(topic):
            converted = _converted(message)
            if self._is_latched[topic]:
                self._latched[topic] = converted, stamp_ns
            self._channels[topic].log(converted, log_time=stamp_ns)

    def repeat(self, topic: str | None = None, at_ns: int | None = None) -> None:
        """Send the last message of a latched topic, or those of all, again, also at a new time."""
        for name, (converted, stamp_ns) in tuple(self._latched.items()):
            if topic in (None, name):
                self._channels[name].log(converted, log_time=stamp_ns if at_ns is None else at_ns)


def _channel(topic: Topic, context: Context) -> Any:
    """Channel of a topic, with Foxglove's schema or that of ROS."""
    if topic.type in _SCHEMAS:
        return getattr(channels, f"{_SCHEMAS[topic.type]}Channel")(topic.name, context=context)
    text, _ = ros_types().generate_msgdef(topic.type, ros_version=2)
    definition = Schema(name=topic.type, encoding="ros2msg", data=text.encode())
    return Channel(topic.name, schema=definition, message_encoding="cdr", context=context)


def _converted(message: Any) -> Any:
    """Message of Foxglove, or the bytes of a message of ROS."""
    schema = _SCHEMAS.get(message.__msgtype__)
    if schema is None:
        return bytes(ros_types().serialize_cdr(message, message.__msgtype__))
    if schema == "FrameTransforms":
        return fox.FrameTransforms(transforms=[_frame_transform(t) for t in message.transforms])
    common: Any = {"timestamp": _timestamp(message.header), "frame_id": message.header.frame_id}
    match schema:
        case "RawImage":
            common |= {"width": message.width, "height": message.height, "step": message.step}
            data, encoding = message.data, message.encoding
            if encoding == "32SC1":  # Foxglove shows no integers of 32 bits
                data, encoding = data.view("<i4").astype("<f4"), "32FC1"
            return fox.RawImage(**common, encoding=encoding, data=data.tobytes())
        case "CompressedImage":
            data = message.data.tobytes()
            return fox.CompressedImage(**common, format=message.format, data=data)
        case "CameraCalibration":
            model = message.distortion_model
            common |= {"width": message.width, "height": message.height}
            common["distortion_model"] = "kannala_brandt" if model == "equidistant" else model
            matrices = {name: getattr(message, name.lower()).tolist() for name in "DKRP"}
            return fox.CameraCalibration(**common, **matrices)
        case "PointCloud":
            fields = _fields((one.name, one.offset, one.datatype) for one in message.fields)
            common |= {"pose": _IDENTITY, "point_stride": message.point_step, "fields": fields}
            return fox.PointCloud(**common, data=message.data.tobytes())
        case "LaserScan":
            common |= {"start_angle": message.angle_min, "end_angle": message.angle_max}
            common |= {"pose": _IDENTITY, "intensities": message.intensities.tolist()}
            return fox.LaserScan(**common, ranges=message.ranges.tolist())
        case "Grid":
            width, cell_m = message.info.width, message.info.resolution
            gray = np.rint(255.0 - 2.55 * np.clip(message.data, 0, 100)).astype(np.uint8)
            gray[message.data < 0] = _UNKNOWN_GRAY
            cells = np.stack([gray, gray, gray, np.full_like(gray, 255)], axis=1)
            colors = enumerate(("red", "green", "blue", "alpha"))
            common |= {"pose": _pose(message.info.origin), "column_count": width}
            common |= {"row_stride": 4 * width, "cell_stride": 4, "data": cells.tobytes()}
            fields = _fields((color, offset, 2) for offset, color in colors)
            return fox.Grid(**common, cell_size=fox.Vector2(x=cell_m, y=cell_m), fields=fields)
        case _:
            pose = getattr(message.pose, "pose", message.pose)  # with covariance, or without
            return fox.PoseInFrame(**common, pose=_pose(pose))


def _fields(fields: Iterable[tuple[str, int, int]]) -> list[fox.PackedElementField]:
    """Fields of packed elements from names, offsets, and types as numbers of ROS."""
    kinds = [getattr(fox.PackedElementFieldNumericType, name) for name in _FIELD_TYPES]
    return [
        fox.PackedElementField(name=name, offset=offset, type=kinds[kind - 1])
        for name, offset, kind in fields
    ]


def _frame_transform(stamped: Any) -> fox.FrameTransform:
    return fox.FrameTransform(
        timestamp=_timestamp(stamped.header),
        parent_frame_id=stamped.header.frame_id,
        child_frame_id=stamped.child_frame_id,
        translation=_vector(stamped.transform.translation),
        rotation=_rotation(stamped.transform.rotation),
    )


def _timestamp(header: Any) -> fox.Timestamp:
    return fox.Timestamp(header.stamp.sec, header.stamp.nanosec)


def _pose(pose: Any) -> fox.Pose:
    return fox.Pose(position=_vector(pose.position), orientation=_rotation(pose.orientation))


def _vector(vector: Any) -> fox.Vector3:
    return fox.Vector3(x=vector.x, y=vector.y, z=vector.z)


def _rotation(rotation: Any) -> fox.Quaternion:
    return fox.Quaternion(x=rotation.x, y=rotation.y, z=rotation.z, w=rotation.w)
