"""Visibility pass: IDs of triangles instead of colors, from which labels and hits follow.

A fragment knows only its triangle's position within the draw call. All triangles are therefore
numbered in drawing order, first those of single items, then those of clusters. The atlas holds
these IDs; the table maps each to draw item and triangle. `RayHitPass` then intersects the rays of
pixels with the triangles that the texels around them show.
Source: Burns & Hunt, "The visibility buffer", 2013.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Indices
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails
from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.gl.buffers import gpu_allocation
from omnisim.rendering.opengl.gl.framebuffers import (
    COLORS,
    DEPTH,
    attach_layer,
    attach_texture,
    framebuffer,
)
from omnisim.rendering.opengl.gl.gpu_textures import (
    bind_textures,
    depth_array,
    depth_texture,
    texture_2d,
    texture_array,
)
from omnisim.rendering.opengl.gl.shader_files import build_program, find_uniform, uniform
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.scene_view import TileRenderer, VirtualCameras
from omnisim.rendering.opengl.surfaces.cluster_drawer import BucketProgram
from omnisim.rendering.opengl.surfaces.scene_drawer import (
    ItemProgram,
    SceneDrawer,
    connect_material,
    material_tables,
    reflectance_defines,
)
from omnisim.rendering.opengl.world.clustered_geometry import Bucket, ClusteredGeometry
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.geometry_store import ROW_BITS
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.scene_textures import TextureArray
from omnisim.scene.surface_kind import SurfaceKind


class VisibilityPass:
    """Renders triangle IDs of all tiles into an atlas; GPU resources are created once.

    It shares draw loop, sides, frusta and holes with the image (`CubePass`). A blended surface is
    drawn where its alpha reaches `BLENDED_CUTOFF`.

    Args:
        buffers: scene and dynamic objects; other passes may share them.
        plan: tiles of the atlas.
        cameras: virtual cameras; only depth range, sides and hidden instances matter here.
        details: details that can be drawn as well, if textures change them.
        layers: maximum number of cameras, of a batch, that are drawn together, each into a layer of
            all atlases; None: one camera, and atlases without layers.
        like: pass of the same scene, whose programs and IDs are used, too.

    Attributes:
        id_atlas: integer texture, 1 + ID of the triangle; 0: nothing visible.
        triangle_ids: table of the IDs.
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
        layers: int | None = None,
        like: VisibilityPass | None = None,
    ):
        context, size = buffers.context, (plan.width_px, plan.height_px)
        self.buffers, self.cameras, self._state = buffers, cameras, GlState()
        self.plan = self._first_plan = plan
        self._layers = layers
        formats = {"u_triangle_ids": (1, "u4"), **atlas_formats(details)}
        self.depth: moderngl.Texture | moderngl.TextureArray
        if layers is None:
            with gpu_allocation(
                f"ground truth by an atlas of {size[0]} × {size[1]} px", "make the image smaller"
            ):
                self._atlases: dict[str, moderngl.Texture | moderngl.TextureArray] = {
                    name: texture_2d(context, size, components, dtype=dtype)
                    for name, (components, dtype) in formats.items()
                }
                self.depth = depth_texture(context, size)
        else:
            with gpu_allocation(f"ground truth of {layers} images", "render fewer at once"):
                self._atlases = {
                    name: texture_array(context, (*size, layers), components, dtype=dtype)
                    for name, (components, dtype) in formats.items()
                }
                self.depth = depth_array(context, (*size, layers))
        self.id_atlas = self._atlases["u_triangle_ids"]
        if like is None:
            self._compiled: dict[VisibilityVariant, VisibilityProgram] = {}
            self.triangle_ids = TriangleIds(buffers, self._one_by_one())
        else:
            self._compiled, self.triangle_ids = like._compiled, like.triangle_ids
        self._drawn: dict[HitDetails, _Drawing] = {}
        self._drawing(details.of_texels if layers else NO_DETAILS)  # before the first frame

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self.triangle_ids.refresh(self._one_by_one())
        self._drawn = {}
        self._drawing(NO_DETAILS)

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        if plan is not self.plan:
            self.plan = plan
            for drawing in self._drawn.values():
                drawing.tiles.use_plan(plan)

    def _drawing(self, details: HitDetails) -> _Drawing:
        """Targets and drawers of IDs and details, created on first use."""
        if details not in self._drawn:
            items, context = self._one_by_one(), self.buffers.context
            atlases = [self.id_atlas, *(self._atlases[name] for name in atlas_formats(details))]
            if isinstance(self.depth, moderngl.Texture):
                target = layer = framebuffer(context, atlases, self.depth)
            else:
                target, layer = framebuffer(context, atlases), framebuffer(context, atlases)
                attach_texture(target.glo, self.depth.glo, DEPTH)
            drawer = SceneDrawer(
                self.buffers,
                items,
                partial(self._item_program, details),
                self.triangle_ids.first_of_item,
                self.cameras.both_sides,
                indices=self.buffers.triangles.indices,
            )
            tiles = TileRenderer(
                self.buffers, self._first_plan, self.cameras, items,
                partial(self._bucket_program, details), self.depth, max_cameras=self._layers or 1,
            )  # fmt: skip
            if self.plan is not self._first_plan:
                tiles.use_plan(self.plan)
            self._drawn[details] = _Drawing(target, layer, [*atlases, self.depth], drawer, tiles)
        return self._drawn[details]

    def _one_by_one(self) -> Indices:
        """Draw items outside of clusters."""
        items = self.buffers.draw_items
        shown = self.buffers.shown_one_by_one(self.cameras.hidden)
        # a material may be so transparent that no texel shows it: textures only reduce alpha
        alphas = np.array([item.material.base_color[3] for item in items])
        shown &= alphas >= np.array([item.material.hit_cutoff for item in items])
        return np.flatnonzero(shown)

    def _item_program(self, details: HitDetails, item: DrawItem) -> VisibilityProgram:
        variant = VisibilityVariant(bool(item.kind & SurfaceKind.HOLES), details)
        found = item.texture_layer.reflectance
        if found is not None:
            variant = variant.with_maps(found.maps, found.second_coordinates)
        return self._program(variant)

    def _bucket_program(self, details: HitDetails, bucket: Bucket) -> BucketProgram:
        """Program of a bucket's IDs and details."""
        is_layered, is_textured = self._layers is not None, bucket.array is not None
        is_cutout = SurfaceKind.CUTOUT in bucket.kind
        variant = VisibilityVariant(is_cutout, details, is_textured, True, is_layered)
        program = self._program(variant.with_maps(bucket.maps, bucket.second_coordinates))
        program.first_plus_one.value = self.triangle_ids.first_of_clusters + 1
        return BucketProgram(program.program, program.sampler(bucket.array), program.first_command)

    def _program(self, variant: VisibilityVariant) -> VisibilityProgram:
        if variant not in self._compiled:
            self._compiled[variant] = VisibilityProgram(self.buffers.context, variant)
        return self._compiled[variant]

    @property
    def culling_bytes(self) -> int:
        """Size of the buffers for culling, draw commands included, bytes."""
        return self._drawing(NO_DETAILS).tiles.culling_bytes

    def render(self, shots: Sequence[ScenePoses], details: HitDetails = NO_DETAILS) -> None:
        """Render all tiles for each shot: poses of the rig and of the dynamic objects."""
        target, layer, attached, drawer, tiles = self._drawing(details.of_texels)
        if details.materials:
            bind_textures(material_tables(self.buffers, has_item_details=True))
        self.buffers.deform(shots[0].world_from_objects, triangles=True)
        tiles.begin(target, [None, *[(0.0, 0.0, 0.0, 0.0)] * (len(attached) - 2)])
        with self._state.drawing():
            tiles.draw_clusters(target, shots)
            for number, shot in enumerate(shots if tiles.has_items else ()):
                if layer is not target:
                    attachments = (*range(COLORS, COLORS + len(attached) - 1), DEPTH)
                    for attachment, atlas in zip(attachments, attached, strict=True):
                        attach_layer(layer.glo, atlas.glo, number, attachment)
                    self._state.use(layer)
                tiles.draw_one_by_one(layer, shot, drawer)
        for program in self._compiled.values():
            program.end()

    def bind_details(self, details: HitDetails, units: Mapping[str, int]) -> None:
        """Bind the atlases of details to units, by sampler name."""
        for name in atlas_formats(details):
            self._atlases[name].use(units[name])


class _Drawing(NamedTuple):
    """Targets and drawers of IDs and details."""

    target: moderngl.Framebuffer  # all layers
    layer: moderngl.Framebuffer  # one layer, attached when it is drawn; the target without layers
    atlases: list[moderngl.Texture | moderngl.TextureArray]  # what is attached, depth last
    drawer: SceneDrawer[VisibilityProgram]
    tiles: TileRenderer


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


class VisibilityVariant(NamedTuple):
    """Compiled version of the shader."""

    holes: bool  # discard fragments with alpha below a cutoff
    details: HitDetails  # details to draw as well
    textured: bool = True  # materials may have a texture
    clustered: bool = False  # True: draws clusters; False: single items
    layered: bool = False  # several cameras, one target layer each
    # True for each of `Material.maps` that it has; None: matte, or materials are not drawn
    maps: tuple[bool, ...] | None = None
    second_coordinates: bool = False  # True if a map uses the second texture coordinates

    def with_maps(
        self, maps: Sequence[TextureArray | None] | None, second_coordinates: bool
    ) -> VisibilityVariant:
        """Variant for a material with these maps, see `Reflectance`; None: matte."""
        if maps is None or not self.details.materials:
            return self
        has_maps = tuple(texture is not None for texture in maps)
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
            self._samplers[texture.repeat_x, texture.repeat_y].use(0)

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw `count` indices of a vertex array; the first triangle gets the ID `first_id`."""
        self.first_plus_one.value = first_id + 1
        array.render(moderngl.TRIANGLES, vertices=count, first=first)

    def end(self) -> None:
        """Restore the textures' own filters."""
        for sampler in self._samplers.values():
            sampler.clear(0)
