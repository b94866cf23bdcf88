"""A view of the scene: what is drawn into the tiles of an atlas, and in which order."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import Enum
from functools import cached_property, partial
from typing import Protocol

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices
from omnisim.core.world import ObjectPart
from omnisim.rendering.atlas.tile_plan import PosedViews, TilePlan, TileViews, clips_from_rig
from omnisim.rendering.camera.quality import DEFAULT_MIRRORS, DEFAULT_PROBES
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.culling.cluster_culling import (
    MIN_CULLED_TRIANGLES,
    MIN_TRIANGLES_OF_PASSES,
    OCCLUDERS_RAD,
    ClusterCuller,
    Views,
)
from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.shader_files import columns_first
from omnisim.rendering.opengl.gl.state import CLEAR_DEPTH, GlState
from omnisim.rendering.opengl.surfaces.cluster_drawer import (
    BlendedDrawer,
    BucketProgram,
    ClusterDrawer,
    DrawBatches,
    arrays_of,
    can_sort,
)
from omnisim.rendering.opengl.surfaces.scene_drawer import P, SceneDrawer, SkyPass
from omnisim.rendering.opengl.surfaces.surface_program import (
    SurfaceProgram,
    SurfacePrograms,
    SurfaceVariant,
    variant_of,
    variant_of_blended,
    variant_of_bucket,
)
from omnisim.rendering.opengl.world.clustered_geometry import Bucket
from omnisim.rendering.opengl.world.draw_item import DrawItem, InstanceTransforms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.surface_kind import SurfaceKind, mask_of

_POSITIONS = 15  # binding, as in `scene/lighting.glsl`


class SceneParts(Enum):
    """Parts of a scene by their motion; dynamic objects and deforming meshes move."""

    ALL = "all"
    STATIC = "static"
    MOVING = "moving"

    def mask(self, items: Sequence[DrawItem]) -> Bools:
        """Mask (items,) of the parts' items."""
        if self is SceneParts.ALL:
            return np.ones(len(items), dtype=np.bool_)
        return np.array(
            [item.moves is (self is SceneParts.MOVING) for item in items], dtype=np.bool_
        )


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
        reflection_probes: maximum number of probes that curved and rough surfaces reflect, and of
            those of planar mirrors and panes.
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
        items: Indices,
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
        is_small = geometry.triangle_count < MIN_CULLED_TRIANGLES
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
            OCCLUDERS_RAD[
                sum(geometry.triangle_count >= triangle for triangle in MIN_TRIANGLES_OF_PASSES)
            ],
            (plan.width_px, plan.height_px),
            depths_m,
            samples,
            cameras.both_sides,
            blended_items,
            None if is_small or batches.has_ids else geometry.cullable,
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

    def select(self, left_out: Bools, parts: SceneParts = SceneParts.ALL) -> None:
        """Select items to draw; clusters of static items show all of them, or none.

        Args:
            left_out: mask (items,) of items not to draw.
            parts: parts of the scene to draw.
        """
        drawn = parts.mask(self._buffers.draw_items)
        self._items = self._all_items[(drawn & ~left_out)[self._all_items]]
        geometry = self._buffers.clustered_geometry
        if self.culler is not None and geometry is not None:
            is_static = np.array([item.object_index is None for item in self._buffers.draw_items])
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
        shots: Sequence[ScenePoses],
        drawer: SceneDrawer[P],
    ) -> None:
        """Draw the clusters of all tiles, then the items, which only a single shot may have.

        Args:
            target: framebuffer, cleared by `begin`, with a layer per shot if there are several.
            shots: poses of the rig and the dynamic objects.
            drawer: drawer of the items.
        """
        self.draw_clusters(target, shots)
        self.draw_one_by_one(target, shots[0], drawer)

    def draw_one_by_one(
        self, target: moderngl.Framebuffer, shot: ScenePoses, drawer: SceneDrawer[P]
    ) -> None:
        """Draw the items of all tiles, after the clusters."""
        if not self._items.size:
            return
        transforms = self._buffers.instance_transforms(shot.viewpoint_m, shot.world_from_objects)
        drawer.begin(transforms)
        order = self._buffers.front_to_back(self._items, transforms)
        self.draw_items(target, self.views.at(shot.world_from_rig), transforms, order, drawer)

    def draw_clusters(self, target: moderngl.Framebuffer, shots: Sequence[ScenePoses]) -> None:
        """Draw the clusters of all tiles, one layer of the target per shot."""
        if self.culler is not None:
            self._cluster_views.write(shots)
            for pass_index in range(self.culler.passes):
                self.culler.run(pass_index, target)
                self._clusters.draw(pass_index)

    def draw_items(
        self,
        target: moderngl.Framebuffer,
        views: PosedViews,
        transforms: InstanceTransforms,
        order: Indices,
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


class MirroredViews(Protocol):
    """Views in planar mirrors, or in panes."""

    @property
    def of_panes(self) -> bool:
        """True for views in panes."""

    @property
    def items(self) -> frozenset[int]:
        """Indices of the items that show the views."""

    @property
    def without_view(self) -> frozenset[int]:
        """Indices of the items for which the last rendered views lack a mirrored view."""

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""

    def render(self, view: SceneView, shot: ScenePoses) -> None:
        """Render the mirrored views that a view shows."""

    def connect(self, programs: Collection[SurfaceProgram]) -> None:
        """Set the mirrors' planes in the programs that show the views."""

    def bind(self) -> None:
        """Bind the views for the next draw calls."""


class Probes(Protocol):
    """Reflection probes."""

    @property
    def items(self) -> frozenset[int]:
        """Indices of the items that reflect a probe."""

    @property
    def planar(self) -> frozenset[int]:
        """Indices of those that are planar mirrors or panes."""

    def render(self, seen: Collection[int], world_from_objects: Sequence[Floats]) -> None:
        """Render the probes that items at the given indices reflect."""

    def connect(self, programs: Collection[SurfaceProgram], shot: ScenePoses) -> None:
        """Set the probes of items in the programs for a viewpoint."""


class SceneView:
    """Drawers of a scene for the tiles of an atlas; invalid once the buffers have changed.

    Args:
        buffers: scene and dynamic objects; other passes may share them.
        programs: surface programs for the scene's lights.
        plan: tiles of the atlas.
        cameras: virtual cameras.
        depth: depth of the atlas; None if shaders cannot read it.
        samples: samples per texel.
        sky: pass of the visible sky; None: no sky.
        mirrors: views in mirrors, and in panes.
        is_mirrored: draw from mirrored rigs, clipped at the mirror.
        probes: reflection probes; None: all surfaces without mirrors reflect sky and lamps.
        layers: number of shots to draw together; 0: a single one.

    Attributes:
        tiles: renderer of the tiles.
        mirrors, probes: see the arguments.
        sorted_items: blended items that the GPU sorts.
        blended_drawer: drawer of these items; None: there are none.
        programs: surface programs in use.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        plan: TilePlan,
        cameras: VirtualCameras,
        depth: moderngl.Texture | moderngl.TextureArray | None,
        samples: int,
        sky: SkyPass | None,
        mirrors: Sequence[MirroredViews] = (),
        is_mirrored: bool = False,
        probes: Probes | None = None,
        layers: int = 0,
    ):
        self._buffers, self._cameras, self._surface_programs = buffers, cameras, programs
        self._sky, self._state, self._is_mirrored = sky, GlState(), is_mirrored
        shown = buffers.shown_one_by_one(cameras.hidden)
        items = buffers.draw_items
        # unlit panes are opaque
        is_blended = SurfaceKind.BLENDED if cameras.unlit else SurfaceKind.SEE_THROUGH
        blended = mask_of([item.kind for item in items], is_blended)
        self._blended = self._all_blended = np.flatnonzero(shown & blended)
        is_sorted = can_sort([items[index] for index in self._blended], buffers.clustered_geometry)
        self._sorted, self._all_unsorted = self._blended[is_sorted], self._blended[~is_sorted]
        self._unsorted, self._has_all_sorted = self._all_unsorted, True
        self.sorted_items = [items[index] for index in self._sorted]
        opaque = np.flatnonzero(shown & ~blended & (layers == 0))
        self._is_layered = layers > 0
        if layers:
            positions = layers * len(programs.positions_m)
            self._positions = written_buffer(buffers.context, 16 * positions)
        self.programs: set[SurfaceProgram] = set()
        self.mirrors, self.probes = mirrors, probes
        of_probes = set() if probes is None else {id(items[index]) for index in probes.items}
        # planar mirrors show mirrored views, and probes where these are missing
        self._planar = frozenset() if probes is None or not mirrors else probes.planar
        of_probes -= {id(items[index]) for index in self._planar}
        of_mirrors = {id(items[index]) for mirror in mirrors for index in mirror.items}

        def find_item_program(item: DrawItem, is_without_view: bool = False) -> SurfaceProgram:
            in_mirrors, has_probe = id(item) in of_mirrors, id(item) in of_probes
            has_probe = has_probe or is_without_view
            return self._program(variant_of(item, cameras.unlit, in_mirrors, has_probe))

        def find_program(bucket: Bucket) -> BucketProgram:
            return BucketProgram(self._program(variant_of_bucket(bucket, cameras.unlit)).program)

        self._find_item_program = find_item_program
        self._drawer = self._item_drawer(opaque)
        self.tiles = TileRenderer(
            buffers, plan, cameras, opaque, find_program, depth, samples,
            max_cameras=max(1, layers), blended_items=len(self.sorted_items),
        )  # fmt: skip
        self.blended_drawer = self._make_blended_drawer()

    def _program(self, variant: SurfaceVariant) -> SurfaceProgram:
        variant = variant._replace(in_mirror=self._is_mirrored, layered=self._is_layered)
        program = self._surface_programs[variant]
        self.programs.add(program)
        return program

    def _item_drawer(self, items: Indices) -> SceneDrawer[SurfaceProgram]:
        """Drawer of items (n,) one by one."""
        return SceneDrawer(
            self._buffers, items, self._find_item_program, {}, is_mirrored=self._is_mirrored
        )

    @cached_property
    def _blended_item_drawer(self) -> SceneDrawer[SurfaceProgram]:
        """Drawer of blended items one by one, made for the first pose that needs it."""
        return self._item_drawer(self._all_blended)

    def _make_blended_drawer(self) -> BlendedDrawer | None:
        geometry, culler = self._buffers.clustered_geometry, self.tiles.culler
        items = self.sorted_items
        if geometry is None or culler is None or not items:
            return None
        variant = variant_of_blended(len(arrays_of(items)), self._cameras.unlit, items)
        program = self._program(variant).program
        return BlendedDrawer(self._buffers.context, geometry, culler, items, program)

    def select(self, left_out: Bools, parts: SceneParts = SceneParts.ALL) -> None:
        """Select what to draw, see `TileRenderer.select`; blended items of all parts are drawn."""
        self._blended = self._all_blended[~left_out[self._all_blended]]
        self._unsorted = self._all_unsorted[~left_out[self._all_unsorted]]
        self._has_all_sorted = not left_out[self._sorted].any()
        self.tiles.select(left_out, parts)

    def sorts_blended(self, shot: ScenePoses) -> bool:
        """True if the GPU sorts all that the blended items show to a viewpoint."""
        showing = self._buffers.showing(self._unsorted, shot)
        return self._has_all_sorted and next(showing, None) is None

    def draw_opaque(self, target: moderngl.Framebuffer, shot: ScenePoses) -> None:
        """Draw the selected opaque items alone; arguments and conditions as of `draw`."""
        self._set_viewpoints((shot,))
        with self._state.drawing():
            self.tiles.draw(target, (shot,), self._drawer)

    def add_one_by_one(self, target: moderngl.Framebuffer, shot: ScenePoses) -> None:
        """Draw the selected opaque items outside of clusters, over a drawn view of this pose."""
        with self._state.drawing():
            self.tiles.draw_one_by_one(target, shot, self._drawer)

    def draw(
        self,
        target: moderngl.Framebuffer,
        shots: Sequence[ScenePoses],
        mirror: Floats | None = None,
    ) -> None:
        """Draw what the tiles see: opaque surfaces, the sky, and what blends, back to front.

        The target is cleared, shadow maps and tables are bound, and meshes are deformed.

        Args:
            target: framebuffer, with a layer per shot if the view has layers.
            shots: poses of the rig and the dynamic objects; one, unless the view has layers, where
                the GPU must sort all that is blended.
            mirror: plane at which a mirrored view ends, see `SurfaceProgram.set_mirror`.
        """
        shot, one_by_one, drawers = shots[0], None, [self._drawer]
        if not self._is_layered and not self.sorts_blended(shot):
            one_by_one = self._blended_item_drawer  # before the programs, as it may add to them
            drawers.append(one_by_one)
        without_view = self._planar & {i for mirror in self.mirrors for i in mirror.without_view}
        for drawer in drawers:
            drawer.use(without_view, partial(self._find_item_program, is_without_view=True))
        self._set_viewpoints(shots)
        if mirror is not None:
            for program in self.programs:
                program.set_mirror(mirror)
        for mirrors in self.mirrors:
            mirrors.connect(self.programs)
        if self.probes is not None:
            self.probes.connect(self.programs, shot)
        with self._state.drawing(), self._mirrored():
            with self._clipped():
                self._bind_mirrors(of_panes=False)
                self.tiles.draw(target, shots, self._drawer)
            if self._sky is not None:
                self._sky.draw(np.array([shot.world_from_rig for shot in shots]))
            if one_by_one is None and self.blended_drawer is None:
                return
            with self._state.blending(), self._clipped():
                if one_by_one is not None:
                    self._bind_mirrors(of_panes=True)
                    self._draw_back_to_front(target, shot, one_by_one)
                elif self.blended_drawer is not None:
                    self.blended_drawer.draw()

    def _set_viewpoints(self, shots: Sequence[ScenePoses]) -> None:
        """Set the positions of lamps and shadow maps, relative to each viewpoint."""
        if not self._is_layered:
            for program in self.programs:
                program.set_viewpoint(shots[0].viewpoint_m)
            return
        positions_m = self._surface_programs.positions_m
        if len(positions_m):
            positions = np.zeros((len(shots), len(positions_m), 4), dtype=np.float32)
            positions[..., :3] = (
                positions_m - np.array([shot.viewpoint_m for shot in shots])[:, None]
            )
            self._positions.write(positions)
        self._positions.bind_to_storage_buffer(_POSITIONS)

    def _bind_mirrors(self, of_panes: bool) -> None:
        for mirrors in self.mirrors:
            if mirrors.of_panes is of_panes:
                mirrors.bind()

    def _mirrored(self) -> AbstractContextManager[None]:
        return self._state.mirrored() if self._is_mirrored else nullcontext()

    def _clipped(self) -> AbstractContextManager[None]:
        return self._state.clipped_at_mirror() if self._is_mirrored else nullcontext()

    def _draw_back_to_front(
        self, target: moderngl.Framebuffer, shot: ScenePoses, drawer: SceneDrawer[SurfaceProgram]
    ) -> None:
        """Sort visible blended items, and their triangles, back to front; draw them one by one."""
        transforms = self._buffers.instance_transforms(shot.viewpoint_m, shot.world_from_objects)
        views = self.tiles.views.at(shot.world_from_rig)
        blended = self._blended[transforms.seen_in(views, self._blended).any(axis=0)]
        distances = np.linalg.norm(transforms.centers_m[blended], axis=1)
        blended = blended[np.argsort(-distances, kind="stable")]
        for index in blended:
            self._buffers.sort_triangles(
                self._buffers.draw_items[index], transforms.viewpoint_from_mesh[index], shot.time_s
            )
        drawer.begin(transforms)
        self.tiles.draw_items(target, views, transforms, blended, drawer)
