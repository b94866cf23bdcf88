"""Pinhole lenses outside our models: more of Brown's coefficients, and the FOV model.

Formats read them; `nearest_lens` replaces them by the nearest of our models.

    Brown: (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶), and p1, p2 as ever
    FOV:   r' = atan(2 r tan(w/2))/w

Source: OpenCV's module calib3d; Devernay & Faugeras, "Straight lines have to be straight", 2001.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    Rays,
)
from omnisim.cameras.focal_camera import TwoFocalCamera
from omnisim.cameras.plane_camera import PlaneCamera, PlanePoints, unit_vectors
from omnisim.errors import OpticsError

MAX_RADIUS = 50.0  # tangent of 88.9°
SAMPLES = 20001
MAX_STEPS = 30  # the tangential part is small: each step leaves a hundredth of the error
NEWTON_STEPS = 4  # from between two samples to the last bit
STEP = 1e-6  # for slopes


@dataclass(frozen=True)
class DistortedPinhole(TwoFocalCamera, PlaneCamera):
    """A pinhole camera with radial and, perhaps, tangential distortion."""

    @abstractmethod
    def _distorted_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distorted radius of a radius (...,)."""

    def _tangential(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tangential distortion (..., 2) of points (..., 2)."""
        return np.zeros_like(plane)

    @cached_property
    def _curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Radii and distorted radii, up to the fold."""
        radius = np.linspace(0.0, MAX_RADIUS, SAMPLES)
        distorted = self._distorted_radius(radius)
        falls = np.flatnonzero(~(np.diff(distorted) > 0.0))
        end = int(falls[0]) + 1 if len(falls) else SAMPLES
        return radius[:end], distorted[:end]

    @property
    def radius_limit(self) -> float:
        """Radius of the fold, or the largest that is looked at."""
        return float(self._curve[0][-1])

    def _undistorted_radius(self, distorted: NDArray[np.float64]) -> NDArray[np.float64]:
        """Radius of a distorted radius (...,), that of the fold past it."""
        radii, known = self._curve
        radius = np.interp(distorted, known, radii)
        for _ in range(NEWTON_STEPS):
            slope = (
                self._distorted_radius(radius + STEP)
                - self._distorted_radius(np.abs(radius - STEP))
            ) / (2.0 * STEP)
            following = radius - (self._distorted_radius(radius) - distorted) / np.maximum(
                slope, 1e-6
            )
            radius = np.clip(following, 0.0, self.radius_limit)
        return radius

    def _rays_from_plane(self, plane: NDArray[np.float64]) -> Rays:
        undistorted = np.zeros_like(plane)
        for _ in range(MAX_STEPS):
            target = plane - self._tangential(undistorted)
            radius = np.hypot(target[..., 0], target[..., 1])
            following = unit_vectors(target, radius) * self._undistorted_radius(radius)[..., None]
            moved = np.abs(following - undistorted).max(initial=0.0)
            undistorted = following
            if moved <= 1e-13 or not self._tangential(undistorted).any():
                break
        miss = np.abs(self._distort(undistorted) - plane).max(axis=-1)
        rays = np.concatenate((undistorted, np.ones_like(undistorted[..., :1])), axis=-1)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        return Rays(rays, miss < 1e-9)

    def _plane_from_rays(self, directions: NDArray[np.float64]) -> PlanePoints:
        valid = directions[..., 2] > 1e-12
        plane = directions[..., :2] / np.where(valid, directions[..., 2], 1.0)[..., None]
        valid &= np.hypot(plane[..., 0], plane[..., 1]) <= self.radius_limit
        return PlanePoints(self._distort(np.where(valid[..., None], plane, 0.0)), valid)

    def _distort(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        radius = np.hypot(plane[..., 0], plane[..., 1])
        return unit_vectors(plane, radius) * self._distorted_radius(radius)[
            ..., None
        ] + self._tangential(plane)


@dataclass(frozen=True)
class BrownLens(DistortedPinhole):
    """Brown's distortion with k1, k2, p1, p2, k3, and OpenCV's k4, k5, k6 in the denominator.

    Attributes:
        distortion: k1, k2, p1, p2, k3, k4, k5, k6, as OpenCV orders them.
    """

    distortion: tuple[float, ...]
    model_name = "rational_polynomial"

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.distortion) != 8:
            raise OpticsError(
                f"camera: distortion: expected k1, k2, p1, p2, k3, k4, k5, k6, "
                f"got {self.distortion}"
            )

    def _distorted_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        k1, k2, _, _, k3, k4, k5, k6 = self.distortion
        squared = radius * radius
        above = 1.0 + squared * (k1 + squared * (k2 + squared * k3))
        below = 1.0 + squared * (k4 + squared * (k5 + squared * k6))
        # past a pole nothing is seen: there the radius no longer grows
        return radius * above / np.where(below > 1e-9, below, np.inf)

    def _tangential(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        p1, p2 = self.distortion[2:4]
        tangential = np.array([p2, p1])
        squared = np.sum(plane * plane, axis=-1, keepdims=True)
        along = np.sum(tangential * plane, axis=-1, keepdims=True)
        offset: NDArray[np.float64] = 2.0 * along * plane + squared * tangential
        return offset


@dataclass(frozen=True)
class FovLens(DistortedPinhole):
    """The FOV model, by the field of view w of the ideal fisheye that it is."""

    w: float
    model_name = "fov"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1e-6 < self.w < math.pi:
            raise OpticsError(f"camera: w: expected more than 0 and less than π, got {self.w:g}")

    def _distorted_radius(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.arctan(2.0 * math.tan(0.5 * self.w) * radius) / self.w
