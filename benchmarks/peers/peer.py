"""What every racer is to the race: a pose in, a picture out."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.sensors import OmniCamera
from omnisim.sensors.stage import Closing

# The frame that all race for: the paper's camera, 360 × 360 px, rim at 105°.
SENSOR = OmniCamera(polygons=None)


class Peer(Closing):
    """One way to the frame; everything that does not change with the pose is made once.

    Attributes:
        name: in the report.
        texels: pixels of the virtual cameras, or rays, that a frame computes colours for; None:
            not known.
        triangles: submitted for the last frame; None: not known, or not a matter of triangles.
    """

    name: str
    texels: int | None = None
    triangles: int | None = None

    @abstractmethod
    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """The picture (height, width, 3 or 4), sRGB, first row at the top, from a pose (4, 4)."""

    def close(self) -> None:
        """Give back what it holds: most have nothing that the context does not end with."""


def mirror_rays(camera: HyperbolicCamera) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Unit rays (height, width, 3) of the pixels' middles, rig frame, and which are valid."""
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    return rays.directions @ camera.rig_from_optical.T, rays.valid
