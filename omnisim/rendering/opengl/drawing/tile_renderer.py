"""Draw loop over the tiles of an atlas, for colors and for triangle IDs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.world import ObjectPart
from omnisim.rendering.camera.quality import DEFAULT_MIRRORS, DEFAULT_PROBES
from omnisim.rendering.opengl.atlas.tile_plan import PosedViews, TilePlan, TileViews, clips_from_rig
from omnisim.rendering.opengl.culling.cluster_culling import (
    MIN_TRIANGLES_OF_PASSES,
    ClusterCuller,
    Views,
)
from omnisim.rendering.opengl.drawing.cluster_drawer import (
    BucketProgram,
    ClusterDrawer,
    DrawBatches,
)
from omnisim.rendering.opengl.drawing.scene_drawer import P, SceneDrawer
from omnisim.rendering.opengl.geometry.clustered_geometry import Bucket
from omnisim.rendering.opengl.geometry.draw_item import DrawItem, InstanceTransforms
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.gpu_textures import CLEAR_DEPTH
from omnisim.rendering.opengl.gl.shader_files import columns_first
from omnisim.rendering.opengl.gl.state import GlState


class SceneParts(Enum):
    """Parts of a scene by their motion; dynamic objects and deforming meshes move."""

    ALL = "all"
    STATIC = "static"
    MOVING = "moving"

    def mask(self, items: Sequence[DrawItem]) -> NDArray[np.bool_]:
        """Mask (items,) of the parts' items."""
        if self is SceneParts.ALL:
            return np.ones(len(items), dtype=np.bool_)
        return np.array([one.moves is (self is SceneParts.MOVING) for one in items], dtype=np.bool_)


@dataclass(frozen=True)
class VirtualCameras:
    """Settings of the virtual cameras.

    Attributes:
        near_m, far_m: depth range; far_m may be infinite.
        samples: samples per texel.
        unlit: show plain base colors.
        background: linear RGB of rays that hit nothing.
        hidden: parts of dynamic objects to leave out.
        both_sides: draw back faces, too.
        mirrors: maximum number of planar mirrors in view, and of panes, that reflect the scene.
        reflection_probes: maximum number of probes that curved and rough surfaces reflect.
    """

    near_m: float
    far_m: float
    samples: int = 1
    unlit: bool = False
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    hidden: frozenset[ObjectPart] = frozenset()
    both_sides: bool = False
    mirrors: int = DEFAULT_MIRRORS
    reflection_probes: int = DEFAULT_PROBES


class TileRenderer:
    """Draws a scene into the tiles of an atlas with any set of programs.

    Faces, depth, clipping and culling are shared by all passes; each has its own clearing, blending
    and programs.

    Args:
        buffers: scene and dynamic objects.
        plan: tiles of the atlas.
        cameras: virtual cameras; only depth range and sides matter here.
        items: (n,) items to draw one by one, front to back.
        find_program: function from a bucket of clusters to its program.
        depth: depth of the atlas; None if shaders cannot read it.
        samples: samples per texel.
        max_cameras: maximum number of cameras drawn together, one target layer each.
        blended_items: number of blended items that the GPU sorts.

    Attributes:
        views: views of the tiles.
        culler: culler of the clusters; None without clusters.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        plan: TilePlan,
        cameras: VirtualCameras,
        items: NDArray[np.intp],
        find_program: Callable[[Bucket], BucketProgram],
        depth: moderngl.Texture | moderngl.TextureArray | None,
        samples: int = 1,
        max_cameras: int = 1,
        blended_items: int = 0,
    ):
        self._buffers, self._items = buffers, items
        self._all_items = items
        self._state = GlState()
        self._depths_m = (cameras.near_m, cameras.far_m)
        self.views = TileViews(plan, *self._depths_m)
        self.culler: ClusterCuller | None = None
        geometry = buffers.clustered_geometry
        if geometry is None:
            return
        context, depths_m = buffers.context, self._depths_m
        batches = DrawBatches(geometry, find_program, cameras.both_sides)
        self._cluster_views = Views(
            context,
            clips_from_rig(plan, *depths_m),
            plan.rectangles_px,
            geometry.anchor_m,
            geometry.objects,
            max_cameras,
        )
        self.culler = ClusterCuller(
            context,
            geometry.buffers,
            batches.groups,
            self._cluster_views,
            depth,
            1 + sum(geometry.triangle_count >= least for least in MIN_TRIANGLES_OF_PASSES),
            (plan.width_px, plan.height_px),
            depths_m,
            samples,
            cameras.both_sides,
            blended_items,
        )
        # hidden static items have no triangles
        shown = buffers.shown(cameras.hidden)
        shown |= np.array([item.object_index is None for item in buffers.draw_items])
        self._shown = shown
        self.culler.show(geometry.shown_clusters(shown))
        self._clusters = ClusterDrawer(context, geometry, self.culler, batches)

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        self.views = TileViews(plan, *self._depths_m)
        if self.culler is not None:
            clips_from_tiles = clips_from_rig(plan, *self._depths_m)
            self._cluster_views.use_tiles(clips_from_tiles, plan.rectangles_px)

    def select(self, left_out: NDArray[np.bool_], parts: SceneParts = SceneParts.ALL) -> None:
        """Select items to draw; clusters of static items show all of them, or none.

        Args:
            left_out: mask (items,) of items not to draw.
            parts: parts of the scene to draw.
        """
        drawn = parts.mask(self._buffers.draw_items)
        self._items = self._all_items[(drawn & ~left_out)[self._all_items]]
        geometry = self._buffers.clustered_geometry
        if self.culler is not None and geometry is not None:
            is_static = np.array([one.object_index is None for one in self._buffers.draw_items])
            drawn &= self._shown & (is_static | ~left_out)
            self.culler.show(geometry.shown_clusters(drawn))

    @property
    def culling_bytes(self) -> int:
        """Size of the buffers for culling, draw commands included, bytes."""
        return 0 if self.culler is None else self.culler.memory_bytes

    @property
    def has_items(self) -> bool:
        """True if some items are drawn one by one."""
        return bool(self._items.size)

    def begin(
        self,
        target: moderngl.Framebuffer,
        colors: Sequence[tuple[float, float, float, float] | None],
    ) -> None:
        """Bind a target and clear depth and colors; None marks integer attachments.

        Everything else is drawn with the state of `GlState.drawing`.
        """
        self._state.use(target, has_depth=True)
        self._state.clear(colors, CLEAR_DEPTH)

    def draw(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
        drawer: SceneDrawer[P],
    ) -> None:
        """Draw the clusters of all tiles, then the items.

        Args:
            target: framebuffer, cleared by `begin`.
            world_from_rig: (4, 4) pose of the camera's rig.
            world_from_objects: (4, 4) each, poses of the dynamic objects.
            drawer: drawer of the items.
        """
        self.draw_clusters(target, world_from_rig, world_from_objects)
        self.draw_one_by_one(target, world_from_rig, world_from_objects, drawer)

    def draw_one_by_one(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
        drawer: SceneDrawer[P],
    ) -> None:
        """Draw the items of all tiles, after the clusters."""
        if not self._items.size:
            return
        transforms = self._buffers.instance_transforms(world_from_rig[:3, 3], world_from_objects)
        drawer.begin(transforms)
        order = self._buffers.front_to_back(self._items, transforms)
        self.draw_items(target, self.views.at(world_from_rig), transforms, order, drawer)

    def draw_clusters(
        self,
        target: moderngl.Framebuffer,
        worlds_from_rigs: NDArray[np.float64],
        worlds_from_objects: NDArray[np.float64] | Sequence[NDArray[np.float64]],
    ) -> None:
        """Draw the clusters of all tiles, for one camera or several, see `Views.write`."""
        if self.culler is not None:
            self._cluster_views.write(worlds_from_rigs, worlds_from_objects)
            for pass_index in range(self.culler.passes):
                self.culler.run(pass_index, target)
                self._clusters.draw(pass_index)

    def draw_items(
        self,
        target: moderngl.Framebuffer,
        views: PosedViews,
        transforms: InstanceTransforms,
        order: NDArray[np.intp],
        drawer: SceneDrawer[P],
    ) -> None:
        """Draw items in order of their indices (n,), each in the tiles that may show it."""
        seen = transforms.seen_in(views, order)
        if not seen.any():
            return
        with self._state.unclipped(), self._state.within_rectangles(target) as aim:
            for number in np.flatnonzero(seen.any(axis=1)).tolist():
                tile, shown = views.tiles[number], order[seen[number]]
                aim(tile.left_px, tile.top_px, *tile.size_px)
                clip_from_viewpoint = views.clips_from_viewpoint[number]
                clips = columns_first(clip_from_viewpoint @ transforms.viewpoint_from_mesh[shown])
                for index, clip_from_mesh in zip(shown.tolist(), clips, strict=True):
                    drawer.draw_item(index, clip_from_mesh)
