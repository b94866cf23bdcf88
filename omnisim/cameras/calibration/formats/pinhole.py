"""Parts shared by many formats: camera matrices, and pinhole cameras with Brown's distortion.

Lists of numbers that are not as expected raise a `CalibrationError` that names their place, and
numbers of no valid camera an `OpticsError`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from omnisim.cameras import (
    CentralCamera,
    KannalaBrandtCamera,
    PerspectiveCamera,
    RationalPolynomialCamera,
    UnifiedCamera,
)
from omnisim.cameras.calibration.documents import counted, unexpected
from omnisim.cameras.calibration.equivalents import equivalent
from omnisim.core.arrays import Floats
from omnisim.core.poses import pose_from_rotation, rotation_from_quaternion

COEFFICIENT_COUNTS = (0, 4, 5, 8, 12, 14)  # allowed by OpenCV


class Intrinsics(NamedTuple):
    """Leading parameters of all models with two focal lengths."""

    width_px: int
    height_px: int
    focal_lengths_px: tuple[float, float]
    principal_point_px: tuple[float, float]


def matrix_intrinsics(
    size_px: tuple[int, int], matrix: Sequence[float], place: str
) -> tuple[Intrinsics, float]:
    """Intrinsics and skew of a row-major camera matrix K; `place` names it in messages."""
    fx, skew, cx, zero, fy, cy, *last_row = counted(matrix, "fx s cx 0 fy cy 0 0 1", place)
    if [zero, *last_row] != [0.0, 0.0, 0.0, 1.0]:
        raise unexpected(place, "[fx, s, cx, 0, fy, cy, 0, 0, 1]", matrix)
    return Intrinsics(*size_px, (fx, fy), (cx, cy)), skew


def check_no_skew(skew_px: float, place: str) -> None:
    """Reject a skew."""
    if skew_px:
        raise unexpected(place, "no skew", skew_px)


def fisheye(
    intrinsics: Intrinsics, coefficients: Sequence[float], place: str
) -> KannalaBrandtCamera:
    """Kannala-Brandt lens with k1, k2, k3, k4; `place` names these in messages."""
    four = counted(coefficients, "k1 k2 k3 k4", place)
    return KannalaBrandtCamera(*intrinsics, tuple(four))


def pinhole(
    intrinsics: Intrinsics, distortion: Sequence[float] = (0.0,) * 4, skew_px: float = 0.0
) -> CentralCamera:
    """Pinhole camera with k1, k2, p1, p2 (k3): unified with ξ = 0, or the perspective model."""
    unified = UnifiedCamera(*intrinsics, 0.0, tuple(distortion), skew_px)
    return equivalent(unified, PerspectiveCamera) or unified


def brown_pinhole(
    intrinsics: Intrinsics, coefficients: Sequence[float], place: str
) -> CentralCamera:
    """Pinhole camera with OpenCV's coefficients, in the simplest model that supports them.

    They are none, or k1 k2 p1 p2, k3, k4 k5 k6, s1 s2 s3 s4, τx τy; `place` names file and key.
    """
    if len(coefficients) not in COEFFICIENT_COUNTS:
        expected = "k1, k2, p1, p2, k3 and optionally k4, k5, k6, s1, s2, s3, s4, τx, τy"
        raise unexpected(place, expected, list(coefficients))
    used = (*map(float, coefficients), *(0.0,) * 8)[: max(8, len(coefficients))]
    if any(used[5:]):
        return RationalPolynomialCamera(*intrinsics, used)
    return pinhole(intrinsics, used[:5] if used[4] else used[:4])


# Poses as a position and a quaternion x, y, z, w.


def pose_from_quaternion(
    position_m: Sequence[float], quaternion: Sequence[float], place: str
) -> Floats:
    """Pose (4, 4) from a position and a quaternion of any length except 0."""
    length = float(np.linalg.norm(np.clip(quaternion, -1e100, 1e100)))
    if not 1e-9 < length < 1e99:
        raise unexpected(f"{place}: quaternion", "x, y, z, w of length 1", list(quaternion))
    return pose_from_rotation(rotation_from_quaternion(np.asarray(quaternion) / length), position_m)


def position_and_quaternion(pose: Floats) -> tuple[list[float], list[float]]:
    """Position and quaternion x, y, z, w (of either sign) of a pose (4, 4)."""
    return pose[:3, 3].tolist(), Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()


# Numbers and matrices in YAML that every reader parses as identical floats.


def yaml_float(value: float) -> str:
    """Float that always has a decimal point: YAML 1.1 parses 1e-05 as a string."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")


def yaml_floats(values: Iterable[float]) -> str:
    """List of floats on one line."""
    return "[" + ", ".join(map(yaml_float, values)) + "]"


def yaml_matrix(
    key: str, rows: int, columns: int, values: Sequence[float], opencv: bool = False
) -> str:
    """Row-major matrix under a key; `opencv`: in the format of `cv2.FileStorage`."""
    tag, indent, kind = (" !!opencv-matrix", "   ", "   dt: d\n") if opencv else ("", "  ", "")
    return (
        f"{key}:{tag}\n{indent}rows: {rows}\n{indent}cols: {columns}\n{kind}"
        f"{indent}data: {yaml_floats(values)}\n"
    )
