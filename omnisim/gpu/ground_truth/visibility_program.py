"""Visibility programs: shaders that draw triangle IDs, and base colours where asked for."""

from __future__ import annotations

from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import find_uniform, uniform
from omnisim.scene.model import Material


class VisibilityVariant(NamedTuple):
    """Compiled version of the shader."""

    holes: bool
    albedo: bool

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of the shaders."""
        return tuple(name.upper() for name, value in self._asdict().items() if value)


class VisibilityProgram:
    """One compiled variant with its uniforms.

    Attributes:
        program: as compiled.
    """

    def __init__(self, context: moderngl.Context, variant: VisibilityVariant):
        folder = "ground_truth/visibility"
        program = build_program(context, f"{folder}.vert", f"{folder}.frag", variant.defines)
        self.program = program
        self._clip_from_mesh = uniform(program, "u_clip_from_mesh")
        self._first_plus_one = uniform(program, "u_first_plus_one")
        self._base_color = find_uniform(program, "u_base_color")
        self._alpha_cutoff = find_uniform(program, "u_alpha_cutoff")
        self._samplers: dict[tuple[bool, bool], moderngl.Sampler] = {}
        if self._base_color is not None:
            program["u_texture"] = 0
            # Holes are those of the picture, and are filtered as there. Plain colours need no blend
            # between two levels, which costs a quarter of the pass.
            minify = moderngl.LINEAR_MIPMAP_NEAREST
            if variant.holes:
                minify = moderngl.LINEAR_MIPMAP_LINEAR
            for repeats in ((False, False), (False, True), (True, False), (True, True)):
                self._samplers[repeats] = context.sampler(
                    *repeats, filter=(minify, moderngl.LINEAR)
                )

    def set_matrices(
        self,
        clip_from_mesh: NDArray[np.float32],
        viewpoint_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Set the matrix (4, 4), columns first, of the next draw calls; IDs need no others."""
        self._clip_from_mesh.write(clip_from_mesh)

    def bind_material(self, material: Material, texture: moderngl.Texture) -> None:
        """Bind the material of the next draw call."""
        if self._base_color is not None:
            self._base_color.value = material.base_color
            texture.use(0)
            self._samplers[texture.repeat_x, texture.repeat_y].use(0)
        if self._alpha_cutoff is not None:
            self._alpha_cutoff.value = material.hit_cutoff

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw some of a vertex array's indices; the first triangle has this ID."""
        self._first_plus_one.value = first_id + 1
        array.render(moderngl.TRIANGLES, vertices=count, first=first)

    def end(self) -> None:
        """Leave the textures to their own filters."""
        for sampler in self._samplers.values():
            sampler.clear(0)
