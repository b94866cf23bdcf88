"""Draws items and clusters of a scene, by the programs of one pass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, Protocol, TypeVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.scene.draw_item import InstanceTransforms
from omnisim.gpu.scene.light_baking import Shading
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.scene.static_drawer import TileCalls
from omnisim.gpu.scene.vertex_format import vertex_array
from omnisim.gpu.uniforms import columns_first
from omnisim.scene.model import Material

_INDEX_BYTES = 12  # of a triangle
_NORMAL_FROM_ANCHOR = columns_first(np.eye(3))


class DrawProgram(Protocol):
    """Program that draws triangles of the scene."""

    @property
    def program(self) -> moderngl.Program:
        """Program of OpenGL."""

    def set_matrices(
        self,
        clip_from_mesh: NDArray[np.float32],
        viewpoint_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Set the matrices (4, 4) and (3, 3), columns first, of the next draw calls."""

    def bind_material(self, material: Material, texture: moderngl.Texture) -> None:
        """Bind the material of the next draw calls."""

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw some of a vertex array's indices; the first triangle has this ID."""


P = TypeVar("P", bound=DrawProgram)


class SceneDrawer(Generic[P]):
    """Draws items and clusters, each by the program of its material.

    Args:
        buffers: the scene and its dynamic objects.
        indices: index buffer of the items.
        find_program: of a material and the shading of its triangles.
        id_of_item: ID of the first triangle of an item.
        assign_ids: gives IDs to the triangles of clusters (n,), and returns the first.
        both_sides: draw back faces, too.

    Attributes:
        programs: all of them.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        indices: moderngl.Buffer,
        find_program: Callable[[Material, Shading], P],
        id_of_item: Mapping[int, int],
        assign_ids: Callable[[NDArray[np.intp]], int],
        both_sides: bool = False,
    ):
        self._both_sides = both_sides
        self._context, self._items = buffers.context, buffers.draw_items
        self._item_programs = [find_program(one.material, Shading.UNKNOWN) for one in self._items]
        self._item_arrays = {
            one: vertex_array(buffers.context, one.program, buffers.vertices, indices)
            for one in set(self._item_programs)
        }
        self._id_of_item, self._assign_ids, self._first_id = id_of_item, assign_ids, 0
        self._transforms = np.empty((0, 4, 4), np.float32), np.empty((0, 3, 3), np.float32)
        self._geometry = geometry = buffers.static_geometry
        self._batches = () if geometry is None else geometry.batches
        self._batch_programs = [find_program(one.material, one.shading) for one in self._batches]
        self.programs = {*self._item_programs, *self._batch_programs}
        self._indices = buffers.context.buffer(reserve=_INDEX_BYTES, dynamic=True)
        self._batch_arrays: dict[P, moderngl.VertexArray] = {}

    def begin(self, transforms: InstanceTransforms) -> None:
        """Begin a frame."""
        self._transforms = (
            columns_first(transforms.viewpoint_from_mesh),
            columns_first(transforms.normal_from_mesh),
        )

    def draw_item(self, index: int, clip_from_mesh: NDArray[np.float32]) -> None:
        """Draw an item by its matrix (4, 4), columns first."""
        item, program = self._items[index], self._item_programs[index]
        viewpoint_from_mesh, normal_from_mesh = self._transforms
        self._context.front_face = "ccw" if item.flips_winding else "cw"
        self._cull_back_faces(item.material)
        program.set_matrices(clip_from_mesh, viewpoint_from_mesh[index], normal_from_mesh[index])
        program.bind_material(item.material, item.texture)
        first_id = self._id_of_item.get(index, 0)
        program.draw(self._item_arrays[program], item.first, item.count, first_id)

    def load_clusters(self, clusters: NDArray[np.intp]) -> None:
        """Put the triangles of clusters (n,) into the index buffer, in this order."""
        if self._geometry is None:
            return
        self._first_id = self._assign_ids(clusters)
        # clipping, which never happens, is quicker than to look whether one is out of range
        triangles = self._geometry.triangles_of(clusters)
        indices = np.take(self._geometry.triangles, triangles, mode="clip")
        if indices.nbytes > self._indices.size or not self._batch_arrays:
            size = max(2 * indices.nbytes, self._indices.size)
            self._indices = self._context.buffer(reserve=size, dynamic=True)
            self._batch_arrays = {
                one: vertex_array(
                    self._context, one.program, self._geometry.vertices, self._indices
                )
                for one in set(self._batch_programs)
            }
        self._indices.write(indices)

    def draw_clusters(self, tile: TileCalls) -> None:
        """Draw the calls of a tile."""
        self._context.front_face = "cw"
        matrices = tile.clip_from_anchor, tile.viewpoint_from_anchor, _NORMAL_FROM_ANCHOR
        placed, double_sided = set(), None
        for number, first, count in tile.calls:
            batch, program = self._batches[number], self._batch_programs[number]
            if program not in placed:
                placed.add(program)
                program.set_matrices(*matrices)
            if batch.material.double_sided is not double_sided:
                double_sided = batch.material.double_sided
                self._cull_back_faces(batch.material)
            program.bind_material(batch.material, batch.texture)
            program.draw(self._batch_arrays[program], first, count, self._first_id + first // 3)

    def _cull_back_faces(self, material: Material) -> None:
        shows_back = material.double_sided or self._both_sides
        toggle = self._context.disable if shows_back else self._context.enable
        toggle(moderngl.CULL_FACE)
