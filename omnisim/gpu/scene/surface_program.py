"""The program that draws surfaces, in the variants that materials ask for."""

from __future__ import annotations

import struct
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.scene.light_baking import Shading
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.shader_files import build_program
from omnisim.scene.model import MAX_LIGHTS, AlphaMode, Light, Lighting, LightKind, Material

_ALL_AROUND = (-1.0, -2.0)  # cosines of a cone that has every direction in it: a point light's
_NO_RANGE_M = 1e9  # the shader divides by it: large, and a float32


class SurfaceVariant(NamedTuple):
    """What differs between compiled versions of the surface shader."""

    lit: bool
    alpha_mode: AlphaMode
    textured: bool
    shading: Shading = Shading.UNKNOWN

    @property
    def has_lamps(self) -> bool:
        """Whether light is found when it is drawn."""
        return self.lit and self.shading is not Shading.BAKED

    def files(self, lighting: Lighting) -> tuple[str, str, tuple[str, ...]]:
        """Vertex file, fragment file and defines."""
        defines = []
        if self.has_lamps:
            directional, punctual = _by_kind(lighting)
            defines += [
                "LIT",
                f"DIRECTIONAL_LIGHTS {len(directional)}",
                f"PUNCTUAL_LIGHTS {len(punctual)}",
            ]
            agree = self.shading is Shading.NORMALS_AGREE
            if agree:
                defines.append("NORMALS_AGREE")
            if punctual or not agree:
                defines.append("POSITION")
        elif self.lit:
            defines.append("BAKED")
        if self.textured:
            defines.append("TEXTURED")
        if self.alpha_mode is not AlphaMode.OPAQUE:
            defines.append(f"ALPHA_{self.alpha_mode.name}")
        return "scene/surface.vert", "scene/surface.frag", tuple(defines)


def variant_of(
    material: Material, unlit: bool, shading: Shading = Shading.UNKNOWN
) -> SurfaceVariant:
    """The variant that draws a material.

    Args:
        material: how it looks.
        unlit: show plain base colours.
        shading: what is known of the light on its triangles; of no use where both of their sides
            are seen.
    """
    textured = material.texture is not None
    if unlit or material.unlit:
        return SurfaceVariant(False, material.alpha_mode, textured)
    known = Shading.UNKNOWN if material.double_sided else shading
    return SurfaceVariant(True, material.alpha_mode, textured, known)


class SurfaceProgram:
    """One compiled variant with its uniforms."""

    def __init__(self, program: moderngl.Program, lighting: Lighting, variant: SurfaceVariant):
        self.program = program
        self._variant, self._lighting = variant, lighting
        self._clip_from_mesh = program["u_clip_from_mesh"]
        self._base_color = program["u_base_color"]
        if variant.textured:
            program["u_texture"] = 0
        if variant.alpha_mode is AlphaMode.MASK:
            self._alpha_cutoff = program["u_alpha_cutoff"]
        self._lamps: list[Light] = []
        self._lamp_positions: moderngl.Uniform | None = None
        self._viewpoint_from_mesh = self._normal_from_mesh = None
        if variant.has_lamps:
            # ambient light alone needs neither, and the compiler leaves them out
            self._viewpoint_from_mesh = program.get("u_viewpoint_from_mesh", None)
            self._normal_from_mesh = program.get("u_normal_from_mesh", None)
            self._set_lights()

    def set_viewpoint(self, viewpoint_m: NDArray[np.float64]) -> None:
        """Say where the effective viewpoint (3,) is; positions of punctual are counted from it."""
        if self._lamp_positions is not None:
            positions = [lamp.position_m - viewpoint_m for lamp in self._lamps]
            self._lamp_positions.write(np.array(positions, dtype=np.float32))

    def set_matrices(
        self,
        clip_from_mesh: NDArray[np.float32],
        viewpoint_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Say where what is drawn next is; matrices (4, 4) and (3, 3), columns first."""
        self._clip_from_mesh.write(clip_from_mesh)
        if self._viewpoint_from_mesh is not None:
            self._viewpoint_from_mesh.write(viewpoint_from_mesh)
        if self._normal_from_mesh is not None:
            self._normal_from_mesh.write(normal_from_mesh)

    def bind_material(self, material: Material, texture: moderngl.Texture) -> None:
        """Say how what is drawn next looks."""
        self._base_color.write(struct.pack("4f", *material.base_color))
        if self._variant.alpha_mode is AlphaMode.MASK:
            self._alpha_cutoff.value = material.alpha_cutoff
        if self._variant.textured:
            texture.use(0)

    def _set_lights(self) -> None:
        directional, punctual = _by_kind(self._lighting)
        self.program["u_ambient"] = self._lighting.ambient
        for name, lights in (("directional", directional), ("punctual", punctual)):
            if not lights:
                continue
            colors = [np.array(one.color) * one.intensity for one in lights]
            self._write(f"u_{name}_color", np.array(colors) * self._lighting.exposure)
            self._write(f"u_{name}_direction", [one.direction for one in lights])
        if punctual:
            self._lamps = punctual
            self._lamp_positions = self.program["u_punctual_position"]
            cones = [
                one.cone_cosines if one.kind is LightKind.SPOT else _ALL_AROUND for one in punctual
            ]
            ranges_m = [min(one.range_m, _NO_RANGE_M) for one in punctual]
            self._write("u_punctual_limits", np.column_stack((ranges_m, cones)))

    def _write(self, name: str, values: ArrayLike) -> None:
        self.program[name].write(np.asarray(values, dtype=np.float32))


def _by_kind(lighting: Lighting) -> tuple[list[Light], list[Light]]:
    """Lights from afar, and lights that have a place."""
    directional = [light for light in lighting.lights if light.kind is LightKind.DIRECTIONAL]
    punctual = [light for light in lighting.lights if light.kind is not LightKind.DIRECTIONAL]
    return directional, punctual


class SurfacePrograms:
    """The variants of the surface shader that were asked for, each compiled once.

    All cameras that look at the same buffers share them: what differs from one to the next is set
    in every frame.

    Raises:
        GraphicsError: more punctual than one would want in a shader.
    """

    def __init__(self, buffers: SceneBuffers, lighting: Lighting):
        if len(lighting.lights) > MAX_LIGHTS:
            raise GraphicsError(
                f"the scene has {len(lighting.lights)} punctual: want at most {MAX_LIGHTS}"
            )
        self._buffers, self._lighting = buffers, lighting
        self._programs: dict[SurfaceVariant, SurfaceProgram] = {}

    def __getitem__(self, variant: SurfaceVariant) -> SurfaceProgram:
        if variant not in self._programs:
            program = build_program(self._buffers.context, *variant.files(self._lighting))
            self._programs[variant] = SurfaceProgram(program, self._lighting, variant)
        return self._programs[variant]
