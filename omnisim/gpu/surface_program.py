"""The program that draws surfaces, in the variants that materials ask for."""

from __future__ import annotations

from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.scene_buffers import Draw, SceneBuffers
from omnisim.gpu.shader_files import build_program
from omnisim.scene.model import MAX_LIGHTS, AlphaMode, Lighting, LightKind, Material

_KINDS = {LightKind.DIRECTIONAL: 0, LightKind.POINT: 1, LightKind.SPOT: 2}
_NO_RANGE_M = 1e9  # the shader divides by it: large, and a float32


class SurfaceVariant(NamedTuple):
    """What differs between compiled versions of the surface shader."""

    lit: bool
    alpha_mode: AlphaMode

    @property
    def files(self) -> tuple[str, str, tuple[str, ...]]:
        """Vertex file, fragment file and defines."""
        defines = ["LIT"] if self.lit else []
        if self.alpha_mode is not AlphaMode.OPAQUE:
            defines.append(f"ALPHA_{self.alpha_mode.name}")
        return "scene/surface.vert", "scene/surface.frag", tuple(defines)


def variant_of(material: Material, unlit: bool) -> SurfaceVariant:
    """The variant that draws a material."""
    return SurfaceVariant(not (unlit or material.unlit), material.alpha_mode)


class SurfaceProgram:
    """One compiled variant with its vertex array.

    Raises:
        GraphicsError: more lamps than the shader has room for.
    """

    def __init__(
        self,
        program: moderngl.Program,
        buffers: SceneBuffers,
        lighting: Lighting,
        variant: SurfaceVariant,
    ):
        self._program, self._variant, self._lighting = program, variant, lighting
        self._vertex_array = buffers.vertex_array(program)
        self._clip_from_mesh = program["u_clip_from_mesh"]
        self._base_color = program["u_base_color"]
        program["u_texture"] = 0
        if variant.alpha_mode is AlphaMode.MASK:
            self._alpha_cutoff = program["u_alpha_cutoff"]
        if variant.lit:
            self._here_from_mesh = program["u_here_from_mesh"]
            self._normal_from_mesh = program["u_normal_from_mesh"]
            self._set_lights()

    def set_viewpoint(self, viewpoint_m: NDArray[np.float64]) -> None:
        """Say where the effective viewpoint (3,) is; positions of lamps are counted from it."""
        if self._variant.lit:
            positions = np.zeros((MAX_LIGHTS, 3), dtype=np.float32)
            for index, light in enumerate(self._lighting.lights):
                positions[index] = light.position_m - viewpoint_m
            self._program["u_light_position"].write(positions)

    def draw(
        self,
        draw: Draw,
        clip_from_mesh: NDArray[np.float32],
        here_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Draw one instance; matrices (4, 4) and (3, 3), columns first."""
        self._clip_from_mesh.write(clip_from_mesh)
        self._base_color.value = draw.material.base_color
        if self._variant.alpha_mode is AlphaMode.MASK:
            self._alpha_cutoff.value = draw.material.alpha_cutoff
        if self._variant.lit:
            self._here_from_mesh.write(here_from_mesh)
            self._normal_from_mesh.write(normal_from_mesh)
        draw.texture.use(0)
        self._vertex_array.render(moderngl.TRIANGLES, vertices=draw.count, first=draw.first)

    def _set_lights(self) -> None:
        lights = self._lighting.lights
        if len(lights) > MAX_LIGHTS:
            raise GraphicsError(f"the scene has {len(lights)} lamps: want at most {MAX_LIGHTS}")
        kinds = np.zeros(MAX_LIGHTS, dtype=np.int32)
        colors, directions, limits = np.zeros((3, MAX_LIGHTS, 3), dtype=np.float32)
        for index, light in enumerate(lights):
            kinds[index] = _KINDS[light.kind]
            colors[index] = np.array(light.color) * (light.intensity * self._lighting.exposure)
            directions[index] = light.direction
            limits[index] = (min(light.range_m, _NO_RANGE_M), *light.cone_cosines)
        self._program["u_ambient"] = self._lighting.ambient
        self._program["u_light_count"] = len(lights)
        for name, values in (
            ("u_light_kind", kinds),
            ("u_light_color", colors),
            ("u_light_direction", directions),
            ("u_light_limits", limits),
        ):
            self._program[name].write(values)


class SurfacePrograms:
    """The variants of the surface shader that were asked for, each compiled once.

    All cameras that look at the same buffers share them: what differs from one to the next is set
    in every frame.
    """

    def __init__(self, buffers: SceneBuffers, lighting: Lighting):
        self._buffers, self._lighting = buffers, lighting
        self._programs: dict[SurfaceVariant, SurfaceProgram] = {}

    def __getitem__(self, variant: SurfaceVariant) -> SurfaceProgram:
        if variant not in self._programs:
            program = build_program(self._buffers.context, *variant.files)
            self._programs[variant] = SurfaceProgram(
                program, self._buffers, self._lighting, variant
            )
        return self._programs[variant]
