"""Pipeline from a scene to an image: cube pass, image pass, degradation, readback."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import moderngl
import numpy as np

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.atlas.image_parts import ImagePart
from omnisim.rendering.opengl.capture.image_pass import image_pass
from omnisim.rendering.opengl.capture.pixel_map import PixelMap
from omnisim.rendering.opengl.drawing.cube_pass import CubePass
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import fits_texture, renderbuffer, texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, Pixels, Read
from omnisim.rendering.readback import Pending, Readback, ScenePoses, SubFrames

if TYPE_CHECKING:
    from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass


class Pipeline:
    """Pipeline of an ideal camera in one scene; GPU resources are created once.

    Args:
        cube: virtual cameras.
        samples: pixel map of the supersampled camera.
        supersampling: samples per pixel side, averaged.
        linear_type: type of the linear image: half floats, or float32.
        parts: parts of the image, drawn one after the other; by default a single one.

    Attributes:
        context: OpenGL context.
        size_px: width and height of the image.
        image_pass: samples the atlas into the image.
        linear: texture of the linear image: RGB and validity; None until one is requested.
        encoded_target: framebuffer with the encoded image alone.
        readback: ring of the camera's readbacks.

    Raises:
        GraphicsError: an image larger than the GPU allows.
    """

    def __init__(
        self,
        cube: CubePass,
        samples: PixelMap,
        supersampling: int = 1,
        linear_type: Literal["f2", "f4"] = "f2",
        parts: Sequence[ImagePart] | None = None,
    ):
        context, (width, height) = samples.context, samples.size_px
        self.context, self._cube = context, cube
        self.readback = PixelReadback(context)
        self.size_px = width, height = (width // supersampling, height // supersampling)
        self._parts = parts or [ImagePart((0, 0, width, height), cube.plan)]
        self._make_pass(samples, supersampling)
        with gpu_allocation(f"an image of {width} × {height} px", "make it smaller"):
            self.linear = texture_2d(context, self.size_px, 4, dtype=linear_type)
            encoded = renderbuffer(context, self.size_px, 4)
            self.encoded_target = framebuffer(context, [encoded])
            self._both_targets = framebuffer(context, [encoded, self.linear])
        # once: pixels without a ray are never drawn
        clear_target(self._both_targets)

    def _make_pass(self, samples: PixelMap, supersampling: int) -> None:
        self.image_pass = image_pass(samples, self._parts, supersampling)

    def draw(self, poses: ScenePoses, linear: bool) -> None:
        """Draw the encoded image and, on request, the linear one."""
        target = self._both_targets if linear else self.encoded_target
        for part in self._parts:
            self._cube.use_plan(part.plan)
            atlas = self._cube.render(poses.world_from_rig, poses.world_from_objects)
            self.image_pass.draw(atlas, target, part)

    def begin(self, poses: ScenePoses, linear: bool = False) -> Pending[Readback]:
        """Begin to render an image, with linear colors on request."""
        self.draw(poses, linear)
        return self.begin_reading(self.linear if linear else None)

    def begin_reading(self, linear: moderngl.Texture | None, *others: Read) -> Pending[Readback]:
        """Begin to read the encoded image, a linear one, and what else was drawn for it."""
        width, height = self.size_px
        rgba = np.empty((height, width, 4), dtype=np.uint8)
        reads: list[Read] = [(Pixels(self.encoded_target), rgba), *others]
        floats = None
        if linear is not None:
            floats = np.empty((height, width, 3), dtype=np.float32)
            reads.append((linear, floats))
        reading = self.readback.start(*reads)
        return Pending(reading.finish).then(lambda _: Readback(rgba, floats))


class DegradedPipeline:
    """Pipeline of a degraded camera.

    Args:
        ideal: pipeline of the sub-frames, with a float32 linear image.
        degradation: passes of the effects.
    """

    def __init__(self, ideal: Pipeline, degradation: DegradationPass):
        self._ideal, self._degradation = ideal, degradation

    def begin(self, frames: SubFrames) -> Pending[Readback]:
        """Begin to render an image from sub-frames.

        A luminance that is only reported is read with the image. One that sets the exposure is
        read before: its logarithm has other digits on GPUs, and noise shows them.
        """
        ideal, degradation = self._ideal, self._degradation
        for sub_frame in frames.parts:
            ideal.draw(sub_frame.poses, linear=True)
            degradation.add(ideal.linear, sub_frame.row_weights)
        metered = None if frames.meter is None else degradation.draw_meter(frames.meter)
        luminance, reads = None, [] if metered is None else [metered[0]]
        if metered is not None and not frames.is_exposed:
            ideal.readback.read(*reads)
            luminance, reads, metered = metered[1](), [], None
        exposed = frames.expose(luminance)
        degradation.finish({"u_exposure_factors": exposed.factors, "u_frame": exposed.frame_number})
        degradation.encode(ideal.encoded_target)
        image = ideal.begin_reading(degradation.finished if frames.linear else None, *reads)
        return image.then(
            lambda done: done._replace(luminance=metered[1]() if metered else luminance)
        )


def check_image_size(
    context: moderngl.Context,
    width_px: int,
    height_px: int,
    what: str = "an image",
    has_half_floats: bool = False,
) -> None:
    """Refuse an image larger than the GPU allows, before anything is allocated.

    Args:
        context: OpenGL context.
        width_px, height_px: size of the image.
        what: for the message.
        has_half_floats: its largest texture has half floats, else floats.

    Raises:
        GraphicsError: the message names the size and the limit.
    """
    limit, size = int(context.info["GL_MAX_TEXTURE_SIZE"]), (width_px, height_px)
    if max(size) > limit:
        reason = f"this GPU takes at most {limit}"
    elif not fits_texture(size, has_half_floats):
        reason = f"this GPU takes no texture of {width_px * height_px >> 16 + has_half_floats} MiB"
    else:
        return
    raise GraphicsError(f"{what} of {width_px} × {height_px} px: {reason}; make it smaller")
