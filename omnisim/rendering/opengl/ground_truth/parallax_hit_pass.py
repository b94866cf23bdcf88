"""Hits of rays with their own origins, on the triangles that one viewpoint sees."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.ground_truth.hits import Hits
from omnisim.rendering.opengl.capture.parallax_pass import DepthPyramid
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.shader_files import uniform
from omnisim.rendering.opengl.ground_truth.ray_hit_pass import RayHitPass
from omnisim.rendering.opengl.ground_truth.visibility_pass import VisibilityPass

UNKNOWN_HIT = np.uint32(1 << 31)  # bit of a draw item's number, as in parallax_hits.frag
UNKNOWN_OCCLUSION = np.uint8(2)  # as in parallax_occlusion.frag
_ORIGINS = 11  # texture unit


class ParallaxHitPass(RayHitPass):
    """Intersects rays with the triangles that the viewpoint sees at their ends.

    Args:
        visibility: pass that draws the triangle IDs.
        pixels: rays of the pixels.
        pyramid: hierarchical depth of the atlas.

    Attributes:
        origins: texture (height, width) of the rays' origins, see `put_origins`.
    """

    shader = "ground_truth/parallax_hits.frag"
    occlusion_shader = "ground_truth/parallax_occlusion.frag"

    def __init__(self, visibility: VisibilityPass, pixels: PixelMap, pyramid: DepthPyramid):
        super().__init__(visibility, pixels)
        self._pyramid = pyramid
        self.origins = texture_2d(pixels.context, pixels.size_px, 4)

    def put_origins(self, origins_m: NDArray[np.floating]) -> None:
        """Upload origins (height, width, 3) relative to the viewpoint.

        For hits in the optical frame; for occlusion in the viewpoint frame.
        """
        texels = np.zeros((*origins_m.shape[:2], 4), dtype=np.float32)
        texels[..., :3] = origins_m
        self.origins.write(texels)

    def bind(self) -> None:
        """Bind rays, origins, and the depth of the last rendered atlas."""
        super().bind()
        self.origins.use(_ORIGINS)
        self._pyramid.update(self.visibility.depth)

    def prepare(self, program: moderngl.Program, rig_from_optical: NDArray[np.float64]) -> None:
        """Set the constant uniforms of a program, with rig_from_optical (3, 3)."""
        super().prepare(program, rig_from_optical)
        self._pyramid.bind_program(program)
        uniform(program, "u_origins").value = _ORIGINS

    def put(self, hits: Hits) -> None:
        """Replace the points and primitives of the last hits, for occlusion."""
        self.put_points(hits)
        self.primitives.write(np.stack((hits.draw_ids, hits.triangles), axis=-1))
