"""Batches of ideal images: where they differ from single ones.

Slice by slice, the atlases of all images are layers of an array, drawn together where they can be
(`CubePass.draw`), sampled by one call into images one above the other, and read at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import moderngl

from omnisim.core.arrays import Bytes
from omnisim.core.pending import Pending
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.camera_frame import AtlasLayers, CubePass
from omnisim.rendering.opengl.capture.image_pass import RemapPass
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, slice_length
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import renderbuffer
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, PixelReading, TargetPixels

_PIXEL_BYTES = 4


class _Reserved(NamedTuple):
    """Memory of a slice: atlases, and a target with the images, one above the other."""

    layers: AtlasLayers
    target: moderngl.Framebuffer


class FrameBatches:
    """Draws batches of one camera's ideal images.

    Args:
        cube: virtual cameras.
        image_pass: samples an atlas into the whole image.
        size_px: width and height of an image.
        readback: ring of images that are read, shared with single ones.
    """

    def __init__(
        self,
        cube: CubePass,
        image_pass: RemapPass,
        size_px: tuple[int, int],
        readback: PixelReadback,
    ):
        self._cube, self._image_pass, self._size_px = cube, image_pass, size_px
        self._context, self._readback = cube.atlas.ctx, readback
        self._reserved: _Reserved | None = None

    def begin(self, poses: Sequence[ScenePoses], out: Bytes) -> Pending[None]:
        """Begin to render images from poses, one entry per image.

        Args:
            out: (n, height, width, components) sRGB, with alpha if there are four components;
                filled by the result.
        """
        readings: list[PixelReading] = []
        slices = -(-len(poses) // self.slice_length)
        length = -(-len(poses) // max(1, slices))
        try:
            for first in range(0, len(poses), length or 1):
                some = slice(first, min(first + length, len(poses)))
                layers, target = self._reserve(length)
                self._cube.draw(poses[some], layers)
                self._image_pass.draw_batch(layers.atlases, target, some.stop - first)
                region = (0, 0, target.width, (some.stop - first) * self._size_px[1])
                readings.append(
                    self._readback.start((TargetPixels(target, region=region), out[some]))
                )
        except BaseException:
            for reading in readings:
                reading.discard()
            raise

        def finish() -> None:
            for reading in readings:
                reading.finish()

        return Pending(finish)

    def refresh(self) -> None:
        """Update after the buffers, and with them the memory of an image, changed."""
        self.__dict__.pop("slice_length", None)
        if self._reserved is not None:
            self._reserved.layers.drawn = None

    @cached_property
    def slice_length(self) -> int:
        """Maximum number of images per slice."""
        width, height = self._size_px
        layer_bytes = self._cube.bytes_of_layer + _PIXEL_BYTES * width * height
        return slice_length(self._context, height, layer_bytes, layer_bytes)

    def _reserve(self, count: int) -> _Reserved:
        """Atlases and a target for `count` to 2 `count` images."""
        held, (width, height) = self._reserved, self._size_px
        if held is None or not count <= held.layers.atlases.layers <= 2 * count:
            self._reserved = held = None  # frees its memory first
            with gpu_allocation(f"a batch of {count} images", "render fewer at once"):
                layers = self._cube.make_layers(count)
                images = renderbuffer(self._context, (width, count * height), 4)
                self._reserved = held = _Reserved(layers, framebuffer(self._context, [images]))
            # once: pixels without a ray are never drawn
            clear_target(held.target)
        return held
