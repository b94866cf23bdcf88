"""Ray hits for batches of images of one camera, slice by slice."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import moderngl
import numpy as np

from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits
from omnisim.rendering.opengl.batch_pipeline import MAX_SLICE_BYTES
from omnisim.rendering.opengl.capture.pixel_map import valid_pixels_array
from omnisim.rendering.opengl.drawing.cube_layers import EXTENSIONS
from omnisim.rendering.opengl.gl.framebuffers import use_target
from omnisim.rendering.opengl.gl.gpu_textures import renderbuffer
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.shader_files import uniform
from omnisim.rendering.opengl.ground_truth.ray_hit_pass import (
    RayHitPass,
    bind_details,
    hits_target,
)
from omnisim.rendering.opengl.ground_truth.visibility_layers import VisibilityLayers
from omnisim.rendering.readback import Pending, ScenePoses

# Bytes per texel (triangle IDs, base colors, depth) and per pixel (points, primitives, normals,
# base colors), and what materials add.
_TEXEL_BYTES, _PIXEL_BYTES = 12, 48
_MATERIAL_TEXEL_BYTES, _MATERIAL_PIXEL_BYTES = 12, 16


class _Variant:
    """Program for a set of channels, and its target."""

    def __init__(self, passes: RayHitPass, details: HitDetails, count: int):
        context, (width, height) = passes.pixels.context, passes.pixels.size_px
        self.details = details
        self.layers = VisibilityLayers(passes.visibility, count, details)
        self.program = passes.build_program(details, "BATCH")
        self.array = valid_pixels_array(context, self.program, passes.pixels.valid)
        uniform(self.program, "u_images").value = self.count = count
        with gpu_allocation(f"ground truth of {count} images", "render fewer at once"):
            size = (width, count * height)
            held = [
                renderbuffer(context, size, 4, dtype="f4"),
                renderbuffer(context, size, 2, dtype="u4"),
            ]  # fmt: skip
            self.target = hits_target(context, size, held, details)


class HitBatches:
    """Intersects the rays of many images, each with the triangles that its camera sees.

    Args:
        passes: passes of a single image.
    """

    def __init__(self, passes: RayHitPass):
        self._passes = passes
        self._variant: _Variant | None = None

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self._variant = None

    def slice_length(self, details: HitDetails = NO_DETAILS) -> int:
        """Maximum number of images per slice; 1: single images are faster."""
        passes = self._passes
        visibility, context = passes.visibility, passes.pixels.context
        has_clusters = visibility.buffers.clustered_geometry is not None
        deforms = visibility.buffers.deforming.size > 0
        is_single = deforms or not has_clusters or len(passes.parts) > 1
        if is_single or not context.extensions >= EXTENSIONS:
            return 1
        limits, (width, height) = context.info, passes.pixels.size_px
        texels = visibility.plan.width_px * visibility.plan.height_px
        image_bytes = _TEXEL_BYTES * texels + _PIXEL_BYTES * width * height
        if details.materials:
            image_bytes += _MATERIAL_TEXEL_BYTES * texels
            image_bytes += _MATERIAL_PIXEL_BYTES * width * height
        image_bytes += visibility.culling_bytes + passes.tables.image_bytes
        max_bytes = int(limits["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        return max(
            1,
            min(
                MAX_SLICE_BYTES // image_bytes,
                max_bytes // max(1, visibility.culling_bytes),
                int(limits["GL_MAX_TEXTURE_SIZE"]) // height,
                int(limits["GL_MAX_ARRAY_TEXTURE_LAYERS"]),
            ),
        )

    def hits(self, poses: Sequence[ScenePoses], details: HitDetails = NO_DETAILS) -> Iterator[Hits]:
        """Yield the hits of each image in order; see `RayHitPass.render`."""
        length = min(self.slice_length(details), len(poses))
        if length <= 1:
            yield from (self._passes.render(*one, details) for one in poses)
            return
        length = -(-len(poses) // -(-len(poses) // length))
        drawn: Pending[list[Hits]] | None = None
        for first in range(0, len(poses), length):
            following = self._draw(poses[first : first + length], length, details)
            if drawn is not None:  # the GPU draws the next slice meanwhile
                yield from drawn.result()
            drawn = following
        if drawn is not None:
            yield from drawn.result()

    def _draw(
        self, poses: Sequence[ScenePoses], count: int, details: HitDetails
    ) -> Pending[list[Hits]]:
        passes, variant = self._passes, self._reserve(count, details)
        layers, buffers = variant.layers, passes.visibility.buffers
        layers.draw(poses)
        use_target(variant.target)
        optical = passes.pixels.camera.rig_from_optical
        passes.tables.update_batch(
            layers.ids,
            [buffers.instance_transforms(rig[:3, 3], objects) for rig, objects in poses],
            np.array([rig[:3, :3] @ optical for rig, _ in poses]),
        )
        passes.bind()
        bind_details(layers.details, details)
        passes.bind_geometry()
        uniform(variant.program, "u_draw_item_count").value = 1 + len(buffers.draw_items)
        variant.array.render(moderngl.TRIANGLES, instances=len(poses))
        return passes.begin_reading(variant.target, len(poses), details)

    def _reserve(self, count: int, details: HitDetails) -> _Variant:
        """Program and layers for `count` to 2 `count` images."""
        variant = self._variant
        if variant is None or not (
            variant.details == details and count <= variant.count <= 2 * count
        ):
            self._variant = None  # frees its memory first
            self._variant = variant = _Variant(self._passes, details, count)
        return variant
