"""Uniforms of items drawn one by one, shared by the programs of all passes."""

from __future__ import annotations

import struct

import moderngl

from omnisim.core.array_types import Float32s
from omnisim.rendering.opengl.geometry.draw_item import DrawItem
from omnisim.rendering.opengl.gl.shader_files import find_uniform
from omnisim.rendering.opengl.materials.scene_textures import bind_maps


class ItemUniforms:
    """Matrix and material of one item; uniforms that a program lacks are skipped.

    Args:
        program: program of single items; one of clusters has none of these uniforms.
    """

    def __init__(self, program: moderngl.Program):
        self._clip_from_mesh = find_uniform(program, "u_clip_from_mesh")
        self._base_color = find_uniform(program, "u_base_color")
        self._alpha_cutoff = find_uniform(program, "u_alpha_cutoff")
        self._record = find_uniform(program, "u_record")

    def set_clip_from_mesh(self, clip_from_mesh: Float32s) -> None:
        """Set the matrix (4, 4), column-major."""
        if self._clip_from_mesh is not None:
            self._clip_from_mesh.write(clip_from_mesh)

    def bind_material(self, item: DrawItem) -> None:
        """Set the numbers of an item's material, and bind its maps."""
        material, reflectance = item.material, item.texture_layer.reflectance
        if self._base_color is not None:
            self._base_color.write(struct.pack("4f", *material.base_color))
        if self._alpha_cutoff is not None:
            self._alpha_cutoff.value = material.hit_cutoff
        if self._record is not None and reflectance is not None:
            self._record.value = reflectance.record
            bind_maps(reflectance.maps)
