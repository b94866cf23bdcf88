"""Cameras of scene files as viewpoints, with their lenses where omnisim has the model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.cameras.camera import without_prefix
from omnisim.core.errors import OmnisimError
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.scene.formats.imported_scene import MAX_COORDINATE
from omnisim.scene.parts import CameraPose

HEIGHT_PX = 480  # of lenses whose files state no resolution


class Cameras:
    """Cameras of a file.

    Attributes:
        notices: one line for each lens that omnisim has no model for.
    """

    def __init__(self) -> None:
        self.notices: list[str] = []
        self._poses: dict[str, CameraPose] = {}

    @property
    def poses(self) -> tuple[CameraPose, ...]:
        """Poses with distinct names, in the order of the file."""
        return tuple(self._poses.values())

    def add(
        self, name: str, world_from_camera: NDArray[np.float64], lens: CentralCamera | str
    ) -> None:
        """Add a camera that looks along −z, with y up; its scale is ignored.

        Args:
            name: name, to which a number is appended if it exists.
            world_from_camera: (4, 4) pose; left out if its axes are degenerate.
            lens: lens, or the reason why there is none.
        """
        free, number = name, 1
        while free in self._poses:
            free, number = f"{name}_{number}", number + 1
        pose = _camera_pose(free, world_from_camera, None if isinstance(lens, str) else lens)
        if pose is None:
            return
        self._poses[free] = pose
        if isinstance(lens, str):
            self.notices.append(
                f"camera {free!r}: its pose is a viewpoint, its lens is not: {lens}"
            )


def read_lens(make: Callable[[], CentralCamera | str]) -> CentralCamera | str:
    """Lens, or the reason why its values are none of a lens."""
    try:
        return make()
    except (OmnisimError, ArithmeticError, ValueError) as reason:
        return " ".join(without_prefix(reason).split())


def pinhole(
    size: tuple[float, float], focal_length: float, offset: tuple[float, float] = (0.0, 0.0)
) -> CentralCamera:
    """Pinhole lens `HEIGHT_PX` high.

    Args:
        size: width and height of the image plane.
        focal_length: in the unit of the size.
        offset: of the image plane's middle from the axis, right and up.
    """
    from omnisim.cameras import PerspectiveCamera  # few files have cameras

    per_unit = HEIGHT_PX / size[1]
    width = max(round(size[0] * per_unit), 1)
    middle = (0.5 * (width - 1), 0.5 * (HEIGHT_PX - 1))
    axis = (middle[0] - offset[0] * per_unit, middle[1] + offset[1] * per_unit)
    return PerspectiveCamera(width, HEIGHT_PX, focal_length * per_unit, axis)


def _camera_pose(
    name: str, world_from_camera: NDArray[np.float64], lens: CentralCamera | None
) -> CameraPose | None:
    """Pose of a camera; None: degenerate axes or coordinates that are too large."""
    if not np.abs(world_from_camera).max() < MAX_COORDINATE:  # false for NaN as well
        return None
    ahead, up = -world_from_camera[:3, 2], world_from_camera[:3, 1]
    left = np.cross(up, ahead)
    lengths = np.linalg.norm(ahead), np.linalg.norm(left)
    if not min(lengths) > 0.0:
        return None
    ahead, left = ahead / lengths[0], left / lengths[1]
    rotation = np.stack((ahead, left, np.cross(ahead, left)), axis=1)
    roll, pitch, yaw = (
        round(angle, 6) + 0.0  # avoids -0.0
        for angle in np.degrees(roll_pitch_yaw_from_rotation(rotation)).tolist()
    )
    x, y, z = world_from_camera[:3, 3].tolist()
    return CameraPose(name, (x, y, z), yaw, pitch, roll, lens)
