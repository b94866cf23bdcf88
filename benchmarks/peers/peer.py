"""Interface of all renderers in the race: takes a pose, returns a frame."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.rendering.camera.omnicamera import PAPER_SIZE_PX, OmniCamera
from omnisim.rendering.shared_scene import Closeable

# Camera of all renderers: the paper's, 360 × 360 px, rim at 105°.
CAMERA = HyperbolicCamera.framed_on_rim(HyperbolicMirror(), PAPER_SIZE_PX, PAPER_SIZE_PX)
SENSOR = OmniCamera(CAMERA, polygons=None)


class Peer(Closeable):
    """Renderer in the race; data that does not depend on the pose is computed once.

    Attributes:
        name: name in the report.
        texels: texels of the virtual cameras, or rays, per frame; None: unknown.
        triangles: triangles submitted for the last frame; None: unknown or not applicable.
    """

    name: str
    texels: int | None = None
    triangles: int | None = None

    @abstractmethod
    def render(self, world_from_rig: NDArray[np.float64]) -> object:
        """Compute a frame from a pose (4, 4)."""

    def close(self) -> None:
        """Release resources that outlive the context; most renderers have none."""


class ImagePeer(Peer):
    """Renderer whose frame is an image."""

    @abstractmethod
    def render(self, world_from_rig: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Image (height, width, 3 or 4), sRGB, top row first, from a pose (4, 4)."""


def mirror_rays(camera: HyperbolicCamera) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Unit rays (height, width, 3) through the pixels' centers, rig frame, and their validity."""
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    return rays.directions @ camera.rig_from_optical.T, rays.valid
