"""Pipeline of many pictures of one camera: drawn, sampled and read together, slice by slice."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.capture.picture_pass import RemapPass
from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.pipeline import ScenePoses
from omnisim.gpu.readback_ring import ReadbackRing
from omnisim.gpu.scene.cube_pass import CubePass

MAX_SLICE_BYTES = 256 * 2**20  # of atlases and pictures: however many poses there are
_TEXEL_BYTES, _PIXEL_BYTES = 8, 4


class BatchPipeline:
    """Draws pictures of an ideal camera into the layers of one atlas and below each other.

    Args:
        cube: the virtual cameras.
        picture_pass: from an atlas to a picture.
        size_px: width and height of a picture.

    Attributes:
        slice_length: most pictures that are drawn together.
    """

    def __init__(self, cube: CubePass, picture_pass: RemapPass, size_px: tuple[int, int]):
        self._context = context = cube.context
        self._cube, self._picture_pass, self.size_px = cube, picture_pass, size_px
        self._ring = ReadbackRing(context)
        width, height = size_px
        plan, limits = cube.plan, context.info
        texels = plan.width_px * plan.height_px * (2 if plan.max_level else 1)
        self.slice_length = max(
            1,
            min(
                MAX_SLICE_BYTES // (_TEXEL_BYTES * texels + _PIXEL_BYTES * width * height),
                int(limits["GL_MAX_TEXTURE_SIZE"]) // height,
                int(limits["GL_MAX_ARRAY_TEXTURE_LAYERS"]),
            ),
        )
        self._atlases: moderngl.TextureArray | None = None

    def begin(self, poses: Sequence[ScenePoses], out: NDArray[np.uint8]) -> None:
        """Draw the pictures of poses, and start to read them.

        Args:
            poses: of each.
            out: (n, height, width, components) sRGB, with alpha if there are four; filled by `end`
                at the latest.
        """
        self.end()
        try:
            slices = -(-len(poses) // self.slice_length)
            length = -(-len(poses) // max(slices, 1))
            for first in range(0, len(poses), length or 1):
                some = poses[first : first + length]
                atlases, target = self._reserve(length)
                self._cube.render_layers(some, atlases)
                self._picture_pass.draw_batch(atlases, target, len(some))
                self._ring.start(target, out[first : first + len(some)])
        except BaseException:
            self._ring.discard()
            raise

    def end(self) -> None:
        """Wait for the pictures of `begin`."""
        self._ring.finish()

    def _reserve(self, count: int) -> tuple[moderngl.TextureArray, moderngl.Framebuffer]:
        """Atlases and a target for at least so many pictures, at most twice as many."""
        if self._atlases is None or not count <= self._atlases.layers <= 2 * count:
            plan, (width, height) = self._cube.plan, self.size_px
            with gpu_allocation(f"a batch of {count} pictures", "render fewer at once"):
                size = (plan.width_px, plan.height_px, count)
                self._atlases = self._context.texture_array(size, 4, dtype="f2")
                if plan.max_level:
                    self._atlases.build_mipmaps(0, plan.max_level)  # allocates the levels
                pictures = self._context.renderbuffer((width, count * height), 4)
                self._target = self._context.framebuffer([pictures])
            self._atlases.repeat_x = self._atlases.repeat_y = False
            self._atlases.filter = self._cube.atlas.filter
            # once: nothing is ever drawn where nothing is valid
            self._target.clear()
        return self._atlases, self._target
