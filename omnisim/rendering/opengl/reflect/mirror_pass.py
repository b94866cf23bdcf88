"""Mirror pass: the scene as planar mirrors and panes reflect it, from mirrored viewpoints.

The mirrored rig has the tiles of the rig itself, so that the view in a mirror has the atlas
coordinates of the mirror. Each mirror's view is drawn only in the texels where that mirror is the
nearest one. Panes have views of their own, since mirrors may be behind them. Mirrors within a
mirrored view, and those beyond the number of views, reflect their probes.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import moderngl
import numpy as np

from omnisim.core.arrays import Bytes, Floats, Indices, triangle_crosses
from omnisim.rendering.atlas.tile_plan import PosedViews, TilePlan, TileViews
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, gpu_buffer
from omnisim.rendering.opengl.gl.framebuffers import framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import depth_texture, texture_2d
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform
from omnisim.rendering.opengl.gl.state import CLEAR_DEPTH, GlState
from omnisim.rendering.opengl.scene_view import Probes, SceneView, VirtualCameras
from omnisim.rendering.opengl.surfaces.scene_drawer import ItemProgram, SceneDrawer, SkyPass
from omnisim.rendering.opengl.surfaces.surface_program import (
    MIRROR_UNITS,
    SurfaceProgram,
    SurfacePrograms,
)
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.model import Material
from omnisim.scene.planar_mirrors import MirrorPlane
from omnisim.scene.surface_kind import SurfaceKind, kind_of
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS

_OWNERS_UNIT, _NUMBERS_UNIT = 0, 0
_ROW_TRIANGLES = 4096  # of the table of owners
_NOWHERE_M = 1e9  # height above a plane without a view
_POINTS = 128  # of a mirror, at which its share of the view is measured
_R2_STEPS = 0.7548776662466927, 0.5698402909980532  # evenly spread


class MirrorPass:
    """Draws a camera's views in mirrors, or in panes; invalid once the buffers have changed.

    Args:
        buffers: scene and dynamic objects.
        mirrors: planes of the mirrors, or of the panes.
        of_panes: True for panes.
        programs: surface programs for the scene's lights.
        plan: tiles of the camera's atlas.
        whole: tiles of the whole image, whose largest mirrors have views in all of its parts.
        cameras: virtual cameras.
        sky: pass of the visible sky; None: no sky.
        probes: reflection probes; None: no surface has one.

    Attributes:
        items: indices of the items that show the views.
        of_panes: see the arguments.
        without_view: those in the last rendered view that have a plane without a mirrored view.

    Raises:
        GraphicsError: the views do not fit on the GPU.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        mirrors: Sequence[MirrorPlane],
        of_panes: bool,
        programs: SurfacePrograms,
        plan: TilePlan,
        whole: TilePlan,
        cameras: VirtualCameras,
        sky: SkyPass | None,
        probes: Probes | None = None,
    ):
        context = buffers.context
        self._buffers, self._mirrors, self._state = buffers, mirrors, GlState()
        self._count = cameras.mirrors
        self._plan, self._world_from_rig = plan, np.eye(4)
        self._middle = whole.middle
        self._whole_views = TileViews(whole, cameras.near_m, cameras.far_m)
        self._planes = np.zeros((len(mirrors), 4))
        items = buffers.draw_items
        self._spreads = [
            min(_facet_slope(items[index].material) for index in mirror.parts) for mirror in mirrors
        ]
        self._background = cameras.background
        size = (plan.width_px, plan.height_px)
        with gpu_allocation(
            f"views in mirrors of {size[0]} × {size[1]} px",
            "make the image or virtual_cameras.size_px smaller",
        ):
            self._colors = texture_2d(context, size, 4, dtype="f2")
            nobody = bytes(size[0] * size[1])  # until a mirror is in view
            self._owners = texture_2d(context, size, 1, nobody, dtype="u1")
            depth = depth_texture(context, size)
        self._target = framebuffer(context, [self._colors], depth)
        self._owners_target = framebuffer(context, [self._owners], depth)
        self._depth_target = framebuffer(context, depth=depth)
        # a mirror shows the vehicle's own body, too
        seen = replace(cameras, hidden=frozenset(), samples=1)
        self._view = SceneView(
            buffers, programs, plan, seen, depth, 1, sky, is_mirrored=True, probes=probes
        )
        shown = np.flatnonzero(buffers.shown_one_by_one(cameras.hidden)).tolist()
        self.items = frozenset(index for mirror in mirrors for index in mirror.parts) & frozenset(
            shown
        )
        self.of_panes = of_panes
        self.without_view = frozenset[int]()
        self._points_m = [self._points_of(mirror) for mirror in mirrors]
        self._items = np.array(sorted(self.items), dtype=np.intp)
        self._owner_drawer = self._make_owner_drawer()
        window = build_program(context, "common/full_screen.vert", "scene/mirror_window.frag")
        uniform(window, "u_mirror_owners").value = _OWNERS_UNIT
        self._window = uniform(window, "u_number")
        self._triangle = context.vertex_array(window, [])

    def _make_owner_drawer(self) -> SceneDrawer[_OwnerProgram]:
        """Drawer of the mirrors' numbers."""
        # triangles of their own, since panes are sorted in the scene's; all mirrors may be hidden
        numbers, triangles = [np.zeros(1, np.uint8)], [np.zeros((1, 3), np.uint32)]
        first_of_item, count = {}, 1
        for index in self._items.tolist():
            item = self._buffers.draw_items[index]
            first_of_item[index] = count
            count += item.triangles
            triangles.append(item.mesh.triangles + np.uint32(item.base))
            numbers.append(np.zeros(item.triangles, dtype=np.uint8))
            for number, plane in enumerate(self._mirrors, start=1):
                if index in plane.parts:
                    numbers[-1][plane.parts[index]] = number
        context = self._buffers.context
        program = _OwnerProgram(context, np.concatenate(numbers))
        return SceneDrawer(
            self._buffers,
            self._items,
            lambda item: program,
            first_of_item,
            indices=gpu_buffer(context, np.concatenate(triangles).astype("<u4")),
        )

    def render(self, view: SceneView, shot: ScenePoses) -> None:
        """Render the mirrored views of a shot.

        Shadow maps and tables are bound, and meshes are deformed.
        """
        planes, sides = self._planes_at(shot)
        transforms = self._buffers.instance_transforms(shot.viewpoint_m, shot.world_from_objects)
        views = view.tiles.views.at(shot.world_from_rig)
        # the mirrors that face the viewpoint and that some tile may show
        whole = self._whole_views.at(shot.world_from_rig)
        visible: list[int] = []
        for number, mirror in enumerate(self._mirrors):
            items = np.array([part for part in mirror.parts if part in self.items], dtype=np.intp)
            if sides[number] in mirror.sides and transforms.seen_in(whole, items).any():
                visible.append(number)
        beyond: list[int] = []
        if len(visible) > self._count:
            order = sorted(visible, key=lambda index: self._rank(index, planes[index], whole, shot))
            visible, beyond = sorted(order[: self._count]), order[self._count :]
        parts = {index for number in beyond for index in self._mirrors[number].parts}
        self.without_view = self.items & parts
        self._planes = np.full_like(planes, _NOWHERE_M)
        self._planes[visible] = planes[visible]
        self._world_from_rig = shot.world_from_rig
        if not visible:
            return
        # the number of the nearest mirror, in exactly the texels that show it
        view.tiles.begin(self._owners_target, [None])
        self._owner_drawer.begin(transforms)
        with self._state.drawing():
            view.tiles.draw_items(
                self._owners_target, views, transforms, self._items, self._owner_drawer
            )
        self._state.use(self._target, has_depth=True)
        self._state.clear([(*self._background, 1.0)], CLEAR_DEPTH)
        for number in visible:
            self._draw_view(number, shot)

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        self._plan = plan
        self._view.tiles.use_plan(plan)

    def connect(self, programs: Collection[SurfaceProgram]) -> None:
        """Set the planes of the last rendered views in the programs that show them."""
        for program in programs:
            if program.is_pane is self.of_panes:
                program.set_mirrors(self._planes, self._plan, self._world_from_rig)

    def bind(self) -> None:
        """Bind the views for the next draw calls."""
        self._owners.use(MIRROR_UNITS["u_mirror_owners"])
        self._colors.use(MIRROR_UNITS["u_mirrored"])

    def _points_of(self, mirror: MirrorPlane) -> Floats:
        """Points (n, 3) spread evenly over a mirror, in the world or in its object's frame."""
        surfaces = [
            (self._buffers.draw_items[index].surface, own) for index, own in mirror.parts.items()
        ]
        corners_m = np.concatenate(
            [surface.positions_m[surface.mesh.triangles[own]] for surface, own in surfaces]
        )
        ends_m2 = np.cumsum(np.linalg.norm(triangle_crosses(corners_m), axis=1))
        numbers = np.arange(_POINTS)
        triangles = np.searchsorted(ends_m2, (numbers + 0.5) / _POINTS * ends_m2[-1])
        u, v = np.modf(np.outer(_R2_STEPS, numbers + 1))[0]
        u, v = np.where(u + v > 1.0, (1.0 - u, 1.0 - v), (u, v))
        shares = np.stack((1.0 - u - v, u, v), axis=1)
        return np.einsum("nk,nkc->nc", shares, corners_m[np.minimum(triangles, len(ends_m2) - 1)])

    def _rank(
        self, number: int, plane: Floats, views: PosedViews, shot: ScenePoses
    ) -> tuple[float, float]:
        """Rank of a mirror: by the solid angle in view, then from the middle of the view."""
        mirror, points_m = self._mirrors[number], self._points_m[number]
        if mirror.object_index is not None:
            pose = shot.world_from_objects[mirror.object_index]
            points_m = points_m @ pose[:3, :3].T + pose[:3, 3]
        points_m = points_m - shot.viewpoint_m
        points_m = points_m[views.cull(points_m, np.zeros(len(points_m))).any(axis=0)]
        ranges_m = np.maximum(np.linalg.norm(points_m, axis=1), 1e-9)
        angle = float(np.sum(plane[3] * mirror.area_m2 / _POINTS / ranges_m**3))
        middle = (points_m / ranges_m[:, None]).sum(axis=0)
        cosine = float(middle @ (shot.world_from_rig[:3, :3] @ self._middle))
        cosine /= max(float(np.linalg.norm(middle)), 1e-9)
        return -float(f"{angle:.1e}"), -cosine

    def _planes_at(self, shot: ScenePoses) -> tuple[Floats, Indices]:
        """Planes (mirrors, 4) and sides (mirrors,) that face the viewpoint.

        Planes have unit normals toward the viewpoint, and its heights in meters.
        """
        planes = np.empty((len(self._mirrors), 4))
        sides = np.empty(len(self._mirrors), dtype=np.intp)
        for number, mirror in enumerate(self._mirrors):
            normal, offset_m = mirror.normal, mirror.offset_m
            if mirror.object_index is not None:
                pose = shot.world_from_objects[mirror.object_index]
                normal = pose[:3, :3] @ normal
                offset_m += float(normal @ pose[:3, 3])
            height_m = float(normal @ shot.viewpoint_m) - offset_m
            sides[number] = side = -1 if height_m < 0.0 else 1
            planes[number] = *(side * normal), abs(height_m)
        return planes, sides

    def _draw_view(self, number: int, shot: ScenePoses) -> None:
        """Draw the view in a mirror."""
        normal, height_m = self._planes[number, :3], self._planes[number, 3]
        mirrored = shot.world_from_rig.copy()
        mirrored[:3, :3] -= 2.0 * np.outer(normal, normal @ mirrored[:3, :3])
        mirrored[:3, 3] -= 2.0 * height_m * normal
        self._owners.use(_OWNERS_UNIT)
        self._window.value = number + 1
        self._state.use(self._depth_target, has_depth=True)
        with self._state.setting_depth():
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
        self._state.use(self._target, has_depth=True)
        plane = np.array((*normal, -height_m, self._spreads[number]))
        self._view.draw(self._target, (shot._replace(world_from_rig=mirrored),), plane)


class _OwnerProgram(ItemProgram):
    """Draws, in each texel, the number of the mirror that it shows.

    Args:
        numbers: (n,) numbers of the triangles' mirrors; 0: none.
    """

    def __init__(self, context: moderngl.Context, numbers: Bytes):
        files = "scene/mirror_owner.vert", "scene/mirror_owner.frag"
        super().__init__(build_program(context, *files))
        self._first_triangle = uniform(self.program, "u_first_triangle")
        uniform(self.program, "u_numbers").value = _NUMBERS_UNIT
        rows = -(-len(numbers) // _ROW_TRIANGLES)
        padded = np.zeros((rows, _ROW_TRIANGLES), dtype=np.uint8)
        padded.ravel()[: len(numbers)] = numbers
        self._numbers = texture_2d(context, (_ROW_TRIANGLES, rows), 1, padded, dtype="u1")

    def bind_material(self, item: DrawItem) -> None:
        """Bind the table of numbers."""
        self._numbers.use(_NUMBERS_UNIT)

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw `count` indices of a vertex array; `first_id`: its first triangle, and number."""
        self._first_triangle.value = first_id
        array.render(moderngl.TRIANGLES, vertices=count, first=3 * first_id)


def _facet_slope(material: Material) -> float:
    """Squared roughness of a mirror's smoothest lobe, the mean over its map; 0: it is smooth."""
    roughness = material.roughness
    if material.metallic_roughness_map is not None:
        roughness *= float(material.metallic_roughness_map.pixels[..., 1].mean()) / 255.0
    if material.clearcoat:
        roughness = min(roughness, material.clearcoat_roughness)
    is_rough = SurfaceKind.ROUGH_MIRROR in kind_of(material) and roughness > MIN_ROUGHNESS
    return roughness**2 if is_rough else 0.0
