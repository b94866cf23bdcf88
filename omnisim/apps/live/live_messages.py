"""Messages between the live page and its server.

The page sends a JSON object whose `type` is a key of `MESSAGES`. The server's messages are binary:
the length of a JSON text in four bytes, little endian, the text, and the parts listed in the text.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from pydantic import Field, JsonValue

from omnisim.core.errors import OutputError
from omnisim.core.files.parameters import Fraction, Number, Table, parse_table
from omnisim.ground_truth import CHANNELS

MAX_MESSAGE_BYTES = 1 << 18  # limit for the page's messages; a lens table has thousands of digits
Deflection = Annotated[Number, Field(ge=-1.0, le=1.0)]  # of a joystick's axis
Angle = Annotated[Number, Field(ge=-3600.0, le=3600.0)]
Meters = Annotated[Number, Field(ge=-1e5, le=1e5)]
Name = Annotated[str, Field(max_length=200)]
VIEWS = ("camera", "panorama", "perspective", "birdseye", "map", "profile", *CHANNELS)


class Message(Table):
    """Message from a page."""


class Ask(Message):
    """Request for the next image, sent when the page has displayed the last one."""


class SetMotion(Message):
    """Motion requested by the pressed keys, as shares of the top speeds; `fast` multiplies them."""

    ahead: Deflection = 0.0
    left: Deflection = 0.0
    up: Deflection = 0.0
    turn: Deflection = 0.0
    tilt: Deflection = 0.0
    fast: Annotated[Number, Field(ge=0.1, le=4.0)] = 1.0


class Go(Message):
    """Destination on the map, in world x and y."""

    x: Meters
    y: Meters


class Turn(Message):
    """Turn by dragging the mouse, without acceleration; angles are relative to the current ones."""

    yaw_deg: Angle = 0.0
    pitch_deg: Angle = 0.0


class SetPlace(Message):
    """New pose, reached at once."""

    x: Meters
    y: Meters
    z: Meters
    yaw_deg: Angle
    pitch_deg: Angle = 0.0
    roll_deg: Angle = 0.0


class ToStart(Message):
    """Return to the initial pose and world time."""


class Walls(Message):
    """Surfaces stop free flight, or do not."""

    on: bool


class SetValue(Message):
    """New value for a key of the camera's files; null removes the key."""

    path: Name
    value: JsonValue = None


class Preset(Message):
    """Preset to apply: its kind (lens, optics, degradation or catalog) and its name."""

    kind: Name
    name: Name


class SearchCatalog(Message):
    """Words of a search in the catalog of measured cameras."""

    words: Name


class Undo(Message):
    """Undo the last edit."""


class Redo(Message):
    """Redo the last undone edit."""


class Reset(Message):
    """Restore the initial camera."""


class SetViews(Message):
    """Views to show beside the camera."""

    names: Annotated[tuple[Name, ...], Field(max_length=len(VIEWS))] = ()


class Gaze(Message):
    """Direction of the perspective view, relative to the vehicle."""

    yaw_deg: Angle
    pitch_deg: Angle
    fov_deg: Annotated[Number, Field(ge=5.0, le=150.0)] = 75.0


class ProbePoint(Message):
    """Point of a view under the mouse, as shares of the view's width and height.

    `follow` turns the perspective view to this point.
    """

    view: Name
    u: Fraction
    v: Fraction
    follow: bool = False


class Save(Message):
    """Request for files: the camera's TOML, or the image with its channels."""

    what: Annotated[str, Field(pattern="^(toml|image)$")]


class RequestStatistics(Message):
    """Request for the numbers of triangles submitted, drawn and visible in the image."""


class Replay(Message):
    """Step of a recorded run to show."""

    step: Annotated[int, Field(ge=0, le=10**9, strict=True)]


class Clock(Message):
    """World time, and whether it runs, for moving objects."""

    running: bool
    time_s: Annotated[Number, Field(ge=-1e9, le=1e9)] | None = None


class RequestControl(Message):
    """Request for control of the camera, which another page may hold."""


MESSAGES: dict[str, type[Message]] = {
    "ask": Ask,
    "drive": SetMotion,
    "go": Go,
    "turn": Turn,
    "place": SetPlace,
    "start": ToStart,
    "walls": Walls,
    "set": SetValue,
    "preset": Preset,
    "search": SearchCatalog,
    "undo": Undo,
    "redo": Redo,
    "reset": Reset,
    "views": SetViews,
    "look": Gaze,
    "probe": ProbePoint,
    "save": Save,
    "statistics": RequestStatistics,
    "replay": Replay,
    "clock": Clock,
    "wheel": RequestControl,
}


class MessagePart(NamedTuple):
    """Binary part of a message with name, media type and further properties for the page."""

    name: str
    media_type: str
    data: bytes
    about: dict[str, Any]


def parse_message(text: str | bytes) -> Message:
    """Parse and check a message from a page.

    Raises:
        OutputError: an invalid message; the text names key, actual and expected value.
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


def pack(kind: str, content: dict[str, Any], parts: Sequence[MessagePart] = ()) -> bytes:
    """Encode a message of the server: its type and content as JSON, followed by binary parts."""
    listed = [
        {"name": part.name, "media_type": part.media_type, "size": len(part.data), **part.about}
        for part in parts
    ]
    text = json.dumps({"type": kind, **content, "parts": listed}, allow_nan=False).encode()
    return b"".join((len(text).to_bytes(4, "little"), text, *(part.data for part in parts)))
