"""Numbers for the triangles that are drawn in a frame, and what they stand for.

A fragment knows only how many triangles of its call came before, and a call joins chunks of many
instances. So the calls of a frame number their triangles one after the other, the atlas holds these
numbers, and a table says what they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.clusters import ranges
from omnisim.gpu.ground_truth.triangle_table import ROW_BITS
from omnisim.gpu.scene.scene_buffers import DrawItem
from omnisim.gpu.scene.static_geometry import StaticGeometry

if TYPE_CHECKING:
    from omnisim.gpu.ground_truth.visibility_program import NumberedProgram, VisibilityProgram

_ROW = 1 << ROW_BITS
_SURFACE = np.dtype([("draw_plus_one", "<u4"), ("triangle", "<u4")])


class TriangleIds:
    """What the numbers of a frame are: those of draws that are drawn alone first, then chunks'.

    Args:
        context: where.
        draws: all of the scene.
        alone: (n,) into `draws`.

    Attributes:
        first_of_draw: number of the first triangle of each that is drawn alone.
        texture: two integers a number: 1 + number of the draw, and number of its triangle.
    """

    def __init__(
        self, context: moderngl.Context, draws: Sequence[DrawItem], alone: NDArray[np.intp]
    ):
        self._context = context
        surfaces = [_surfaces_of(draws[index], index) for index in alone]
        counts = np.array([len(part) for part in surfaces], dtype=np.int64)
        firsts = np.cumsum(counts) - counts
        self.first_of_draw = dict(zip(alone.tolist(), firsts.tolist(), strict=True))
        self._alone = np.concatenate([np.empty(0, dtype=_SURFACE), *surfaces])
        self._rows_alone = -(-len(self._alone) // _ROW)
        self._chunks: list[NDArray[np.void]] = []
        self._make_room(max(1, self._rows_alone))

    @property
    def next_number(self) -> int:
        """What the next triangle of a chunk gets."""
        return _ROW * self._rows_alone + sum(len(part) for part in self._chunks)

    def begin(self) -> None:
        """Begin a frame."""
        self._chunks = []

    def append(self, surfaces: NDArray[np.void]) -> None:
        """Give the next numbers to triangles (n,) of chunks."""
        self._chunks.append(surfaces)
        count = sum(len(part) for part in self._chunks)
        rows = -(-count // _ROW)
        if self._rows_alone + rows > self.texture.height:
            self._make_room(self._rows_alone + 2 * rows)
        whole = np.empty(rows * _ROW, dtype=_SURFACE)
        np.concatenate(self._chunks, out=whole[:count])
        self.texture.write(whole, viewport=(0, self._rows_alone, _ROW, rows))

    def _make_room(self, rows: int) -> None:
        self.texture = self._context.texture((_ROW, rows), 2, dtype="u4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        if len(self._alone):
            whole = np.zeros(self._rows_alone * _ROW, dtype=_SURFACE)
            whole[: len(self._alone)] = self._alone
            self.texture.write(whole, viewport=(0, 0, _ROW, self._rows_alone))


class TriangleIdGeometry:
    """Standing geometry, as `StaticDrawer` draws it, whose triangles have numbers.

    Args:
        geometry: which is not empty.
        surfaces: of its triangles, see `surfaces_of`.
        numbers: of the frame.

    Attributes:
        looks, chunks, groups, look_of_chunk, anchor_m: of the geometry.
    """

    def __init__(self, geometry: StaticGeometry, surfaces: NDArray[np.void], numbers: TriangleIds):
        self._geometry, self._numbers = geometry, numbers
        self.looks, self.chunks, self.groups = geometry.looks, geometry.chunks, geometry.groups
        self.look_of_chunk, self.anchor_m = geometry.look_of_chunk, geometry.anchor_m
        self._surfaces = surfaces
        self.first_number = 0

    def vertex_array(self, program: NumberedProgram, indices: moderngl.Buffer) -> NumberedCalls:
        """What draws what `indices` name, and tells the program which numbers a call has."""
        arrays = {one: self._geometry.vertex_array(one.program, indices) for one in program.all}
        return NumberedCalls(self, program, arrays)

    def indices(self, chunks: NDArray[np.intp]) -> NDArray[np.void]:
        """Indices of the triangles of some chunks, which get numbers."""
        triangles = ranges(self.chunks.first[chunks], self.chunks.count[chunks])
        self.first_number = self._numbers.next_number
        self._numbers.append(np.take(self._surfaces, triangles, mode="clip"))
        return self._geometry.indices(chunks)


class NumberedCalls:
    """Vertex arrays of which the program that draws is told which numbers the triangles have.

    Args:
        geometry: that is drawn.
        program: whose variants draw.
        arrays: theirs.
    """

    def __init__(
        self,
        geometry: TriangleIdGeometry,
        program: NumberedProgram,
        arrays: dict[VisibilityProgram, moderngl.VertexArray],
    ):
        self._geometry, self._program, self._arrays = geometry, program, arrays

    def render(self, mode: int, vertices: int, first: int) -> None:
        """DrawItem some of the indices."""
        program = self._program.current
        program.set_first_number(self._geometry.first_number + first // 3)
        self._arrays[program].render(mode, vertices=vertices, first=first)


def surfaces_of(geometry: StaticGeometry, draws: Sequence[DrawItem]) -> NDArray[np.void]:
    """Of each triangle (n,) of the geometry, in its order, 1 + the number of its draw, and its
    number in the draw."""  # fmt: skip
    taken = np.flatnonzero(geometry.taken)
    surfaces = np.concatenate([_surfaces_of(draws[index], index) for index in taken])
    ordered: NDArray[np.void] = surfaces[geometry.order]
    return ordered


def _surfaces_of(draw: DrawItem, index: int) -> NDArray[np.void]:
    surfaces = np.empty(draw.count // 3, dtype=_SURFACE)
    surfaces["draw_plus_one"], surfaces["triangle"] = index + 1, np.arange(draw.count // 3)
    return surfaces
