"""Program that draws, in each texel, the number of the mirror that it shows."""

from __future__ import annotations

import moderngl
import numpy as np

from omnisim.core.arrays import Bytes
from omnisim.rendering.opengl.drawing.scene_drawer import ItemProgram
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform
from omnisim.rendering.opengl.world.draw_item import DrawItem

_ROW_TRIANGLES = 4096
_NUMBERS_UNIT = 0


class MirrorOwnerProgram(ItemProgram):
    """Program that draws the numbers (n,) of the triangles' mirrors; 0: none."""

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
