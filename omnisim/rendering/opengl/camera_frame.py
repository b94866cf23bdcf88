"""A camera's frame, from poses to pixels: atlas, image, exposure, degradation, readback."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from omnisim.core.arrays import Bytes
from omnisim.core.pending import Pending
from omnisim.rendering.atlas.image_parts import ImagePart
from omnisim.rendering.contract import Readback, ScenePoses, SubFrames
from omnisim.rendering.opengl.capture.image_pass import RemapPass, image_pass
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.drawing.atlas_levels import AtlasLevels
from omnisim.rendering.opengl.drawing.cube_pass import CubePass
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import renderbuffer, texture_2d, texture_array
from omnisim.rendering.opengl.gl.memory import gpu_allocation, slice_length
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, Pixels, Read, Reading

if TYPE_CHECKING:
    from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass

_PIXEL_BYTES = 4


class CameraFrame:
    """Draws the images of one camera in one scene; GPU resources are created once.

    Args:
        cube: virtual cameras.
        samples: pixel map of the supersampled camera.
        supersampling: samples per pixel side, averaged.
        degradation: passes of the effects; None: an ideal camera.
        parts: parts of the image, drawn one after the other; by default a single one.

    Attributes:
        size_px: width and height of the image.
        image_pass: samples the atlas into the image.
        linear: texture of the linear image: RGB and validity.
        encoded_target: framebuffer with the encoded image alone.

    Raises:
        GraphicsError: an image larger than the GPU allows.
    """

    def __init__(
        self,
        cube: CubePass,
        samples: PixelMap,
        supersampling: int = 1,
        degradation: DegradationPass | None = None,
        parts: Sequence[ImagePart] | None = None,
    ):
        context, (width, height) = samples.context, samples.size_px
        self._context, self._cube, self._degradation = context, cube, degradation
        self._readback = PixelReadback(context)
        self.size_px = width, height = (width // supersampling, height // supersampling)
        self._parts = parts or [ImagePart((0, 0, width, height), cube.plan)]
        self._make_pass(samples, supersampling)
        with gpu_allocation(f"an image of {width} × {height} px", "make it smaller"):
            linear_type = "f2" if degradation is None else "f4"
            self.linear = texture_2d(context, self.size_px, 4, dtype=linear_type)
            encoded = renderbuffer(context, self.size_px, 4)
            self.encoded_target = framebuffer(context, [encoded])
            self._both_targets = framebuffer(context, [encoded, self.linear])
        # once: pixels without a ray are never drawn
        clear_target(self._both_targets)
        self._atlases: moderngl.TextureArray | None = None

    def _make_pass(self, samples: PixelMap, supersampling: int) -> None:
        self.image_pass = image_pass(samples, self._parts, supersampling)

    def begin(self, poses: ScenePoses, linear: bool = False) -> Pending[Readback]:
        """Begin to render an ideal image, with linear colors on request."""
        self.draw(poses, linear)
        return self._begin_reading(self.linear if linear else None)

    def draw(self, poses: ScenePoses, linear: bool) -> None:
        """Draw the encoded image and, on request, the linear one: part by part, atlas and image."""
        target = self._both_targets if linear else self.encoded_target
        for part in self._parts:
            self._cube.use_plan(part.plan)
            atlas = self._cube.render(poses.world_from_rig, poses.world_from_objects)
            self.image_pass.draw(atlas, target, part)

    def begin_degraded(self, frames: SubFrames) -> Pending[Readback]:
        """Begin to render a degraded image from sub-frames.

        A luminance that is only reported is read with the image. One that sets the exposure is
        read before: its logarithm has other digits on GPUs, and noise shows them.
        """
        degradation = self._degradation
        assert degradation is not None
        for sub_frame in frames.parts:
            self.draw(sub_frame.poses, linear=True)
            degradation.add(self.linear, sub_frame.row_weights)
        metered = None if frames.meter is None else degradation.draw_meter(frames.meter)
        luminance, reads = None, [] if metered is None else [metered[0]]
        if metered is not None and not frames.is_exposed:
            self._readback.read(*reads)
            luminance, reads, metered = metered[1](), [], None
        exposed = frames.expose(luminance)
        degradation.finish({"u_exposure_factors": exposed.factors, "u_frame": exposed.frame_number})
        degradation.encode(self.encoded_target)
        image = self._begin_reading(degradation.finished if frames.linear else None, *reads)
        return image.then(
            lambda done: done._replace(luminance=metered[1]() if metered else luminance)
        )

    def _begin_reading(self, linear: moderngl.Texture | None, *others: Read) -> Pending[Readback]:
        """Begin to read the encoded image, a linear one, and what else was drawn for it."""
        width, height = self.size_px
        rgba = np.empty((height, width, 4), dtype=np.uint8)
        reads: list[Read] = [(Pixels(self.encoded_target), rgba), *others]
        floats = None
        if linear is not None:
            floats = np.empty((height, width, 3), dtype=np.float32)
            reads.append((linear, floats))
        reading = self._readback.start(*reads)
        return Pending(reading.finish).then(lambda _: Readback(rgba, floats))

    @property
    def draws_together(self) -> bool:
        """True if `begin_batch` can draw its images."""
        return self._degradation is None and isinstance(self.image_pass, RemapPass)

    def begin_batch(self, poses: Sequence[ScenePoses], out: Bytes) -> Pending[None]:
        """Begin to render ideal images slice by slice, one layer of an atlas array per pose.

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
        assert isinstance(self.image_pass, RemapPass)
        slices = -(-len(poses) // self.slice_length)
        length = -(-len(poses) // slices)
        for first in range(0, len(poses), length):
            some = slice(first, min(first + length, len(poses)))
            atlases, target = self._reserve(length)
            self._cube.render_layers(poses[some], atlases, self._levels)
            self.image_pass.draw_batch(atlases, target, some.stop - some.start)
            yield some, target

    def refresh(self) -> None:
        """Update after the buffers, and with them the memory per image of a batch, changed."""
        self._cube.refresh()
        self.__dict__.pop("slice_length", None)

    @cached_property
    def slice_length(self) -> int:
        """Maximum number of images per slice of a batch."""
        width, height = self.size_px
        layer_bytes = self._cube.bytes_of_layer + _PIXEL_BYTES * width * height
        return slice_length(self._context, height, layer_bytes, layer_bytes)

    def _reserve(self, count: int) -> tuple[moderngl.TextureArray, moderngl.Framebuffer]:
        """Atlases and a target for `count` to 2 `count` images."""
        if self._atlases is None or not count <= self._atlases.layers <= 2 * count:
            plan, (width, height) = self._cube.plan, self.size_px
            with gpu_allocation(f"a batch of {count} images", "render fewer at once"):
                size = (plan.width_px, plan.height_px, count)
                self._atlases = texture_array(self._context, size, 4, levels=1 + plan.max_level)
                self._levels = AtlasLevels(self._atlases, plan.max_level)
                images = renderbuffer(self._context, (width, count * height), 4)
                self._target = framebuffer(self._context, [images])
            self._atlases.repeat_x = self._atlases.repeat_y = False
            self._atlases.filter = self._cube.atlas.filter
            # once: pixels without a ray are never drawn
            clear_target(self._target)
        return self._atlases, self._target
