"""The draw loop over the tiles of an atlas, for colours and for triangle IDs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.atlas.tile_plan import TilePlan
from omnisim.gpu.atlas.tile_views import TileView, TileViews
from omnisim.gpu.gl_functions import flush
from omnisim.gpu.scene.draw_item import InstanceTransforms
from omnisim.gpu.scene.reversed_depth import CLEAR_DEPTH, DEPTH_FUNCTION
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.scene_drawer import P, SceneDrawer
from omnisim.gpu.scene.static_drawer import StaticDrawer
from omnisim.gpu.uniforms import columns_first
from omnisim.world import ObjectPart


@dataclass(frozen=True)
class VirtualCameras:
    """Settings of the virtual cameras.

    Attributes:
        near_m, far_m: depth range; far_m may be infinite.
        samples: of a texel of the picture.
        unlit: show plain base colours.
        background: linear RGB where nothing is hit.
        hidden: parts of dynamic objects that are not drawn.
        both_sides: show all surfaces from behind, too.
    """

    near_m: float
    far_m: float
    samples: int = 1
    unlit: bool = False
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    hidden: frozenset[ObjectPart] = frozenset()
    both_sides: bool = False


class TileRenderer:
    """Draws a scene into the tiles of an atlas, by any programs.

    Faces, depth, clipping and culling are the same for all passes; clearing, blending and programs
    are their own.

    Args:
        buffers: the scene and its dynamic objects.
        plan: the tiles.
        cameras: their depth range and sides count.
        items: (n,) draw items to draw one by one, front to back.
        samples: of a texel.

    Attributes:
        views: of the tiles.
        static: draws the static geometry; None where there is none.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        plan: TilePlan,
        cameras: VirtualCameras,
        items: NDArray[np.intp],
        samples: int = 1,
    ):
        self._context, self._buffers, self._items = buffers.context, buffers, items
        self.views = TileViews(plan, cameras.near_m, cameras.far_m)
        geometry = buffers.static_geometry
        self.static = (
            None if geometry is None else StaticDrawer(geometry, plan, samples, cameras.both_sides)
        )

    def begin(self, target: moderngl.Framebuffer, color: tuple[float, float, float, float]) -> None:
        """Clear a target and use it, with depth."""
        context = self._context
        target.use()
        _draw_everywhere(target)
        target.viewport = (0, 0, *target.size)
        target.depth_mask = True
        target.clear(color=color, depth=CLEAR_DEPTH)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = DEPTH_FUNCTION
        # y of the clip space runs down the picture, so triangles are wound the other way round
        context.cull_face = "back"

    def draw(
        self,
        target: moderngl.Framebuffer,
        views: Sequence[TileView],
        viewpoint_m: NDArray[np.float64],
        transforms: InstanceTransforms,
        drawer: SceneDrawer[P],
    ) -> None:
        """Draw the items and the static geometry, tile by tile and pass by pass.

        Args:
            target: cleared by `begin`.
            views: of the tiles.
            viewpoint_m: (3,), world.
            transforms: of the items.
            drawer: draws one item, or clusters.
        """
        drawer.begin(transforms)
        order = self._buffers.front_to_back(self._items, transforms)
        if self.static is None:
            for view in views:
                self.draw_items(target, view, transforms, order, drawer)
            return
        read_depth = partial(_read_depth, target)
        passes = self.static.passes(views, viewpoint_m, drawer.load_clusters, read_depth)
        for pass_index, tiles in enumerate(passes):
            for view, tile in zip(views, tiles, strict=True):
                self.draw_items(target, view, transforms, order, drawer)
                drawer.draw_clusters(tile)
                if pass_index == 0:
                    # tile by tile: a software renderer keeps the commands of all tiles in memory
                    # otherwise, and is slower by up to a seventh
                    flush()
            order = order[:0]

    def draw_items(
        self,
        target: moderngl.Framebuffer,
        view: TileView,
        transforms: InstanceTransforms,
        order: NDArray[np.intp],
        drawer: SceneDrawer[P],
    ) -> None:
        """Draw the items of `order` (n,) that a tile may show, in that order."""
        tile = view.tile
        target.viewport = target.scissor = (tile.left_px, tile.top_px, *tile.size_px)
        if order.size:
            order = order[self.cull_items(view, transforms, order)]
            clips = columns_first(view.clip_from_viewpoint @ transforms.viewpoint_from_mesh[order])
            for index, clip_from_mesh in zip(order.tolist(), clips, strict=True):
                drawer.draw_item(index, clip_from_mesh)

    def cull_items(
        self, view: TileView, transforms: InstanceTransforms, items: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Mask of items (n,) whose bounding spheres are not outside of a tile's frustum."""
        inside_m = (
            transforms.centres_m[items] @ view.frustum_planes[:, :3].T + view.frustum_planes[:, 3]
        )
        kept: NDArray[np.bool_] = np.all(inside_m.T + self._buffers.radii_m[items] >= 0.0, axis=0)
        return kept

    def end(self, target: moderngl.Framebuffer) -> None:
        """Leave the state that later passes expect."""
        _draw_everywhere(target)
        target.depth_mask = True
        self._context.disable(moderngl.CULL_FACE | moderngl.BLEND | moderngl.DEPTH_TEST)


def _draw_everywhere(target: moderngl.Framebuffer) -> None:
    target.scissor = None  # type: ignore[assignment]  # moderngl's stub lacks it


def _read_depth(target: moderngl.Framebuffer) -> NDArray[np.float32]:
    """Depth (height, width) of all that was drawn."""
    depth = np.empty(target.size[::-1], dtype=np.float32)
    target.read_into(depth, components=1, attachment=-1, dtype="f4")
    return depth
