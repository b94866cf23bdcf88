"""Pixel under the mouse: its direction, world point, and position in all views."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.live.live_frame import LiveFrame, degrees
from omnisim.apps.live.live_messages import Gaze, Probe
from omnisim.apps.live.view_maker import UNWARPED, ViewMaker, direction_in, place_in
from omnisim.cameras import NonCentralCamera
from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.perception.unwarping.views import View

Json = dict[str, Any]


def probe(
    message: Probe, frame: LiveFrame, views: ViewMaker, gaze: Gaze, height_m: float
) -> dict[str, Any]:
    """Answer a probe with JSON-serializable values.

    `yaw_deg` and `pitch_deg` are relative to the vehicle; `direction` is in the world. `pixel` and
    `color` refer to the camera's image. `range_m`, `class`, `instance` and `point_m` are present
    if the channel is. `marks` has the position in each view, as shares of its width and height.
    Without a ray there is only a `reason`.

    Args:
        message: view, and position in the view.
        frame: image with ground-truth channels.
        views: maker of the unwarped views.
        gaze: direction of the perspective view.
        height_m: height of the viewpoint above the ground.
    """
    if message.view == "map":
        return {"marks": {}}
    cameras = {"camera": View(frame.model, frame.base_from_optical[:3, :3])}
    is_central = not isinstance(frame.model, NonCentralCamera)
    for name in UNWARPED if is_central else ():
        try:
            cameras[name] = views.view(name, frame, gaze, height_m)
        except OmnisimError:  # this camera lacks the view
            continue
    source = cameras.get(message.view, cameras["camera"])
    try:
        direction = direction_in(source, message.u, message.v)
    except OpticsError as reason:
        return {"view": message.view, "reason": str(reason), "marks": {}}
    own = (message.u, message.v) if source is cameras["camera"] else None
    if own is None and is_central:
        own = place_in(cameras["camera"], direction)
    marks: dict[str, tuple[float, float]] = {}
    if own is not None:
        marks["camera"] = own = _center(frame, *own)
        with suppress(OpticsError):  # the pixel's center may be outside the rim
            direction = direction_in(cameras["camera"], *own)
    for name, camera in cameras.items():
        if name != "camera" and (place := place_in(camera, direction)) is not None:
            marks[name] = place
    world = frame.world_from_base[:3, :3] @ direction
    answer: Json = {
        "view": message.view,
        "yaw_deg": degrees(math.atan2(direction[1], direction[0])),
        "pitch_deg": degrees(math.atan2(-direction[2], math.hypot(direction[0], direction[1]))),
        "direction": np.round(world, 5).tolist(),
        "marks": marks,
    }
    if "camera" in marks:
        answer |= _channels_at(frame, *marks["camera"])
    return answer


def _center(frame: LiveFrame, u: float, v: float) -> tuple[float, float]:
    """Center of the pixel that contains (u, v); both are shares of the image's width and height.

    The values of the channels belong to the ray through the center.
    """
    height, width = frame.rgb.shape[:2]
    column, row = min(int(u * width), width - 1), min(int(v * height), height - 1)
    return (column + 0.5) / width, (row + 0.5) / height


def _channels_at(frame: LiveFrame, u: float, v: float) -> Json:
    """Pixel, color and channel values at (u, v), given as fractions of the image size in [0, 1]."""
    height, width = frame.rgb.shape[:2]
    column, row = min(int(u * width), width - 1), min(int(v * height), height - 1)
    values: Json = {"pixel": [column, row], "color": frame.rgb[row, column].tolist()}
    channels, labels = frame.channels, frame.labels
    if "range" in channels:
        range_m = float(channels["range"][row, column])
        values["range_m"] = round(range_m, 4) if math.isfinite(range_m) else None
    if "position" in channels:
        values["point_m"] = _finite(channels["position"][row, column])
    if labels is not None and "semantic" in channels:
        number = int(channels["semantic"][row, column])
        values["class"] = next((one.name for one in labels.classes if one.id == number), None)
    if labels is not None and "instance" in channels:
        number = int(channels["instance"][row, column])
        values["instance"] = labels.instances[number - 1].name if number else None
    return values


def _finite(values: NDArray[Any]) -> list[float] | None:
    numbers: list[float] = np.round(values.astype(np.float64), 4).tolist()
    return numbers if np.all(np.isfinite(values)) else None
