"""Rotations as matrices, quaternions and angles.

Quaternions are (x, y, z, w). Both signs mean the same rotation; those made here have w ≥ 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# An angle or quaternion printed with a few digits, or rounded to float32, is well within this.
ROUNDING = 1e-3


def rotation_from_quaternion(quaternion: ArrayLike) -> NDArray[np.float64]:
    """Rotations (..., 3, 3) from quaternions (..., 4), not zero; their length does not matter."""
    x, y, z, w = np.moveaxis(_unit(np.asarray(quaternion, dtype=np.float64)), -1, 0)
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_rotation(rotation: ArrayLike) -> NDArray[np.float64]:
    """Unit quaternions (..., 4) from rotations (..., 3, 3), equally precise for all of them.

    Four times the outer product q qᵀ is linear in the rotation; its row with the largest diagonal,
    which is at least 1, is a multiple of q that nothing was cancelled in.
    """
    r = np.asarray(rotation, dtype=np.float64)
    r00, r11, r22 = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    xy, xz, yz = (
        r[..., 0, 1] + r[..., 1, 0],
        r[..., 0, 2] + r[..., 2, 0],
        r[..., 1, 2] + r[..., 2, 1],
    )
    xw, yw, zw = (
        r[..., 2, 1] - r[..., 1, 2],
        r[..., 0, 2] - r[..., 2, 0],
        r[..., 1, 0] - r[..., 0, 1],
    )
    diagonal = (1.0 + r00 - r11 - r22, 1.0 - r00 + r11 - r22, 1.0 - r00 - r11 + r22)
    rows = (
        (diagonal[0], xy, xz, xw),
        (xy, diagonal[1], yz, yw),
        (xz, yz, diagonal[2], zw),
        (xw, yw, zw, 1.0 + r00 + r11 + r22),
    )
    outer = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(outer, largest[..., None, None], axis=-2)[..., 0, :]
    quaternion = _unit(row)
    return np.where(quaternion[..., 3:] < 0.0, -quaternion, quaternion)


def roll_pitch_yaw_from_rotation(rotation: ArrayLike) -> NDArray[np.float64]:
    """Fixed-axis roll, pitch and yaw (..., 3) of rotations (..., 3, 3), as REP 103 has them.

    Where x points straight up or down, roll and yaw turn about the same axis: any split between
    them is right, and roll is taken as what is left once yaw is undone.
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


def yaw_from_rotation(rotation: ArrayLike) -> NDArray[np.float64]:
    """Heading (...) of x on the ground in radians, within ±π; 0 where x points straight up or down.

    Args:
        rotation: (..., 3, 3), or poses (..., 4, 4).
    """
    r = np.asarray(rotation, dtype=np.float64)
    return np.arctan2(r[..., 1, 0], r[..., 0, 0])


def rotation_from_yaw(yaw_rad: ArrayLike) -> NDArray[np.float64]:
    """Rotations (..., 3, 3) about z from headings (...)."""
    yaw = np.asarray(yaw_rad, dtype=np.float64)
    rotation = np.zeros((*yaw.shape, 3, 3))
    rotation[..., 0, 0] = rotation[..., 1, 1] = np.cos(yaw)
    rotation[..., 1, 0] = np.sin(yaw)
    rotation[..., 0, 1] = -rotation[..., 1, 0]
    rotation[..., 2, 2] = 1.0
    return rotation


def turn_between(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
    """Angles (...) in radians, within ±π, from rotations (..., 3, 3) to others of that shape.

    About whatever axis; positive when that axis points up from the vehicle, or lies level.
    """
    first, second = np.asarray(first), np.asarray(second)
    change = np.swapaxes(first, -1, -2) @ second
    axis = 0.5 * np.stack(
        (
            change[..., 2, 1] - change[..., 1, 2],
            change[..., 0, 2] - change[..., 2, 0],
            change[..., 1, 0] - change[..., 0, 1],
        ),
        axis=-1,
    )
    cosine = 0.5 * (np.trace(change, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(np.linalg.norm(axis, axis=-1), cosine)  # precise for small angles, too
    return np.where(axis[..., 2] < 0.0, -angle, angle)


def nearest_rotation(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (..., 3, 3) from matrices that are rotations but for `ROUNDING`.

    Three of Newton's steps towards the orthogonal factor: the error is squared each time.
    Source: Higham, Computing the polar decomposition (1986).
    """
    rotation = matrix
    for _ in range(3):
        rotation = rotation @ (1.5 * np.eye(3) - 0.5 * np.swapaxes(rotation, -1, -2) @ rotation)
    return rotation


def is_rotation(matrix: NDArray[np.float64], tolerance: float) -> NDArray[np.bool_]:
    """Mask (...) of the matrices (..., 3, 3) that neither scale, shear nor mirror."""
    product = matrix @ np.swapaxes(matrix, -1, -2)
    orthogonal = np.all(np.abs(product - np.eye(3)) <= tolerance, axis=(-2, -1))
    handed = np.sum(matrix[..., 0] * np.cross(matrix[..., 1], matrix[..., 2]), axis=-1)
    return orthogonal & (handed > 0.0)


def _unit(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    return quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
