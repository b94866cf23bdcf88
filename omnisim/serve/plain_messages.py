"""Messages of the plain protocol: JSON with a header, and arrays as bytes behind it.

A message to a client is 4 bytes with the length of a JSON header, little-endian, the header, and
the bytes of its arrays, one after the other:

    {"op": "message", "topic": "/scan", "type": "sensor_msgs/msg/LaserScan", "stamp_ns": 100000000,
     "message": {…, "ranges": {"array": 0}}, "arrays": [{"dtype": "<f4", "shape": [361]}]}

The message has the fields of the ROS 2 type; arrays of more than 64 numbers are in the bytes.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from typing import Any

import numpy as np

from omnisim.datasets.export.ros2 import ros_messages as ros

MAX_LISTED = 64  # longer arrays follow the header as bytes


def pack_message(topic: str, stamp_ns: int, message: object) -> bytes:
    """Bytes of a ROS 2 message of `omnisim.datasets.export.ros2.ros_messages`."""
    arrays: list[np.ndarray[Any, Any]] = []
    content = _plain(message, arrays)
    about = [{"dtype": array.dtype.str, "shape": list(array.shape)} for array in arrays]
    kind = ros.message_type(message)
    header = {"op": "message", "topic": topic, "type": kind, "stamp_ns": stamp_ns}
    parts = [np.ascontiguousarray(array).tobytes() for array in arrays]
    return pack({**header, "message": content, "arrays": about}, parts)


def pack(header: dict[str, Any], parts: list[bytes] | tuple[bytes, ...] = ()) -> bytes:
    """Bytes of a header and what follows it."""
    text = json.dumps(header, allow_nan=False).encode()
    return b"".join((len(text).to_bytes(4, "little"), text, *parts))


@functools.cache
def _names(kind: Any) -> tuple[str, ...]:
    """Names of a message's fields."""
    return tuple(
        field.name for field in dataclasses.fields(kind) if not field.name.startswith("__")
    )


def _plain(value: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    """Value in JSON types; long arrays are moved to `arrays`."""
    if dataclasses.is_dataclass(value):
        return {name: _plain(getattr(value, name), arrays) for name in _names(type(value))}
    if isinstance(value, np.ndarray):
        if value.size > MAX_LISTED or not np.all(np.isfinite(value)):
            arrays.append(value)
            return {"array": len(arrays) - 1}
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item, arrays) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # JSON has no infinity
    return value.item() if isinstance(value, np.generic) else value
