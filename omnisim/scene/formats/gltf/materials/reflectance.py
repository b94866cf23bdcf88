"""Reflectance of materials: metal, roughness, gloss, clear coat and emission."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.formats.gltf.materials.factors import Color, Factors
from omnisim.scene.model import Material, Texture

DEFAULT_IOR = 1.5
_WHOLE = 25.0  # specular color with which a dielectric of that index reflects all, not 4 %
_BRIGHTEST = 65504.0  # largest half float, the precision of images
_MAX_SCALE = 1e3


def with_reflectance(
    material: Material, entry: JsonObject, maps: Sequence[Texture | None], factors: Factors
) -> Material:
    """Material with the reflectance of its JSON entry, and maps in the order of `Material.maps`.

    Factors outside their ranges are limited, and recorded in `factors`. An index of refraction of 0
    means that the specular color is the reflectance itself, as of a metal.

    Source: glTF 2.0, section 3.9; KHR_materials_emissive_strength, _ior, _specular, _clearcoat,
    _transmission, _volume, _dispersion, and the glossiness of KHR_materials_pbrSpecularGlossiness.
    """
    metallic_roughness, normal, occlusion, emissive, gloss, clear, coat_normal = maps
    metallic = entry.object("pbrMetallicRoughness")
    color, scale = _emissive(entry, factors), _scale(entry.object("normalTexture"), factors)
    strength = factors.share(entry.object("occlusionTexture"), "strength", 1.0)
    common = replace(
        material,
        emissive=color,
        normal_scale=scale,
        occlusion_strength=strength,
        normal_map=normal if scale else None,
        occlusion_map=occlusion if strength else None,
        emissive_map=emissive if any(color) else None,
    )
    glossy = entry.extension("KHR_materials_pbrSpecularGlossiness")
    if glossy is not None:
        return _specular_glossiness(common, glossy, factors)
    coat = entry.extension("KHR_materials_clearcoat") or JsonObject({}, "")
    specular = entry.extension("KHR_materials_specular") or JsonObject({}, "")
    ior = entry.extension("KHR_materials_ior") or JsonObject({}, "")
    volume = entry.extension("KHR_materials_volume") or JsonObject({}, "")
    dispersion = entry.extension("KHR_materials_dispersion") or JsonObject({}, "")
    strength, coating = (
        factors.share(specular, "specularFactor", 1.0),
        factors.share(coat, "clearcoatFactor", 0.0),
    )
    coat_scale = _scale(coat.object("clearcoatNormalTexture"), factors)
    gives_reflectance = ior.number("ior", DEFAULT_IOR) == 0.0
    is_opaque = gives_reflectance or has_transmission_map(entry)
    red, green, blue = factors.color(specular, "specularColorFactor", 1.0)
    return replace(
        common,
        metallic=factors.share(metallic, "metallicFactor", 1.0),
        roughness=factors.share(metallic, "roughnessFactor", 1.0),
        specular=strength,
        specular_color=_relative(red, green, blue) if gives_reflectance else (red, green, blue),
        ior=DEFAULT_IOR if gives_reflectance else factors.number(ior, "ior", DEFAULT_IOR, 1.0),
        transmission=0.0 if is_opaque else _transmission(entry, factors),
        thickness_m=factors.number(volume, "thicknessFactor", 0.0, 0.0),
        attenuation_color=factors.color(volume, "attenuationColor", 1.0, 1.0),
        attenuation_distance_m=_attenuation_distance_m(volume, factors),
        dispersion=factors.number(dispersion, "dispersion", 0.0, 0.0),
        clearcoat=coating,
        clearcoat_roughness=factors.share(coat, "clearcoatRoughnessFactor", 0.0),
        clearcoat_normal_scale=coat_scale,
        metallic_roughness_map=metallic_roughness,
        specular_map=gloss if strength else None,
        clearcoat_map=clear if coating else None,
        clearcoat_normal_map=coat_normal if coating and coat_scale else None,
    )


def has_transmission_map(entry: JsonObject) -> bool:
    """True for a material that transmits light by a map."""
    transmission = entry.extension("KHR_materials_transmission") or JsonObject({}, "")
    is_used = transmission.number("transmissionFactor", 0.0) > 0.0
    return is_used and transmission.has("transmissionTexture")


def _attenuation_distance_m(volume: JsonObject, factors: Factors) -> float:
    if not volume.has("attenuationDistance"):
        return math.inf
    distance_m = volume.number("attenuationDistance", 0.0)
    used_m = distance_m if distance_m > 0.0 else math.inf
    return factors.replaced("attenuationDistance", distance_m, used_m)


def _transmission(entry: JsonObject, factors: Factors) -> float:
    transmission = entry.extension("KHR_materials_transmission") or JsonObject({}, "")
    return factors.share(transmission, "transmissionFactor", 0.0)


def _specular_glossiness(material: Material, glossy: JsonObject, factors: Factors) -> Material:
    """Dielectric whose reflectance at normal incidence is the specular factor."""
    red, green, blue = factors.color(glossy, "specularFactor", 1.0, 1.0)
    return replace(
        material,
        roughness=1.0 - factors.share(glossy, "glossinessFactor", 1.0),
        specular=1.0,
        specular_color=_relative(red, green, blue),
    )


def _relative(red: float, green: float, blue: float) -> Color:
    """Specular color of a dielectric of the default index, for a reflectance."""
    return _WHOLE * red, _WHOLE * green, _WHOLE * blue


def _emissive(entry: JsonObject, factors: Factors) -> Color:
    strength = entry.extension("KHR_materials_emissive_strength") or JsonObject({}, "")
    factor = factors.number(strength, "emissiveStrength", 1.0, 0.0)
    bright = [factor * one for one in factors.color(entry, "emissiveFactor", 0.0)]
    peak = max(bright)
    if peak > _BRIGHTEST:
        factors.replaced("emissiveFactor · emissiveStrength", peak, _BRIGHTEST)
    red, green, blue = (min(one, _BRIGHTEST) for one in bright)
    return red, green, blue


def _scale(texture: JsonObject, factors: Factors) -> float:
    return factors.number(texture, "scale", 1.0, -_MAX_SCALE, _MAX_SCALE)
