"""Cameras of a stage as start poses."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.parts import StartPose

_LEVEL = 1e-6  # minimum horizontal part of a viewing direction that has a heading


def start_of_camera(world_from_camera: NDArray[np.float64]) -> StartPose | None:
    """Start pose from a camera's position and heading; None: an invalid pose.

    Source: UsdGeomCamera looks along −z, with y up.
    """
    position, ahead = world_from_camera[:3, 3], -world_from_camera[:3, 2]
    if not np.isfinite(world_from_camera).all():
        return None
    if np.hypot(*ahead[:2]) < _LEVEL * np.linalg.norm(ahead):
        ahead = world_from_camera[:3, 1] * -np.sign(ahead[2])  # the top of the image
    x, y, z = position.tolist()
    yaw_deg = math.degrees(math.atan2(ahead[1], ahead[0]))
    return StartPose((x, y, z), round(yaw_deg, 6) + 0.0)  # avoids -0.0
