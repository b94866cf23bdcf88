"""Image of a camera: samples the atlas, and the atlas's mip levels that it samples."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats32
from omnisim.rendering.atlas.image_parts import ImagePart
from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.mesh_and_lens import (
    CaptureOutput,
    PixelMap,
    drawn_mask,
    valid_pixels_array,
)
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, gpu_buffer
from omnisim.rendering.opengl.gl.framebuffers import (
    attach_layer,
    attach_texture,
    clear_target,
    framebuffer,
    use_target,
    within,
)
from omnisim.rendering.opengl.gl.functions import StorageBindings
from omnisim.rendering.opengl.gl.gpu_textures import limit_levels, renderbuffer, texture_2d
from omnisim.rendering.opengl.gl.pixel_readback import TargetPixels, read_once
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform
from omnisim.rendering.opengl.gl.state import GlState

# Limit of a table, which the least storage buffers hold; larger images have textures instead.
MAX_TABLE_BYTES = 128 * 2**20
# Limit of these textures: those of 12 megapixels at default quality are kept.
MAX_KEPT_BYTES = 5 << 28
_UV_BYTES = 8
_FIRST_TABLE = 5  # bindings of the UV and level tables, as in `capture/image.frag`


def image_pass(
    samples: PixelMap, parts: Sequence[ImagePart], supersampling: int
) -> RemapPass | UvPass:
    """Image pass of a camera.

    Args:
        samples: pixel map of the supersampled camera.
        parts: parts of the image, each with the tiles of its atlas.

    Raises:
        GraphicsError: out of GPU memory.
    """
    width, height = samples.size_px
    with gpu_allocation(
        f"a capture of {width} × {height} px", "make the image or camera.supersampling smaller"
    ):
        if len(parts) == 1 and fits_table(width * height):
            return RemapPass(samples, parts[0].plan, supersampling)
        return UvPass(samples, parts, supersampling)


def fits_table(sample_count: int) -> bool:
    """Tell whether a table of the samples' UVs is small enough."""
    return _UV_BYTES * sample_count <= MAX_TABLE_BYTES


class RemapPass:
    """Image pass of a whole image through a UV table, which does not depend on the pose.

    A frame takes the same time with all cameras, also with a mirror's mesh or an iterative model.
    Arguments and errors are those of `image_pass`.
    """

    def __init__(self, samples: PixelMap, plan: TilePlan, supersampling: int):
        context = samples.context
        target = framebuffer(
            context, [renderbuffer(context, samples.size_px, parts, dtype="f4") for parts in (2, 1)]
        )
        clear_target(target, *[(-1.0, -1.0, 0.0, 0.0)] * 2)
        samples.vertex_array(CaptureOutput.UV, plan).render()
        corrections = samples.corrections(_values(target, 0)[..., 0] >= 0.0)
        if len(corrections):
            samples.correcting_array(CaptureOutput.UV, corrections, plan).render()
        uvs = _by_pixel(target, 0, supersampling)
        tables = [gpu_buffer(context, uvs)]
        defines = ["REMAP"]
        if plan.max_level:
            tables.append(gpu_buffer(context, _by_pixel(target, 1, supersampling)))
            defines.append("MIP_LEVELS")
        self._tables, self._state = StorageBindings(tables, _FIRST_TABLE), GlState()
        valid: Bools = np.any(uvs[..., 0] >= 0.0, axis=-1)
        self._array = image_array(context, valid, supersampling, *defines)
        self._make_batch_array = partial(
            image_array, context, valid, supersampling, *defines, "BATCH"
        )
        self._image_height_px, self._images = len(valid), 0

    def draw(self, atlas: moderngl.Texture, target: moderngl.Framebuffer, part: ImagePart) -> None:
        """Draw all valid pixels: encoded, and linear if there is a second attachment.

        Args:
            atlas: drawn virtual cameras.
            target: framebuffer of the image.
            part: the whole image.
        """
        self._state.bind_texture(0, atlas.glo)
        self._tables.bind()
        self._state.use(target)
        self._array.render()

    def draw_batch(
        self, atlases: moderngl.TextureArray, target: moderngl.Framebuffer, count: int
    ) -> None:
        """Draw the encoded images of the first `count` layers of atlases, stacked vertically."""
        self._state.bind_texture(0, atlases.glo)
        self._tables.bind()
        self._state.use(target)
        images = target.height // self._image_height_px
        if images != self._images:
            self._images = images
            uniform(self._batch_array.program, "u_images").value = images
        self._batch_array.render(instances=count)

    @cached_property
    def _batch_array(self) -> moderngl.VertexArray:
        return self._make_batch_array()


class UvPass:
    """Image pass of an image's parts through textures of their samples' UVs.

    Textures are kept up to `MAX_KEPT_BYTES`. Other parts share one, drawn anew in each frame.
    Arguments and errors are those of `image_pass`.
    """

    def __init__(self, samples: PixelMap, parts: Sequence[ImagePart], supersampling: int):
        self._samples, self._supersampling = samples, supersampling
        self._components = (2, 1) if parts[0].plan.max_level else (2,)
        largest_px = np.max([part.rectangle_px[2:] for part in parts], axis=0).tolist()
        self._largest_px = supersampling * largest_px[0], supersampling * largest_px[1]
        self._kept: dict[tuple[int, int, int, int], moderngl.Framebuffer] = {}
        self._kept_bytes = 0
        self._corrections: dict[tuple[int, int, int, int], Floats32] = {}
        self._uvs_array = samples.vertex_array(CaptureOutput.UV, parts[0].plan)
        width, height = (length // supersampling for length in samples.size_px)
        everything = np.ones((height, width), dtype=np.bool_)
        defines = ["UVS", "MIP_LEVELS"][: len(self._components)]
        self._array = image_array(samples.context, everything, supersampling, *defines)
        for unit, name in enumerate(("u_uvs", "u_levels")[: len(self._components)], start=1):
            uniform(self._array.program, name).value = unit
        self._first_px = uniform(self._array.program, "u_first_px")

    def draw(self, atlas: moderngl.Texture, target: moderngl.Framebuffer, part: ImagePart) -> None:
        """Draw a part's valid pixels, see `RemapPass.draw`."""
        uvs = self._kept.get(part.rectangle_px) or self._draw_uvs(part)
        atlas.use(0)
        for unit, texture in enumerate(uvs.color_attachments, start=1):
            assert isinstance(texture, moderngl.Texture)
            texture.use(unit)
        self._first_px.value = part.rectangle_px[:2]
        with within(target, part.rectangle_px):
            self._array.render()

    def _draw_uvs(self, part: ImagePart) -> moderngl.Framebuffer:
        """Target with the UVs of a part, and with their mip levels if there are several."""
        left, top, width, height = (self._supersampling * side for side in part.rectangle_px)
        size_bytes = 4 * sum(self._components) * width * height
        if self._kept_bytes + size_bytes <= MAX_KEPT_BYTES:
            self._kept_bytes += size_bytes
            target = self._kept[part.rectangle_px] = self._target((width, height))
        else:
            target = self._shared_target
            target.viewport = (0, 0, width, height)
        self._samples.use_part(self._uvs_array, part.plan, (left, top), (width, height))
        clear_target(target, *[(-1.0, -1.0, 0.0, 0.0)] * len(self._components))
        self._uvs_array.render()
        size_px = (width, height)
        if part.rectangle_px not in self._corrections:
            drawn = drawn_mask(target, size_px, 2, lambda uvs: uvs[..., 0] >= 0.0)
            nothing = np.empty((0, 6), dtype=np.float32)
            found = self._samples.corrections(drawn, (left, top)) if drawn.any() else nothing
            self._corrections[part.rectangle_px] = found
        if len(wrong := self._corrections[part.rectangle_px]):
            self._samples.correcting_array(CaptureOutput.UV, wrong, part.plan, size_px).render()
        return target

    @cached_property
    def _shared_target(self) -> moderngl.Framebuffer:
        return self._target(self._largest_px)

    def _target(self, size_px: tuple[int, int]) -> moderngl.Framebuffer:
        context = self._samples.context
        return framebuffer(
            context, [texture_2d(context, size_px, component) for component in self._components]
        )


def image_array(
    context: moderngl.Context, valid: Bools, supersampling: int, *defines: str
) -> moderngl.VertexArray:
    """Vertex array over the valid pixels (height, width), for UVs or for colors of pixels."""
    program = build_program(
        context,
        "capture/image.vert",
        "capture/image.frag",
        (f"SUPERSAMPLING {supersampling}", *defines),
    )
    return valid_pixels_array(context, program, valid)


def _by_pixel(target: moderngl.Framebuffer, attachment: int, supersampling: int) -> Floats32:
    """Values (height, width, supersampling², parts) of an attachment, grouped by pixel."""
    samples = _values(target, attachment)
    height, width = (length // supersampling for length in samples.shape[:2])
    by_pixel = samples.reshape(height, supersampling, width, supersampling, -1)
    return by_pixel.transpose(0, 2, 1, 3, 4).reshape(height, width, supersampling**2, -1)


def _values(target: moderngl.Framebuffer, attachment: int) -> Floats32:
    """Values (height, width, parts) of an attachment: two parts of the first, one of the other."""
    values = np.empty((*target.size[::-1], (2, 1)[attachment]), dtype=np.float32)
    read_once(target.ctx, (TargetPixels(target, attachment), values))
    return values


# Mip levels of an atlas, rendered in each frame.


_LAYERED = "GL_ARB_shader_viewport_layer_array"  # lets a vertex shader choose the layer


class AtlasLevels:
    """Mip levels of an atlas, or of a texture array of atlases.

    Each level is a pass of ours, so that all drivers compute the same means. Llvmpipe's own passes,
    one per level and layer, do not keep their fences, see `functions.py`.

    Args:
        texture: half-float texture with these levels.
        max_level: last level; 0: no further levels.
    """

    def __init__(self, texture: moderngl.Texture | moderngl.TextureArray, max_level: int):
        self._texture, self._max_level = texture, max_level
        if not max_level:
            return
        context = texture.ctx
        self._is_array = isinstance(texture, moderngl.TextureArray)
        self._is_layered = self._is_array and _LAYERED in context.extensions
        defines = ["ARRAY"] * self._is_array + ["LAYERED"] * self._is_layered
        program = build_program(context, "scene/mip_level.vert", "scene/mip_level.frag", defines)
        uniform(program, "u_finer").value = 0
        self._texels = uniform(program, "u_texels")
        self._layer = None
        if self._is_array and not self._is_layered:
            self._layer = uniform(program, "u_layer")
        self._triangle = context.vertex_array(program, [])
        self._sampler = context.sampler(
            repeat_x=False, repeat_y=False, filter=(moderngl.LINEAR, moderngl.LINEAR)
        )
        self._targets = [framebuffer(context, [texture]) for _ in range(max_level)]
        for level, target in enumerate(self._targets, start=1):
            attach_texture(target.glo, texture.glo, level=level)
            target.viewport = 0, 0, *(max(1, side >> level) for side in texture.size[:2])

    def draw(self, layers: int = 1) -> None:
        """Draw all levels but the first, for `layers` layers."""
        if not self._max_level:
            return
        self._texture.use(0)
        self._sampler.use(0)
        for level, target in enumerate(self._targets, start=1):
            limit_levels(self._texture.glo, level - 1, level - 1)
            _, _, width, height = target.viewport
            self._texels.value = 1.0 / width, 1.0 / height
            if self._layer is None:
                use_target(target)
                self._triangle.render(moderngl.TRIANGLES, vertices=3, instances=layers)
                continue
            for layer in range(layers):
                attach_layer(target.glo, self._texture.glo, layer, level=level)
                use_target(target)
                self._layer.value = float(layer)
                self._triangle.render(moderngl.TRIANGLES, vertices=3)
        limit_levels(self._texture.glo, 0, self._max_level)
        self._sampler.clear(0)
