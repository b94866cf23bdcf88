"""Level panorama for landmark detection, and the geometry of its rows and columns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import CentralCamera, CylindricalCamera, HyperbolicCamera, NonCentralCamera
from omnisim.cameras.mirrors.hyperbolic import theta_from_image_radius_eq2_rad
from omnisim.core.arrays import Bools, Floats
from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.errors import LocalizationError
from omnisim.perception.unwarping.unwarping import Unwarping
from omnisim.perception.unwarping.views import cylinder_view

LOWEST_RAD, HIGHEST_RAD = math.radians(-60.0), math.radians(3.0)
_LEVEL = 1e-9  # maximum error of a rotation about the upright axis


@dataclass(frozen=True, eq=False)
class CameraMount:
    """Camera on a vehicle.

    The caveat is of the assumed single viewpoint of non-central optics, and of its errors.
    """

    camera: CentralCamera
    base_from_optical: Floats  # (4, 4) pose on the vehicle
    # (height, width) pixels that show the scene; None: all valid
    covered: Bools | None = None
    caveat: str | None = None  # None: a central camera, or no assumption

    def assuming_viewpoint(self) -> CameraMount:
        """The same mount; for non-central optics, as if all rays met in one point."""
        if not isinstance(self.camera, NonCentralCamera):
            return self
        from omnisim.cameras.optics.central_view import CentralView  # few cameras need it

        view = CentralView(self.camera)
        base_from_view = view.frame_from_view(self.base_from_optical)
        return CameraMount(view, base_from_view, self.covered, view.caveat())

    @property
    def height_m(self) -> float:
        """Height of the effective viewpoint above the ground."""
        return float(self.base_from_optical[2, 3])

    @property
    def position_m(self) -> tuple[float, float]:
        """Effective viewpoint x, y in the base frame."""
        return float(self.base_from_optical[0, 3]), float(self.base_from_optical[1, 3])


class Panorama:
    """Panorama of a whole turn around a vehicle, from 60° below the horizon to 3° above it.

    Rows and columns count from the center of the first pixel and may have fractions.

    Args:
        mount: camera on the vehicle.
        width_px: columns of the whole turn; None: the length of the horizon in the image, pixels.

    Attributes:
        camera: camera model of the panorama, a cylinder.

    Raises:
        LocalizationError: a camera at or below the ground, or one that sees no part of the horizon.
        OpticsError: the camera sees nothing of the panorama.
    """

    def __init__(self, mount: CameraMount, width_px: int | None = None):
        if not mount.height_m > 0.0:
            raise LocalizationError(
                f"camera: {mount.height_m:g} m above the ground: expected more than 0 for ranges"
            )
        self.mount = mount
        rotation = mount.base_from_optical[:3, :3]
        width = width_px or _horizon_px(mount.camera, rotation)
        view = cylinder_view(width, LOWEST_RAD, HIGHEST_RAD)
        assert isinstance(view.camera, CylindricalCamera)
        self.camera = view.camera
        self._unwarp = Unwarping(
            mount.camera, view.camera, rotation.T @ view.base_from_view, mount.covered
        )

    def __call__(self, image: NDArray[Any]) -> NDArray[Any]:
        """Unwarp an image to a panorama (height, width, 3); black outside the image."""
        return self._unwarp(image)

    @property
    def valid(self) -> Bools:
        """Mask (height, width) of pixels that show the scene."""
        return self._unwarp.valid

    def bearings_rad(self, columns: ArrayLike) -> Floats:
        """Bearings (...) of columns (...), counter-clockwise from the front; unwrapped."""
        u = np.asarray(columns, dtype=np.float64)
        return (self.camera.principal_point_px[0] - u) / self.camera.focal_length_px

    def ranges_m(self, rows: ArrayLike, height_m: float = 0.0) -> Floats:
        """Ranges (...) along the ground at rows (...), for a known height: r = (H − z) tan θ.

        H is the camera's height, z = `height_m` the height of the points, and θ the angle of the
        row from straight down. Infinite at and above the camera's horizon.
        """
        down = self._tangents(rows)
        drop_m = self.mount.height_m - height_m
        return np.where(down > 0.0, drop_m / np.where(down > 0.0, down, 1.0), np.inf)

    def rows(self, ranges_m: ArrayLike, height_m: float = 0.0) -> Floats:
        """Rows (...) of points with known ranges (...) and height."""
        tangents = (self.mount.height_m - height_m) / np.asarray(ranges_m, dtype=np.float64)
        return self.camera.principal_point_px[1] + self.camera.focal_length_px * tangents

    def ranges_eq2_m(self, rows: ArrayLike, height_m: float = 0.0) -> Floats:
        """Ranges (...) of points of known height from the image radius, by the inverse of Eq. 2.

        NaN if Eq. 2 does not apply: the camera has no hyperbolic mirror, or is not upright.
        Infinite at and above the camera's horizon.
        """
        down = self._tangents(rows)
        camera = self.mount.camera
        # straight up, with any rotation about the camera's axis
        rotation = self.mount.base_from_optical[:3, :3] @ RIG_FROM_OPTICAL_LOOKING_UP.T
        is_upright = abs(rotation[2, 2] - 1.0) < _LEVEL
        if not isinstance(camera, HyperbolicCamera) or not is_upright:
            return np.full(down.shape, np.nan)
        theta = 0.5 * math.pi - np.arctan(down)
        radius = camera.image_radius(theta).radii_px
        paper = theta_from_image_radius_eq2_rad(radius, camera.horizon_radius_px)
        near = paper < 0.5 * math.pi
        drop_m = self.mount.height_m - height_m
        return np.where(near, drop_m * np.tan(np.where(near, paper, 0.0)), np.inf)

    def range_sigmas_m(self, ranges_m: ArrayLike, height_m: float, row_sigma_px: float) -> Floats:
        """Standard deviations of ranges, given that of the row: dr/dv = r²/((H − z) f).

        H and z are as in `ranges_m`; f is the panorama's focal length.
        """
        drop_m = self.mount.height_m - height_m
        squared = np.square(np.asarray(ranges_m, dtype=np.float64))
        return squared * row_sigma_px / (abs(drop_m) * self.camera.focal_length_px)

    def heights_m(self, rows: ArrayLike, ranges_m: ArrayLike) -> Floats:
        """Heights (...) above the ground of points at rows (...) with known ranges (...)."""
        return self.mount.height_m - np.asarray(ranges_m) * self._tangents(rows)

    def _tangents(self, rows: ArrayLike) -> Floats:
        """Tangents (...) of the angles of rows (...) below the horizon."""
        v = np.asarray(rows, dtype=np.float64)
        return (v - self.camera.principal_point_px[1]) / self.camera.focal_length_px


def _horizon_px(camera: CentralCamera, base_from_optical: Floats) -> int:
    """Length of the horizon in the image, pixels."""
    step_rad = 1e-3
    headings = np.linspace(-math.pi, math.pi, 72, endpoint=False)

    def pixels(shift_rad: float) -> Any:
        turned = headings + shift_rad
        level = np.stack((np.cos(turned), np.sin(turned), np.full_like(turned, -0.1)), axis=-1)
        level /= np.linalg.norm(level, axis=-1, keepdims=True)
        return camera.pixel_from_ray(level @ base_from_optical)

    start, end = pixels(0.0), pixels(step_rad)
    seen = start.valid & end.valid
    if not seen.any():
        raise LocalizationError("camera: sees nothing of the horizon: no landmark can be found")
    steps = np.linalg.norm(end.positions_px - start.positions_px, axis=-1)[seen]
    return max(64, math.ceil(2.0 * math.pi * float(np.median(steps)) / step_rad))
