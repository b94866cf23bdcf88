"""Types of ROS 2 messages and services: names, hashes and CDR, without ROS.

Source: REP 2011, type hashes; github.com/ros2/common_interfaces, std_srvs.
"""

from __future__ import annotations

from typing import Any, Literal

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from omnisim.core.errors import ServeError

Distribution = Literal["humble", "jazzy"]

_EMPTY = [("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))]
_BOOL, _TEXT = (Nodetype.BASE, ("bool", 0)), (Nodetype.BASE, ("string", 0))
_ANSWER = [("success", _BOOL), ("message", _TEXT)]
# std_srvs, which rosbags does not have: fields of request and response, and hash.
_SERVICES: dict[str, tuple[list[Any], list[Any], str]] = {
    "std_srvs/srv/Empty": (
        _EMPTY, _EMPTY, "5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19",
    ),
    "std_srvs/srv/SetBool": (
        [("data", _BOOL)], _ANSWER,
        "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
    ),
    "std_srvs/srv/Trigger": (
        _EMPTY, _ANSWER, "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    ),
}  # fmt: skip
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
        for name, (request, response, _) in _SERVICES.items():
            self._store.register({f"{name}_Request": ([], request)})
            self._store.register({f"{name}_Response": ([], response)})

    def names(self, type_name: str) -> str:
        """Name and hash of a type in keys: std_msgs::msg::dds_::String_/RIHS01_ and 64 digits."""
        package, kind, name = type_name.split("/")
        if self._is_humble:
            hashed = "TypeHashNotSupported"
        elif type_name in _SERVICES:
            hashed = f"RIHS01_{_SERVICES[type_name][2]}"
        else:
            hashed = self._store.hash_rihs01(type_name)
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
