"""Central views of optical systems: approximations with one viewpoint, and their error."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import NonCentralCamera, Pixels, Rays
from omnisim.cameras.camera import CameraParameters, Uniforms, as_directions
from omnisim.cameras.central_error import CentralError
from omnisim.cameras.optics.centrality import (
    SeenRays,
    central_errors,
    common_point,
    directions_at,
    seen_rays,
)
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.core.errors import OpticsError
from omnisim.core.short_repr import short_repr

DISTANCES_M = (0.3, 1.0, 5.0)  # distances of points for which errors are reported


@dataclass(frozen=True, eq=False)
class CentralView:
    """Central approximation of an optical system, as if its rays met in one point.

    It is exact for points at one distance from the viewpoint. Its optical frame has the sensor's
    axes, but its origin is the viewpoint.

    Attributes:
        system: optical system.
        distance_m: distance at which the view is exact; infinite: only directions count.
        axes: (3, 3) orthogonal view_from_optical; a reflection if files store a mirrored image.

    Raises:
        OpticsError: the distance is not positive, or the system sees nothing.
    """

    system: NonCentralCamera
    distance_m: float = math.inf
    axes: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))

    model_name = "central view of optics"
    domain_limit_rad = None

    def __post_init__(self) -> None:
        if not self.distance_m > 0.0:
            raise OpticsError(f"distance_m: expected more than 0, got {self.distance_m:g}")
        assert len(self.seen_rays.pixels_px)  # raises if the system sees nothing

    def __repr__(self) -> str:
        return short_repr(self, repr(self.system), f"right at {self.distance_m:g} m")

    @property
    def width_px(self) -> int:
        """Image width."""
        return self.system.width_px

    @property
    def height_px(self) -> int:
        """Image height."""
        return self.system.height_px

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """Principal point (u, v) of the system's camera."""
        return self.system.principal_point_px

    @property
    def rig_from_optical(self) -> NDArray[np.float64]:
        """Orientation (3, 3) in a level rig."""
        rotation: NDArray[np.float64] = self.system.rig_from_optical @ self.axes.T
        return rotation

    @cached_property
    def seen_rays(self) -> SeenRays:
        """Rays spread evenly over the image, in the sensor's optical frame."""
        return seen_rays(self.system)

    @cached_property
    def viewpoint_m(self) -> Floats:
        """Point (3,) nearest to all rays, in the sensor's optical frame."""
        return common_point(self.seen_rays.origins_m, self.seen_rays.directions)

    def frame_from_view(self, frame_from_optical: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose (4, 4) of the view, from the pose of the sensor's optical frame."""
        pose = frame_from_optical.copy()
        pose[:3, 3] += frame_from_optical[:3, :3] @ self.viewpoint_m
        pose[:3, :3] = frame_from_optical[:3, :3] @ self.axes.T
        return pose

    def scaled(self, scale: float) -> CentralView:
        """The same view in an image `scale` times as large; sizes are rounded."""
        return dataclasses.replace(self, system=self.system.scaled(scale))

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2) from the viewpoint."""
        rays = self.system.ray_from_pixel(pixels_px)
        origins_m = np.zeros(3) if rays.origins_m is None else rays.origins_m
        directions, meets = directions_at(
            origins_m, rays.directions, self.viewpoint_m, self.distance_m
        )
        unit = directions / np.maximum(np.linalg.norm(directions, axis=-1, keepdims=True), 1e-300)
        return Rays(unit @ self.axes.T, rays.valid & meets)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) from the viewpoint."""
        optical = as_directions(directions) @ self.axes
        if math.isinf(self.distance_m):
            return self.system.pixel_from_ray(optical)
        lengths = np.maximum(np.linalg.norm(optical, axis=-1, keepdims=True), 1e-300)
        return self.system.pixel_from_point(self.viewpoint_m + self.distance_m / lengths * optical)

    def errors(self, distances_m: Sequence[float] = DISTANCES_M) -> tuple[CentralError, ...]:
        """Errors of the view for points at given distances."""
        return central_errors(
            self.seen_rays,
            self.viewpoint_m,
            distances_m,
            lambda directions: self.pixel_from_ray(directions @ self.axes.T),
        )

    def caveat(self, distances_m: Sequence[float] = DISTANCES_M) -> str:
        """Approximation and its errors, as one line of text."""
        others = [distance_m for distance_m in distances_m if distance_m != self.distance_m]
        errors = ", ".join(map(str, self.errors(others)))
        exact = "infinity" if math.isinf(self.distance_m) else f"{self.distance_m:g} m"
        return (
            f"rays meet in no point: one is assumed, right for points at {exact}; off by up to "
            f"{errors} (99 % of the image)"
        )

    def uniforms(self) -> Uniforms:
        """Raise, because no shader traces these rays.

        Raises:
            OpticsError: always.
        """
        raise OpticsError("camera: a central view of optics has no shader")

    def parameters(self) -> CameraParameters:
        """Size and distance, for messages; they cannot be saved in a file."""
        return {"model": self.model_name, "width_px": self.width_px, "height_px": self.height_px}
