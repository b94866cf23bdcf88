"""OmniPBR, the material of Omniverse and Isaac Sim, without its gloss maps."""

from __future__ import annotations

from pxr import Sdf

from omnisim.scene.formats.omissions import Omissions
from omnisim.scene.formats.usd.shading.shading import IDENTITY, Inputs, TextureSource
from omnisim.scene.formats.usd.shading.texture_files import TextureFiles
from omnisim.scene.parts import AlphaMode, Material, Texture

NAMES = ("OmniPBR", "OmniPBR_Opacity")
_MAPS = (
    "reflectionroughness_texture", "metallic_texture", "ORM_texture", "ao_texture",
    "emissive_color_texture", "opacity_texture", "detail_normalmap_texture",
)  # fmt: skip
Color = tuple[float, float, float]


def read_omni_pbr(
    name: str, inputs: Inputs, files: TextureFiles, notices: Omissions
) -> tuple[Material, TextureSource | None]:
    """Material, and the texture that determines its meshes' texture coordinates.

    Source: OmniPBR.mdl's parameters and their defaults, by NVIDIA.
    """
    for key in _MAPS:
        if _source(inputs, key) is not None:
            notices.count(f"{key} of OmniPBR is not drawn", "material")
    source = _source(inputs, "diffuse_texture")
    texture = None if source is None else files.texture(source, name)
    color: Color = (1.0, 1.0, 1.0)
    if texture is None:
        color = inputs.get("diffuse_color_constant").color((0.2, 0.2, 0.2))
    red, green, blue = (
        own * tint
        for own, tint in zip(color, inputs.get("diffuse_tint").color((1.0, 1.0, 1.0)), strict=True)
    )
    normal_source = _source(inputs, "normalmap_texture")
    normal: Texture | None = None
    if normal_source is not None:
        normal = files.normals(normal_source, name)
    alpha, mode = 1.0, AlphaMode.OPAQUE
    threshold = inputs.get("opacity_threshold").number(0.0)
    if inputs.get("enable_opacity").value:
        alpha = inputs.get("opacity_constant").number(1.0)
        mode = AlphaMode.MASK if threshold > 0.0 else AlphaMode.BLEND
    emissive: Color = (0.0, 0.0, 0.0)
    if inputs.get("enable_emission").value and inputs.get("emissive_intensity").number(40.0) > 0.0:
        emissive = inputs.get("emissive_color").color((1.0, 0.1, 0.1))
    material = Material(
        name,
        (red, green, blue, alpha),
        texture,
        mode,
        alpha_cutoff=threshold if threshold > 0.0 else 0.5,
        metallic=inputs.get("metallic_constant").number(0.0),
        roughness=inputs.get("reflection_roughness_constant").number(0.5),
        specular=min(2.0 * inputs.get("specular_level").number(0.5), 1.0),
        emissive=emissive,
        normal_scale=inputs.get("bump_factor").number(1.0),
        normal_map=normal,
    )
    return material, source or normal_source


def _source(inputs: Inputs, key: str) -> TextureSource | None:
    """Texture of an input whose value is an asset."""
    value = inputs.get(key).value
    if not isinstance(value, Sdf.AssetPath) or not value.path:
        return None
    (sx, sy), (dx, dy) = inputs.pair("texture_scale", 1.0), inputs.pair("texture_translate", 0.0)
    transform = IDENTITY
    if (sx, sy, dx, dy) != (1.0, 1.0, 0.0, 0.0):  # converts to v down
        transform = (sx, 0.0, dx), (0.0, sy, 1.0 - sy - dy)
    return TextureSource(
        str(value.path), str(value.resolvedPath), "st", transform, ("repeat", "repeat")
    )
