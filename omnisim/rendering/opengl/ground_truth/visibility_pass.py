"""Visibility pass: triangle IDs instead of colors."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.array_types import Float64s, Indices
from omnisim.core.world import Poses
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.drawing.cluster_drawer import BucketProgram
from omnisim.rendering.opengl.drawing.item_uniforms import (
    ItemProgram,
    connect_material,
    material_tables,
    reflectance_defines,
)
from omnisim.rendering.opengl.drawing.scene_drawer import SceneDrawer
from omnisim.rendering.opengl.drawing.tile_renderer import TileRenderer, VirtualCameras
from omnisim.rendering.opengl.geometry.clustered_geometry import Bucket, ClusteredGeometry
from omnisim.rendering.opengl.geometry.draw_item import DrawItem
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.geometry.triangle_table import ROW_BITS
from omnisim.rendering.opengl.gl.framebuffers import (
    COLORS,
    DEPTH,
    attach_layer,
    attach_texture,
    framebuffer,
)
from omnisim.rendering.opengl.gl.gpu_textures import bind_textures, depth_texture, texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.shader_files import build_program, find_uniform, uniform
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.materials.scene_textures import TextureArray

# Pose (4, 4) of a camera's rig, and poses of the dynamic objects.
CameraPoses = tuple[Float64s, Sequence[Float64s]]


class Drawers(NamedTuple):
    """Drawers of single items and of tiles."""

    drawer: SceneDrawer[VisibilityProgram]
    tiles: TileRenderer


class VisibilityPass:
    """Renders triangle IDs of all tiles into an atlas; GPU resources are created once.

    It shares draw loop, sides, frusta and holes with the image (`CubePass`). A blended surface is
    drawn where its alpha reaches `BLENDED_CUTOFF`.

    Args:
        cameras: virtual cameras; only depth range, sides and hidden instances matter here.
        details: details that can be drawn as well, if textures change them.

    Attributes:
        buffers, plan, cameras, near_m, far_m, both_sides: see the arguments.
        id_atlas: integer texture, 1 + ID of the triangle; 0: nothing visible.
        detail_atlases: textures of base colors (square root of linear RGB) and of materials, by
            sampler name.
        depth: depth of the last rendered atlas.

    Raises:
        GraphicsError: the atlas does not fit on the GPU.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        plan: TilePlan,
        cameras: VirtualCameras,
        details: HitDetails = NO_DETAILS,
    ):
        context = buffers.context
        self.buffers, self._state = buffers, GlState()
        self.plan = self._first_plan = plan
        self.near_m, self.far_m = cameras.near_m, cameras.far_m
        self.both_sides = cameras.both_sides
        size = (plan.width_px, plan.height_px)
        with gpu_allocation(
            f"ground truth by an atlas of {size[0]} × {size[1]} px", "make the image smaller"
        ):
            self.id_atlas = texture_2d(context, size, 1, dtype="u4")
            self.detail_atlases = {
                name: texture_2d(context, size, components, dtype=dtype)
                for name, (components, dtype) in atlas_formats(details).items()
            }
            self.depth = depth_texture(context, size)
        self._targets: dict[HitDetails, moderngl.Framebuffer] = {}
        self.cameras = cameras
        self._compiled: dict[VisibilityVariant, VisibilityProgram] = {}
        self.triangle_ids = TriangleIds(buffers, self._one_by_one())
        self._draw_by_ids()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self.triangle_ids.refresh(self._one_by_one())
        self._draw_by_ids()

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        if plan is not self.plan:
            self.plan = plan
            for one in self._drawn.values():
                one.tiles.use_plan(plan)

    def _draw_by_ids(self) -> None:
        self._drawn: dict[HitDetails, Drawers] = {}
        self.drawers(NO_DETAILS)

    def drawers(self, details: HitDetails) -> Drawers:
        """Drawers of IDs and details, created on first use."""
        if details not in self._drawn:
            items = self._one_by_one()
            drawer = SceneDrawer(
                self.buffers,
                items,
                partial(self._item_program, details),
                self.triangle_ids.first_of_item,
                self.cameras.both_sides,
                indices=self.buffers.triangles.indices,
            )
            find_program = partial(self.bucket_program, details)
            tiles = TileRenderer(
                self.buffers, self._first_plan, self.cameras, items, find_program, self.depth
            )
            if self.plan is not self._first_plan:
                tiles.use_plan(self.plan)
            self._drawn[details] = Drawers(drawer, tiles)
        return self._drawn[details]

    def _target(self, details: HitDetails) -> moderngl.Framebuffer:
        """Target of IDs and details, created on first use."""
        if details not in self._targets:
            atlases = self._atlases(details)
            self._targets[details] = framebuffer(self.buffers.context, atlases, self.depth)
        return self._targets[details]

    def _atlases(self, details: HitDetails) -> list[moderngl.Texture]:
        return [self.id_atlas, *(self.detail_atlases[name] for name in atlas_formats(details))]

    def _one_by_one(self) -> Indices:
        """Draw items outside of clusters."""
        items, cameras = self.buffers.draw_items, self.cameras
        shown = self.buffers.shown_one_by_one(cameras.hidden)
        # a material may be so transparent that no texel shows it: textures only reduce alpha
        alphas = np.array([one.material.base_color[3] for one in items])
        shown &= alphas >= np.array([one.material.hit_cutoff for one in items])
        return np.flatnonzero(shown)

    def _item_program(self, details: HitDetails, item: DrawItem) -> VisibilityProgram:
        variant = VisibilityVariant(item.material.hit_cutoff > 0.0, details)
        found = item.texture_layer.reflectance
        if found is not None:
            variant = variant.with_maps(found.maps, found.second_coordinates)
        return self._program(variant)

    def draw_items(
        self,
        poses: Sequence[CameraPoses],
        layers: Sequence[moderngl.TextureArray],
        details: HitDetails,
    ) -> None:
        """Draw the items outside of clusters into layers of IDs, details and depth.

        Needs the state of `GlState.drawing`.
        """
        details = details.of_texels
        target, (drawer, tiles) = self._target(details), self.drawers(details)
        if not tiles.has_items:
            return
        self.bind_materials(details)
        own = [*self._atlases(details), self.depth]
        attachments = [*range(COLORS, COLORS + len(layers) - 1), DEPTH]
        try:
            for number, one in enumerate(poses):
                for attachment, layer in zip(attachments, layers, strict=True):
                    attach_layer(target.glo, layer.glo, number, attachment)
                self._state.use(target)
                tiles.draw_one_by_one(target, *one, drawer)
        finally:
            for attachment, texture in zip(attachments, own, strict=True):
                attach_texture(target.glo, texture.glo, attachment)

    @property
    def culling_bytes(self) -> int:
        """Size of the buffers for culling, draw commands included, bytes."""
        return self.drawers(NO_DETAILS).tiles.culling_bytes

    def bucket_program(
        self, details: HitDetails, bucket: Bucket, layered: bool = False
    ) -> BucketProgram:
        """Program of a bucket's IDs and details."""
        variant = VisibilityVariant(bucket.cutoff, details, bucket.array is not None, True, layered)
        variant = variant.with_maps(bucket.maps, bucket.second_coordinates)
        program = self._program(variant)
        program.first_plus_one.value = self.triangle_ids.first_of_clusters + 1
        return BucketProgram(program.program, program.sampler(bucket.array), program.first_command)

    def bind_materials(self, details: HitDetails) -> None:
        """Bind the material tables, if materials are drawn."""
        if details.materials:
            bind_textures(material_tables(self.buffers, has_item_details=True))

    def end(self) -> None:
        """Restore the state that later passes expect."""
        for program in self._compiled.values():
            program.end()

    def _program(self, variant: VisibilityVariant) -> VisibilityProgram:
        if variant not in self._compiled:
            self._compiled[variant] = VisibilityProgram(self.buffers.context, variant)
        return self._compiled[variant]

    def render(
        self,
        world_from_rig: Float64s,
        world_from_objects: Poses = (),
        details: HitDetails = NO_DETAILS,
    ) -> None:
        """Render all tiles from a pose (4, 4), with the dynamic objects at their poses."""
        details = details.of_texels
        target, (drawer, tiles) = self._target(details), self.drawers(details)
        self.bind_materials(details)
        self.buffers.deform(world_from_objects, triangles=True)
        tiles.begin(target, clear_colors(details))
        with self._state.drawing():
            tiles.draw(target, world_from_rig, world_from_objects, drawer)
        self.end()


class VisibilityVariant(NamedTuple):
    """Compiled version of the shader."""

    holes: bool  # discard fragments with alpha below a cutoff
    details: HitDetails  # details to draw as well
    textured: bool = True  # materials may have a texture
    clustered: bool = False  # True: draws clusters; False: single items
    layered: bool = False  # several cameras, one target layer each
    # True for each map of the material, in the order of `Material.maps`; None: matte, or
    # materials are not drawn
    maps: tuple[bool, ...] | None = None
    second_coordinates: bool = False  # True if a map uses the second texture coordinates

    def with_maps(
        self, maps: Sequence[TextureArray | None] | None, second_coordinates: bool
    ) -> VisibilityVariant:
        """Variant for a material with these maps, see `Reflectance`; None: matte."""
        if maps is None or not self.details.materials:
            return self
        has_maps = tuple(one is not None for one in maps)
        return self._replace(maps=has_maps, second_coordinates=second_coordinates)

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of the shaders."""
        colored = self.holes or self.details.albedos
        defined = {
            "ALPHA_MASK": self.holes,
            "ALBEDO": self.details.albedos,
            "MATERIALS": self.details.materials,
            "COLORED": colored,
            "TEXTURED": self.textured and colored,
            "CLUSTERED": self.clustered,
            "LAYERED": self.layered,
        }
        names = [name for name, is_defined in defined.items() if is_defined]
        return (*names, *reflectance_defines(self.maps, self.second_coordinates))


def atlas_formats(details: HitDetails) -> dict[str, tuple[int, str]]:
    """Components and type of each detail's atlas, by sampler name."""
    formats = {"u_albedos": (4, "f1")} if details.albedos else {}
    if details.materials:
        formats |= {"u_gloss": (2, "f2"), "u_emission": (4, "f2")}
    return formats


def clear_colors(details: HitDetails) -> list[tuple[float, float, float, float] | None]:
    """Clear color of each atlas; None: the integer atlas of IDs."""
    return [None, *[(0.0, 0.0, 0.0, 0.0)] * len(atlas_formats(details))]


class VisibilityProgram(ItemProgram):
    """Compiled variant with its uniforms.

    Attributes:
        first_plus_one: uniform, 1 + ID of the first triangle.
        first_command: uniform for clusters, index of the first command.
    """

    def __init__(self, context: moderngl.Context, variant: VisibilityVariant):
        folder = "ground_truth/visibility"
        program = build_program(context, f"{folder}.vert", f"{folder}.frag", variant.defines)
        super().__init__(program)
        self.first_plus_one = uniform(program, "u_first_plus_one")
        self.first_command = find_uniform(program, "u_first_command")
        if variant.maps is not None:
            connect_material(program, variant.clustered)
        self._samplers: dict[tuple[bool, bool], moderngl.Sampler] = {}
        if "TEXTURED" in variant.defines:
            program["u_textures" if variant.clustered else "u_texture"] = 0
            # Holes are filtered as in the image. Plain colors need no blend between two levels,
            # which would cost a quarter of the pass.
            minify = moderngl.LINEAR_MIPMAP_NEAREST
            if variant.holes:
                minify = moderngl.LINEAR_MIPMAP_LINEAR
            for repeats in ((False, False), (False, True), (True, False), (True, True)):
                self._samplers[repeats] = context.sampler(
                    *repeats, filter=(minify, moderngl.LINEAR)
                )

    def sampler(self, array: TextureArray | None) -> moderngl.Sampler | None:
        """Sampler of a bucket's textures."""
        if array is None or not self._samplers:
            return None
        return self._samplers[array.array.repeat_x, array.array.repeat_y]

    def bind_material(self, item: DrawItem) -> None:
        """Bind an item's material for the next draw call."""
        super().bind_material(item)
        if self._samplers:
            texture = item.texture
            texture.use(0)
            self._samplers[texture.repeat_x, texture.repeat_y].use(0)

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw `count` indices of a vertex array; the first triangle gets the ID `first_id`."""
        self.first_plus_one.value = first_id + 1
        array.render(moderngl.TRIANGLES, vertices=count, first=first)

    def end(self) -> None:
        """Restore the textures' own filters."""
        for sampler in self._samplers.values():
            sampler.clear(0)


# Triangle IDs (visibility buffer), and the table that resolves them.
#
# A fragment knows only its triangle's position within the draw call. All triangles are therefore
# numbered in drawing order, first those of single items, then those of clusters. The atlas holds
# these IDs; the table maps each to draw item and triangle.
# Source: Burns & Hunt, "The visibility buffer", 2013.
_ROW = 1 << ROW_BITS
_ENTRY = np.dtype([("item_plus_one", "<u4"), ("triangle", "<u4")])


class TriangleIds:
    """Table of triangle IDs: first single items, then clusters.

    Args:
        one_by_one: (n,) items that are drawn one by one.

    Attributes:
        first_of_item: ID of the first triangle of each such item.
        first_of_clusters: ID of the first triangle of the clusters.
        texture: two integers per ID: 1 + draw item, and triangle in the item.
    """

    def __init__(self, buffers: SceneBuffers, one_by_one: Indices):
        self._context, self._buffers = buffers.context, buffers
        self.refresh(one_by_one)

    def refresh(self, one_by_one: Indices) -> None:
        """Renumber after the buffers changed; `one_by_one` are the items outside of clusters."""
        draw_items, geometry = self._buffers.draw_items, self._buffers.clustered_geometry
        items = one_by_one.tolist()
        counts = np.array([draw_items[item].triangles for item in items], dtype=np.int64)
        self.first_of_item = dict(zip(items, (np.cumsum(counts) - counts).tolist(), strict=True))
        entries = _entries(draw_items, items)
        self.first_of_clusters = len(entries)
        if geometry is not None:
            entries = np.concatenate((entries, cluster_triangle_entries(geometry, draw_items)))
        padded = np.zeros(max(1, -(-len(entries) // _ROW)) * _ROW, dtype=_ENTRY)
        padded[: len(entries)] = entries
        self.texture = texture_2d(self._context, (_ROW, len(padded) // _ROW), 2, padded, dtype="u4")


def cluster_triangle_entries(
    geometry: ClusteredGeometry, draw_items: Sequence[DrawItem]
) -> NDArray[np.void]:
    """Table entries (n,) of the clusters' triangles, in drawing order."""
    entries = _entries(draw_items, np.flatnonzero(geometry.contains).tolist())
    return entries[geometry.hierarchy.order]


def _entries(draw_items: Sequence[DrawItem], items: list[int]) -> NDArray[np.void]:
    """Table entries (n,) of the items' triangles."""
    counts = [draw_items[item].triangles for item in items]
    entries = np.empty(sum(counts), dtype=_ENTRY)
    entries["item_plus_one"] = np.repeat(np.array(items, dtype=np.intp) + 1, counts)
    entries["triangle"] = np.concatenate([np.empty(0, int), *map(np.arange, counts)])
    return entries
