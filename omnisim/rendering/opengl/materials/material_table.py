"""Reflectance tables for shaders: records of materials, and details of vertices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.materials.texture_array import TextureArray
from omnisim.scene.model import Material, Mesh
from omnisim.scene.surface_reflectance import dielectric_f0, tinted_reflectance

# As in shaders/scene/reflective_material.glsl.
_TEXELS, _FIRST_MAP, _IN_ROW = 20, 5, 256
_ROW_VERTICES = 4096


class Reflectance(NamedTuple):
    """Reflectance of a glossy, metallic or mapped material on a mesh.

    Attributes:
        record: index of its record in the table.
        maps: arrays of its maps, in the order of `Material.maps`; None for missing maps.
        second_coordinates: True if a map uses the second texture coordinates.
    """

    record: int
    maps: tuple[TextureArray | None, ...]
    second_coordinates: bool


class MaterialTable:
    """Records of materials; grows with new materials.

    Args:
        context: OpenGL context.
    """

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._records: list[NDArray[np.float32]] = []
        self._uploaded = 0
        self._texture: moderngl.Texture | None = None

    def append(self, material: Material, layers: Sequence[int | None]) -> int:
        """Append a material, given the array layers of its maps; return the index of its record."""
        self._records.append(_record(material, layers))
        return len(self._records) - 1

    @property
    def texture(self) -> moderngl.Texture | None:
        """Texture of the table; None while it is empty."""
        if self._uploaded != len(self._records):
            rows = -(-len(self._records) // _IN_ROW)
            values = np.zeros((rows * _IN_ROW, _TEXELS, 4), dtype=np.float32)
            values[: len(self._records)] = self._records
            size = (_IN_ROW * _TEXELS, rows)
            self._texture = texture_2d(self._context, size, 4, values)
            self._uploaded = len(self._records)
        return self._texture


def vertex_details(
    context: moderngl.Context, meshes: Sequence[tuple[Mesh, int]]
) -> moderngl.Texture:
    """Second texture coordinates and material record of each vertex, mesh after mesh.

    Args:
        context: OpenGL context.
        meshes: meshes, each with its material's record.
    """
    bases = np.cumsum([0, *(len(mesh.positions) for mesh, _ in meshes)]).tolist()
    placed = [(mesh, record, base) for (mesh, record), base in zip(meshes, bases, strict=False)]
    return placed_details(context, placed)


def placed_details(
    context: moderngl.Context, meshes: Sequence[tuple[Mesh, int, int]]
) -> moderngl.Texture:
    """Details as from `vertex_details`, with the first vertex of each mesh."""
    count = max(base + len(mesh.positions) for mesh, _, base in meshes)
    rows = max(1, -(-count // _ROW_VERTICES))
    values = np.zeros((rows * _ROW_VERTICES, 4), dtype=np.float32)
    for mesh, record, base in meshes:
        part = values[base : base + len(mesh.positions)]
        if mesh.second_texture_coordinates is not None:
            part[:, :2] = mesh.second_texture_coordinates
        part[:, 2] = record
    return texture_2d(context, (_ROW_VERTICES, rows), 4, values)


def _record(material: Material, layers: Sequence[int | None]) -> NDArray[np.float32]:
    record = np.zeros((_TEXELS, 4), dtype=np.float32)
    f0 = dielectric_f0(material.ior, material.specular, material.specular_color)
    record[0] = *f0, material.specular
    record[1] = (
        material.metallic, material.roughness, material.normal_scale, material.occlusion_strength
    )  # fmt: skip
    record[2] = *material.emissive, material.pane_transmission
    record[3] = (
        material.clearcoat, material.clearcoat_roughness, material.clearcoat_normal_scale,
        material.ior,
    )  # fmt: skip
    record[4] = *tinted_reflectance(material.ior, material.specular_color), material.is_slab
    record[19, :3] = material.optical_depths
    for number, (texture, layer) in enumerate(zip(material.maps, layers, strict=True)):
        if texture is not None and layer is not None:
            across, down = texture.uv_transform
            record[_FIRST_MAP + 2 * number] = *across, layer
            record[_FIRST_MAP + 2 * number + 1] = *down, texture.uv_set
    return record
