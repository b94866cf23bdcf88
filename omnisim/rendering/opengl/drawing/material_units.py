"""Texture units and defines of programs that read materials: table, vertex details, maps."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl

from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.gpu_textures import AnyTexture
from omnisim.rendering.opengl.gl.shader_files import set_sampler
from omnisim.rendering.opengl.materials.scene_textures import MAP_UNITS

MAPS = (  # in the order of `Material.maps`
    "metallic_roughness_map", "normal_map", "occlusion_map", "emissive_map",
    "specular_map", "clearcoat_map", "clearcoat_normal_map",
)  # fmt: skip
_MAP_UNITS = {f"u_{name}": unit for unit, name in zip(MAP_UNITS, MAPS, strict=True)}
_DETAILS_UNIT, _MATERIALS_UNIT, _ITEM_DETAILS_UNIT = 10, 11, 12


def map_units() -> list[tuple[int, str]]:
    """Texture units and sampler names of the maps, in the order of `Material.maps`."""
    return [(unit, name) for name, unit in _MAP_UNITS.items()]


def reflectance_defines(
    maps: Sequence[bool] | None, second_coordinates: bool = False
) -> tuple[str, ...]:
    """Defines of a material with the given maps; None: a matte material."""
    if maps is None:
        return ()
    has_maps = [name for name, is_there in zip(MAPS, maps, strict=True) if is_there]
    return (
        "REFLECTANCE",
        *(name.upper() for name in has_maps),
        *(["TEXTURE_COORDINATES"] if has_maps else []),
        *(["SECOND_COORDINATES"] if second_coordinates else []),
    )


def connect_material(program: moderngl.Program, clustered: bool) -> None:
    """Set the texture units of a program's material maps and tables."""
    details = _DETAILS_UNIT if clustered else _ITEM_DETAILS_UNIT
    units = {**_MAP_UNITS, "u_materials": _MATERIALS_UNIT, "u_vertex_details": details}
    for name, unit in units.items():
        set_sampler(program, name, unit)


def material_tables(buffers: SceneBuffers, has_item_details: bool) -> dict[int, AnyTexture]:
    """Tables of materials and vertex details by unit, on request also of single items."""
    clusters, materials = buffers.clustered_geometry, buffers.materials.texture
    if materials is None:
        return {}
    tables: dict[int, AnyTexture] = {_MATERIALS_UNIT: materials}
    if has_item_details and buffers.item_details is not None:
        tables[_ITEM_DETAILS_UNIT] = buffers.item_details
    if clusters is not None and clusters.details is not None:
        tables[_DETAILS_UNIT] = clusters.details
    return tables
