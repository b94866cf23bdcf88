"""The programs that draw which triangle a texel shows, instance by instance or chunk by chunk."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.scene.surface_program import SurfaceVariant
from omnisim.gpu.shader_files import build_program
from omnisim.scene.model import AlphaMode, Material

# Glass, or a picture with soft edges: it counts where it hides at least half of what is behind it.
BLENDED_CUTOFF = 0.5


def alpha_cutoff(material: Material) -> float:
    """Alpha from which on a surface counts; 0: everywhere."""
    if material.alpha_mode is AlphaMode.MASK:
        return material.alpha_cutoff
    return BLENDED_CUTOFF if material.alpha_mode is AlphaMode.BLEND else 0.0


class VisibilityVariant(NamedTuple):
    """What differs between compiled versions of the shader."""

    holes: bool
    albedo: bool

    @property
    def defines(self) -> tuple[str, ...]:
        """Of the program."""
        return tuple(name.upper() for name, value in self._asdict().items() if value)


class VisibilityProgram:
    """One compiled variant with its uniforms.

    Attributes:
        program: the program.
    """

    def __init__(self, context: moderngl.Context, variant: VisibilityVariant):
        folder = "ground_truth/visibility"
        program = build_program(context, f"{folder}.vert", f"{folder}.frag", variant.defines)
        self.program = program
        self._clip_from_mesh = program["u_clip_from_mesh"]
        self._first_plus_one = program["u_first_plus_one"]
        self._base_color = program.get("u_base_color", None)
        self._alpha_cutoff = program["u_alpha_cutoff"] if variant.holes else None
        self._samplers: dict[tuple[bool, bool], moderngl.Sampler] = {}
        if self._base_color is not None:
            program["u_texture"] = 0
            # Holes are those of the picture, and are filtered as there. Plain colours need no blend
            # between two levels, which costs a quarter of the pass.
            between = moderngl.LINEAR_MIPMAP_NEAREST
            if variant.holes:
                between = moderngl.LINEAR_MIPMAP_LINEAR
            for repeats in ((False, False), (False, True), (True, False), (True, True)):
                self._samplers[repeats] = context.sampler(
                    *repeats, filter=(between, moderngl.LINEAR)
                )

    def set_first_number(self, number: int) -> None:
        """Say which number the first triangle that is drawn next has."""
        self._first_plus_one.value = number + 1

    def set_matrix(self, clip_from_mesh: NDArray[np.float32]) -> None:
        """Say where what is drawn next is; (4, 4), columns first."""
        self._clip_from_mesh.write(clip_from_mesh)

    def bind_material(self, material: Material, texture: moderngl.Texture) -> None:
        """Say how what is drawn next looks."""
        if self._base_color is not None:
            self._base_color.value = material.base_color
            texture.use(0)
            self._samplers[texture.repeat_x, texture.repeat_y].use(0)
        if self._alpha_cutoff is not None:
            self._alpha_cutoff.value = alpha_cutoff(material)

    def end(self) -> None:
        """Leave the textures to their own filters."""
        for sampler in self._samplers.values():
            sampler.clear(0)


class NumberedPrograms:
    """What draws what stands still, as `StaticDrawer` asks for programs.

    Args:
        programs: all variants that may be asked for.

    Attributes:
        albedo: draw plain colours, too, from now on.
    """

    def __init__(self, programs: Mapping[VisibilityVariant, VisibilityProgram]):
        self._programs = programs
        self.albedo = False
        self._pairs: dict[bool, NumberedProgram] = {}

    def __getitem__(self, variant: SurfaceVariant) -> NumberedProgram:
        """What draws surfaces of this kind."""
        holes = variant.alpha_mode is not AlphaMode.OPAQUE
        if holes not in self._pairs:
            programs = {
                key.albedo: one for key, one in self._programs.items() if key.holes == holes
            }
            self._pairs[holes] = NumberedProgram(self, programs)
        return self._pairs[holes]


class NumberedProgram:
    """With plain colours or without, as its set has it."""

    def __init__(self, owner: NumberedPrograms, programs: dict[bool, VisibilityProgram]):
        self._owner, self._programs = owner, programs

    @property
    def current(self) -> VisibilityProgram:
        """The one that draws now."""
        return self._programs[self._owner.albedo]

    @property
    def program(self) -> NumberedProgram:
        """What `TriangleIdGeometry` makes vertex arrays of."""
        return self

    @property
    def all(self) -> tuple[VisibilityProgram, ...]:
        """Both."""
        return tuple(self._programs.values())

    def set_matrices(
        self,
        clip_from_mesh: NDArray[np.float32],
        viewpoint_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Say where what is drawn next is; lights, which need the others, are none here."""
        self.current.set_matrix(clip_from_mesh)

    def bind_material(self, material: Material, texture: moderngl.Texture) -> None:
        """Say how what is drawn next looks."""
        self.current.bind_material(material, texture)
