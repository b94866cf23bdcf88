"""Poses as a position and a quaternion x, y, z, w."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from omnisim.errors import CalibrationError


def pose_of(
    position_m: Sequence[float], quaternion_xyzw: Sequence[float], source: str
) -> NDArray[np.float64]:
    """The pose (4, 4); the quaternion may be of any length but 0.

    Raises:
        CalibrationError: it is 0, or far too long.
    """
    length = float(np.linalg.norm(np.clip(quaternion_xyzw, -1e100, 1e100)))
    if not 1e-9 < length < 1e99:
        raise CalibrationError(
            f"{source}: quaternion {list(quaternion_xyzw)}: want x, y, z, w of length 1"
        )
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(np.asarray(quaternion_xyzw) / length).as_matrix()
    pose[:3, 3] = position_m
    return pose


def position_and_quaternion(pose: NDArray[np.float64]) -> tuple[list[float], list[float]]:
    """Position, and quaternion x, y, z, w, of a pose (4, 4)."""
    return pose[:3, 3].tolist(), Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
