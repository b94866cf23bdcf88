"""Unwarped views of the camera's image, and the pixel under the mouse in all of them."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from omnisim.apps.live.live_messages import Gaze, Probe
from omnisim.apps.live.run_source import LiveFrame, degrees
from omnisim.cameras import CentralCamera, NonCentralCamera
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.perception.unwarping import (
    Unwarping,
    View,
    birdseye_view,
    cylinder_view,
    highest_elevation_deg,
    perspective_view,
)

UNWARPED = ("panorama", "perspective", "birdseye")
PANORAMA_PX, LOWEST_RAD = 720, math.radians(-45.0)
PERSPECTIVE_PX = (480, 360)
BIRDSEYE_PX, EXTENT_PER_HEIGHT = 360, 4.0
MIN_HEIGHT_M = 0.02
FINE_SAMPLES = 2  # per pixel side: a remap table takes 24 bytes per sample
_KEPT = 8  # maximum number of cached remap tables, coarse and fine
Json = dict[str, Any]


class _Key(NamedTuple):
    """Cache key of a remap table: ID of the camera model, rotation on the vehicle, and view."""

    model: int
    rotation: bytes
    name: str
    view: tuple[float, ...]
    is_fine: bool


class ViewMaker:
    """Creates views of images, and caches their remap tables while the camera stays the same."""

    def __init__(self) -> None:
        # The camera is kept as well: after its deletion, another one could have its id.
        self._tables: dict[_Key, tuple[CentralCamera, Unwarping]] = {}
        self._highest: dict[_Key, tuple[CentralCamera, float]] = {}

    def view(self, name: str, frame: LiveFrame, gaze: Gaze, height_m: float) -> View:
        """Virtual camera of a view, with its rotation.

        Args:
            name: one of `UNWARPED`.
            frame: image to unwarp.
            gaze: direction of the perspective view.
            height_m: height of the viewpoint above the ground.

        Raises:
            OpticsError: the camera does not see the horizon, so it has no panorama.
        """
        if name == "panorama":
            rotation = frame.base_from_optical[:3, :3]
            key = _Key(id(frame.model), rotation.tobytes(), "panorama", (), False)
            if key not in self._highest:
                if len(self._highest) >= _KEPT:
                    self._highest.clear()
                highest_rad = math.radians(max(highest_elevation_deg(frame.model, rotation), 5.0))
                self._highest[key] = (frame.model, highest_rad)
            return cylinder_view(PANORAMA_PX, LOWEST_RAD, self._highest[key][1])
        if name == "perspective":
            fov_rad, yaw_rad, pitch_rad = np.radians((gaze.fov_deg, gaze.yaw_deg, gaze.pitch_deg))
            return perspective_view(*PERSPECTIVE_PX, fov_rad, yaw_rad, pitch_rad)
        height_m = max(height_m, MIN_HEIGHT_M)
        return birdseye_view(BIRDSEYE_PX, EXTENT_PER_HEIGHT * height_m, height_m)

    def image(
        self, name: str, frame: LiveFrame, gaze: Gaze, height_m: float, is_fine: bool
    ) -> Bytes:
        """Unwarped image (height, width, 3) of a view; arguments as for `view`.

        Fine images have four samples per pixel.

        Raises:
            OpticsError: the camera sees nothing of the view, or it is non-central.
        """
        rotation = frame.base_from_optical[:3, :3]
        numbers: tuple[float, ...] = ()
        if name == "perspective":
            numbers = (gaze.yaw_deg, gaze.pitch_deg, gaze.fov_deg)
        # no height in the key of a map: its extent grows with the height, so its table is the same
        key = _Key(id(frame.model), rotation.tobytes(), name, numbers, is_fine)
        if key not in self._tables:
            view = self.view(name, frame, gaze, height_m)
            if len(self._tables) >= _KEPT:
                del self._tables[next(iter(self._tables))]
            rotation_in, samples = rotation.T @ view.base_from_view, FINE_SAMPLES if is_fine else 1
            table = Unwarping(frame.model, view.camera, rotation_in, samples=samples)
            self._tables[key] = (frame.model, table)
        return self._tables[key][1](frame.rgb)


def direction_in(view: View, u: float, v: float) -> Floats:
    """Direction (3,) of a view's ray, base frame; u and v are shares of the width and height.

    Raises:
        OpticsError: no ray at (u, v).
    """
    pixel = np.array((u * view.camera.width_px - 0.5, v * view.camera.height_px - 0.5))
    rays = view.camera.ray_from_pixel(pixel)
    if not rays.valid:
        raise OpticsError("no ray here: outside the lens or mirror")
    return view.base_from_view @ rays.directions


def place_in(view: View, direction: Floats) -> tuple[float, float] | None:
    """Position of a direction (3,), base frame, in a view; None: outside.

    The position (u, v) is given as shares of the view's width and height.
    """
    pixels = view.camera.pixel_from_ray(view.base_from_view.T @ direction)
    u, v = ((pixels.positions_px + 0.5) / (view.camera.width_px, view.camera.height_px)).tolist()
    return (u, v) if pixels.valid and 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0 else None


def probe(
    message: Probe, frame: LiveFrame, views: ViewMaker, gaze: Gaze, height_m: float
) -> dict[str, Any]:
    """Answer a probe with JSON-serializable values.

    `yaw_deg` and `pitch_deg` are relative to the vehicle; `direction` is in the world. `pixel` and
    `color` refer to the camera's image. `range_m`, `class`, `instance` and `point_m` are present
    if the channel is. `marks` has the position in each view, as shares of its width and height.
    Without a ray there is only a `reason`.

    Args:
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
        # the values of the channels belong to the ray through the pixel's center
        height, width = frame.rgb.shape[:2]
        column, row = min(int(own[0] * width), width - 1), min(int(own[1] * height), height - 1)
        marks["camera"] = (column + 0.5) / width, (row + 0.5) / height
        with suppress(OpticsError):  # the pixel's center may be outside the rim
            direction = direction_in(cameras["camera"], *marks["camera"])
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
    if own is not None:
        answer |= {"pixel": [column, row], "color": frame.rgb[row, column].tolist()}
        channels, labels = frame.channels, frame.labels
        if "range" in channels:
            range_m = float(channels["range"][row, column])
            answer["range_m"] = round(range_m, 4) if math.isfinite(range_m) else None
        if "position" in channels:
            point = channels["position"][row, column].astype(np.float64)
            is_known = bool(np.all(np.isfinite(point)))
            answer["point_m"] = np.round(point, 4).tolist() if is_known else None
        if labels is not None and "semantic" in channels:
            number = int(channels["semantic"][row, column])
            names = {kind.id: kind.name for kind in labels.classes}
            answer["class"] = names.get(number)
        if labels is not None and "instance" in channels:
            number = int(channels["instance"][row, column])
            answer["instance"] = labels.instances[number - 1].name if number else None
    return answer
