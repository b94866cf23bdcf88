"""Drawers of items one by one, and of the sky."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from typing import Generic, TypeVar

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats, Floats32, Indices
from omnisim.rendering.atlas.tile_plan import TilePlan, clips_from_rig
from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.gpu_textures import AnyTexture
from omnisim.rendering.opengl.gl.shader_files import (
    build_program,
    columns_first,
    find_uniform,
    set_uniforms,
)
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.world.draw_item import DrawItem, InstanceTransforms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.scene_textures import MAP_UNITS, bind_maps
from omnisim.rendering.opengl.world.vertex_format import vertex_array


class ItemProgram:
    """Program that draws items; uniforms that it lacks, as those of clusters do, are skipped."""

    def __init__(self, program: moderngl.Program):
        self.program = program
        found = {name: find_uniform(program, name) for name in program}
        self._uniforms = {name: uniform for name, uniform in found.items() if uniform is not None}

    def write(self, name: str, values: ArrayLike) -> None:
        """Set a uniform of floats, unless the program lacks it."""
        if name in self._uniforms:
            self._uniforms[name].write(np.asarray(values, dtype=np.float32))

    def set_matrices(
        self, clip_from_mesh: Floats32, viewpoint_from_mesh: Floats32, normal_from_mesh: Floats32
    ) -> None:
        """Set the matrices (4, 4) and (3, 3), column-major, that the next draw calls need."""
        self.write("u_clip_from_mesh", clip_from_mesh)
        self.write("u_viewpoint_from_mesh", viewpoint_from_mesh)
        self.write("u_normal_from_mesh", normal_from_mesh)

    def bind_material(self, item: DrawItem) -> None:
        """Bind an item's material for the next draw calls."""
        material, reflectance = item.material, item.texture_layer.reflectance
        self.write("u_base_color", material.base_color)
        self.write("u_alpha_cutoff", [material.hit_cutoff])
        if "u_record" in self._uniforms and reflectance is not None:
            self._uniforms["u_record"].value = reflectance.record
            bind_maps(reflectance.maps)
        if "u_texture" in self._uniforms:
            item.texture.use(0)

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw `count` indices of a vertex array; the first triangle gets the ID `first_id`."""
        array.render(moderngl.TRIANGLES, vertices=count, first=first)


# Texture units and defines of programs that read materials: table, vertex details, maps.

MAPS = (  # in the order of `Material.maps`
    "metallic_roughness_map", "normal_map", "occlusion_map", "emissive_map",
    "specular_map", "clearcoat_map", "clearcoat_normal_map",
)  # fmt: skip
_MAP_UNITS = {f"u_{name}": unit for unit, name in zip(MAP_UNITS, MAPS, strict=True)}
_DETAILS_UNIT, _MATERIALS_UNIT, _ITEM_DETAILS_UNIT = 10, 11, 12


def map_units() -> list[tuple[int, str]]:
    """Texture units and sampler names of the maps, in the order of `Material.maps`."""
    return [(unit, name) for name, unit in _MAP_UNITS.items()]


def reflectance_defines(
    maps: Sequence[bool] | None, second_coordinates: bool = False
) -> tuple[str, ...]:
    """Defines of a material with the given maps; None: a matte material."""
    if maps is None:
        return ()
    has_maps = [name for name, is_there in zip(MAPS, maps, strict=True) if is_there]
    return (
        "REFLECTANCE",
        *(name.upper() for name in has_maps),
        *(["TEXTURE_COORDINATES"] if has_maps else []),
        *(["SECOND_COORDINATES"] if second_coordinates else []),
    )


def connect_material(program: moderngl.Program, clustered: bool) -> None:
    """Set the texture units of a program's material maps and tables."""
    details = _DETAILS_UNIT if clustered else _ITEM_DETAILS_UNIT
    tables = {"u_materials": _MATERIALS_UNIT, "u_vertex_details": details}
    set_uniforms(program, {**_MAP_UNITS, **tables})


def material_tables(buffers: SceneBuffers, has_item_details: bool) -> dict[int, AnyTexture]:
    """Tables of materials and vertex details by unit, on request also of single items."""
    clusters, materials = buffers.clustered_geometry, buffers.materials.texture
    if materials is None:
        return {}
    tables: dict[int, AnyTexture] = {_MATERIALS_UNIT: materials}
    if has_item_details and buffers.item_details is not None:
        tables[_ITEM_DETAILS_UNIT] = buffers.item_details
    if clusters is not None and clusters.details is not None:
        tables[_DETAILS_UNIT] = clusters.details
    return tables


# Draws a scene's items one by one with the programs of one pass.

P = TypeVar("P", bound=ItemProgram)


class SceneDrawer(Generic[P]):
    """Draws items, each with the program of its material.

    Args:
        items: (n,) drawable items.
        find_program: function from an item to its program.
        id_of_item: function from an item to the ID of its first triangle.
        both_sides: draw back faces, too.
        is_mirrored: the rig is mirrored, see `GlState.mirrored`.
        indices: another index buffer of the items than the scene's.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        items: Indices,
        find_program: Callable[[DrawItem], P],
        id_of_item: Mapping[int, int],
        both_sides: bool = False,
        is_mirrored: bool = False,
        indices: moderngl.Buffer | None = None,
    ):
        self._both_sides, self._is_mirrored = both_sides, is_mirrored
        self._buffers, self._items = buffers, buffers.draw_items
        self._state = GlState()
        self._programs = {
            index: find_program(buffers.draw_items[index]) for index in items.tolist()
        }
        self.programs = set(self._programs.values())
        self._own_programs, self._replaced = self._programs, frozenset[int]()
        self._arrays: dict[P, moderngl.VertexArray] = {}
        if items.size:  # otherwise the scene's own buffers may never be needed
            vertices, own_indices = buffers.buffers_of(items)
            self._of_arrays = vertices, own_indices if indices is None else indices
            self._make_arrays()
        self._id_of_item = id_of_item
        self._transforms = np.empty((0, 4, 4), np.float32), np.empty((0, 3, 3), np.float32)

    def _make_arrays(self) -> None:
        """Make the vertex arrays of programs that have none."""
        for program in self.programs - self._arrays.keys():
            self._arrays[program] = vertex_array(
                self._buffers.context,
                program.program,
                *self._of_arrays,
                self._buffers.light_coordinates,
            )

    def use(self, replaced: Set[int], find_program: Callable[[DrawItem], P]) -> None:
        """Draw some of the items, by their indices, with other programs; all others with their own.

        Args:
            find_program: function from such an item to its program.
        """
        replaced = replaced & self._own_programs.keys()
        if replaced == self._replaced:
            return
        others = {index: find_program(self._items[index]) for index in sorted(replaced)}
        self._programs, self._replaced = self._own_programs | others, frozenset(replaced)
        self.programs |= set(others.values())
        self._make_arrays()

    def begin(self, transforms: InstanceTransforms) -> None:
        """Begin a frame."""
        self._transforms = (
            columns_first(transforms.viewpoint_from_mesh),
            columns_first(transforms.normal_from_mesh),
        )

    def draw_item(self, index: int, clip_from_mesh: Floats32) -> None:
        """Draw an item with its matrix (4, 4), column-major."""
        item, program = self._items[index], self._programs[index]
        viewpoint_from_mesh, normal_from_mesh = self._transforms
        if item.flips_winding:
            self._state.set_mirrored(not self._is_mirrored)
        self._state.set_culling(not (item.material.double_sided or self._both_sides))
        program.set_matrices(clip_from_mesh, viewpoint_from_mesh[index], normal_from_mesh[index])
        program.bind_material(item)
        first_id = self._id_of_item.get(index, 0)
        program.draw(self._arrays[program], item.first, item.count, first_id)
        if item.flips_winding:
            self._state.set_mirrored(self._is_mirrored)


# Draws an environment map behind the geometry in the tiles of an atlas.


SKY_UNIT = 0
_INSTANCE = np.dtype(  # inputs of shaders/scene/sky.vert
    [("direction_from_corner", "<f4", (3, 3)), ("scale", "<f4", 2), ("shift", "<f4", 2)]
)


class SkyPass:
    """Draws the sky where nothing opaque is; `cameras`: layers drawn together; None: no layers."""

    def __init__(
        self,
        context: moderngl.Context,
        sky: moderngl.Texture,
        plan: TilePlan,
        cameras: int | None = None,
    ):
        self._sky, self._state = sky, GlState()
        defines = () if cameras is None else ("LAYERED",)
        program = build_program(context, "scene/sky.vert", "scene/sky.frag", defines)
        program["u_sky"] = SKY_UNIT
        if cameras is not None:
            program["u_tiles"] = len(plan.tiles)
        self._cameras = cameras or 1
        self.use_plan(plan)
        self._buffer = written_buffer(context, self._instances)
        inputs = "in_direction_from_corner", "in_placement"
        self._tiles = context.vertex_array(program, [(self._buffer, "9f 4f/i", *inputs)])

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        clips = clips_from_rig(plan, 1.0, np.inf)[:, [0, 1, 3], :3]
        self._rig_from_corners = np.linalg.inv(clips).astype(np.float64)
        self._instances = np.zeros((self._cameras, len(plan.tiles)), dtype=_INSTANCE)
        atlas_px = np.array([plan.width_px, plan.height_px])
        scale = plan.rectangles_px[:, 2:] / atlas_px
        self._instances["scale"] = scale
        self._instances["shift"] = 2.0 * plan.rectangles_px[:, :2] / atlas_px + scale - 1.0

    def draw(self, worlds_from_rigs: Floats) -> None:
        """Draw from poses (cameras, 4, 4), with the state of `GlState.drawing`; keep the depth."""
        instances = self._instances[: len(worlds_from_rigs)]
        directions = worlds_from_rigs[:, None, :3, :3] @ self._rig_from_corners
        instances["direction_from_corner"] = np.swapaxes(directions, -1, -2)  # column-major
        self._buffer.write(instances)
        self._state.bind_texture(SKY_UNIT, self._sky.glo)
        # at the depth of the sky, which is the target's clear depth
        with self._state.where_clear():
            self._tiles.render(moderngl.TRIANGLE_STRIP, vertices=4, instances=instances.size)
