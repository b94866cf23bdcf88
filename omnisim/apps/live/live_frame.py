"""Captured image with its camera and pose, from the renderer or a recorded run."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from omnisim.apps.live.session import Draw, PageState
from omnisim.apps.live.viewpoint_motion import Place
from omnisim.cameras import CentralCamera
from omnisim.core.poses import roll_pitch_yaw_from_rotation
from omnisim.ground_truth import Labels
from omnisim.scene import Scene


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """Image with its camera and pose, live or replayed.

    Attributes:
        model: model of the camera.
        base_from_optical: (4, 4) pose of the camera's optical frame on its vehicle.
        world_from_base: (4, 4) pose of the vehicle's base.
        rgb: (height, width, 3) uint8 sRGB.
        png: contents of the image file; None for a coarse image.
        channels: ground truth by name.
        labels: labels of the IDs in the channels; None: no labels.
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
        """Pose (4, 4) of the camera's optical frame in the world."""
        return self.world_from_base @ self.base_from_optical

    @property
    def viewpoint(self) -> Place:
        """Position of the effective viewpoint and attitude of the vehicle, as for `render`."""
        x, y, z = self.world_from_optical[:3, 3].tolist()
        angles = np.degrees(roll_pitch_yaw_from_rotation(self.world_from_base[:3, :3]))
        roll, pitch, yaw = (float(angle) + 0.0 for angle in angles)
        return Place((x, y, z), yaw, pitch, roll)


class Source(Protocol):
    """Source of images for the live page; usable by a single thread only.

    Attributes:
        scene: scene of the images.
        channel_names: available ground-truth channels.
    """

    scene: Scene
    channel_names: tuple[str, ...]

    def take(self, draw: Draw, channels: Collection[str]) -> LiveFrame:
        """Image of a state with the requested channels of ground truth.

        Raises:
            OmnisimError: an invalid camera, or a damaged file of the run.
        """
        ...

    def files(self, draw: Draw) -> dict[str, bytes]:
        """Contents of the files of an image with all its channels, by file name.

        Raises:
            OmnisimError: see `take`.
        """
        ...

    def command(self, state: PageState, taken: LiveFrame) -> str:
        """Shell commands that produce the same image."""
        ...

    def about(self) -> dict[str, Any]:
        """Properties of the source for the page, such as title, robot and steps."""
        ...

    def close(self) -> None:
        """Free the GPU memory."""
        ...


def degrees(radians: float) -> float:
    """Convert an angle to degrees, rounded to thousandths."""
    return round(math.degrees(radians), 3) + 0.0
