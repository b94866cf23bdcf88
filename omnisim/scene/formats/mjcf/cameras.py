"""Cameras: lens, mount, and the viewpoint of a frame's first image."""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera, UnifiedCamera
from omnisim.core.coordinate_frames import BASE_FROM_OPTICAL_LOOKING_AHEAD
from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.poses import pose_from_rotation
from omnisim.scene.parts import StartPose

_DEFAULT_SIZE_PX = (640, 480)  # for cameras without a resolution


def lens_of(
    model: mujoco.MjModel, camera: str | int, size_px: tuple[int, int] | None = None
) -> PerspectiveCamera | UnifiedCamera:
    """Pinhole lens of a camera in the model; omnisim's images then match MuJoCo's.

    Args:
        model: MuJoCo model.
        camera: camera name or index.
        size_px: (width, height); None: the camera's resolution, or 640 × 480 by default.

    Raises:
        SceneError: an unknown or an orthographic camera.
        OpticsError: a size below 1.
    """
    index = camera
    if isinstance(index, str):
        mount = find_mount(model, camera=index)
        assert mount is not None
        index = mount.number
    if int(model.cam_projection[index]) != mujoco.mjtProjection.mjPROJ_PERSPECTIVE:
        raise SceneError(f"camera = {camera!r}: expected a perspective camera, got an orthographic")
    stated = (int(model.cam_resolution[index][0]), int(model.cam_resolution[index][1]))
    width, height = size_px or (stated if min(stated) > 1 else _DEFAULT_SIZE_PX)
    middle = (0.5 * (width - 1), 0.5 * (height - 1))
    sensor_x, sensor_y = (float(size) for size in model.cam_sensorsize[index])
    if min(sensor_x, sensor_y) <= 0.0:
        half_rad = math.radians(0.5 * float(model.cam_fovy[index]))
        return PerspectiveCamera(width, height, 0.5 * height / math.tan(half_rad), middle)
    focal_x, focal_y, off_x, off_y = (float(value) for value in model.cam_intrinsic[index])
    per_x, per_y = width / sensor_x, height / sensor_y  # pixels per unit of sensor size
    axis = (middle[0] - off_x * per_x, middle[1] - off_y * per_y)  # sign as in MuJoCo's images
    if math.isclose(focal_x * per_x, focal_y * per_y, rel_tol=1e-6):
        return PerspectiveCamera(width, height, focal_x * per_x, axis)
    return UnifiedCamera(width, height, (focal_x * per_x, focal_y * per_y), axis, xi=0.0)


# Elements of a MuJoCo model that carry cameras, and their poses.


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


# Start pose for a MuJoCo model: its first fixed camera, or an overview of its center.


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
