"""Pixel rays from a table instead of a camera model's GLSL file."""

from __future__ import annotations

from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d


class TracedPixels(PixelMap):
    """Pixel map of an optical system.

    Args:
        context: OpenGL context.
        camera: optical system.
        directions: (height, width, 3) unit, optical frame.
        valid: (height, width) mask of pixels with a ray.
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
        """Texture of unit rays in the optical frame; w: 1 where the pixel has a ray."""
        return texture_2d(self.context, self.size_px, 4, self._texels)
