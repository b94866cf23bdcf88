"""Pipeline that renders batches of images of one camera, slice by slice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.capture.image_pass import RemapPass
from omnisim.rendering.opengl.drawing.atlas_levels import AtlasLevels
from omnisim.rendering.opengl.drawing.cube_pass import CubePass
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import renderbuffer, texture_array
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, Pixels, Reading
from omnisim.rendering.readback import Pending, ScenePoses

MAX_SLICE_BYTES = 256 * 2**20  # of atlases and images, for any number of poses
_PIXEL_BYTES = 4


class BatchPipeline:
    """Renders an ideal camera into one layer of the atlas per pose, images stacked in one target.

    Args:
        readback: ring of the camera's readbacks.
        cube: virtual cameras.
        image_pass: samples an atlas into an image.
        size_px: width and height of an image.

    Attributes:
        slice_length: maximum number of images per slice.
    """

    def __init__(
        self,
        readback: PixelReadback,
        cube: CubePass,
        image_pass: RemapPass,
        size_px: tuple[int, int],
    ):
        self._readback, self.context = readback, readback.context
        self._cube, self._image_pass, self.size_px = cube, image_pass, size_px
        self._atlases: moderngl.TextureArray | None = None
        self.refresh()

    def refresh(self) -> None:
        """Recompute the slice length, after the virtual cameras' memory per image has changed."""
        width, height = self.size_px
        limits = self.context.info
        layer_bytes = self._cube.bytes_of_layer + _PIXEL_BYTES * width * height
        self.slice_length = max(
            1,
            min(
                min(MAX_SLICE_BYTES, limits["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]) // layer_bytes,
                int(limits["GL_MAX_TEXTURE_SIZE"]) // height,
                int(limits["GL_MAX_ARRAY_TEXTURE_LAYERS"]),
            ),
        )

    def begin(self, poses: Sequence[ScenePoses], out: NDArray[np.uint8]) -> Pending[None]:
        """Render the poses and start the readback.

        Args:
            poses: poses of the camera and the objects, one entry per image.
            out: (n, height, width, components) sRGB, with alpha if there are four components;
                filled by the result.
        """
        readings: list[Reading] = []
        try:
            for some, target in self._draw_slices(poses):
                region = (0, 0, target.width, (some.stop - some.start) * self.size_px[1])
                readings.append(self._readback.start((Pixels(target, region=region), out[some])))
        except BaseException:
            for reading in readings:
                reading.discard()
            raise

        def finish() -> None:
            for reading in readings:
                reading.finish()

        return Pending(finish)

    def _draw_slices(
        self, poses: Sequence[ScenePoses]
    ) -> Iterator[tuple[slice, moderngl.Framebuffer]]:
        """Render slice by slice; yield the slice of poses and the target with their images."""
        if not poses:
            return
        slices = -(-len(poses) // self.slice_length)
        length = -(-len(poses) // slices)
        for first in range(0, len(poses), length):
            some = slice(first, min(first + length, len(poses)))
            atlases, target = self._reserve(length)
            self._cube.render_layers(poses[some], atlases, self._levels)
            self._image_pass.draw_batch(atlases, target, some.stop - some.start)
            yield some, target

    def _reserve(self, count: int) -> tuple[moderngl.TextureArray, moderngl.Framebuffer]:
        """Atlases and a target for `count` to 2 `count` images."""
        if self._atlases is None or not count <= self._atlases.layers <= 2 * count:
            plan, (width, height) = self._cube.plan, self.size_px
            with gpu_allocation(f"a batch of {count} images", "render fewer at once"):
                size = (plan.width_px, plan.height_px, count)
                self._atlases = texture_array(self.context, size, 4, levels=1 + plan.max_level)
                self._levels = AtlasLevels(self._atlases, plan.max_level)
                images = renderbuffer(self.context, (width, count * height), 4)
                self._target = framebuffer(self.context, [images])
            self._atlases.repeat_x = self._atlases.repeat_y = False
            self._atlases.filter = self._cube.atlas.filter
            # once: pixels without a ray are never drawn
            clear_target(self._target)
        return self._atlases, self._target
