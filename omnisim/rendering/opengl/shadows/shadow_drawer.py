"""Draws the depth of shadow casters into maps, static and dynamic ones separately."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices
from omnisim.core.world import Poses
from omnisim.rendering.atlas.tile_plan import frustum_planes
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.culling.cluster_culling import ClusterCuller, Views
from omnisim.rendering.opengl.gl.shader_files import build_program, columns_first
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.surfaces.cluster_drawer import (
    BucketProgram,
    ClusterDrawer,
    DrawBatches,
)
from omnisim.rendering.opengl.surfaces.scene_drawer import ItemProgram, SceneDrawer
from omnisim.rendering.opengl.world.clustered_geometry import Bucket, ClusteredGeometry
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_records import INSTANCE
from omnisim.scene.model import LAMP_NEAR_M
from omnisim.scene.surface_kind import SurfaceKind

# For maps that are not drawn: every point is nearer than the near plane.
_NOWHERE = np.zeros((4, 4))
_NOWHERE[3, 3] = -1.0


class MapPart(NamedTuple):
    """Part of a map."""

    clip: Floats  # (4, 4) clip_from_anchor matrix of the whole map
    part_clip: Floats  # (4, 4) clip_from_anchor matrix of the part alone
    map_px: tuple[int, int, int, int]  # left, top, width and height of the map in the target
    part_px: tuple[int, int, int, int]  # those of the part


class CasterDrawer:
    """Draws shadow casters into maps, by clusters if the scene has them.

    Both sides of a surface cast shadows. Masked surfaces have holes; a blended surface casts a
    shadow where its alpha reaches `BLENDED_CUTOFF`, where rays hit it, too.

    Args:
        rectangles_px: (maps, 4) left, top, width and height of each map in the texture.
        size_px: size of the texture.
        has_parts: `draw_part` will be used.

    Attributes:
        anchor_m: (3,) world position that the maps' matrices are relative to.
        has_dynamic: a moving object casts shadows.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        anchor_m: Floats,
        rectangles_px: Floats,
        size_px: tuple[int, int],
        has_parts: bool,
    ):
        self._context, self._buffers, self.anchor_m = buffers.context, buffers, anchor_m
        self._rectangles_px, self._state = rectangles_px, GlState()
        self._programs: dict[tuple[str, ...], ItemProgram] = {}
        self._rig = np.eye(4)
        self._rig[:3, 3] = anchor_m
        self._clusters: tuple[ClusterCuller, ClusterDrawer] | None = None
        self._part_clusters: tuple[ClusterCuller, ClusterDrawer] | None = None
        geometry = buffers.clustered_geometry
        if geometry is not None:
            self._clusters = self._cluster_drawer(geometry, rectangles_px, size_px)
            if has_parts:
                self._part_clusters = self._cluster_drawer(geometry, np.zeros((1, 4)), size_px)
        self.refresh()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        buffers, items = self._buffers, self._buffers.draw_items
        alphas = np.array([item.material.base_color[3] for item in items])
        single = buffers.shown_one_by_one()
        single &= alphas >= np.array([item.material.hit_cutoff for item in items])
        casts = np.array([item.casts_shadow for item in items], dtype=np.bool_)
        single &= casts
        moves = np.array([item.moves for item in items], dtype=np.bool_)
        dynamic, static = casts & moves, casts & ~moves
        self.has_dynamic = bool(np.any(dynamic & buffers.shown()))
        self._items = [np.flatnonzero(single & some) for some in (static, dynamic)]
        self._drawer = SceneDrawer(
            buffers, np.flatnonzero(single), self._program_of, id_of_item={}, both_sides=True
        )
        if buffers.clustered_geometry is not None:
            # hidden static items have no triangles
            shown_clusters = buffers.clustered_geometry.shown_clusters
            self._shown = [shown_clusters(some) for some in (static, dynamic)]
            if self._part_clusters is not None:
                self._part_clusters[0].show(self._shown[False])
        self._shows_dynamic: bool | None = None  # of the clusters of whole maps

    def draw(
        self,
        target: moderngl.Framebuffer,
        clips: Floats,
        active: Bools,
        world_from_objects: Poses,
        dynamic: bool,
    ) -> None:
        """Draw the static casters, or the dynamic ones on top.

        Args:
            clips: (maps, 4, 4) clip_from_anchor matrices.
            active: (maps,) mask of the maps to draw.
            dynamic: draw the dynamic casters.
        """
        self._state.use(target, has_depth=True)
        with self._state.drawing():
            if self._clusters is not None:
                culler, drawer = self._clusters
                culler.views.write((ScenePoses(self._rig, world_from_objects),))
                seen = np.where(active[:, None, None], clips, _NOWHERE)
                culler.views.clips_from_rig.write(columns_first(seen))
                if self._shows_dynamic is not dynamic:
                    culler.show(self._shown[dynamic])
                    self._shows_dynamic = dynamic
                culler.run(0)
                drawer.draw(0)
            if self._items[dynamic].size:
                rectangles_px = self._rectangles_px[active].astype(int).tolist()
                maps = [
                    MapPart(clip, clip, rectangle, rectangle)
                    for clip, rectangle in zip(
                        clips[active], map(tuple, rectangles_px), strict=True
                    )
                ]
                self._draw_items(target, maps, world_from_objects, self._items[dynamic])

    def draw_part(
        self, target: moderngl.Framebuffer, part: MapPart, world_from_objects: Poses
    ) -> None:
        """Draw the static casters into a part of a map: the same bytes as in the whole map."""
        self._state.use(target, has_depth=True)
        with self._state.drawing():
            if self._part_clusters is not None:
                culler, drawer = self._part_clusters
                culler.views.write((ScenePoses(self._rig, world_from_objects),))
                culler.views.clips_from_rig.write(columns_first(part.part_clip[None]))
                culler.views.rectangles_px.write(np.array(part.part_px, dtype=np.float32))
                culler.run(0)
                # culled for the part, but drawn with the matrix of the whole map
                left, top, *size_px = part.map_px
                scale = np.array(size_px) / target.size
                shift = 2.0 * np.array([left, top]) / target.size + scale - 1.0
                instance = np.zeros(1, dtype=INSTANCE)  # static geometry: its origin is the anchor
                instance["in_clip_from_object"] = columns_first(part.clip)
                instance["in_placement"] = *scale, *shift
                instance["in_viewpoint_from_object"] = np.eye(3, 4)
                self._context.memory_barrier(self._context.BUFFER_UPDATE_BARRIER_BIT)
                culler.instances.write(instance)
                with self._state.within_rectangles(target) as aim:
                    aim(0, 0, *target.size, within=part.part_px)
                    drawer.draw(0)
            if self._items[False].size:
                self._draw_items(target, [part], world_from_objects, self._items[False])

    def _draw_items(
        self,
        target: moderngl.Framebuffer,
        parts: Sequence[MapPart],
        world_from_objects: Poses,
        items: Indices,
    ) -> None:
        """Draw items one by one."""
        transforms = self._buffers.instance_transforms(self.anchor_m, world_from_objects)
        self._drawer.begin(transforms)
        with self._state.unclipped(), self._state.within_rectangles(target) as aim:
            for part in parts:
                sides = frustum_planes(part.part_clip[None])[0, :4]  # casters at any depth count
                inside_m = transforms.centers_m[items] @ sides[:, :3].T + sides[:, 3]
                seen = items[np.all(inside_m.T + transforms.radii_m[items] >= 0.0, axis=0)]
                aim(*part.map_px, within=part.part_px)
                matrices = columns_first(part.clip @ transforms.viewpoint_from_mesh[seen])
                for index, clip_from_mesh in zip(seen.tolist(), matrices, strict=True):
                    self._drawer.draw_item(index, clip_from_mesh)

    def _cluster_drawer(
        self, geometry: ClusteredGeometry, rectangles_px: Floats, size_px: tuple[int, int]
    ) -> tuple[ClusterCuller, ClusterDrawer]:
        context = self._context
        nowhere = np.tile(_NOWHERE, (len(rectangles_px), 1, 1))
        views = Views(context, nowhere, rectangles_px, self.anchor_m, geometry.objects)
        depths_m = (LAMP_NEAR_M, math.inf)
        batches = DrawBatches(geometry, self._program_of_bucket, both_sides=True)
        culler = ClusterCuller(
            context, geometry.buffers, batches.groups, views, None, (), size_px, depths_m,
            both_sides=True,
        )  # fmt: skip
        return culler, ClusterDrawer(context, geometry, culler, batches)

    def _program_of(self, item: DrawItem) -> ItemProgram:
        has_holes = bool(item.kind & SurfaceKind.HOLES)
        return self._program(has_holes, item.material.texture is not None)

    def _program_of_bucket(self, bucket: Bucket) -> BucketProgram:
        has_holes = SurfaceKind.CUTOUT in bucket.kind
        found = self._program(has_holes, bucket.array is not None, "CLUSTERED")
        return BucketProgram(found.program)

    def _program(self, has_holes: bool, is_textured: bool, *defines: str) -> ItemProgram:
        """Program of surfaces that may discard fragments with alpha below a cutoff."""
        if has_holes:
            defines = (*defines, "ALPHA_MASK", *(["TEXTURED"] if is_textured else []))
        if defines not in self._programs:
            files = "scene/caster.vert", "scene/caster.frag"
            self._programs[defines] = ItemProgram(build_program(self._context, *files, defines))
        return self._programs[defines]
