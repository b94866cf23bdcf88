"""Poses and rotations: matrices, quaternions and angles.

A pose is a matrix (4, 4) target_from_source, and a rotation is its upper left (3, 3).
`omnisim.core.coordinate_frames` lists the frames. Quaternions are (x, y, z, w). Both signs are the
same rotation; functions here return w ≥ 0. Angles are counter-clockwise about their axis.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OmnisimError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

# Beyond this, products of coordinates overflow the GPU's floats.
MAX_M = 1e15
# Looser than the float32 rounding of a rotation, far below a tenth of a pixel.
POSE_TOLERANCE = 1e-6
_LAST_ROW, _IDENTITY = np.array([0.0, 0.0, 0.0, 1.0]), np.eye(3)


def rotation_type() -> type[Rotation]:
    """SciPy's class of rotations."""
    from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

    return Rotation


def pose(
    position_m: ArrayLike = (0.0, 0.0, 0.0),
    *,
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    yaw_deg: float = 0.0,
) -> Floats:
    """Pose (4, 4) parent_from_child from a position in meters and angles in degrees.

    Raises:
        OmnisimError: a position is not three finite numbers, or an angle is not finite.
    """
    position = np.asarray(position_m, dtype=np.float64)
    angles_deg = (roll_deg, pitch_deg, yaw_deg)
    if position.shape != (3,) or not np.all(np.abs(position) < MAX_M):  # also rejects NaN
        raise OmnisimError(
            f"position {position.tolist()}: expected three finite numbers in meters below {MAX_M:g}"
        )
    if not all(math.isfinite(angle) for angle in angles_deg):
        raise OmnisimError(f"roll, pitch, yaw {angles_deg}: expected finite numbers in degrees")
    return pose_from_rotation(rotation_from_roll_pitch_yaw(*np.radians(angles_deg)), position)


def pose_from_rotation(rotation: ArrayLike, position_m: ArrayLike) -> Floats:
    """Poses (..., 4, 4) from rotations (..., 3, 3) and positions (..., 3)."""
    rotation = np.asarray(rotation, dtype=np.float64)
    poses = np.zeros((*rotation.shape[:-2], 4, 4))
    poses[..., :3, :3] = rotation
    poses[..., :3, 3] = position_m
    poses[..., 3, 3] = 1.0
    return poses


def check_pose(matrix: ArrayLike) -> Floats:
    """Validate a pose and return it as float64 (4, 4).

    Raises:
        OmnisimError: the matrix is not (4, 4), not finite, or not a rotation and a translation.
    """
    checked = _matrices(matrix, "pose")
    if checked.shape != (4, 4):
        raise OmnisimError(
            "pose: expected a finite 4 × 4 matrix, as omnisim.pose makes one, "
            f"got an array of shape {checked.shape}"
        )
    _check_values(checked, "pose")
    return checked


def check_poses(matrices: object) -> Floats:
    """Validate poses and return them as float64 (n, 4, 4).

    Raises:
        OmnisimError: the array is not (n, 4, 4), or one matrix is not a pose; names its index.
    """
    checked = _matrices(matrices, "poses")
    if checked.ndim != 3 or checked.shape[1:] != (4, 4):
        raise OmnisimError(
            f"poses: expected finite matrices (n, 4, 4), got an array of shape {checked.shape}"
        )
    is_right = (np.abs(checked) < MAX_M).all(axis=(1, 2))
    if is_right.all():  # otherwise squares may overflow
        is_right = is_pose(checked)
    if not is_right.all():
        first = int(np.argmin(is_right))
        _check_values(checked[first], f"poses[{first}]")
    return checked


def _matrices(given: object, what: str) -> Floats:
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        kind = type(given).__name__
        raise OmnisimError(f"{what}: expected a finite 4 × 4 matrix, got {kind}") from None


def _check_values(matrix: Floats, what: str) -> None:
    if not (np.abs(matrix) < MAX_M).all():
        raise OmnisimError(f"{what}: expected a finite 4 × 4 matrix")
    if not is_pose(matrix):
        raise OmnisimError(f"{what}: expected a rotation and a translation, no scale, no mirroring")


def is_pose(matrices: Floats) -> Bools:
    """Mask (...) of finite matrices (..., 4, 4) that are a rotation and a translation."""
    affine: Bools = (matrices[..., 3, :] == _LAST_ROW).all(axis=-1)
    return affine & is_rotation(matrices[..., :3, :3], POSE_TOLERANCE)


def inverse(pose: Floats) -> Floats:
    """Invert poses (..., 4, 4): source_from_target."""
    rotation = np.swapaxes(pose[..., :3, :3], -1, -2)
    return pose_from_rotation(rotation, -(rotation @ pose[..., :3, 3:])[..., 0])


def interpolate_pose(first: Floats, second: Floats, share: float) -> Floats:
    """Interpolate poses (4, 4) at a share in [0, 1]: positions linearly, rotations by slerp.

    Source: Shoemake, Animating rotation with quaternion curves (1985).
    """
    rotations = rotation_type().from_matrix
    change = rotations(first[:3, :3].T @ second[:3, :3]) ** share
    return pose_from_rotation(
        first[:3, :3] @ change.as_matrix(), first[:3, 3] + share * (second[:3, 3] - first[:3, 3])
    )


def rotation_from_roll_pitch_yaw(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Floats:
    """Rotation (3, 3) parent_from_child: fixed-axis roll about x, pitch about y, yaw about z.

    Source: REP 103, fixed-axis roll, pitch, yaw.
    """
    cr, sr = math.cos(roll_rad), math.sin(roll_rad)
    cp, sp = math.cos(pitch_rad), math.sin(pitch_rad)
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def roll_pitch_yaw_from_rotation(rotation: ArrayLike) -> Floats:
    """Fixed-axis roll, pitch and yaw (..., 3) of rotations (..., 3, 3), as in REP 103.

    If x points straight up or down (gimbal lock), roll and yaw turn about the same axis, and any
    split between them is right. Here yaw follows from the matrix elements and roll is the
    remainder, without the threshold and the warning of SciPy's `as_euler`.
    """
    r = np.asarray(rotation, dtype=np.float64)
    pitch = np.arctan2(-r[..., 2, 0], np.hypot(r[..., 0, 0], r[..., 1, 0]))
    yaw = yaw_from_rotation(r)
    sin, cos = np.sin(yaw), np.cos(yaw)
    # the second row of (rotation by −yaw) @ r is (0, cos roll, −sin roll), at any pitch
    roll = np.arctan2(
        sin * r[..., 0, 2] - cos * r[..., 1, 2], cos * r[..., 1, 1] - sin * r[..., 0, 1]
    )
    return np.stack((roll, pitch, yaw), axis=-1)


def rotation_from_yaw(yaw_rad: ArrayLike) -> Floats:
    """Rotations (..., 3, 3) about z from headings (...)."""
    yaw = np.asarray(yaw_rad, dtype=np.float64)
    rotation = np.zeros((*yaw.shape, 3, 3))
    rotation[..., 0, 0] = rotation[..., 1, 1] = np.cos(yaw)
    rotation[..., 1, 0] = np.sin(yaw)
    rotation[..., 0, 1] = -rotation[..., 1, 0]
    rotation[..., 2, 2] = 1.0
    return rotation


def yaw_from_rotation(rotation: ArrayLike) -> Floats:
    """Heading (...) of x on the ground of rotations (..., 3, 3) or poses (..., 4, 4), radians.

    It is within ±π, and 0 if x points straight up or down.
    """
    r = np.asarray(rotation, dtype=np.float64)
    return np.arctan2(r[..., 1, 0], r[..., 0, 0])


def rotation_from_quaternion(quaternion: ArrayLike) -> Floats:
    """Rotations (n, 3, 3) from non-zero quaternions (n, 4) of any length."""
    return rotation_type().from_quat(np.asarray(quaternion)).as_matrix()


def quaternion_from_rotation(rotation: ArrayLike) -> Floats:
    """Unit quaternions (n, 4) from rotations (n, 3, 3)."""
    return rotation_type().from_matrix(np.asarray(rotation)).as_quat(canonical=True)


def rotation_angles(first: Floats, second: Floats) -> Floats:
    """Angles (n,) in radians, within ±π, between rotations (n, 3, 3), about any axis.

    Positive if the axis points up from the vehicle, or is level.
    """
    change = np.swapaxes(first, -1, -2) @ second
    vectors = rotation_type().from_matrix(change).as_rotvec()
    angles: Floats = np.linalg.norm(vectors, axis=-1)
    return np.where(vectors[..., 2] < 0.0, -angles, angles)


def nearest_rotation(matrix: Floats) -> Floats:
    """Rotations (..., 3, 3) nearest to matrices that deviate from rotations only by rounding.

    Source: Higham, Computing the polar decomposition (1986): its orthogonal factor.
    """
    u, _, vt = np.linalg.svd(matrix)
    return u @ vt


def proper_rotation(matrix: Floats) -> Floats:
    """Axes (3, 3) nearest to those of a matrix (3, 3), without its scale, shear and mirroring."""
    axes = nearest_rotation(matrix)
    return axes if np.linalg.det(axes) > 0.0 else -axes


def is_rotation(matrices: Floats, tolerance: float) -> Bools:
    """Mask (...) of finite matrices (..., 3, 3) that neither scale, shear nor mirror."""
    errors = np.abs(matrices @ matrices.swapaxes(-1, -2) - _IDENTITY)
    orthogonal: Bools = errors.max(axis=(-2, -1)) <= tolerance
    handed: Bools = np.linalg.det(matrices) > 0.0
    return orthogonal & handed


def wrap_angle(angle_rad: float) -> float:
    """Wrap an angle to ±π."""
    return math.remainder(angle_rad, 2.0 * math.pi)


def wrap_angles(angles_rad: Floats) -> Floats:
    """Wrap angles (...) to ±π."""
    return angles_rad - 2.0 * math.pi * np.rint(angles_rad / (2.0 * math.pi))
