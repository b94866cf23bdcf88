"""Views beside the camera's picture: unwarped, each with its own camera at the same viewpoint."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.browser.messages import Gaze
from omnisim.browser.taken import Taken
from omnisim.cameras import CentralCamera
from omnisim.errors import OpticsError
from omnisim.perception.unwarping import Unwarping
from omnisim.perception.views import (
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
LEAST_HEIGHT_M = 0.02
_KEPT = 8  # remap tables


class _Key(NamedTuple):
    """Camera, place on the vehicle and view that a remap table is of."""

    name: str
    view: tuple[float, ...]
    is_fine: bool


class ViewMaker:
    """Makes views of pictures; keeps their remap tables while the camera stays."""

    def __init__(self) -> None:
        self._model: CentralCamera | None = None
        self._rotation = np.eye(3)
        self._tables: dict[_Key, Unwarping] = {}
        self._highest_rad = 0.0
        self._highest_of: CentralCamera | None = None

    def view(self, name: str, taken: Taken, gaze: Gaze, height_m: float) -> View:
        """Camera of a view.

        Args:
            name: one of `UNWARPED`.
            taken: picture that it is of.
            gaze: direction of the perspective view.
            height_m: of the viewpoint above the ground.

        Raises:
            OpticsError: a camera that sees no horizon has no panorama.
        """
        if name == "panorama":
            return cylinder_view(PANORAMA_PX, LOWEST_RAD, self._highest(taken))
        if name == "perspective":
            fov_rad, yaw_rad, pitch_rad = np.radians((gaze.fov_deg, gaze.yaw_deg, gaze.pitch_deg))
            return perspective_view(*PERSPECTIVE_PX, fov_rad, yaw_rad, pitch_rad)
        height_m = max(height_m, LEAST_HEIGHT_M)
        return birdseye_view(BIRDSEYE_PX, EXTENT_PER_HEIGHT * height_m, height_m)

    def picture(
        self, name: str, taken: Taken, gaze: Gaze, height_m: float, is_fine: bool
    ) -> NDArray[np.uint8]:
        """Unwarped picture (height, width, 3), see `view`; coarse ones have a sample a pixel.

        Raises:
            OpticsError: the camera sees nothing of it, or its rays do not meet in one point.
        """
        rotation = taken.base_from_optical[:3, :3]
        if self._model is not taken.model or not np.array_equal(rotation, self._rotation):
            self._tables.clear()
            self._model, self._rotation = taken.model, rotation
        numbers: tuple[float, ...] = ()
        if name == "perspective":
            numbers = (gaze.yaw_deg, gaze.pitch_deg, gaze.fov_deg)
        elif name == "panorama":
            numbers = (self._highest(taken),)
        key = _Key(name, numbers, is_fine)  # of a map: its extent grows with the height
        if key not in self._tables:
            view = self.view(name, taken, gaze, height_m)
            if len(self._tables) >= _KEPT:
                del self._tables[next(iter(self._tables))]
            self._tables[key] = Unwarping(
                taken.model,
                view.camera,
                rotation.T @ view.base_from_view,
                samples=None if is_fine else 1,
            )
        picture: NDArray[np.uint8] = self._tables[key](taken.rgb)
        return picture

    def _highest(self, taken: Taken) -> float:
        if self._highest_of is not taken.model:
            found = highest_elevation_deg(taken.model, taken.base_from_optical[:3, :3])
            self._highest_rad, self._highest_of = math.radians(max(found, 5.0)), taken.model
        return self._highest_rad


def direction_in(view: View, u: float, v: float) -> NDArray[np.float64]:
    """Direction (3,) in the vehicle's base of a place in a view, as shares of its sides.

    Raises:
        OpticsError: the view has no ray there.
    """
    pixel = np.array((u * view.camera.width_px - 0.5, v * view.camera.height_px - 0.5))
    rays = view.camera.ray_from_pixel(pixel)
    if not rays.valid:
        raise OpticsError("no ray here: outside of the lens or the mirror")
    direction: NDArray[np.float64] = view.base_from_view @ rays.directions
    return direction


def place_in(view: View, direction: NDArray[np.float64]) -> tuple[float, float] | None:
    """Shares of a view's sides where a direction (3,) in the base is seen; None: nowhere."""
    pixels = view.camera.pixel_from_ray(view.base_from_view.T @ direction)
    u, v = ((pixels.positions_px + 0.5) / (view.camera.width_px, view.camera.height_px)).tolist()
    return (u, v) if pixels.valid and 0.0 <= u <= 1.0 and 0.0 <= v <= 1.0 else None
