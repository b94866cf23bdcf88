"""Hits of a camera's rays on the triangles that its virtual cameras see, singly and in batches."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.extras import require_extra
from omnisim.core.pending import Pending
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits, ThroughHits
from omnisim.rendering.atlas.image_parts import image_parts
from omnisim.rendering.atlas.tile_plan import sensor_tiles
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraRays, DeformingDraw, HitSource, ScenePoses
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.opengl.gl.buffers import slice_length
from omnisim.rendering.opengl.gl.context import graphics_info
from omnisim.rendering.opengl.gl.framebuffers import draws_layers
from omnisim.rendering.opengl.gl.gpu_textures import check_image_size
from omnisim.rendering.opengl.hits.ray_hit_pass import RayHitPass
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass
from omnisim.rendering.opengl.scene_view import VirtualCameras
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.surface_kind import SurfaceKind, mask_of

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
        camera_rays: rays at what virtual cameras do not see; its camera sets them.
    """

    camera_rays: CameraRays | None = None

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
        assert self.camera_rays is not None
        return self.camera_rays.through(poses, hits, self._is_specular, self._numbers)

    @cached_property
    def _is_specular(self) -> Bools:
        """Mask (draws,) of glass and mirrors."""
        return mask_of([item.kind for item in self._buffers.draw_items], SurfaceKind.SPECULAR)

    @cached_property
    def _numbers(self) -> dict[ObjectPart, int]:
        """Draw IDs of the instances that are drawn."""
        shown = np.flatnonzero(self._buffers.shown())
        return {self.draws[number]: 1 + number for number in shown.tolist()}

    def _find_draws(self) -> None:
        items = self._buffers.draw_items
        self.draws = [(item.object_index, item.name) for item in items]
        for name in ("_is_specular", "_numbers"):
            self.__dict__.pop(name, None)
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
        self._reserved: tuple[HitDetails, int, RayHitPass] | None = None  # details, images

    def refresh(self) -> None:
        """Adapt to the scene after its buffers have changed."""
        super().refresh()
        self._passes.refresh()
        self._reserved = None

    def rays(self) -> Floats32:
        """Unit rays (height, width, 3), optical frame."""
        return self._pixels.read_rays()[0]

    def hits(self, poses: ScenePoses, details: HitDetails = NO_DETAILS) -> Hits:
        """Intersect all rays with the triangles visible around them."""
        return self._passes.render([poses], details).result()[0]

    def begin_occlusion(
        self, other: ScenePoses, other_from_current: Floats, deformed: Hits | None
    ) -> Pending[Bools]:
        """Begin to render the occlusion from another viewpoint."""
        if deformed is not None:
            self._passes.put_points(deformed)
        bits = self._passes.occlusion.begin(other, other_from_current)
        return bits.then(lambda values: values > 0)

    def slice_length(self, details: HitDetails = NO_DETAILS) -> int:
        """Maximum number of images per slice; 1: single images are faster."""
        passes = self._passes
        visibility, context = passes.visibility, passes.pixels.context
        has_clusters = visibility.buffers.clustered_geometry is not None
        deforms = visibility.buffers.deforming.size > 0
        is_single = deforms or not has_clusters or len(passes.parts) > 1
        if is_single or not draws_layers(context):
            return 1
        width, height = passes.pixels.size_px
        texels = visibility.plan.width_px * visibility.plan.height_px
        image_bytes = _TEXEL_BYTES * texels + _PIXEL_BYTES * width * height
        if details.materials:
            image_bytes += _MATERIAL_TEXEL_BYTES * texels
            image_bytes += _MATERIAL_PIXEL_BYTES * width * height
        image_bytes += visibility.culling_bytes + passes.tables.image_bytes
        return slice_length(context, height, image_bytes, visibility.culling_bytes)

    def batch_hits(
        self, poses: Sequence[ScenePoses], details: HitDetails = NO_DETAILS
    ) -> Iterator[Hits]:
        """Intersect the rays of many images, drawn together."""
        length = min(self.slice_length(details), len(poses))
        if length <= 1:
            yield from (self.hits(pose, details) for pose in poses)
            return
        length = -(-len(poses) // -(-len(poses) // length))
        drawn: Pending[list[Hits]] | None = None
        for first in range(0, len(poses), length):
            some = poses[first : first + length]
            following = self._reserve(length, details).render(some, details)
            if drawn is not None:  # the GPU draws the next slice meanwhile
                yield from drawn.result()
            drawn = following
        if drawn is not None:
            yield from drawn.result()

    def _reserve(self, count: int, details: HitDetails) -> RayHitPass:
        """Pass for `count` to 2 `count` images."""
        kept, visibility = self._reserved, self._passes.visibility
        if kept is not None and kept[0] == details and count <= kept[1] <= 2 * count:
            return kept[2]
        self._reserved = None  # frees its memory first
        layers = VisibilityPass(
            visibility.buffers, visibility.plan, visibility.cameras, details, count, visibility
        )
        together = RayHitPass(layers, self._passes.pixels, images=count)
        self._reserved = details, count, together
        return together
