"""The frames of omnisim and the poses between them.

world    metres, x and y on the ground, z up; a robot at yaw 0 faces +x (REP 103).
base     the vehicle that carries the sensor: x forward, y left, z up (REP 103).
rig      the sensor's own body at its effective viewpoint: x forward, y left, z up when mounted
         level. The faces of the cube are aligned with it.
optical  the camera as its picture shows it: x right, y down, z forward, into the scene or into
         the mirror (OpenCV). Origin at the effective viewpoint.
mirror   x of the optical frame, z towards the pinhole: the frame of Eq. 1.

Every matrix is named target_from_source and maps column vectors of the source to the target.
Pixels count from the centre of the first one: the picture's corner is at (−0.5, −0.5) (OpenCV,
Kalibr).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.errors import OmnisimError

# Beyond, products of coordinates overflow the GPU's floats.
LARGEST_M = 1e15
# The camera looks up at the mirror with the rig's front at the top of the picture. Seen from
# below, the left of the rig is then on the right of the picture: not a flip, a look from below.
RIG_FROM_OPTICAL_LOOKING_UP: NDArray[np.float64] = np.array(
    [
        [0.0, -1.0, 0.0],  # forward is up in the picture
        [1.0, 0.0, 0.0],  # left is right in the picture
        [0.0, 0.0, 1.0],  # up is into the mirror
    ]
)
# A camera that looks the way the vehicle goes: forward is into the picture (REP 103, REP 105).
BASE_FROM_OPTICAL_LOOKING_AHEAD: NDArray[np.float64] = np.array(
    [
        [0.0, 0.0, 1.0],
        [-1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
    ]
)
# A map of the ground: looks straight down, forward is up in the picture, left is left.
BASE_FROM_OPTICAL_LOOKING_DOWN: NDArray[np.float64] = np.array(
    [
        [0.0, -1.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 0.0, -1.0],
    ]
)
# Half a turn about x: the camera looks into the mirror, the mirror's axis looks at the camera.
MIRROR_FROM_OPTICAL: NDArray[np.float64] = np.diag([1.0, -1.0, -1.0])
# Factors that reflect a ray in the picture's plane: from a mirror's optical frame to a lens's.
FLIP_Z: NDArray[np.float64] = np.array([1.0, 1.0, -1.0])


def rotation_from_roll_pitch_yaw(
    roll_rad: float, pitch_rad: float, yaw_rad: float
) -> NDArray[np.float64]:
    """Rotation (3, 3) parent_from_child: yaw about z, then pitch about y, then roll about x.

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


def pose(
    position_m: ArrayLike = (0.0, 0.0, 0.0),
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    yaw_deg: float = 0.0,
) -> NDArray[np.float64]:
    """Pose (4, 4) parent_from_child from a position in metres and angles in degrees.

    Raises:
        OmnisimError: a position that is not three finite numbers, or an angle that is not finite.
    """
    position = np.asarray(position_m, dtype=np.float64)
    angles_deg = (roll_deg, pitch_deg, yaw_deg)
    if position.shape != (3,) or not np.all(np.abs(position) < LARGEST_M):  # false for NaN, too
        raise OmnisimError(f"position {position_m}: want three finite numbers in metres")
    if not all(math.isfinite(angle) for angle in angles_deg):
        raise OmnisimError(f"roll, pitch, yaw {angles_deg}: want finite numbers in degrees")
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_from_roll_pitch_yaw(*np.radians(angles_deg))
    matrix[:3, 3] = position
    return matrix


def check_pose(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return a pose as float64 (4, 4).

    Raises:
        OmnisimError: not (4, 4), not finite, or not a rotation and a translation.
    """
    checked = np.asarray(matrix, dtype=np.float64)
    if checked.shape != (4, 4) or not np.all(np.abs(checked) < LARGEST_M):
        raise OmnisimError("pose: want a finite 4 × 4 matrix")
    rotation = checked[:3, :3]
    # 1e-6: looser than float32 rounding of a rotation, far below a tenth of a pixel
    if (
        not np.allclose(rotation @ rotation.T, np.eye(3), rtol=0.0, atol=1e-6)
        or np.linalg.det(rotation) < 0.0
        or not np.array_equal(checked[3], (0.0, 0.0, 0.0, 1.0))
    ):
        raise OmnisimError("pose: want a rotation and a translation, no scale, no mirroring")
    return checked
