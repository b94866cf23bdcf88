"""Pinhole lenses that no model of ours is: more of Brown's coefficients, and the FOV model.

They are what a file means, and are read as the nearest of our models; see `nearest_lens`.

    Brown: (1 + k1 r² + k2 r⁴ + k3 r⁶)/(1 + k4 r² + k5 r⁴ + k6 r⁶), and p1, p2 as ever
    FOV:   r' = atan(2 r tan(w/2))/w

Source: OpenCV's module calib3d; Devernay & Faugeras, "Straight lines have to be straight", 2001.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    CentralCamera,
    EucmCamera,
    KannalaBrandtCamera,
    Rays,
    UnifiedCamera,
)
from omnisim.cameras.focal_camera import TwoFocalCamera
from omnisim.cameras.parameters import check_finite
from omnisim.cameras.plane_camera import PlaneCamera, PlanePoints, unit_vectors
from omnisim.errors import CalibrationError, OpticsError

FURTHEST = 50.0  # tangent of 88.9°
SAMPLES = 20001
MOST_STEPS = 30  # the slant is small: each makes what is left some hundred times smaller
NEWTON_STEPS = 4  # from between two samples to the last bit
STEP = 1e-6  # for slopes
FURTHEST_OFF = 0.01  # of the picture's shorter side
GOOD_PX = 0.05  # what no corner detector sees


@dataclass(frozen=True)
class DistortedPinhole(TwoFocalCamera, PlaneCamera):
    """A pinhole camera whose picture is distorted along the radius, and perhaps aslant."""

    @abstractmethod
    def _grown(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distorted radius of a radius (...,)."""

    def _slant(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is added to points (..., 2) beside the radial part."""
        return np.zeros_like(plane)

    @cached_property
    def _curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Radii and distorted radii, as far as they grow together."""
        radius = np.linspace(0.0, FURTHEST, SAMPLES)
        grown = self._grown(radius)
        falls = np.flatnonzero(~(np.diff(grown) > 0.0))
        end = int(falls[0]) + 1 if len(falls) else SAMPLES
        return radius[:end], grown[:end]

    @property
    def radius_limit(self) -> float:
        """Where the distorted radius no longer grows."""
        return float(self._curve[0][-1])

    def _shrunk(self, grown: NDArray[np.float64]) -> NDArray[np.float64]:
        """Radius of a distorted radius (...,), at the limit's where there is none."""
        radii, known = self._curve
        radius = np.interp(grown, known, radii)
        for _ in range(NEWTON_STEPS):
            slope = (self._grown(radius + STEP) - self._grown(np.abs(radius - STEP))) / (2.0 * STEP)
            following = radius - (self._grown(radius) - grown) / np.maximum(slope, 1e-6)
            radius = np.clip(following, 0.0, self.radius_limit)
        return radius

    def _rays_from_plane(self, plane: NDArray[np.float64]) -> Rays:
        found = np.zeros_like(plane)
        for _ in range(MOST_STEPS):
            target = plane - self._slant(found)
            radius = np.hypot(target[..., 0], target[..., 1])
            following = unit_vectors(target, radius) * self._shrunk(radius)[..., None]
            moved = np.abs(following - found).max(initial=0.0)
            found = following
            if moved <= 1e-13 or not self._slant(found).any():
                break
        miss = np.abs(self._distort(found) - plane).max(axis=-1)
        rays = np.concatenate((found, np.ones_like(found[..., :1])), axis=-1)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        return Rays(rays, miss < 1e-9)

    def _plane_from_rays(self, directions: NDArray[np.float64]) -> PlanePoints:
        valid = directions[..., 2] > 1e-12
        plane = directions[..., :2] / np.where(valid, directions[..., 2], 1.0)[..., None]
        valid &= np.hypot(plane[..., 0], plane[..., 1]) <= self.radius_limit
        return PlanePoints(self._distort(np.where(valid[..., None], plane, 0.0)), valid)

    def _distort(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        radius = np.hypot(plane[..., 0], plane[..., 1])
        return unit_vectors(plane, radius) * self._grown(radius)[..., None] + self._slant(plane)


@dataclass(frozen=True)
class BrownLens(DistortedPinhole):
    """Brown's distortion with k1, k2, p1, p2, k3, and OpenCV's k4, k5, k6 below the line.

    Attributes:
        distortion: k1, k2, p1, p2, k3, k4, k5, k6, as OpenCV orders them.
    """

    distortion: tuple[float, ...]
    model_name = "rational_polynomial"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_finite(self, "distortion")
        if len(self.distortion) != 8:
            raise OpticsError(
                f"camera: distortion = {self.distortion}: want k1, k2, p1, p2, k3, k4, k5, k6"
            )

    def _grown(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        k1, k2, _, _, k3, k4, k5, k6 = self.distortion
        squared = radius * radius
        above = 1.0 + squared * (k1 + squared * (k2 + squared * k3))
        below = 1.0 + squared * (k4 + squared * (k5 + squared * k6))
        # past a pole nothing is seen: there the radius no longer grows
        return radius * above / np.where(below > 1e-9, below, np.inf)

    def _slant(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        p1, p2 = self.distortion[2:4]
        tangential = np.array([p2, p1])
        squared = np.sum(plane * plane, axis=-1, keepdims=True)
        along = np.sum(tangential * plane, axis=-1, keepdims=True)
        return 2.0 * along * plane + squared * tangential


@dataclass(frozen=True)
class FovLens(DistortedPinhole):
    """The FOV model, by the field of view w of the ideal fisheye that it is."""

    w: float
    model_name = "fov"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1e-6 < self.w < math.pi:
            raise OpticsError(f"camera: w = {self.w:g}: want more than 0 and less than π")

    def _grown(self, radius: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.arctan(2.0 * math.tan(0.5 * self.w) * radius) / self.w


def nearest_lens(lens: DistortedPinhole, source: str) -> tuple[CentralCamera, tuple[str, ...]]:
    """The nearest of our models, and how near it is, in words; `source` names the file.

    Raises:
        CalibrationError: none is near.
    """
    from omnisim.calibration.fit import fit_camera

    if not lens.radius_limit > 0.0:
        raise CalibrationError(f"{source}: {lens.model_name}: folds at its own middle: want a lens")
    best: Any = None
    candidates: tuple[tuple[type[Any], dict[str, float]], ...] = (
        (UnifiedCamera, {}), (UnifiedCamera, {"xi": 0.0}), (KannalaBrandtCamera, {}),
        (EucmCamera, {}),
    )  # fmt: skip
    for model, fixed in candidates:
        try:
            fit = fit_camera(lens, model, fixed=fixed)
        except CalibrationError:
            continue
        if fit.covered > 0.99 and (best is None or fit.max_px < best.max_px):
            best = fit
        if best is not None and best.max_px <= GOOD_PX:
            break
    if best is None:
        raise CalibrationError(f"{source}: {lens.model_name}: no model of omnisim comes near it")
    if best.max_px > FURTHEST_OFF * min(lens.width_px, lens.height_px):
        raise CalibrationError(
            f"{source}: {lens.model_name}: the nearest model of omnisim, {best.camera.model_name}, "
            f"is up to {best.max_px:.3g} px off"
        )
    note = (
        f"{lens.model_name} is none of omnisim's models: read as {best.camera.model_name}, "
        f"RMS {best.rms_px:.2g} px and at most {best.max_px:.2g} px off within "
        f"{math.degrees(best.theta_max_rad):.1f}°"
    )
    return best.camera, (note,)
