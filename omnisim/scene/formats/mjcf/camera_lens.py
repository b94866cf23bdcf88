"""Lenses of the cameras in a MuJoCo model."""

from __future__ import annotations

import math

import mujoco

from omnisim.cameras import PerspectiveCamera, UnifiedCamera
from omnisim.core.errors import SceneError
from omnisim.scene.formats.mjcf.camera_mount import find_mount

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
