"""Types of ROS 2 messages and services: names, hashes and CDR, without ROS.

Source: REP 2011, type hashes; rosidl_generator_type_description, those of services.
"""

from __future__ import annotations

from typing import Any, Literal

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from omnisim.core.errors import ServeError

Distribution = Literal["humble", "jazzy"]

_BASE, _NAME = Nodetype.BASE, Nodetype.NAME
_EMPTY = [("structure_needs_at_least_one_member", (_BASE, ("uint8", 0)))]
_ANSWER = [("success", (_BASE, ("bool", 0))), ("message", (_BASE, ("string", 0)))]
# Fields of request and response; rosbags has no services.
_SERVICES: dict[str, tuple[list[Any], list[Any]]] = {
    "std_srvs/srv/Empty": (_EMPTY, _EMPTY),
    "std_srvs/srv/SetBool": ([("data", (_BASE, ("bool", 0)))], _ANSWER),
    "std_srvs/srv/Trigger": (_EMPTY, _ANSWER),
}
_RANGE = "sensor_msgs/msg/Range"


class RosTypes:
    """Types of a ROS 2 distribution.

    Args:
        distribution: "humble", which has no type hashes, or "jazzy", whose messages are also those
            of Kilted and Lyrical.
    """

    def __init__(self, distribution: Distribution):
        self._is_humble = distribution == "humble"
        self._store = get_typestore(Stores.ROS2_HUMBLE if self._is_humble else Stores.ROS2_JAZZY)
        for name, (request, response) in _SERVICES.items():
            self._store.register({f"{name}_Request": ([], request)})
            self._store.register({f"{name}_Response": ([], response)})
            self._store.fielddefs.update(_described(name))

    def names(self, type_name: str) -> str:
        """Name and hash of a type in keys: std_msgs::msg::dds_::String_/RIHS01_ and 64 digits."""
        package, kind, name = type_name.split("/")
        hashed = "TypeHashNotSupported" if self._is_humble else self._store.hash_rihs01(type_name)
        return f"{package}::{kind}::dds_::{name}_/{hashed}"

    def encode(self, type_name: str, message: Any) -> bytes:
        """CDR of a message of any distribution's class, or of a tuple of its values."""
        if isinstance(message, tuple):
            message = self._store.types[type_name](*message)
        elif type_name == _RANGE and not self._is_humble:  # Humble's has no variance
            message = self._store.types[type_name](**{"variance": 0.0, **vars(message)})
        return bytes(self._store.serialize_cdr(message, type_name))

    def decode(self, type_name: str, payload: bytes) -> Any:
        """Message of CDR.

        Raises:
            ServeError: the bytes are no message of this type.
        """
        try:
            return self._store.deserialize_cdr(payload, type_name)
        except SerdeError as error:
            raise ServeError(f"expected a {type_name}") from error


def _described(service: str) -> dict[str, Any]:
    """Types whose description is hashed as a service's."""
    parts = "Request", "Response", "Event"
    request, response, event = ((_NAME, f"{service}_{part}") for part in parts)
    info = [
        ("event_type", (_BASE, ("uint8", 0))),
        ("stamp", (_NAME, "builtin_interfaces/msg/Time")),
        ("client_gid", (Nodetype.ARRAY, ((_BASE, ("uint8", 0)), 16))),  # rosbags: char
        ("sequence_number", (_BASE, ("int64", 0))),
    ]
    events = [
        ("info", (_NAME, "service_msgs/msg/ServiceEventInfo")),
        ("request", (Nodetype.SEQUENCE, (request, 1))),
        ("response", (Nodetype.SEQUENCE, (response, 1))),
    ]
    messages = {"request_message": request, "response_message": response, "event_message": event}
    types = {"service_msgs/msg/ServiceEventInfo": info, f"{service}_Event": events}
    return {name: ([], fields) for name, fields in (types | {service: [*messages.items()]}).items()}
