"""Optical systems: a central camera behind surfaces that reflect and refract.

The system frame is the optical frame of the nominal camera, without misalignment (x right, y down,
z forward, into the mirror). Outgoing rays are in the sensor's optical frame, which has the same
axes; the system defines its origin.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from omnisim.cameras import CentralCamera, NonCentralCamera, Pixels, Rays, pixel_grid, summary
from omnisim.cameras.camera import (
    CameraParameters,
    ParameterValue,
    Uniforms,
    as_directions,
    as_pixels,
)
from omnisim.cameras.optics.inverse import Inverse, Targets
from omnisim.cameras.optics.media import (
    WAVELENGTHS_UM,
    Medium,
    Primary,
    medium_parameter,
    refractive_index,
)
from omnisim.cameras.optics.shapes.shape import Floats
from omnisim.cameras.optics.surface import Place, Rod, Surface, pose_parameters
from omnisim.cameras.optics.tracing import Fate, Paths, TracedRays, trace
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    BASE_FROM_OPTICAL_LOOKING_DOWN,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.core.errors import OpticsError
from omnisim.core.files.parameters import Flag
from omnisim.core.poses import check_pose, pose_from_rotation
from omnisim.core.short_repr import counted, short_repr

ORIENTATIONS = {
    "up": RIG_FROM_OPTICAL_LOOKING_UP,
    "ahead": BASE_FROM_OPTICAL_LOOKING_AHEAD,
    "down": BASE_FROM_OPTICAL_LOOKING_DOWN,
}


@dataclass(frozen=True, eq=False)
class OpticalSystem:
    """Non-central camera with mirrors and refracting surfaces; immutable.

    Attributes:
        camera: central camera, whose pixels are the system's pixels.
        surfaces: mirrors and boundaries, in the order of the rays from the camera.
        obstacles: opaque parts that can block rays.
        system_from_camera: (4, 4) pose of the camera's optical frame: its misalignment.
        orientation: (3, 3) rig_from_optical in a level rig; None: up into a mirror, else the
            camera's own.

    Raises:
        OmnisimError: the camera is non-central, there is no surface, a medium or color is unknown,
            or a misalignment or orientation is not a pose.
    """

    camera: CentralCamera
    surfaces: tuple[Surface, ...]
    obstacles: Annotated[tuple[Rod, ...], Field(max_length=64)] = ()
    medium: Medium = "air"
    """Medium around the camera: a name, a refractive index, or three indices for R, G and B."""
    system_from_camera: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    origin_m: Place = (0.0, 0.0, 0.0)
    """Origin of the sensor's frame, meters in the system's frame; default: the camera's pinhole."""
    color: Primary | None = None
    """Primary whose wavelength is refracted; default: helium's d line."""
    orientation: NDArray[np.float64] | None = None
    chromatic: Flag = False
    """Render red, green and blue along rays of their own wavelengths, at three times the cost.
    Ground truth uses green."""

    model_name = "optics"
    domain_limit_rad = None

    def __post_init__(self) -> None:
        if not isinstance(self.camera, CentralCamera):
            raise OpticsError(f"camera: expected a camera model, got {type(self.camera).__name__}")
        if isinstance(self.camera, NonCentralCamera):
            raise OpticsError("camera: expected a central camera, got an optical system")
        check_pose(self.system_from_camera)
        if self.orientation is not None:
            check_pose(pose_from_rotation(self.orientation, (0.0, 0.0, 0.0)))
        if not self.surfaces:
            raise OpticsError("surfaces: expected at least one, got none")
        if self.chromatic and self.color is not None:
            raise OpticsError(f"color: expected none, as chromatic is true, got {self.color!r}")
        assert self.indices  # raises if a medium is unknown

    def __repr__(self) -> str:
        mirrors = sum(surface.is_mirror for surface in self.surfaces)
        return short_repr(
            self,
            summary(self.camera),
            counted(mirrors, "mirror"),
            counted(len(self.surfaces) - mirrors, "boundary", "boundaries"),
        )

    @property
    def width_px(self) -> int:
        """Image width."""
        return self.camera.width_px

    @property
    def height_px(self) -> int:
        """Image height."""
        return self.camera.height_px

    @property
    def principal_point_px(self) -> tuple[float, float]:
        """Principal point (u, v) of the camera."""
        return self.camera.principal_point_px

    @property
    def rig_from_optical(self) -> NDArray[np.float64]:
        """Orientation (3, 3) in a level rig; default: up with a mirror, otherwise the camera's."""
        if self.orientation is not None:
            return self.orientation
        has_mirror = any(surface.is_mirror for surface in self.surfaces)
        return RIG_FROM_OPTICAL_LOOKING_UP if has_mirror else self.camera.rig_from_optical

    @cached_property
    def indices(self) -> tuple[float, ...]:
        """Refractive indices (surfaces + 1), starting at the camera."""
        media = [self.medium]
        for surface in self.surfaces:
            media.append(media[-1] if surface.medium is None else surface.medium)
        color = "G" if self.chromatic else self.color
        return tuple(refractive_index(medium, color) for medium in media)

    def surface(self, number: int, source: str) -> Surface:
        """Surface with the given number; `source` names the system in messages.

        Raises:
            OpticsError: the number is invalid.
        """
        if not 0 <= number < len(self.surfaces):
            expected = f"expected 0 to {len(self.surfaces) - 1}"
            raise OpticsError(f"{source}: surface: {expected}, got {number}")
        return self.surfaces[number]

    def scaled(self, scale: float) -> Self:
        """The same view in an image `scale` times as large; sizes are rounded."""
        return dataclasses.replace(self, camera=self.camera.scaled(scale))

    def of_color(self, color: Primary | None) -> Self:
        """The same system at the wavelength of "R", "G" or "B"; None: at the d line."""
        return dataclasses.replace(self, color=color, chromatic=False)

    def by_color(self) -> tuple[Self, ...]:
        """Systems for R, G and B if the system is chromatic and refracts; otherwise itself."""
        if not self.chromatic or all(surface.is_mirror for surface in self.surfaces):
            return (self,)
        return tuple(self.of_color(color) for color in WAVELENGTHS_UM)

    def paths(self, pixels_px: ArrayLike) -> Paths:
        """Paths of the rays of pixels (n, 2), in the system frame."""
        rays = self.camera.ray_from_pixel(pixels_px)
        fates = np.where(rays.valid, Fate.SEEN, Fate.OUTSIDE).astype(np.uint8)
        directions = rays.directions @ self.system_from_camera[:3, :3].T
        origins = np.tile(self.system_from_camera[:3, 3], (len(directions), 1))
        if rays.origins_m is not None:
            origins += rays.origins_m @ self.system_from_camera[:3, :3].T
        return trace(self.surfaces, self.indices, self.obstacles, origins, directions, fates)

    def rays(self, pixels_px: ArrayLike) -> TracedRays:
        """Rays of pixels (..., 2) where they leave the system, in the sensor's optical frame."""
        pixels = as_pixels(pixels_px)
        paths = self.paths(pixels.reshape(-1, 2))
        shape = pixels.shape[:-1]
        valid = paths.fates == Fate.SEEN
        origins = np.where(valid[:, None], paths.points_m[-1] - self.origin_m, 0.0)
        directions = np.where(valid[:, None], paths.directions, (0.0, 0.0, 1.0))
        return TracedRays(
            origins.reshape(*shape, 3),
            directions.reshape(*shape, 3),
            valid.reshape(shape),
            paths.fates.reshape(shape),
        )

    def all_rays(self) -> TracedRays:
        """Rays (height, width) of all pixels."""
        return self.rays(pixel_grid(self.width_px, self.height_px))

    def ray_from_pixel(self, pixels_px: ArrayLike) -> Rays:
        """Rays of pixels (..., 2) with their origins, as a camera model returns them."""
        rays = self.rays(pixels_px)
        return Rays(rays.directions, rays.valid, rays.origins_m)

    def pixel_from_point(self, points_m: ArrayLike) -> Pixels:
        """Pixels of points (..., 3) in the sensor's optical frame; valid where they are seen.

        A point that is seen more than once gets one of its pixels, see `pixels_from_point`.
        """
        points = as_directions(points_m)
        return self._pixels(points + self.origin_m, 1.0)

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3) to points at infinity."""
        return self._pixels(as_directions(directions), 0.0)

    def pixels_from_point(self, point_m: ArrayLike) -> Floats:
        """All pixels (n, 2) of a point (3,) in the sensor's optical frame."""
        point = as_directions(point_m) + self.origin_m
        return self.inverse.all_pixels(Targets(point[None], 1.0))

    @cached_property
    def inverse(self) -> Inverse:
        """Solver from points to pixels."""
        return Inverse(self)

    def camera_directions(self, points_m: Floats) -> Floats:
        """Unit directions (n, 3), camera frame, to points (n, 3) in the system frame."""
        moved = points_m - self.system_from_camera[:3, 3]
        rotated: Floats = np.einsum("nj,ji->ni", moved, self.system_from_camera[:3, :3])
        rotated /= np.maximum(np.linalg.norm(rotated, axis=1, keepdims=True), 1e-300)
        return rotated

    def _pixels(self, points: Floats, weight: float) -> Pixels:
        pixels = self.inverse.pixels(Targets(points.reshape(-1, 3), weight))
        shape = points.shape[:-1]
        return Pixels(pixels.positions_px.reshape(*shape, 2), pixels.valid.reshape(shape))

    def uniforms(self) -> Uniforms:
        """Raise, because no shader traces these rays.

        Raises:
            OpticsError: always.
        """
        raise OpticsError("camera: an optical system has no shader")

    def parameters(self) -> CameraParameters:
        """Model name and all keys and values of an optics file, enough to rebuild the system."""
        parameters: CameraParameters = {
            "model": self.model_name,
            "medium": medium_parameter(self.medium),
            "origin_m": list(self.origin_m),
        }
        if self.orientation is not None:
            parameters["looking"] = _looking(self.orientation)
        if self.color is not None:
            parameters["color"] = self.color
        if self.chromatic:
            parameters["chromatic"] = True
        parameters["camera"] = {
            **self.camera.parameters(),
            **pose_parameters(self.system_from_camera),
        }
        parameters["surfaces"] = [surface.parameters() for surface in self.surfaces]
        if self.obstacles:
            parameters["obstacles"] = [obstacle.parameters() for obstacle in self.obstacles]
        return parameters


def _looking(orientation: NDArray[np.float64]) -> ParameterValue:
    """Orientation as a name, or as the rows of a matrix."""
    names = (name for name, one in ORIENTATIONS.items() if np.array_equal(one, orientation))
    return next(names, None) or orientation.tolist()
