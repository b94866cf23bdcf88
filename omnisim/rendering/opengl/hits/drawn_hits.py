"""Hits of a camera's rays on the triangles that its virtual cameras see, singly and in batches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.extras import require_extra
from omnisim.core.pending import Pending
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits, ThroughHits
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import DeformingDraw, HitSource, ScenePoses
from omnisim.rendering.opengl.atlas.image_parts import image_parts
from omnisim.rendering.opengl.capture.pixel_map import PixelMap, valid_pixels_array
from omnisim.rendering.opengl.drawing.cube_pass import EXTENSIONS
from omnisim.rendering.opengl.drawing.scene_view import VirtualCameras
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.rendering.opengl.gl.framebuffers import use_target
from omnisim.rendering.opengl.gl.gpu_textures import check_image_size, renderbuffer
from omnisim.rendering.opengl.gl.memory import gpu_allocation, slice_length
from omnisim.rendering.opengl.gl.shader_files import uniform
from omnisim.rendering.opengl.hits.occlusion_pass import OcclusionPass
from omnisim.rendering.opengl.hits.ray_hit_pass import DETAIL_UNITS, RayHitPass, hits_target
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.sensor_tiles import sensor_tiles
from omnisim.scene.planar_mirrors import specular_mask

if TYPE_CHECKING:
    from omnisim.rendering.rays.through import ThroughCaster

# A triangle is hit if a texel near the ray shows it or an adjacent one. Measured in the warehouse:
# 0.1 % of the rays miss one at 1 texel per pixel, 0.05 % at 1.5, mostly at silhouettes.
TEXELS_PER_PIXEL = 1.5
# Bytes per texel (triangle IDs, base colors, depth) and per pixel (points, primitives, normals,
# base colors), and what materials add.
_TEXEL_BYTES, _PIXEL_BYTES = 12, 48
_MATERIAL_TEXEL_BYTES, _MATERIAL_PIXEL_BYTES = 12, 16


class DrawnHits(HitSource):
    """Hits on the triangles that virtual cameras see; GPU resources are created once.

    Args:
        buffers: scene on the GPU; its context must be current, here and in all methods.
        sensor: omnidirectional camera.
        cameras: virtual cameras; only depth range and hidden instances matter here.
        details: details that its hits can include.

    Attributes:
        details: see the arguments.
        through_caster: caster of rays at glass and mirrors; its camera sets it.
    """

    through_caster: ThroughCaster | None = None

    def __init__(
        self,
        buffers: SceneBuffers,
        sensor: OmniCamera,
        cameras: VirtualCameras,
        details: HitDetails,
    ):
        self.camera, self.polygons, self.details = sensor.model, sensor.mesh_polygons, details
        self._buffers, self._cameras = buffers, cameras
        self._find_draws()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self._find_draws()

    def through(self, poses: ScenePoses, hits: Hits) -> ThroughHits:
        """Surfaces behind glass and after mirrors, cast as rays where those are first."""
        draws = np.unique(hits.draw_ids)
        if not self._is_specular[draws[draws > 0] - 1].any():
            return ThroughHits.of_first(hits)
        require_extra("rays", "what pixels show behind glass and in mirrors")
        assert self.through_caster is not None
        return self.through_caster.cast(poses, hits, self._is_specular, self.draws)

    @cached_property
    def _is_specular(self) -> Bools:
        """Mask (draws,) of glass and mirrors."""
        materials = [item.material for item in self._buffers.draw_items]
        return specular_mask(materials, self._buffers.is_matte)

    def _find_draws(self) -> None:
        items = self._buffers.draw_items
        self.draws = [(item.object_index, item.name) for item in items]
        self.__dict__.pop("_is_specular", None)
        self.deforming = {
            index: DeformingDraw(
                items[index].mesh, items[index].object_index, items[index].object_from_mesh
            )
            for index in self._buffers.deforming.tolist()
        }


class CubeHits(DrawnHits):
    """Hits of rays from one viewpoint."""

    def __init__(
        self,
        buffers: SceneBuffers,
        sensor: OmniCamera,
        cameras: VirtualCameras,
        details: HitDetails,
    ):
        super().__init__(buffers, sensor, cameras, details)
        size_px = sensor.model.width_px, sensor.model.height_px
        check_image_size(buffers.context, *size_px, "ground truth")
        self._pixels = PixelMap(buffers.context, sensor.model, sensor.mesh_polygons)
        plan = sensor_tiles(sensor, sensor.model, TEXELS_PER_PIXEL)
        side_px = graphics_info(buffers.context).max_texture_size_px
        parts = image_parts(sensor.model, plan, side_px, mesh_error_px=sensor.mesh_error_px)
        visibility = VisibilityPass(buffers, parts[0].plan, cameras, details)
        self._passes = RayHitPass(visibility, self._pixels, parts)
        self.has_ray = self._pixels.valid

    def refresh(self) -> None:
        """Adapt to the scene after its buffers have changed."""
        super().refresh()
        self._passes.refresh()
        if "_batches" in self.__dict__:
            self._batches.refresh()

    def rays(self) -> Floats32:
        """Unit rays (height, width, 3), optical frame."""
        return self._pixels.read_rays()[0]

    def hits(self, poses: ScenePoses, details: HitDetails = NO_DETAILS) -> Hits:
        """Intersect all rays with the triangles visible around them."""
        return self._passes.render(*poses, details=details)

    def batch_hits(
        self, poses: Sequence[ScenePoses], details: HitDetails = NO_DETAILS
    ) -> Iterator[Hits]:
        """Intersect the rays of many images, drawn together."""
        return self._batches.hits(poses, details)

    @cached_property
    def _batches(self) -> HitBatches:
        return HitBatches(self._passes)

    def begin_occlusion(
        self, other: ScenePoses, other_from_current: Floats, deformed: Hits | None
    ) -> Pending[Bools]:
        """Begin to render the occlusion from another viewpoint."""
        if deformed is not None:
            self._passes.put_points(deformed)
        bits = self._occlusion_pass.begin(
            other.world_from_rig, other.world_from_objects, other_from_current
        )
        return bits.then(lambda values: values > 0)

    @cached_property
    def _occlusion_pass(self) -> OcclusionPass:
        return OcclusionPass(self._passes)


class _BatchTarget:
    """Program for a set of channels, the layers that it reads, and its target."""

    def __init__(self, passes: RayHitPass, details: HitDetails, count: int):
        context, (width, height) = passes.pixels.context, passes.pixels.size_px
        self.details, own = details, passes.visibility
        self.visibility = VisibilityPass(
            own.buffers, own.plan, own.cameras, details, layers=count, like=own
        )
        self.program = passes.build_program(details, "BATCH")
        self.array = valid_pixels_array(context, self.program, passes.pixels.valid)
        uniform(self.program, "u_images").value = self.count = count
        with gpu_allocation(f"ground truth of {count} images", "render fewer at once"):
            size = (width, count * height)
            held = [
                renderbuffer(context, size, 4, dtype="f4"),
                renderbuffer(context, size, 2, dtype="u4"),
            ]
            self.target = hits_target(context, size, held, details)


class HitBatches:
    """Intersects the rays of many images, each with the triangles that its camera sees.

    Args:
        passes: passes of a single image.
    """

    def __init__(self, passes: RayHitPass):
        self._passes = passes
        self._variant: _BatchTarget | None = None

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
        width, height = passes.pixels.size_px
        texels = visibility.plan.width_px * visibility.plan.height_px
        image_bytes = _TEXEL_BYTES * texels + _PIXEL_BYTES * width * height
        if details.materials:
            image_bytes += _MATERIAL_TEXEL_BYTES * texels
            image_bytes += _MATERIAL_PIXEL_BYTES * width * height
        image_bytes += visibility.culling_bytes + passes.tables.image_bytes
        return slice_length(context, height, image_bytes, visibility.culling_bytes)

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
        buffers = passes.visibility.buffers
        variant.visibility.render(poses, details)
        use_target(variant.target)
        optical = passes.pixels.camera.rig_from_optical
        passes.tables.update_batch(
            variant.visibility.id_atlas,
            [buffers.instance_transforms(rig[:3, 3], objects) for rig, objects in poses],
            np.array([rig[:3, :3] @ optical for rig, _ in poses]),
        )
        passes.bind()
        variant.visibility.bind_details(details, DETAIL_UNITS)
        passes.bind_geometry()
        uniform(variant.program, "u_draw_item_count").value = 1 + len(buffers.draw_items)
        variant.array.render(moderngl.TRIANGLES, instances=len(poses))
        return passes.begin_reading(variant.target, len(poses), details)

    def _reserve(self, count: int, details: HitDetails) -> _BatchTarget:
        """Program and layers for `count` to 2 `count` images."""
        variant = self._variant
        if variant is None or not (
            variant.details == details and count <= variant.count <= 2 * count
        ):
            self._variant = None  # frees its memory first
            self._variant = variant = _BatchTarget(self._passes, details, count)
        return variant
