"""Draws a scene's items one by one with the programs of one pass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

import moderngl
import numpy as np

from omnisim.core.array_types import Float32s, Indices
from omnisim.rendering.opengl.drawing.item_uniforms import ItemProgram
from omnisim.rendering.opengl.geometry.draw_item import DrawItem, InstanceTransforms
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.geometry.vertex_format import vertex_array
from omnisim.rendering.opengl.gl.shader_files import columns_first
from omnisim.rendering.opengl.gl.state import GlState

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
        self._both_sides = both_sides
        self._front_faces = ("ccw", "cw") if is_mirrored else ("cw", "ccw")
        self._context, self._items = buffers.context, buffers.draw_items
        self._state = GlState()
        self._programs = {
            index: find_program(buffers.draw_items[index]) for index in items.tolist()
        }
        self.programs = set(self._programs.values())
        self._arrays: dict[P, moderngl.VertexArray] = {}
        if items.size:  # otherwise the scene's own buffers may never be needed
            vertices, own_indices = buffers.buffers_of(items)
            indices = own_indices if indices is None else indices
            self._arrays = {
                one: vertex_array(
                    buffers.context, one.program, vertices, indices, buffers.light_coordinates
                )
                for one in self.programs
            }
        self._id_of_item = id_of_item
        self._transforms = np.empty((0, 4, 4), np.float32), np.empty((0, 3, 3), np.float32)

    def begin(self, transforms: InstanceTransforms) -> None:
        """Begin a frame."""
        self._transforms = (
            columns_first(transforms.viewpoint_from_mesh),
            columns_first(transforms.normal_from_mesh),
        )

    def draw_item(self, index: int, clip_from_mesh: Float32s) -> None:
        """Draw an item with its matrix (4, 4), column-major."""
        item, program = self._items[index], self._programs[index]
        viewpoint_from_mesh, normal_from_mesh = self._transforms
        if item.flips_winding:
            self._context.front_face = self._front_faces[1]
        self._state.set_culling(not (item.material.double_sided or self._both_sides))
        program.set_matrices(clip_from_mesh, viewpoint_from_mesh[index], normal_from_mesh[index])
        program.bind_material(item)
        first_id = self._id_of_item.get(index, 0)
        program.draw(self._arrays[program], item.first, item.count, first_id)
        if item.flips_winding:
            self._context.front_face = self._front_faces[0]
