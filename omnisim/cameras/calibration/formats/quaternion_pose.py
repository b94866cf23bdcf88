"""Poses as a position and a quaternion x, y, z, w."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from omnisim.cameras.calibration.fields import unexpected
from omnisim.core.poses import pose_from_rotation, rotation_from_quaternion


def pose_from_quaternion(
    position_m: Sequence[float], quaternion: Sequence[float], place: str
) -> NDArray[np.float64]:
    """Pose (4, 4) from a position and a quaternion of any length except 0.

    Raises:
        CalibrationError: the quaternion is 0, or far too long.
    """
    length = float(np.linalg.norm(np.clip(quaternion, -1e100, 1e100)))
    if not 1e-9 < length < 1e99:
        raise unexpected(f"{place}: quaternion", "x, y, z, w of length 1", list(quaternion))
    return pose_from_rotation(rotation_from_quaternion(np.asarray(quaternion) / length), position_m)


def position_and_quaternion(pose: NDArray[np.float64]) -> tuple[list[float], list[float]]:
    """Position and quaternion x, y, z, w (of either sign) of a pose (4, 4)."""
    return pose[:3, 3].tolist(), Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
