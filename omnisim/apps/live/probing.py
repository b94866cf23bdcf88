"""Pixel under the mouse: its direction, and its point in the world and in all views."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.live.live_messages import Gaze, Probe
from omnisim.apps.live.taken import Taken, degrees
from omnisim.apps.live.view_maker import UNWARPED, ViewMaker, direction_in, place_in
from omnisim.cameras import NonCentralCamera
from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.perception.unwarping.views import View

Json = dict[str, Any]


def probe(
    message: Probe, taken: Taken, views: ViewMaker, gaze: Gaze, height_m: float
) -> dict[str, Any]:
    """Answer to a probe, as JSON can hold it.

    `u`, `v` in the camera's image; `yaw_deg`, `pitch_deg` relative to the vehicle; `direction` in
    the world; `range_m`, `class`, `instance`, `point_m` as far as they are known; `marks`: places
    in all views, as shares of their sides.

    Args:
        message: view and place in it.
        taken: image, with channels of ground truth.
        views: makes the other views.
        gaze: of the perspective view.
        height_m: of the viewpoint above the ground.
    """
    if message.view == "map":
        return {"marks": {}}
    cameras = {"camera": View(taken.model, taken.base_from_optical[:3, :3])}
    is_central = not isinstance(taken.model, NonCentralCamera)
    for name in UNWARPED if is_central else ():
        try:
            cameras[name] = views.view(name, taken, gaze, height_m)
        except OmnisimError:  # a view that this camera does not have
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
        marks["camera"] = own = _center(taken, *own)
        with suppress(OpticsError):  # the pixel's center may be beyond the rim
            direction = direction_in(cameras["camera"], *own)
    for name, camera in cameras.items():
        if name != "camera" and (place := place_in(camera, direction)) is not None:
            marks[name] = place
    world = taken.world_from_base[:3, :3] @ direction
    found: Json = {
        "view": message.view,
        "yaw_deg": degrees(math.atan2(direction[1], direction[0])),
        "pitch_deg": degrees(math.atan2(-direction[2], math.hypot(direction[0], direction[1]))),
        "direction": np.round(world, 5).tolist(),
        "marks": marks,
    }
    if "camera" in marks:
        found |= _channels_at(taken, *marks["camera"])
    return found


def _center(taken: Taken, u: float, v: float) -> tuple[float, float]:
    """Shares of the sides at the center of the pixel there, whose ray the channels are of."""
    height, width = taken.rgb.shape[:2]
    column, row = min(int(u * width), width - 1), min(int(v * height), height - 1)
    return (column + 0.5) / width, (row + 0.5) / height


def _channels_at(taken: Taken, u: float, v: float) -> Json:
    """Pixel of the camera's image, and the values of the channels there."""
    height, width = taken.rgb.shape[:2]
    column, row = min(int(u * width), width - 1), min(int(v * height), height - 1)
    found: Json = {"pixel": [column, row], "color": taken.rgb[row, column].tolist()}
    channels, labels = taken.channels, taken.labels
    if "range" in channels:
        range_m = float(channels["range"][row, column])
        found["range_m"] = round(range_m, 4) if math.isfinite(range_m) else None
    if "position" in channels:
        found["point_m"] = _finite(channels["position"][row, column])
    if labels is not None and "semantic" in channels:
        number = int(channels["semantic"][row, column])
        found["class"] = next((one.name for one in labels.classes if one.id == number), None)
    if labels is not None and "instance" in channels:
        number = int(channels["instance"][row, column])
        found["instance"] = labels.instances[number - 1].name if number else None
    return found


def _finite(values: NDArray[Any]) -> list[float] | None:
    numbers: list[float] = np.round(values.astype(np.float64), 4).tolist()
    return numbers if np.all(np.isfinite(values)) else None
