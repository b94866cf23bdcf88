"""Surface programs: shaders that draw surfaces, in the variants that materials ask for."""

from __future__ import annotations

import struct
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.scene.clustered_geometry import Bucket
from omnisim.gpu.scene.light_baking import Shading
from omnisim.gpu.scene.scene_buffers import SceneBuffers
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import find_uniform, uniform
from omnisim.scene.model import MAX_LIGHTS, AlphaMode, Light, Lighting, LightKind, Material

_ALL_DIRECTIONS = (-1.0, -2.0)  # cosines of a cone that has every direction in it: a point light's
_NO_RANGE_M = 1e9  # the shader divides by it: large, and a float32


class SurfaceVariant(NamedTuple):
    """Compiled version of the surface shader."""

    lit: bool
    alpha_mode: AlphaMode
    textured: bool
    shading: Shading = Shading.UNKNOWN
    clustered: bool = False
    layered: bool = False
    blended_arrays: int | None = None

    @property
    def computes_light(self) -> bool:
        """Light is computed for each fragment."""
        return self.lit and self.shading is not Shading.BAKED

    def defines(self, lighting: Lighting) -> tuple[str, ...]:
        """Defines of the shaders."""
        defines = []
        if self.computes_light:
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
        if self.clustered:
            defines.append("CLUSTERED")
        if self.layered:
            defines.append("LAYERED")
        if self.blended_arrays is not None:
            defines.append(f"BLENDED_ARRAYS {self.blended_arrays}")
        return tuple(defines)


def variant_of(
    material: Material, unlit: bool, shading: Shading = Shading.UNKNOWN
) -> SurfaceVariant:
    """Variant that draws a material.

    Args:
        material: of the surface.
        unlit: show plain base colours.
        shading: of its triangles; of no use where both of their sides are seen.
    """
    textured = material.texture is not None
    if unlit or material.unlit:
        return SurfaceVariant(False, material.alpha_mode, textured)
    known = Shading.UNKNOWN if material.double_sided else shading
    return SurfaceVariant(True, material.alpha_mode, textured, known)


def variant_of_bucket(bucket: Bucket, unlit: bool) -> SurfaceVariant:
    """Variant that draws the clusters of a bucket; `unlit`: plain base colours."""
    textured = bucket.array is not None
    if unlit or bucket.unlit:
        return SurfaceVariant(False, bucket.alpha_mode, textured, clustered=True)
    return SurfaceVariant(True, bucket.alpha_mode, textured, bucket.shading, clustered=True)


def variant_of_blended(arrays: int, unlit: bool) -> SurfaceVariant:
    """Variant that draws all blended items, of so many texture arrays."""
    return SurfaceVariant(
        not unlit, AlphaMode.BLEND, arrays > 0, clustered=True, blended_arrays=arrays
    )


class SurfaceProgram:
    """One compiled variant with its uniforms.

    Args:
        context: where.
        variant: to compile.
        lighting: of the scene.

    Attributes:
        program: as compiled.
    """

    def __init__(self, context: moderngl.Context, variant: SurfaceVariant, lighting: Lighting):
        files = "scene/surface.vert", "scene/surface.frag"
        self.program = program = build_program(context, *files, variant.defines(lighting))
        self._is_textured = variant.textured
        # those of single items
        self._clip_from_mesh = find_uniform(program, "u_clip_from_mesh")
        self._base_color = find_uniform(program, "u_base_color")
        self._alpha_cutoff = find_uniform(program, "u_alpha_cutoff")
        # ambient light alone needs neither, and the compiler leaves them out
        self._viewpoint_from_mesh = find_uniform(program, "u_viewpoint_from_mesh")
        self._normal_from_mesh = find_uniform(program, "u_normal_from_mesh")
        self._light_positions = find_uniform(program, "u_punctual_position")
        self._light_positions_m = np.array([one.position_m for one in _by_kind(lighting)[1]])
        if variant.textured:
            arrays = variant.blended_arrays or 1
            units = 0 if arrays == 1 else tuple(range(arrays))
            program["u_textures" if variant.clustered else "u_texture"] = units
        if variant.computes_light:
            _write_lights(program, lighting)

    def set_viewpoint(self, viewpoint_m: NDArray[np.float64]) -> None:
        """Count positions of punctual lights from the effective viewpoint (3,), world."""
        if self._light_positions is not None:
            positions_m = self._light_positions_m - viewpoint_m
            self._light_positions.write(positions_m.astype(np.float32))

    def set_matrices(
        self,
        clip_from_mesh: NDArray[np.float32],
        viewpoint_from_mesh: NDArray[np.float32],
        normal_from_mesh: NDArray[np.float32],
    ) -> None:
        """Set the matrices (4, 4) and (3, 3), columns first, of the next draw call."""
        if self._clip_from_mesh is not None:
            self._clip_from_mesh.write(clip_from_mesh)
        if self._viewpoint_from_mesh is not None:
            self._viewpoint_from_mesh.write(viewpoint_from_mesh)
        if self._normal_from_mesh is not None:
            self._normal_from_mesh.write(normal_from_mesh)

    def bind_material(self, material: Material, texture: moderngl.Texture) -> None:
        """Bind the material of the next draw call."""
        if self._base_color is not None:
            self._base_color.write(struct.pack("4f", *material.base_color))
        if self._alpha_cutoff is not None:
            self._alpha_cutoff.value = material.alpha_cutoff
        if self._is_textured:
            texture.use(0)

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw some of a vertex array's indices; colours need no IDs."""
        array.render(moderngl.TRIANGLES, vertices=count, first=first)


class SurfacePrograms:
    """Variants of the surface shader that were asked for, each compiled once.

    All cameras that draw from the same buffers share them: per-camera uniforms are set in every
    frame.

    Raises:
        GraphicsError: more lights than one would want in a shader.
    """

    def __init__(self, buffers: SceneBuffers, lighting: Lighting):
        if len(lighting.lights) > MAX_LIGHTS:
            raise GraphicsError(
                f"lights: expected at most {MAX_LIGHTS}, got {len(lighting.lights)}"
            )
        self._context, self._lighting = buffers.context, lighting
        self._programs: dict[SurfaceVariant, SurfaceProgram] = {}

    @property
    def punctual_positions_m(self) -> NDArray[np.float64]:
        """Positions (n, 3) of the punctual lights, world."""
        positions_m = [light.position_m for light in _by_kind(self._lighting)[1]]
        return np.array(positions_m, dtype=np.float64).reshape(-1, 3)

    def __getitem__(self, variant: SurfaceVariant) -> SurfaceProgram:
        if variant not in self._programs:
            self._programs[variant] = SurfaceProgram(self._context, variant, self._lighting)
        return self._programs[variant]


def _by_kind(lighting: Lighting) -> tuple[list[Light], list[Light]]:
    """Directional lights, and punctual ones."""
    directional = [light for light in lighting.lights if light.kind is LightKind.DIRECTIONAL]
    punctual = [light for light in lighting.lights if light.kind is not LightKind.DIRECTIONAL]
    return directional, punctual


def _write_lights(program: moderngl.Program, lighting: Lighting) -> None:
    """Write the uniforms of all lights, but for positions, which count from the viewpoint."""

    def write(name: str, values: ArrayLike) -> None:
        uniform(program, name).write(np.asarray(values, dtype=np.float32))

    directional, punctual = _by_kind(lighting)
    program["u_ambient"] = lighting.ambient
    for name, lights in (("directional", directional), ("punctual", punctual)):
        if lights:
            colors = [np.array(one.color) * one.intensity for one in lights]
            write(f"u_{name}_color", np.array(colors) * lighting.exposure)
            write(f"u_{name}_direction", [one.direction for one in lights])
    if punctual:
        cones = [
            one.cone_cosines if one.kind is LightKind.SPOT else _ALL_DIRECTIONS for one in punctual
        ]
        ranges_m = [min(one.range_m, _NO_RANGE_M) for one in punctual]
        write("u_punctual_limits", np.column_stack((ranges_m, cones)))
