"""ROS CameraInfo lenses, in YAML files and in Foxglove's JSON.

| distortion_model | D | model |
| --- | --- | --- |
| plumb_bob | k1 k2 p1 p2 k3 | perspective, unified with ξ = 0 |
| rational_polynomial | k1 k2 p1 p2 k3 k4 k5 k6 | rational_polynomial, or as plumb_bob |
| equidistant (fisheye, kannala_brandt) | k1 k2 k3 k4 | kannala_brandt |

Pixel (0, 0) is the center of the first pixel, as in omnisim. Rays at or beyond 90° from the axis
have no model: `P` and every rectified image lie in a plane.

Source: sensor_msgs/CameraInfo, image_pipeline/CameraInfo.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from omnisim.cameras import (
    CentralCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration.fields import check_choice
from omnisim.cameras.calibration.formats.format import ANY, PINHOLE, Format, error_context
from omnisim.cameras.calibration.formats.pinhole import (
    brown_pinhole,
    check_no_skew,
    fisheye,
    matrix_intrinsics,
)

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
CameraInfoLens = UnifiedCamera | RationalPolynomialCamera | KannalaBrandtCamera


class CameraInfo(Format[CameraInfoLens]):
    """Base of the formats with a CameraInfo.

    Attributes:
        distortion_models: names of Brown's distortion models.
        fisheye_models: names of the Kannala-Brandt models.
    """

    models = (UnifiedCamera, RationalPolynomialCamera, KannalaBrandtCamera)
    fits = ((UnifiedCamera, PINHOLE), (RationalPolynomialCamera, ANY), (KannalaBrandtCamera, ANY))
    max_theta_rad = 0.5 * math.pi
    distortion_models: tuple[str, ...]
    fisheye_models: tuple[str, ...]

    def _lens(
        self,
        size_px: tuple[int, int],
        model: str,
        matrix: Sequence[float],
        coefficients: Sequence[float],
        source: str,
        keys: tuple[str, str],
    ) -> CentralCamera:
        """Lens from an image size, distortion model, K and D; `keys` name K and D in messages.

        Raises:
            CalibrationError: the model is unknown, or the numbers do not fit it.
        """
        intrinsics, skew_px = matrix_intrinsics(size_px, matrix, f"{source}: {keys[0]}")
        check_no_skew(skew_px, f"{source}: {keys[0]}")
        expected = (*self.distortion_models, *self.fisheye_models)
        check_choice(model, expected, f"{source}: distortion_model")
        with error_context(source):
            if model in self.fisheye_models:
                return fisheye(intrinsics, coefficients, f"{source}: {keys[1]}")
            return brown_pinhole(intrinsics, coefficients, f"{source}: {keys[1]}")


class CameraInfoFields(NamedTuple):
    """Distortion model in ROS's terms, D, K and P."""

    distortion_model: str
    d: list[float]
    k: list[float]
    p: list[float]


def camera_info(lens: CameraInfoLens) -> CameraInfoFields:
    """Fields of the message for a lens."""
    (fx, fy), (cx, cy) = lens.focal_lengths_px, lens.principal_point_px
    k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    p = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    if isinstance(lens, KannalaBrandtCamera):
        return CameraInfoFields("equidistant", list(lens.coefficients), k, p)
    if isinstance(lens, RationalPolynomialCamera):
        return CameraInfoFields("rational_polynomial", list(lens.distortion[:8]), k, p)
    return CameraInfoFields("plumb_bob", [*lens.distortion[:4], lens.k3], k, p)
