"""Elements of a MuJoCo model that carry cameras, and their poses."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.poses import pose_from_rotation

# MuJoCo's cameras look along −z with y up, as in OpenGL.
_OPTICAL_FROM_OPENGL = np.diag([1.0, -1.0, -1.0])
_OPENGL_FROM_BASE = (BASE_FROM_OPTICAL_LOOKING_AHEAD @ _OPTICAL_FROM_OPENGL).T


class Mount(NamedTuple):
    """Body, site or camera of a model.

    Attributes:
        kind: "body", "site" or "camera".
        number: index in the model.
    """

    kind: str
    number: int

    def pose(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Pose (4, 4) world_from_mount, x forward, z up."""
        if self.kind == "body":
            rotation, position = data.xmat[self.number], data.xpos[self.number]
        elif self.kind == "site":
            rotation, position = data.site_xmat[self.number], data.site_xpos[self.number]
        else:
            rotation, position = data.cam_xmat[self.number], data.cam_xpos[self.number]
        rotation = rotation.reshape(3, 3)
        if self.kind == "camera":
            rotation = rotation @ _OPENGL_FROM_BASE
        return pose_from_rotation(rotation, position)


def find_mount(model: mujoco.MjModel, **names: str | None) -> Mount | None:
    """Element of a model by its kind and name; None: no name is given.

    Raises:
        SceneError: an unknown element, or several names.
    """
    given = {kind: name for kind, name in names.items() if name is not None}
    if len(given) > 1:
        raise SceneError(f"expected one mount, got {' and '.join(given)}")
    kinds = mujoco.mjtObj
    types = {
        "body": (kinds.mjOBJ_BODY, model.nbody),
        "site": (kinds.mjOBJ_SITE, model.nsite),
        "camera": (kinds.mjOBJ_CAMERA, model.ncam),
    }
    for kind, name in given.items():
        number, count = types[kind]
        known = [mujoco.mj_id2name(model, number, index) or "" for index in range(count)]
        if name not in known:
            raise SceneError(f"{kind} = {name!r}: {did_you_mean(name, known, 'the model has')}")
        return Mount(kind, known.index(name))
    return None
