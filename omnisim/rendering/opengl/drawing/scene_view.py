"""Draws the scene from one viewpoint into an atlas: clusters, single items, sky, blended items."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property
from typing import Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.world import time_of
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.drawing.cluster_drawer import (
    BlendedDrawer,
    BucketProgram,
    arrays_of,
    can_sort,
)
from omnisim.rendering.opengl.drawing.scene_drawer import SceneDrawer
from omnisim.rendering.opengl.drawing.sky_pass import SkyPass
from omnisim.rendering.opengl.drawing.surface_program import (
    SurfaceProgram,
    SurfacePrograms,
    SurfaceVariant,
    variant_of,
    variant_of_blended,
    variant_of_bucket,
)
from omnisim.rendering.opengl.drawing.tile_renderer import (
    SceneParts,
    TileRenderer,
    VirtualCameras,
)
from omnisim.rendering.opengl.geometry.clustered_geometry import Bucket
from omnisim.rendering.opengl.geometry.draw_item import DrawItem
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.scene.planar_mirrors import is_rough_mirror


class MirroredViews(Protocol):
    """Rendered views in planar mirrors, or in panes."""

    @property
    def of_panes(self) -> bool:
        """True for views in panes."""

    @property
    def items(self) -> frozenset[int]:
        """Indices of the items that show the views."""

    def connect(self, programs: Collection[SurfaceProgram]) -> None:
        """Set the mirrors' planes in the programs that show the views."""

    def bind(self) -> None:
        """Bind the views for the next draw calls."""


class Probes(Protocol):
    """Rendered reflection probes."""

    @property
    def items(self) -> frozenset[int]:
        """Indices of the items that reflect a probe."""

    def connect(
        self,
        programs: Collection[SurfaceProgram],
        viewpoint_m: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
    ) -> None:
        """Set the probes of items, relative to a viewpoint (3,), in the programs, and bind them."""


class SceneView:
    """Drawers of a scene for the tiles of an atlas; of no use once the buffers have changed.

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

    Attributes:
        tiles: renderer of the tiles.
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
        depth: moderngl.Texture | None,
        samples: int,
        sky: SkyPass | None,
        mirrors: Sequence[MirroredViews] = (),
        is_mirrored: bool = False,
        probes: Probes | None = None,
    ):
        self._buffers, self._cameras, self._surface_programs = buffers, cameras, programs
        self._sky, self._state, self._is_mirrored = sky, GlState(), is_mirrored
        shown = buffers.shown_one_by_one(cameras.hidden)
        items = buffers.draw_items
        blended = np.array([item.is_blended for item in items], dtype=np.bool_)
        if cameras.unlit:  # panes are opaque
            blended = np.array([item.material.is_blended for item in items], dtype=np.bool_)
        self._blended = self._all_blended = np.flatnonzero(shown & blended)
        is_sorted = can_sort([items[one] for one in self._blended], buffers.clustered_geometry)
        self._sorted, self._all_unsorted = self._blended[is_sorted], self._blended[~is_sorted]
        self._unsorted, self._has_all_sorted = self._all_unsorted, True
        self.sorted_items = [items[index] for index in self._sorted]
        opaque = np.flatnonzero(shown & ~blended)
        self.programs: set[SurfaceProgram] = set()
        self._mirrors = mirrors
        self._probes = probes
        of_probes = set() if probes is None else {id(items[index]) for index in probes.items}
        of_mirrors = {id(items[index]) for one in mirrors for index in one.items}

        def find_item_program(item: DrawItem) -> SurfaceProgram:
            variant = variant_of(item, cameras.unlit)
            if id(item) in of_mirrors:
                is_rough = is_rough_mirror(item.material)
                variant = variant._replace(is_planar_mirror=True, is_rough_mirror=is_rough)
            if id(item) in of_probes:
                is_glass = item.material.glass_transmission > 0.0
                variant = variant._replace(has_probe=True, is_glass=is_glass)
            return self._program(variant)

        def find_program(bucket: Bucket) -> BucketProgram:
            return BucketProgram(self._program(variant_of_bucket(bucket, cameras.unlit)).program)

        self._find_item_program = find_item_program
        self._drawer = self._item_drawer(opaque)
        self.tiles = TileRenderer(
            buffers, plan, cameras, opaque, find_program, depth, samples,
            blended_items=len(self.sorted_items),
        )  # fmt: skip
        self.blended_drawer = self._make_blended_drawer()

    def _program(self, variant: SurfaceVariant) -> SurfaceProgram:
        program = self._surface_programs[variant._replace(in_mirror=self._is_mirrored)]
        self.programs.add(program)
        return program

    def _item_drawer(self, items: NDArray[np.intp]) -> SceneDrawer[SurfaceProgram]:
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

    def select(self, left_out: NDArray[np.bool_], parts: SceneParts = SceneParts.ALL) -> None:
        """Select what to draw, see `TileRenderer.select`; blended items of all parts are drawn."""
        self._blended = self._all_blended[~left_out[self._all_blended]]
        self._unsorted = self._all_unsorted[~left_out[self._all_unsorted]]
        self._has_all_sorted = not left_out[self._sorted].any()
        self.tiles.select(left_out, parts)

    def sorts_blended(
        self, viewpoint_m: NDArray[np.float64], world_from_objects: Sequence[NDArray[np.float64]]
    ) -> bool:
        """True if the GPU sorts all that the blended items show to a viewpoint (3,), world."""
        showing = self._buffers.showing(self._unsorted, viewpoint_m, world_from_objects)
        return self._has_all_sorted and next(showing, None) is None

    def draw_opaque(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
    ) -> None:
        """Draw the selected opaque items alone; arguments and conditions as of `draw`."""
        for program in self.programs:
            program.set_viewpoint(world_from_rig[:3, 3])
        with self._state.drawing():
            self.tiles.draw(target, world_from_rig, world_from_objects, self._drawer)

    def add_one_by_one(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
    ) -> None:
        """Draw the selected opaque items outside of clusters, over a drawn view of this pose."""
        with self._state.drawing():
            self.tiles.draw_one_by_one(target, world_from_rig, world_from_objects, self._drawer)

    def draw(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
        mirror: NDArray[np.float64] | None = None,
    ) -> None:
        """Draw from a pose (4, 4) onto the bound target; `mirror`: see `SurfaceProgram.set_mirror`.

        The target is cleared, shadow maps and tables are bound, and meshes are deformed.
        """
        is_sorted = self.sorts_blended(world_from_rig[:3, 3], world_from_objects)
        one_by_one = None if is_sorted else self._blended_item_drawer  # its programs are set, too
        for program in self.programs:
            program.set_viewpoint(world_from_rig[:3, 3])
            if mirror is not None:
                program.set_mirror(mirror)
        for mirrors in self._mirrors:
            mirrors.connect(self.programs)
        if self._probes is not None:
            self._probes.connect(self.programs, world_from_rig[:3, 3], world_from_objects)
        with self._state.drawing(), self._mirrored():
            with self._clipped():
                self._bind_mirrors(of_panes=False)
                self.tiles.draw(target, world_from_rig, world_from_objects, self._drawer)
            if self._sky is not None:
                self._sky.draw(world_from_rig[None])
            if one_by_one is None and self.blended_drawer is None:
                return
            with self._state.blending(), self._clipped():
                if one_by_one is not None:
                    self._bind_mirrors(of_panes=True)
                    self._draw_back_to_front(target, world_from_rig, world_from_objects, one_by_one)
                elif self.blended_drawer is not None:
                    self.blended_drawer.draw()

    def _bind_mirrors(self, of_panes: bool) -> None:
        for mirrors in self._mirrors:
            if mirrors.of_panes is of_panes:
                mirrors.bind()

    def _mirrored(self) -> AbstractContextManager[None]:
        return self._state.mirrored() if self._is_mirrored else nullcontext()

    def _clipped(self) -> AbstractContextManager[None]:
        return self._state.clipped_at_mirror() if self._is_mirrored else nullcontext()

    def _draw_back_to_front(
        self,
        target: moderngl.Framebuffer,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]],
        drawer: SceneDrawer[SurfaceProgram],
    ) -> None:
        """Sort visible blended items, and their triangles, back to front; draw them one by one."""
        transforms = self._buffers.instance_transforms(world_from_rig[:3, 3], world_from_objects)
        views, time_s = self.tiles.views.at(world_from_rig), time_of(world_from_objects)
        blended = self._blended[transforms.seen_in(views, self._blended).any(axis=0)]
        distances = np.linalg.norm(transforms.centers_m[blended], axis=1)
        blended = blended[np.argsort(-distances, kind="stable")]
        for index in blended:
            self._buffers.sort_triangles(
                self._buffers.draw_items[index], transforms.viewpoint_from_mesh[index], time_s
            )
        drawer.begin(transforms)
        self.tiles.draw_items(target, views, transforms, blended, drawer)
