"""Image with its camera and pose, whatever made it: the renderer, or a recorded run."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.live.session import Draw, Shown
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.cameras import CentralCamera
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.ground_truth import Labels
from omnisim.scene import Scene


@dataclass(frozen=True, eq=False)
class Taken:
    """Image of a camera.

    Attributes:
        model: of the camera.
        base_from_optical: (4, 4) camera on its vehicle.
        world_from_base: (4, 4) pose of the vehicle.
        rgb: (height, width, 3) uint8 sRGB.
        png: bytes of its file; None: a coarse image.
        channels: ground truth by name.
        labels: of the IDs in it.
    """

    model: CentralCamera
    base_from_optical: NDArray[np.float64]
    world_from_base: NDArray[np.float64]
    rgb: NDArray[np.uint8]
    png: bytes | None
    channels: Mapping[str, NDArray[Any]]
    labels: Labels | None

    @property
    def world_from_optical(self) -> NDArray[np.float64]:
        """Pose (4, 4) of the camera's optical frame."""
        found: NDArray[np.float64] = self.world_from_base @ self.base_from_optical
        return found

    @property
    def viewpoint(self) -> Place:
        """Effective viewpoint and the vehicle's attitude, as `omnisim render` takes them."""
        x, y, z = self.world_from_optical[:3, 3].tolist()
        angles = np.degrees(roll_pitch_yaw_from_rotation(self.world_from_base[:3, :3]))
        roll, pitch, yaw = (float(angle) + 0.0 for angle in angles)
        return Place((x, y, z), yaw, pitch, roll)


class Source(Protocol):
    """Maker of images for the live page; all of it belongs to one thread.

    Attributes:
        scene: that is seen.
        channel_names: channels of ground truth that it has.
    """

    scene: Scene
    channel_names: tuple[str, ...]

    def take(self, draw: Draw, channels: Collection[str]) -> Taken:
        """Image of a state with channels of ground truth.

        Raises:
            OmnisimError: a camera that cannot be, or a file of the run that is damaged.
        """
        ...

    def files(self, draw: Draw) -> dict[str, bytes]:
        """Files of the image with all its channels, by name.

        Raises:
            OmnisimError: as `take`.
        """
        ...

    def command(self, shown: Shown, taken: Taken) -> str:
        """Shell commands that make the same image."""
        ...

    def about(self) -> dict[str, Any]:
        """Title, robot, steps and the like, for the page."""
        ...

    def close(self) -> None:
        """Free the GPU memory."""
        ...


def degrees(radians: float) -> float:
    """Angle for people, in thousandths of a degree."""
    return round(math.degrees(radians), 3) + 0.0
