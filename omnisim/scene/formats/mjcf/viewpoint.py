"""Start pose of a model: its first camera in the world, or a look at its middle."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.scene.parts import StartPose

_WORLD = 0
# In front of what mostly faces +x, and above its middle.
_OFFSET_PER_EXTENT = np.array([0.6, 0.0, 0.3])


@np.errstate(over="ignore", invalid="ignore")  # of a model without end
def find_viewpoint(
    model: mujoco.MjModel, data: mujoco.MjData, world_from_file: NDArray[np.float64]
) -> StartPose:
    """Start pose of a model in the world."""
    position, ahead = _camera(model, data) or _overview(model)
    rotation = world_from_file[:3, :3]
    x, y, z = (rotation @ position + world_from_file[:3, 3]).tolist()
    forward = rotation @ ahead
    return StartPose((x, y, z), math.degrees(math.atan2(forward[1], forward[0])))


def _camera(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Position (3,) of the first camera that no body carries, and the way that it looks (3,)."""
    for camera in range(model.ncam):
        if int(model.cam_bodyid[camera]) == _WORLD:
            axes = data.cam_xmat[camera].reshape(3, 3)
            is_level = abs(axes[2, 2]) < 0.99  # else the top of its image is ahead
            return data.cam_xpos[camera].copy(), -axes[:, 2] if is_level else axes[:, 1]
    return None


def _overview(model: mujoco.MjModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    offset = float(model.stat.extent) * _OFFSET_PER_EXTENT
    return model.stat.center + offset, -offset
