"""Surface programs: shaders that draw surfaces, in the variants that materials require."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import cached_property
from typing import NamedTuple, Protocol

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.arrays import Floats, Floats32
from omnisim.core.errors import GraphicsError
from omnisim.core.world import Poses
from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.mesh_and_lens import bind_tiles
from omnisim.rendering.opengl.gl.gpu_textures import (
    AnyTexture,
    bind_texture,
    bind_textures,
    texture_2d,
)
from omnisim.rendering.opengl.gl.shader_files import (
    build_program,
    columns_first,
    set_uniforms,
    write_fog,
)
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.surfaces.scene_drawer import (
    ItemProgram,
    connect_material,
    material_tables,
    reflectance_defines,
)
from omnisim.rendering.opengl.world.clustered_geometry import Bucket, ClusterShading
from omnisim.rendering.opengl.world.draw_item import DrawItem, LightSource
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.scene_textures import (
    TextureArray,
    baked_textures,
    connect_baked_light,
    environment_texture,
)
from omnisim.scene.model import MAX_LIGHTS, Lighting, LightKind
from omnisim.scene.planar_mirrors import MAX_PLANES
from omnisim.scene.reflection_probes import ProbePlace
from omnisim.scene.slabs import normal_of_slabs
from omnisim.scene.surface_kind import SurfaceKind, transmitted
from omnisim.scene.surface_reflectance import environment_table


class ShadowSource(Protocol):
    """Shadow maps of a scene's lamps, for shaders/scene/shadow.glsl."""

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of programs that look up shadows."""

    @property
    def anchor_m(self) -> Floats:
        """Origin (3,) of the maps, world."""

    def are_shared(self, poses: Sequence[tuple[Floats, Sequence[Floats]]]) -> bool:
        """Tell whether poses of rigs and of the dynamic objects all share their maps."""

    def connect(self, program: moderngl.Program) -> None:
        """Set the samplers and blocks of a program that looks up shadows."""

    def prepare(self, viewpoint_m: Floats, world_from_objects: Poses) -> None:
        """Draw the maps that a frame from a viewpoint (3,), world, needs, and bind them."""


_ALL_DIRECTIONS = (-1.0, -2.0)  # cosines of a cone with all directions: a point light's
_NO_RANGE_M = 1e9  # large, finite and a float32, because the shader divides by it
_ENVIRONMENT_UNITS = {"u_environment_table": 5, "u_filtered_sky": 6}
# Units of the normal maps, which planar mirrors do not have. A unit keeps the maps, which are array
# textures, beside these.
MIRROR_UNITS = {"u_mirror_owners": 2, "u_mirrored": 15}
# As in shaders/scene/reflection_probe.glsl; units 16 and 17 are those of culling.
PROBE_UNIT = 18


class Probe(NamedTuple):
    """Reflection probe of an item, as in shaders/scene/reflection_probe.glsl."""

    place: Floats32  # (4,) center in the viewpoint frame, and index of its cube
    steps: tuple[int, int]  # toward a hit, and refinements of it
    texture: int  # OpenGL's name of the cubes


# Defines of the kinds that the surface shader distinguishes.
_KIND_DEFINES = {
    SurfaceKind.CUTOUT: "ALPHA_MASK",
    SurfaceKind.BLENDED: "ALPHA_BLEND",
    SurfaceKind.PANE: "PANE",
    SurfaceKind.GLASS: "GLASS",
    SurfaceKind.PLANAR_MIRROR: f"PLANAR_MIRRORS {MAX_PLANES}",
    SurfaceKind.ROUGH_MIRROR: "MIRROR_GLOSS",
}


class SurfaceVariant(NamedTuple):
    """Compiled version of the surface shader."""

    # kind of the surfaces, as far as the shader distinguishes it and the view shows it
    kind: SurfaceKind
    textured: bool
    shading: ClusterShading = ClusterShading.UNKNOWN  # shading of the triangles
    clustered: bool = False  # True: draws clusters; False: single items
    layered: bool = False  # each camera has a layer
    blended_arrays: int | None = None  # number of texture arrays of blended clusters
    # True for each map of the material, in the order of `Material.maps`; None: matte
    maps: tuple[bool, ...] | None = None
    second_coordinates: bool = False  # True if a map uses the second texture coordinates
    in_fog: bool = True  # True if drawn with the scene's fog, if it has one
    light: LightSource = LightSource.COMPUTED  # source of the light on lit surfaces
    both_sides: bool = False  # each side has its own light in the lightmap
    in_mirror: bool = False  # drawn from a mirrored rig, clipped at the mirror
    has_probe: bool = False  # reflects a probe of `ProbePass`

    @property
    def lit(self) -> bool:
        """True if the scene's light is on the surfaces."""
        return SurfaceKind.UNLIT not in self.kind

    def in_light(self, unlit: bool) -> SurfaceVariant:
        """Variant without light, if the camera shows plain base colors or the surfaces do."""
        if self.lit and not unlit:
            return self
        return SurfaceVariant(
            self.kind & SurfaceKind.HOLES | SurfaceKind.UNLIT,
            self.textured,
            clustered=self.clustered,
            blended_arrays=self.blended_arrays,
            in_fog=not unlit,
        )

    @property
    def computes_light(self) -> bool:
        """True if light is computed per fragment."""
        in_lightmap = self.light is LightSource.LIGHTMAP and self.maps is None
        return self.lit and self.shading is not ClusterShading.BAKED and not in_lightmap

    def defines(self, lighting: Lighting, shadows: ShadowSource | None = None) -> tuple[str, ...]:
        """Defines of the shaders in a scene with this lighting."""
        defines = []
        is_placed = in_fog = lighting.fog is not None and self.in_fog
        if self.computes_light:
            directional, punctual = lighting.by_kind()
            defines += [
                "LIT",
                f"DIRECTIONAL_LIGHTS {len(directional)}",
                f"PUNCTUAL_LIGHTS {len(punctual)}",
                f"EACH_DIRECTIONAL(f) {_calls(len(directional))}",
                f"EACH_PUNCTUAL(f) {_calls(len(punctual))}",
            ]
            agree = self.shading is ClusterShading.NORMALS_AGREE
            if agree:
                defines.append("NORMALS_AGREE")
            is_placed = is_placed or bool(punctual) or not agree or self.maps is not None
            is_placed = is_placed or shadows is not None or self.light.is_baked
            if lighting.environment is not None:
                defines.append("ENVIRONMENT")
            if shadows is not None:
                defines += shadows.defines
            if self.light.is_baked:
                defines.append("BAKED_LIGHT")
            defines += reflectance_defines(self.maps, self.second_coordinates)
        elif self.lit and not self.light.is_baked:
            defines.append("BAKED")
        if self.lit:
            defines += self.light.defines
        others = {
            "BOTH_SIDES": self.both_sides,
            **{name: kind in self.kind for kind, name in _KIND_DEFINES.items()},
            "IN_MIRROR": self.in_mirror,
            "REFLECTION_PROBE": self.has_probe,
            "POSITION": is_placed or self.in_mirror,
            "FOG": in_fog,
            "TEXTURED": self.textured,
            "CLUSTERED": self.clustered,
            "LAYERED": self.layered,
            f"BLENDED_ARRAYS {self.blended_arrays}": self.blended_arrays is not None,
        }
        return (*defines, *(name for name, is_defined in others.items() if is_defined))


def variant_of(
    item: DrawItem, unlit: bool, in_mirrors: bool = False, has_probe: bool = False
) -> SurfaceVariant:
    """Variant that draws an item.

    Args:
        unlit: show plain base colors.
        in_mirrors: show mirrored views of the scene.
        has_probe: show a reflection probe.
    """
    kind = item.kind & (SurfaceKind.UNLIT | SurfaceKind.HOLES | SurfaceKind.PANE)
    if in_mirrors:
        kind |= SurfaceKind.PLANAR_MIRROR | item.kind & SurfaceKind.ROUGH_MIRROR
    if has_probe:
        kind |= item.kind & SurfaceKind.GLASS
    reflectance = item.texture_layer.reflectance
    variant = SurfaceVariant(
        kind,
        item.material.texture is not None,
        maps=None if reflectance is None else _are_used(reflectance.maps),
        second_coordinates=reflectance is not None and reflectance.second_coordinates,
        light=item.light,
        both_sides=item.material.double_sided and item.light.is_mapped,
        has_probe=has_probe,
    )
    return variant.in_light(unlit)


def variant_of_bucket(bucket: Bucket, unlit: bool) -> SurfaceVariant:
    """Variant that draws the clusters of a bucket; `unlit`: plain base colors."""
    variant = SurfaceVariant(
        bucket.kind,
        bucket.array is not None,
        bucket.shading,
        clustered=True,
        maps=None if bucket.maps is None else _are_used(bucket.maps),
        second_coordinates=bucket.second_coordinates,
        light=bucket.light,
        both_sides=bucket.double_sided and bucket.light.is_mapped,
    )
    return variant.in_light(unlit)


def variant_of_blended(arrays: int, unlit: bool, items: Sequence[DrawItem]) -> SurfaceVariant:
    """Variant that draws all blended items, which use `arrays` texture arrays."""
    sources = {item.light for item in items}
    light = sources.pop() if len(sources) == 1 else LightSource.LIGHTMAP_OR_PROBES
    variant = SurfaceVariant(
        SurfaceKind.BLENDED,
        arrays > 0,
        clustered=True,
        blended_arrays=arrays,
        light=light,
        both_sides=light.is_mapped,
    )
    return variant.in_light(unlit)


def _are_used(maps: Sequence[TextureArray | None]) -> tuple[bool, ...]:
    return tuple(texture is not None for texture in maps)


class SurfaceProgram(ItemProgram):
    """Compiled variant with its uniforms.

    Args:
        shadows: shadow maps of its lights; None: no shadows.

    Attributes:
        is_pane: draws panes of glass.
    """

    def __init__(
        self,
        context: moderngl.Context,
        variant: SurfaceVariant,
        lighting: Lighting,
        shadows: ShadowSource | None = None,
    ):
        files = "scene/surface.vert", "scene/surface.frag"
        program = build_program(context, *files, variant.defines(lighting, shadows))
        super().__init__(program)
        self._shadows, self._lighting, self._state = shadows, lighting, GlState()
        self._probes: Mapping[int, Probe] = {}
        self.is_pane = SurfaceKind.PANE in variant.kind
        self.needs_item_details = variant.second_coordinates and not variant.clustered
        self._light_positions_m = np.array([light.position_m for light in lighting.by_kind()[1]])
        if lighting.baked is not None:
            connect_baked_light(program, lighting.baked)
        if shadows is not None:
            shadows.connect(program)
        if (variant.blended_arrays or 0) > 1:
            program["u_textures"] = tuple(range(variant.blended_arrays or 0))
        if variant.maps is not None:
            connect_material(program, variant.clustered)
            set_uniforms(program, _ENVIRONMENT_UNITS)
        if SurfaceKind.PLANAR_MIRROR in variant.kind:
            set_uniforms(program, MIRROR_UNITS)
        if lighting.fog is not None and variant.in_fog:
            write_fog(program, lighting.fog)
        if variant.computes_light:
            _write_lights(program, lighting)
            if lighting.environment is not None:
                self.write("u_irradiance", lighting.environment.irradiance)

    def set_viewpoint(self, viewpoint_m: Floats) -> None:
        """Set the viewpoint (3,), world: positions of lights and shadow maps are relative to it."""
        if len(self._light_positions_m):
            self.write("u_punctual_position", self._light_positions_m - viewpoint_m)
        if self._shadows is not None:
            self.write("u_shadow_viewpoint", viewpoint_m - self._shadows.anchor_m)
        if self._lighting.baked is not None:
            self.write("u_probes_viewpoint", viewpoint_m - self._lighting.baked.probes.origin_m)

    def set_mirrors(self, planes: Floats, plan: TilePlan, world_from_rig: Floats) -> None:
        """Set the planes (n, 4) of the mirrors of a rig's pose (4, 4): normals and heights."""
        if "u_rig_from_world" in self._uniforms:
            self.write("u_rig_from_world", columns_first(world_from_rig[:3, :3].T))
            bind_tiles(self.program, plan, np.eye(3))
        padded = np.zeros((MAX_PLANES, 4), dtype=np.float32)
        padded[: len(planes)] = planes
        self.write("u_mirror_planes", padded)

    def set_mirror(self, plane: Floats) -> None:
        """Set the plane (5,) of a mirrored view: unit normal, viewpoint's height, facets' slope."""
        self.write("u_mirror", plane[:4])
        self.write("u_mirror_spread", plane[4:])

    def set_probes(self, probes: Mapping[int, Probe]) -> None:
        """Set the probes of items, by their identity."""
        self._probes = probes

    def bind_material(self, item: DrawItem) -> None:
        """Bind an item's material for the next draw call."""
        super().bind_material(item)
        material = item.material
        if "u_probe" in self._uniforms:
            probe, steps, texture = self._probes[id(item)]
            self.write("u_probe", probe)
            self._uniforms["u_probe_steps"].value = steps
            bind_texture(PROBE_UNIT, texture)
        if "u_glass" in self._uniforms:
            self.write("u_glass", (transmitted(material, SurfaceKind.GLASS), material.ior))
            self.write("u_glass_absorption_per_m", material.absorption_per_m)
        if "u_slab_normal" in self._uniforms:
            is_slab = SurfaceKind.SLAB in item.kind
            self.write("u_slab_normal", normal_of_slabs(item.mesh) if is_slab else np.zeros(3))
        if "u_light_rectangles" in self._uniforms and item.light_rectangles:
            sides = self._uniforms["u_light_rectangles"].array_length
            self.write("u_light_rectangles", item.light_rectangles[:sides])

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw `count` indices of a vertex array from `first`; `first_id` is unused."""
        with self._state.blending_panes() if self.is_pane else nullcontext():
            array.render(moderngl.TRIANGLES, vertices=count, first=first)


class SurfacePrograms:
    """Variants of the surface shader, each compiled on first use.

    All cameras that draw from the same buffers share them, so per-camera uniforms are set in every
    frame.

    Args:
        shadows: shadow maps of its lights; None: no shadows.

    Attributes:
        shared_passes: passes that all cameras share: by version of the buffers, their probes, and
            background.

    Raises:
        GraphicsError: more lights than a shader should loop over.
    """

    def __init__(
        self, buffers: SceneBuffers, lighting: Lighting, shadows: ShadowSource | None = None
    ):
        if len(lighting.lights) > MAX_LIGHTS:
            raise GraphicsError(
                f"lights: expected at most {MAX_LIGHTS}, got {len(lighting.lights)}"
            )
        self._context, self._buffers, self._lighting = buffers.context, buffers, lighting
        self.shadows = shadows
        self.shared_passes: dict[
            tuple[int, tuple[ProbePlace, ...], tuple[float, float, float]], object
        ] = {}
        self._programs: dict[tuple[SurfaceVariant, tuple[str, ...]], SurfaceProgram] = {}

    @property
    def positions_m(self) -> Floats:
        """Positions (n, 3) that are set relative to the viewpoint, in world axes.

        The punctual lights, the origin of the shadow maps, and the first probe of baked light.
        """
        positions_m = [light.position_m for light in self._lighting.by_kind()[1]]
        if self.shadows is not None:
            positions_m.append(self.shadows.anchor_m)
        if self._lighting.baked is not None:
            positions_m.append(self._lighting.baked.probes.origin_m)
        return np.array(positions_m, dtype=np.float64).reshape(-1, 3)

    def bind_tables(self) -> None:
        """Bind baked light, and the lookup tables of reflective materials, if there are any."""
        tables = dict(self._baked_textures)
        if self._buffers.materials.texture is not None:
            needed = any(program.needs_item_details for program in self._programs.values())
            tables |= material_tables(self._buffers, needed)
            tables[_ENVIRONMENT_UNITS["u_environment_table"]] = self._environment_table
            if self._filtered_sky is not None:
                tables[_ENVIRONMENT_UNITS["u_filtered_sky"]] = self._filtered_sky
        bind_textures(tables)

    def sky_seen(self, unlit: bool) -> moderngl.Texture | None:
        """Texture of the visible environment map; None without one, or in fog."""
        return None if self._lighting.fog is not None and not unlit else self._sky

    @cached_property
    def _sky(self) -> moderngl.Texture | None:
        sky = self._lighting.environment
        return None if sky is None else environment_texture(self._context, sky.pyramid)

    @cached_property
    def _filtered_sky(self) -> moderngl.Texture | None:
        sky = self._lighting.environment
        return None if sky is None else environment_texture(self._context, sky.filtered)

    @cached_property
    def _baked_textures(self) -> dict[int, AnyTexture]:
        baked = self._lighting.baked
        return {} if baked is None else baked_textures(self._context, baked)

    @cached_property
    def _environment_table(self) -> moderngl.Texture:
        table = environment_table()
        size = (table.shape[1], table.shape[0])
        return texture_2d(self._context, size, 3, np.ascontiguousarray(table), is_linear=True)

    def __getitem__(self, variant: SurfaceVariant) -> SurfaceProgram:
        # the shadow maps of an edited scene need new programs
        key = variant, () if self.shadows is None else self.shadows.defines
        if key not in self._programs:
            self._programs[key] = SurfaceProgram(
                self._context, variant, self._lighting, self.shadows
            )
        return self._programs[key]


def _calls(count: int) -> str:
    """Calls f(0) f(1) … of a macro, one per light."""
    return " ".join(f"f({number})" for number in range(count))


def _write_lights(program: moderngl.Program, lighting: Lighting) -> None:
    """Set the uniforms of all lights except positions, which are relative to the viewpoint."""
    directional, punctual = lighting.by_kind()
    values: dict[str, ArrayLike] = {"u_ambient": lighting.ambient}
    for name, lights in (("directional", directional), ("punctual", punctual)):
        if lights:
            colors = [np.array(light.color) * light.intensity for light in lights]
            values[f"u_{name}_color"] = np.array(colors) * lighting.exposure
            values[f"u_{name}_direction"] = [light.direction for light in lights]
    if punctual:
        cones = [
            light.cone_cosines if light.kind is LightKind.SPOT else _ALL_DIRECTIONS
            for light in punctual
        ]
        ranges_m = [min(light.range_m, _NO_RANGE_M) for light in punctual]
        values["u_punctual_limits"] = np.column_stack((ranges_m, cones))
    # those that baked light replaces are missing
    set_uniforms(program, {key: np.asarray(value, np.float32) for key, value in values.items()})
