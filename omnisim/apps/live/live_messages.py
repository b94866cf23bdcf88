"""Messages between page and server.

The page sends JSON of one object whose `type` is a key of `MESSAGES`. The server answers in binary:
the length of a JSON text in four bytes, little endian, the text, and the parts that it lists.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from pydantic import Field, JsonValue

from omnisim.core.errors import OutputError
from omnisim.core.files.parameters import Number, Table, parse_table
from omnisim.ground_truth import CHANNELS

MAX_MESSAGE_BYTES = 1 << 18  # of the page's: a table of a lens has thousands of digits
Share = Annotated[Number, Field(ge=-1.0, le=1.0)]
Angle = Annotated[Number, Field(ge=-3600.0, le=3600.0)]
Meters = Annotated[Number, Field(ge=-1e5, le=1e5)]
Within = Annotated[Number, Field(ge=0.0, le=1.0)]
Name = Annotated[str, Field(max_length=200)]
VIEWS = ("camera", "panorama", "perspective", "birdseye", "map", "profile", *CHANNELS)


class Message(Table):
    """Message of a page."""


class Ask(Message):
    """Next image, as the last one is drawn."""


class Drive(Message):
    """Keys that are held."""

    ahead: Share = 0.0
    left: Share = 0.0
    up: Share = 0.0
    turn: Share = 0.0
    tilt: Share = 0.0
    fast: Annotated[Number, Field(ge=0.1, le=4.0)] = 1.0


class Go(Message):
    """Point on the map to go to."""

    x: Meters
    y: Meters


class Turn(Message):
    """Drag: angles to turn by at once."""

    yaw_deg: Angle = 0.0
    pitch_deg: Angle = 0.0


class SetPlace(Message):
    """Place to be at."""

    x: Meters
    y: Meters
    z: Meters
    yaw_deg: Angle
    pitch_deg: Angle = 0.0
    roll_deg: Angle = 0.0


class SetValue(Message):
    """Value of a key of the camera's files; null takes it away."""

    path: Name
    value: JsonValue = None


class Preset(Message):
    """Camera, optical system or effects of a preset."""

    kind: Name
    name: Name


class Undo(Message):
    """One step back."""


class Redo(Message):
    """One step forward."""


class Reset(Message):
    """Camera as it was at the start."""


class Views(Message):
    """Views that are shown beside the camera."""

    names: Annotated[tuple[Name, ...], Field(max_length=len(VIEWS))] = ()


class Gaze(Message):
    """Direction of the perspective view, relative to the vehicle."""

    yaw_deg: Angle
    pitch_deg: Angle
    fov_deg: Annotated[Number, Field(ge=5.0, le=150.0)] = 75.0


class Probe(Message):
    """Pixel of a view, as shares of its width and height, that the mouse is over."""

    view: Name
    u: Within
    v: Within
    follow: bool = False


class Save(Message):
    """Files to save: the camera's, or the image's with its channels."""

    what: Annotated[str, Field(pattern="^(toml|image)$")]


class Replay(Message):
    """Step of a recorded run."""

    step: Annotated[int, Field(ge=0, le=10**9, strict=True)]


class Clock(Message):
    """World's time, where objects move."""

    running: bool
    time_s: Annotated[Number, Field(ge=-1e9, le=1e9)] | None = None


class TakeWheel(Message):
    """Wish to drive in place of another page."""


MESSAGES: dict[str, type[Message]] = {
    "ask": Ask,
    "drive": Drive,
    "go": Go,
    "turn": Turn,
    "place": SetPlace,
    "set": SetValue,
    "preset": Preset,
    "undo": Undo,
    "redo": Redo,
    "reset": Reset,
    "views": Views,
    "look": Gaze,
    "probe": Probe,
    "save": Save,
    "replay": Replay,
    "clock": Clock,
    "wheel": TakeWheel,
}


class Part(NamedTuple):
    """Bytes of a message with their name and media type, and more that the page is told."""

    name: str
    media_type: str
    data: bytes
    about: dict[str, Any]


def parse_message(text: str | bytes) -> Message:
    """Check a message of a page.

    Raises:
        OutputError: naming key, value and what was expected.
    """
    if isinstance(text, bytes):
        raise OutputError("message: expected JSON, got bytes")
    try:
        data = json.loads(text)
    except (ValueError, RecursionError):
        raise OutputError("message: expected JSON") from None
    kind = data.pop("type", None) if isinstance(data, dict) else None
    if not isinstance(kind, str) or kind not in MESSAGES:
        raise OutputError(f"message: type = {kind!r}: expected one of {', '.join(MESSAGES)}")
    return parse_table(data, MESSAGES[kind], OutputError, at=kind)


def pack(kind: str, content: dict[str, Any], parts: Sequence[Part] = ()) -> bytes:
    """Message of the server."""
    listed = [
        {"name": one.name, "media_type": one.media_type, "size": len(one.data), **one.about}
        for one in parts
    ]
    text = json.dumps({"type": kind, **content, "parts": listed}, allow_nan=False).encode()
    return b"".join((len(text).to_bytes(4, "little"), text, *(one.data for one in parts)))
