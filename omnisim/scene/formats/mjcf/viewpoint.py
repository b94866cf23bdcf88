"""Start pose for a MuJoCo model: its first fixed camera, or an overview of its center."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.scene.parts import StartPose

_WORLD = 0
# In front of a model that faces +x, and above its center.
_OFFSET_PER_EXTENT = np.array([0.6, 0.0, 0.3])


@np.errstate(over="ignore", invalid="ignore")  # for models of infinite extent
def find_viewpoint(
    model: mujoco.MjModel, data: mujoco.MjData, world_from_file: NDArray[np.float64]
) -> StartPose:
    """Start pose for a model, in the world."""
    position, ahead = _camera(model, data) or _overview(model)
    rotation = world_from_file[:3, :3]
    x, y, z = (rotation @ position + world_from_file[:3, 3]).tolist()
    forward = rotation @ ahead
    return StartPose((x, y, z), math.degrees(math.atan2(forward[1], forward[0])))


def _camera(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Position (3,) and viewing direction (3,) of the first camera fixed to the world."""
    for camera in range(model.ncam):
        if int(model.cam_bodyid[camera]) == _WORLD:
            axes = data.cam_xmat[camera].reshape(3, 3)
            is_level = abs(axes[2, 2]) < 0.99  # otherwise its image top points ahead
            return data.cam_xpos[camera].copy(), -axes[:, 2] if is_level else axes[:, 1]
    return None


def _overview(model: mujoco.MjModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    offset = float(model.stat.extent) * _OFFSET_PER_EXTENT
    return model.stat.center + offset, -offset
