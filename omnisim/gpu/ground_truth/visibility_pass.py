"""Visibility pass: triangle IDs in place of colours."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.gl_functions import clear_integers
from omnisim.gpu.ground_truth.triangle_ids import TriangleIds, static_triangle_entries
from omnisim.gpu.ground_truth.visibility_program import (
    VisibilityProgram,
    VisibilityVariant,
    alpha_cutoff,
)
from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.scene.draw_item import InstanceTransforms
from omnisim.gpu.scene.reversed_depth import float_depth
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.static_drawer import ClusterIndices
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.scene.tile_renderer import TileRenderer, VirtualCameras
from omnisim.gpu.scene.vertex_format import vertex_array
from omnisim.scene.model import Material


class VisibilityPass:
    """Draws the tiles into an atlas of integers; everything on the GPU is made once.

    Sides, frusta and holes are those of the picture (`CubePass`), as is the draw loop. A blended
    surface counts where its alpha reaches `BLENDED_CUTOFF`.

    Args:
        buffers: the scene and its dynamic objects; other passes may draw from them, too.
        plan: the tiles.
        cameras: their depth range and the hidden instances count.
        albedo: also be able to draw plain base colours.

    Attributes:
        buffers, plan, near_m, far_m: as given.
        id_atlas: texture of integers: 1 + ID of the triangle; 0: nothing is seen.
        triangle_ids: table of the IDs.
        albedo_atlas: texture of the square root of linear RGB, or None.

    Raises:
        GraphicsError: the atlas does not fit on the GPU.
        SceneError: a hidden name that no dynamic object has.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        plan: TilePlan,
        cameras: VirtualCameras,
        albedo: bool = False,
    ):
        context = buffers.context
        self.buffers, self.plan = buffers, plan
        self.near_m, self.far_m = cameras.near_m, cameras.far_m
        size = (plan.width_px, plan.height_px)
        with gpu_allocation(
            f"ground truth by an atlas of {size[0]} × {size[1]} px", "make the picture smaller"
        ):
            self.id_atlas = context.texture(size, 1, dtype="u4")
            self.albedo_atlas = context.texture(size, 4) if albedo else None
            depth = float_depth(context, size, 0)
            self._targets = {False: context.framebuffer([self.id_atlas], depth)}
            if self.albedo_atlas is not None:
                atlases = [self.id_atlas, self.albedo_atlas]
                self._targets[True] = context.framebuffer(atlases, depth)
        for texture in (self.id_atlas, self.albedo_atlas):
            if texture is not None:
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        items = buffers.draw_items
        self._has_holes = [alpha_cutoff(item.material) > 0.0 for item in items]
        self._programs = {
            variant: VisibilityProgram(context, variant)
            for holes in set(self._has_holes)
            for variant in (VisibilityVariant(holes, colored) for colored in self._targets)
        }
        indices = buffers.triangles.indices
        self._vertex_arrays = {
            variant: vertex_array(context, one.program, buffers.vertices, indices)
            for variant, one in self._programs.items()
        }
        shown = buffers.shown_one_by_one(cameras.hidden)
        shown &= [not _is_invisible(item.material) for item in items]
        one_by_one = np.flatnonzero(shown)
        self.triangle_ids = TriangleIds(context, items, one_by_one)
        self._tiles = TileRenderer(buffers, plan, cameras, one_by_one)
        self._clusters: dict[bool, TriangleIdClusters] = {}
        geometry = buffers.static_geometry
        if geometry is not None:
            entries = static_triangle_entries(geometry, items)
            cluster_indices = ClusterIndices(
                geometry, [one.program for one in self._programs.values()]
            )
            self._clusters = {
                colored: TriangleIdClusters(
                    geometry,
                    entries,
                    self.triangle_ids,
                    cluster_indices,
                    [
                        self._programs[VisibilityVariant(alpha_cutoff(one.material) > 0.0, colored)]
                        for one in geometry.batches
                    ],
                )
                for colored in self._targets
            }

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        transforms: InstanceTransforms,
        albedo: bool = False,
    ) -> None:
        """Draw all tiles from a pose (4, 4), by the transforms of the draw items from there."""
        target = self._targets[albedo]
        self._tiles.begin(target, (0.0, 0.0, 0.0, 0.0))
        clear_integers(0)

        def draw_item(index: int, clip_from_mesh: NDArray[np.float32]) -> None:
            item, variant = (
                self.buffers.draw_items[index],
                VisibilityVariant(self._has_holes[index], albedo),
            )
            program = self._programs[variant]
            program.set_matrix(clip_from_mesh)
            program.set_first_id(self.triangle_ids.first_of_item[index])
            program.bind_material(item.material, item.texture)
            self._vertex_arrays[variant].render(
                moderngl.TRIANGLES, vertices=item.count, first=item.first
            )

        views = self._tiles.views(world_from_rig)
        self.triangle_ids.begin()
        clusters = self._clusters.get(albedo)
        self._tiles.draw(target, views, world_from_rig[:3, 3], transforms, draw_item, clusters)
        self._tiles.end(target)
        for program in self._programs.values():
            program.end()


class TriangleIdClusters:
    """Draws triangle IDs of the static geometry's clusters.

    Args:
        geometry: the clusters.
        entries: of its triangles, see `static_triangle_entries`.
        ids: of the frame.
        indices: to draw from.
        programs: of the batches.
    """

    def __init__(
        self,
        geometry: StaticGeometry,
        entries: NDArray[np.void],
        ids: TriangleIds,
        indices: ClusterIndices,
        programs: Sequence[VisibilityProgram],
    ):
        self._geometry, self._entries, self._ids = geometry, entries, ids
        self._indices, self._programs = indices, programs
        self._first_id = 0
        self._clip_from_anchor = np.eye(4, dtype=np.float32)
        self._placed: set[VisibilityProgram] = set()

    def load(self, clusters: NDArray[np.intp]) -> None:
        """See `ClusterDrawer`; the triangles get the next IDs."""
        triangles = self._geometry.triangles_of(clusters)
        self._first_id = self._ids.append(np.take(self._entries, triangles, mode="clip"))
        self._indices.load(clusters)

    def begin_tile(
        self,
        clip_from_anchor: NDArray[np.float32],
        viewpoint_from_anchor: NDArray[np.float32],
    ) -> None:
        """See `ClusterDrawer`."""
        self._clip_from_anchor = clip_from_anchor
        self._placed.clear()

    def draw(self, batch: int, first: int, count: int) -> None:
        """See `ClusterDrawer`."""
        program, material_batch = self._programs[batch], self._geometry.batches[batch]
        if program not in self._placed:
            self._placed.add(program)
            program.set_matrix(self._clip_from_anchor)
        program.bind_material(material_batch.material, material_batch.texture)
        program.set_first_id(self._first_id + first // 3)
        self._indices.render(program.program, first, count)


def _is_invisible(material: Material) -> bool:
    """Test for a material so clear that no texel can show it: textures only take away."""
    return material.base_color[3] < alpha_cutoff(material)
