"""Errors of a calibrated camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import EstimatorError
from omnisim.core.poses import nearest_rotation

STEP_PX = 8  # spacing of the grid over the image
NEAR_AXIS_RAD = 1e-3
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CameraErrors:
    """Errors of a calibrated camera over all pixels that have a true ray.

    A calibration does not determine the lens's orientation in its housing. The rays are therefore
    aligned with the true ones by the best rotation first.
    """

    model: str  # name of the estimated model
    # relative error of the focal length at the axis; NaN: the axis is outside of the image
    focal_length: float
    rms_px: float  # root mean square distance of the pixels of true rays from the true pixels
    max_px: float  # largest such distance
    covered: float  # share of the true rays that the estimated model projects to a pixel

    @property
    def summary(self) -> str:
        """Model and errors in one line of text."""
        return (
            f"{self.model}: focal length {100.0 * self.focal_length:+z.3f} %, {self.rms_px:.3f} px "
            f"RMS, at most {self.max_px:.3g} px, over {100.0 * self.covered:.4g} % of the image"
        )


def camera_errors(estimate: CentralCamera, truth: CentralCamera) -> CameraErrors:
    """Compare a calibrated camera with the true one.

    Args:
        estimate: calibrated camera.
        truth: true camera, of the same image size.

    Raises:
        EstimatorError: the two cameras have no rays in common.
    """
    pixels = pixel_grid(truth.width_px, truth.height_px)[::STEP_PX, ::STEP_PX].reshape(-1, 2)
    true_rays, rays = truth.ray_from_pixel(pixels), estimate.ray_from_pixel(pixels)
    both = true_rays.valid & rays.valid
    if both.sum() < 3:
        raise EstimatorError("the calibrated camera has no rays in common with the true one")
    turned = rays.directions[both].T @ true_rays.directions[both]
    estimate_from_true = nearest_rotation(turned)
    seen = true_rays.valid
    found = estimate.pixel_from_ray(true_rays.directions[seen] @ estimate_from_true.T)
    offsets = np.linalg.norm(found.positions_px - pixels[seen], axis=1)[found.valid]
    return CameraErrors(
        estimate.model_name,
        _focal_length_px(estimate) / _focal_length_px(truth) - 1.0,
        float(np.sqrt(np.mean(np.square(offsets)))),
        float(offsets.max()),
        float(found.valid.mean()),
    )


def _focal_length_px(camera: CentralCamera) -> float:
    """Pixels per radian at the axis, mean of u and v; NaN: the axis has no pixel."""
    small = NEAR_AXIS_RAD * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)], dtype=np.float64)
    ends = camera.pixel_from_ray(np.column_stack((small, np.ones(4))))
    if not ends.valid.all():
        return float("nan")
    spans = np.linalg.norm(ends.positions_px[::2] - ends.positions_px[1::2], axis=1)
    return float(spans.mean() / (2.0 * np.arctan(NEAR_AXIS_RAD)))
