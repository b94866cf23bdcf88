"""Interface of all racers: a pose in, a frame out."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.rendering.camera.omnicamera import PAPER_SIZE_PX, OmniCamera
from omnisim.rendering.shared_scene import Closing

# The frame that all race for: the paper's camera, 360 × 360 px, rim at 105°.
CAMERA = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), PAPER_SIZE_PX, PAPER_SIZE_PX)
SENSOR = OmniCamera(CAMERA, polygons=None)


class Peer(Closing):
    """One way to compute the frame; everything that does not change with the pose is made once.

    Attributes:
        name: in the report.
        texels: pixels of the virtual cameras, or rays, per frame; None: not known.
        triangles: submitted for the last frame; None: not known, or not a matter of triangles.
    """

    name: str
    texels: int | None = None
    triangles: int | None = None

    @abstractmethod
    def render(self, world_from_rig: NDArray[np.float64]) -> object:
        """Compute a frame from a pose (4, 4)."""

    def close(self) -> None:
        """Release resources; most hold none that the context does not end with."""


class ImagePeer(Peer):
    """A peer whose frame is an image."""

    @abstractmethod
    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Image (height, width, 3 or 4), sRGB, first row at the top, from a pose (4, 4)."""


def mirror_rays(camera: HyperbolicCamera) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Unit rays (height, width, 3) of the pixels' middles, rig frame, and which are valid."""
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    return rays.directions @ camera.rig_from_optical.T, rays.valid
