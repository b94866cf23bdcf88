"""Rays of pixels that are given, not computed by a camera model's GLSL file."""

from __future__ import annotations

from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.rendering.opengl.capture.pixel_map import PixelMap


class TracedPixels(PixelMap):
    """Map from the pixels of an optical system to its rays.

    Args:
        context: of OpenGL.
        camera: the optical system.
        directions: (height, width, 3) unit, optical frame.
        valid: (height, width).
    """

    def __init__(
        self,
        context: moderngl.Context,
        camera: CentralCamera,
        directions: NDArray[np.float32],
        valid: NDArray[np.bool_],
    ):
        super().__init__(context, camera)
        self._texels = np.concatenate((directions, valid[..., None].astype(np.float32)), axis=-1)

    @cached_property
    def rays(self) -> moderngl.Texture:
        """Texture of unit rays, optical frame, and 1 where the pixel has one."""
        rays = self.context.texture(self.size_px, 4, self._texels.tobytes(), dtype="f4")
        rays.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return rays
