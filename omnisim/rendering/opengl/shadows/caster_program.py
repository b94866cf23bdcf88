"""Caster programs: shaders that draw the depth of shadow casters."""

from __future__ import annotations

from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.drawing.item_uniforms import ItemUniforms
from omnisim.rendering.opengl.geometry.draw_item import DrawItem
from omnisim.rendering.opengl.gl.shader_files import build_program


class CasterVariant(NamedTuple):
    """Compiled version of the shader.

    Attributes:
        holes: discard fragments with alpha below a cutoff.
        textured: alpha comes from a texture.
        clustered: True: draws clusters; False: single items.
    """

    holes: bool
    textured: bool
    clustered: bool = False

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of the shaders."""
        defined = {
            "ALPHA_MASK": self.holes,
            "TEXTURED": self.holes and self.textured,
            "CLUSTERED": self.clustered,
        }
        return tuple(name for name, is_defined in defined.items() if is_defined)


class CasterProgram:
    """Compiled variant with its uniforms.

    Attributes:
        program: compiled OpenGL program.
    """

    def __init__(self, context: moderngl.Context, variant: CasterVariant):
        files = "scene/caster.vert", "scene/caster.frag"
        self.program = program = build_program(context, *files, variant.defines)
        self._item = ItemUniforms(program)
        self._is_textured = "TEXTURED" in variant.defines
        if self._is_textured:
            program["u_textures" if variant.clustered else "u_texture"] = 0

    def set_matrices(
        self,
        clip_from_mesh: NDArray[np.float32],
        viewpoint_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Set the matrix (4, 4), column-major, for the next draw calls; depth needs no others."""
        self._item.set_clip_from_mesh(clip_from_mesh)

    def bind_material(self, item: DrawItem) -> None:
        """Bind an item's material for the next draw calls."""
        self._item.bind_material(item)
        if self._is_textured:
            item.texture.use(0)

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw `count` indices of a vertex array; depth needs no IDs."""
        array.render(moderngl.TRIANGLES, vertices=count, first=first)
