"""Cube pass: the colours that the virtual cameras at the effective viewpoint see."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.atlas.tile_plan import Tile, TilePlan
from omnisim.gpu.atlas.tile_views import TileView
from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.scene.draw_item import InstanceTransforms
from omnisim.gpu.scene.reversed_depth import float_depth
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.static_drawer import ClusterIndices
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.scene.surface_program import SurfaceProgram, SurfacePrograms, variant_of
from omnisim.gpu.scene.tile_renderer import TileRenderer, VirtualCameras
from omnisim.gpu.uniforms import columns_first

_NORMAL_FROM_ANCHOR = columns_first(np.eye(3))


class CubePass:
    """Draws the tiles into one atlas texture.

    Args:
        buffers: the scene and its dynamic objects; other passes may draw from them, too.
        programs: lit by the scene's lights.
        plan: the tiles.
        cameras: the virtual cameras.

    Attributes:
        plan: as given.
        atlas: linear RGBA, half floats, first row of each face's picture first.
        tiles: the draw loop.

    Raises:
        GraphicsError: the atlas is larger than the GPU allows.
        SceneError: a hidden name that no dynamic object has.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        plan: TilePlan,
        cameras: VirtualCameras,
    ):
        context = buffers.context
        self._context, self._buffers, self.plan = context, buffers, plan
        self._background = cameras.background
        size = (plan.width_px, plan.height_px)
        limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        if max(size) > limit:
            raise GraphicsError(
                f"virtual cameras of {max(tile.face_size_px for tile in plan.tiles)} px need an "
                f"atlas of {size[0]} × {size[1]} px: this GPU takes at most {limit}; "
                "make the picture, virtual_cameras.texels_per_pixel or size_px smaller"
            )
        samples = min(cameras.samples, int(context.max_samples))
        with gpu_allocation(
            f"an atlas of {size[0]} × {size[1]} px with {samples} samples",
            "make the picture, virtual_cameras.size_px or virtual_cameras.samples smaller",
        ):
            self.atlas = context.texture(size, 4, dtype="f2")
            self._resolved = context.framebuffer([self.atlas])
            color: moderngl.Texture | moderngl.Renderbuffer = self.atlas
            if samples > 1:
                color = context.renderbuffer(size, 4, samples=samples, dtype="f2")
            depth = float_depth(context, size, samples if samples > 1 else 0)
            self._target = context.framebuffer([color], depth)
        self.atlas.repeat_x = self.atlas.repeat_y = False
        mipmapped = moderngl.LINEAR_MIPMAP_LINEAR if plan.max_level else moderngl.LINEAR
        self.atlas.filter = (mipmapped, moderngl.LINEAR)
        self._is_multisampled = samples > 1
        variants = [variant_of(item.material, cameras.unlit) for item in buffers.draw_items]
        self._programs = [programs[variant] for variant in variants]
        arrays = {one: buffers.vertex_array(one.program) for one in set(self._programs)}
        self._vertex_arrays = [arrays[program] for program in self._programs]
        geometry = buffers.static_geometry
        self._clusters, self._used_programs = None, set(self._programs)
        if geometry is not None:
            self._clusters = SurfaceClusters(geometry, programs, cameras.unlit)
            self._used_programs |= set(self._clusters.programs)
        shown = buffers.shown_one_by_one(cameras.hidden)
        blended = np.array([item.is_blended for item in buffers.draw_items])
        self._blended = np.flatnonzero(shown & blended)
        # OpenGL reads no depth of several samples, and one may show what another occludes
        self.tiles = TileRenderer(buffers, plan, cameras, np.flatnonzero(shown & ~blended), samples)

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> moderngl.Texture:
        """Draw all tiles from a pose (4, 4), dynamic objects at theirs, and return the atlas."""
        context, target, tiles = self._context, self._target, self.tiles
        viewpoint_m = world_from_rig[:3, 3]
        transforms = self._buffers.instance_transforms(viewpoint_m, world_from_objects)
        for program in self._used_programs:
            program.set_viewpoint(viewpoint_m)
        views = tiles.views(world_from_rig)
        blended = self._back_to_front(views, transforms)
        viewpoint_matrices = columns_first(transforms.viewpoint_from_mesh)
        normal_matrices = columns_first(transforms.normal_from_mesh)

        def draw_item(index: int, clip_from_mesh: NDArray[np.float32]) -> None:
            item, program = self._buffers.draw_items[index], self._programs[index]
            program.set_matrices(clip_from_mesh, viewpoint_matrices[index], normal_matrices[index])
            program.bind_material(item.material, item.texture)
            self._vertex_arrays[index].render(
                moderngl.TRIANGLES, vertices=item.count, first=item.first
            )

        tiles.begin(target, (*self._background, 1.0))
        tiles.draw(target, views, viewpoint_m, transforms, draw_item, self._clusters)
        if blended.size:
            context.blend_func = (  # type: ignore[assignment]  # moderngl's stub has two only
                moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA, moderngl.ZERO, moderngl.ONE
            )  # fmt: skip
            target.depth_mask = False
            context.enable(moderngl.BLEND)
            for view in views:
                tiles.draw_items(target, view, transforms, blended, draw_item)
        tiles.end(target)
        if self._is_multisampled:
            context.copy_framebuffer(self._resolved, target)
        if self.plan.max_level:
            self.atlas.build_mipmaps(0, self.plan.max_level)
        return self.atlas

    def read_face(self, tile: Tile) -> NDArray[np.float32]:
        """Read the 90° of a face as last drawn: linear RGB (size, size, 3), first row at the top.

        The tile must have the whole face.
        """
        size = tile.face_size_px
        pixels = np.empty((size, size, 3), dtype=np.float32)
        region = (*tile.face_corner_px, size, size)
        self._resolved.read_into(pixels, region, components=3, dtype="f4")
        return pixels

    def _back_to_front(
        self, views: Sequence[TileView], transforms: InstanceTransforms
    ) -> NDArray[np.intp]:
        """Sort blended items that are seen, and their triangles, back to front."""
        if not self._blended.size:
            return self._blended
        seen = [self.tiles.cull_items(view, transforms, self._blended) for view in views]
        blended = self._blended[np.any(seen, axis=0)]
        distances = np.linalg.norm(transforms.centres_m[blended], axis=1)
        blended = blended[np.argsort(-distances, kind="stable")]
        for index in blended:
            self._buffers.sort_triangles(
                self._buffers.draw_items[index], transforms.viewpoint_from_mesh[index]
            )
        return blended


class SurfaceClusters:
    """Draws clusters of the static geometry in colour.

    Args:
        geometry: the clusters.
        programs: lit by the scene's lights.
        unlit: show plain base colours.

    Attributes:
        programs: of the batches.
    """

    def __init__(self, geometry: StaticGeometry, programs: SurfacePrograms, unlit: bool):
        self._batches = geometry.batches
        self.programs = [
            programs[variant_of(batch.material, unlit, batch.shading)] for batch in geometry.batches
        ]
        self._indices = ClusterIndices(geometry, [one.program for one in self.programs])
        self._matrices = (columns_first(np.eye(4)), columns_first(np.eye(4)))
        self._placed: set[SurfaceProgram] = set()

    def load(self, clusters: NDArray[np.intp]) -> None:
        """See `ClusterDrawer`."""
        self._indices.load(clusters)

    def begin_tile(
        self,
        clip_from_anchor: NDArray[np.float32],
        viewpoint_from_anchor: NDArray[np.float32],
    ) -> None:
        """See `ClusterDrawer`."""
        self._matrices = clip_from_anchor, viewpoint_from_anchor
        self._placed.clear()

    def draw(self, batch: int, first: int, count: int) -> None:
        """See `ClusterDrawer`."""
        program = self.programs[batch]
        if program not in self._placed:
            self._placed.add(program)
            program.set_matrices(*self._matrices, _NORMAL_FROM_ANCHOR)
        program.bind_material(self._batches[batch].material, self._batches[batch].texture)
        self._indices.render(program.program, first, count)
