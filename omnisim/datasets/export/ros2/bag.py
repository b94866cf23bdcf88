"""ROS 2 bags: topics and messages in MCAP or SQLite files, by rosbags."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Literal

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
