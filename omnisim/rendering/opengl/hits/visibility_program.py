"""Visibility programs: shaders that draw triangle IDs and, on request, colors and materials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl

from omnisim.ground_truth.hits import HitDetails
from omnisim.rendering.opengl.gl.shader_files import build_program, find_uniform, uniform
from omnisim.rendering.opengl.surfaces.scene_drawer import (
    ItemProgram,
    connect_material,
    reflectance_defines,
)
from omnisim.rendering.opengl.world.draw_item import DrawItem
from omnisim.rendering.opengl.world.scene_textures import TextureArray


class VisibilityVariant(NamedTuple):
    """Compiled version of the shader."""

    holes: bool  # discard fragments with alpha below a cutoff
    details: HitDetails  # details to draw as well
    textured: bool = True  # materials may have a texture
    clustered: bool = False  # True: draws clusters; False: single items
    layered: bool = False  # several cameras, one target layer each
    # True for each map of the material, in the order of `Material.maps`; None: matte, or
    # materials are not drawn
    maps: tuple[bool, ...] | None = None
    second_coordinates: bool = False  # True if a map uses the second texture coordinates

    def with_maps(
        self, maps: Sequence[TextureArray | None] | None, second_coordinates: bool
    ) -> VisibilityVariant:
        """Variant for a material with these maps, see `Reflectance`; None: matte."""
        if maps is None or not self.details.materials:
            return self
        has_maps = tuple(one is not None for one in maps)
        return self._replace(maps=has_maps, second_coordinates=second_coordinates)

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of the shaders."""
        colored = self.holes or self.details.albedos
        defined = {
            "ALPHA_MASK": self.holes,
            "ALBEDO": self.details.albedos,
            "MATERIALS": self.details.materials,
            "COLORED": colored,
            "TEXTURED": self.textured and colored,
            "CLUSTERED": self.clustered,
            "LAYERED": self.layered,
        }
        names = [name for name, is_defined in defined.items() if is_defined]
        return (*names, *reflectance_defines(self.maps, self.second_coordinates))


def atlas_formats(details: HitDetails) -> dict[str, tuple[int, str]]:
    """Components and type of each detail's atlas, by sampler name."""
    formats = {"u_albedos": (4, "f1")} if details.albedos else {}
    if details.materials:
        formats |= {"u_gloss": (2, "f2"), "u_emission": (4, "f2")}
    return formats


def clear_colors(details: HitDetails) -> list[tuple[float, float, float, float] | None]:
    """Clear color of each atlas; None: the integer atlas of IDs."""
    return [None, *[(0.0, 0.0, 0.0, 0.0)] * len(atlas_formats(details))]


class VisibilityProgram(ItemProgram):
    """Compiled variant with its uniforms.

    Attributes:
        first_plus_one: uniform, 1 + ID of the first triangle.
        first_command: uniform for clusters, index of the first command.
    """

    def __init__(self, context: moderngl.Context, variant: VisibilityVariant):
        folder = "ground_truth/visibility"
        program = build_program(context, f"{folder}.vert", f"{folder}.frag", variant.defines)
        super().__init__(program)
        self.first_plus_one = uniform(program, "u_first_plus_one")
        self.first_command = find_uniform(program, "u_first_command")
        if variant.maps is not None:
            connect_material(program, variant.clustered)
        self._samplers: dict[tuple[bool, bool], moderngl.Sampler] = {}
        if "TEXTURED" in variant.defines:
            program["u_textures" if variant.clustered else "u_texture"] = 0
            # Holes are filtered as in the image. Plain colors need no blend between two levels,
            # which would cost a quarter of the pass.
            minify = moderngl.LINEAR_MIPMAP_NEAREST
            if variant.holes:
                minify = moderngl.LINEAR_MIPMAP_LINEAR
            for repeats in ((False, False), (False, True), (True, False), (True, True)):
                self._samplers[repeats] = context.sampler(
                    *repeats, filter=(minify, moderngl.LINEAR)
                )

    def sampler(self, array: TextureArray | None) -> moderngl.Sampler | None:
        """Sampler of a bucket's textures."""
        if array is None or not self._samplers:
            return None
        return self._samplers[array.array.repeat_x, array.array.repeat_y]

    def bind_material(self, item: DrawItem) -> None:
        """Bind an item's material for the next draw call."""
        super().bind_material(item)
        if self._samplers:
            texture = item.texture
            self._samplers[texture.repeat_x, texture.repeat_y].use(0)

    def draw(self, array: moderngl.VertexArray, first: int, count: int, first_id: int) -> None:
        """Draw `count` indices of a vertex array; the first triangle gets the ID `first_id`."""
        self.first_plus_one.value = first_id + 1
        array.render(moderngl.TRIANGLES, vertices=count, first=first)

    def end(self) -> None:
        """Restore the textures' own filters."""
        for sampler in self._samplers.values():
            sampler.clear(0)
