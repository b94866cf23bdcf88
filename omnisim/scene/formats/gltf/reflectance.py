"""Reflectance of materials: metal, roughness, gloss, clear coat and emission."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.model import Material, Texture

DEFAULT_IOR = 1.5
_BRIGHTEST = 65504.0  # largest half float, the precision of images
_MAX_SCALE = 1e3
Color = tuple[float, float, float]


def with_reflectance(
    material: Material, entry: JsonObject, maps: Sequence[Texture | None]
) -> Material:
    """Material with the reflectance of its JSON entry, and maps in the order of `Material.maps`.

    Source: glTF 2.0, section 3.9; KHR_materials_emissive_strength, _ior, _specular, _clearcoat,
    _transmission, _volume, _dispersion, and the glossiness of KHR_materials_pbrSpecularGlossiness.
    """
    metallic_roughness, normal, occlusion, emissive, gloss, clear, coat_normal = maps
    metallic = entry.object("pbrMetallicRoughness")
    color, scale = _emissive(entry), entry.object("normalTexture").number("scale", 1.0)
    strength = _share(entry.object("occlusionTexture"), "strength", 1.0)
    common = replace(
        material,
        emissive=color,
        normal_scale=_scale(scale),
        occlusion_strength=strength,
        normal_map=normal if scale else None,
        occlusion_map=occlusion if strength else None,
        emissive_map=emissive if any(color) else None,
    )
    glossy = entry.extension("KHR_materials_pbrSpecularGlossiness")
    if glossy is not None:
        return _specular_glossiness(common, glossy)
    coat = entry.extension("KHR_materials_clearcoat") or JsonObject({}, "")
    specular = entry.extension("KHR_materials_specular") or JsonObject({}, "")
    ior = entry.extension("KHR_materials_ior") or JsonObject({}, "")
    volume = entry.extension("KHR_materials_volume") or JsonObject({}, "")
    dispersion = entry.extension("KHR_materials_dispersion") or JsonObject({}, "")
    strength, coating = (
        _share(specular, "specularFactor", 1.0),
        _share(coat, "clearcoatFactor", 0.0),
    )
    coat_scale = coat.object("clearcoatNormalTexture").number("scale", 1.0)
    return replace(
        common,
        metallic=_share(metallic, "metallicFactor", 1.0),
        roughness=_share(metallic, "roughnessFactor", 1.0),
        specular=strength,
        specular_color=_color(specular, "specularColorFactor", 1.0),
        ior=max(ior.number("ior", DEFAULT_IOR), 1.0),
        transmission=0.0 if has_transmission_map(entry) else _transmission(entry),
        thickness_m=max(volume.number("thicknessFactor", 0.0), 0.0),
        attenuation_color=_attenuation_color(volume),
        attenuation_distance_m=_attenuation_distance_m(volume),
        dispersion=max(dispersion.number("dispersion", 0.0), 0.0),
        clearcoat=coating,
        clearcoat_roughness=_share(coat, "clearcoatRoughnessFactor", 0.0),
        clearcoat_normal_scale=_scale(coat_scale),
        metallic_roughness_map=metallic_roughness,
        specular_map=gloss if strength else None,
        clearcoat_map=clear if coating else None,
        clearcoat_normal_map=coat_normal if coating and coat_scale else None,
    )


def has_transmission_map(entry: JsonObject) -> bool:
    """True for a material that transmits light by a map."""
    transmission = entry.extension("KHR_materials_transmission") or JsonObject({}, "")
    return _transmission(entry) > 0.0 and transmission.has("transmissionTexture")


def _attenuation_color(volume: JsonObject) -> Color:
    red, green, blue = (min(max(one, 0.0), 1.0) for one in _color(volume, "attenuationColor", 1.0))
    return red, green, blue


def _attenuation_distance_m(volume: JsonObject) -> float:
    distance_m = volume.number("attenuationDistance", 0.0)
    return distance_m if distance_m > 0.0 else math.inf


def _transmission(entry: JsonObject) -> float:
    transmission = entry.extension("KHR_materials_transmission") or JsonObject({}, "")
    return _share(transmission, "transmissionFactor", 0.0)


def _specular_glossiness(material: Material, glossy: JsonObject) -> Material:
    """Dielectric whose reflectance at normal incidence is the specular factor."""
    red, green, blue = (min(max(one, 0.0), 1.0) for one in _color(glossy, "specularFactor", 1.0))
    return replace(
        material,
        roughness=1.0 - _share(glossy, "glossinessFactor", 1.0),
        specular=1.0,
        specular_color=(25.0 * red, 25.0 * green, 25.0 * blue),  # relative to 4 %, at index 1.5
    )


def _emissive(entry: JsonObject) -> Color:
    strength = entry.extension("KHR_materials_emissive_strength")
    factor = 1.0 if strength is None else max(strength.number("emissiveStrength", 1.0), 0.0)
    red, green, blue = (
        min(factor * max(one, 0.0), _BRIGHTEST) for one in _color(entry, "emissiveFactor", 0.0)
    )
    return red, green, blue


def _scale(scale: float) -> float:
    return min(max(scale, -_MAX_SCALE), _MAX_SCALE)


def _share(entry: JsonObject, key: str, default: float) -> float:
    return min(max(entry.number(key, default), 0.0), 1.0)


def _color(entry: JsonObject, key: str, default: float) -> Color:
    red, green, blue = entry.numbers(key, 3) or (default, default, default)
    return red, green, blue
