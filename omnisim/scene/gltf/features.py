"""Features of glTF: applied, left out with a notice, or refused.

The notices, the table in the documentation and its tests are made from `FEATURES`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from omnisim.errors import SceneError
from omnisim.scene.gltf.json_object import JsonObject
from omnisim.scene.gltf.primitives import POINTS_AND_LINES, TRIANGLES
from omnisim.short_repr import counted

_NEAREST = 9728  # OpenGL's number
_MATTE_IOR = 1.5  # the default: 4 % reflectance


class Support(Enum):
    """Treatment of a feature."""

    APPLIED = "applied"
    LEFT_OUT = "left out"
    REFUSED = "refused"


@dataclass(frozen=True)
class Feature:
    """Property or extension of glTF.

    Attributes:
        name: as in the file, or several of one purpose.
        support: treatment.
        effect: the notice of a feature that is left out, and its words in the documentation.
        group: objects that have it, a name of `DrawnObjects`; empty: it gets no notice.
        is_used: true for an object of the group that the feature would change.
    """

    name: str
    support: Support
    effect: str
    group: str = ""
    is_used: Callable[[JsonObject], bool] = lambda _: False

    @property
    def is_extension(self) -> bool:
        """True for an extension."""
        return self.name.startswith(("KHR_", "EXT_"))


@dataclass(frozen=True)
class DrawnObjects:
    """Objects of a file, those that its scene draws.

    Attributes:
        nodes: of the scene.
        weights: nodes with a mesh, or that mesh, where it has the weights of morph targets.
        primitives: of the nodes' meshes.
        materials: of the primitives, without unlit ones, which have a base colour only.
        samplers, animations: of the file.
    """

    nodes: Sequence[JsonObject] = ()
    weights: Sequence[JsonObject] = ()
    primitives: Sequence[JsonObject] = ()
    materials: Sequence[JsonObject] = ()
    samplers: Sequence[JsonObject] = ()
    animations: Sequence[JsonObject] = ()


def feature_notices(drawn: DrawnObjects, used_extensions: Sequence[str]) -> list[str]:
    """One line for each feature that a file uses and that is not drawn."""
    notices = []
    for feature in FEATURES:
        if feature.support is Support.LEFT_OUT and feature.group:
            count = sum(_uses(entry, feature) for entry in getattr(drawn, feature.group))
            if count:
                noun = "node" if feature.group == "weights" else feature.group[:-1]
                notices.append(f"{feature.effect} ({counted(count, noun)})")
    known = {feature.name for feature in FEATURES} | _INVISIBLE_EXTENSIONS
    return notices + [f"{name} is not read" for name in used_extensions if name not in known]


def _uses(entry: JsonObject, feature: Feature) -> bool:
    try:
        return feature.is_used(entry)
    except SceneError:  # a damaged value of what is not read
        return True


def _extension(name: str, key: str, effect: str, neutral: float = 0.0) -> Feature:
    """Extension of materials that is left out; the neutral value of its key changes nothing."""

    def is_used(material: JsonObject) -> bool:
        extension = material.extension(name)
        return extension is not None and extension.number(key, neutral) != neutral

    return Feature(name, Support.LEFT_OUT, effect, "materials", is_used)


def _map(name: str, share: str, effect: str) -> Feature:
    """Texture of materials that is left out; `share` is the key of its strength."""

    def is_used(material: JsonObject) -> bool:
        return material.has(name) and material.object(name).number(share, 1.0) != 0.0

    return Feature(name, Support.LEFT_OUT, effect, "materials", is_used)


def _color(entry: JsonObject, key: str, default: float) -> tuple[float, ...]:
    return entry.numbers(key, 3) or (default, default, default)


def _emits(material: JsonObject) -> bool:
    return any(_color(material, "emissiveFactor", 0.0))


def _emits_strongly(material: JsonObject) -> bool:
    extension = material.extension("KHR_materials_emissive_strength")
    strength = 1.0 if extension is None else extension.number("emissiveStrength", 1.0)
    return _emits(material) and strength != 1.0


def _is_glossy(material: JsonObject) -> bool:
    glossy = material.extension("KHR_materials_pbrSpecularGlossiness")
    return glossy is not None and (
        any(_color(glossy, "specularFactor", 1.0)) or glossy.has("specularGlossinessTexture")
    )


def _metallic(material: JsonObject) -> JsonObject | None:
    """Metallic-roughness values, where they are stated and count."""
    if material.extension("KHR_materials_pbrSpecularGlossiness") is not None:
        return None
    has = material.has("pbrMetallicRoughness")
    return material.object("pbrMetallicRoughness") if has else None


def _is_metal(material: JsonObject) -> bool:
    values = _metallic(material)
    if values is None or values.has("metallicRoughnessTexture"):
        return False
    return values.number("metallicFactor", 1.0) > 0.0


def _has_metal_map(material: JsonObject) -> bool:
    values = _metallic(material)
    return values is not None and values.has("metallicRoughnessTexture")


def _has_sheen(material: JsonObject) -> bool:
    sheen = material.extension("KHR_materials_sheen")
    return sheen is not None and any(_color(sheen, "sheenColorFactor", 0.0))


def _has_specular(material: JsonObject) -> bool:
    specular = material.extension("KHR_materials_specular")
    return specular is not None and (
        specular.number("specularFactor", 1.0) != 1.0
        or _color(specular, "specularColorFactor", 1.0) != (1.0, 1.0, 1.0)
        or specular.has("specularTexture")
        or specular.has("specularColorTexture")
    )


def _is_hidden(node: JsonObject) -> bool:
    visibility = node.extension("KHR_node_visibility")
    return visibility is not None and visibility.has("visible") and not visibility.flag("visible")


def _has_extension(name: str) -> Callable[[JsonObject], bool]:
    return lambda entry: entry.extension(name) is not None


_APPLIED, _LEFT_OUT, _REFUSED = Support.APPLIED, Support.LEFT_OUT, Support.REFUSED
FEATURES = (
    Feature("translation, rotation, scale, matrix", _APPLIED, "of nodes and their parents"),
    Feature("mode: 4, 5, 6", _APPLIED, "triangles, their strips and fans"),
    Feature(
        "mode: 0, 1, 2, 3", _LEFT_OUT, "points and lines are not drawn", "primitives",
        lambda primitive: primitive.integer("mode", TRIANGLES) in POINTS_AND_LINES,
    ),
    Feature("sparse", _APPLIED, "of accessors"),
    Feature("NORMAL", _APPLIED, "smooth shading; flat without it"),
    Feature("COLOR_0", _APPLIED, "linear, times the base colour"),
    Feature("skins", _APPLIED, "in the pose of the file, four joints a vertex"),
    Feature(
        "JOINTS_1", _LEFT_OUT, "joints beyond the fourth of a vertex are not applied",
        "primitives", lambda primitive: primitive.object("attributes").has("JOINTS_1"),
    ),
    Feature(
        "weights", _LEFT_OUT, "morph targets are not applied", "weights",
        lambda holder: any(holder.array("weights")),
    ),
    Feature("animations", _LEFT_OUT, "animations are not played", "animations", lambda _: True),
    Feature(
        "camera", _LEFT_OUT, "cameras are not used as viewpoints", "nodes",
        lambda node: node.has("camera"),
    ),
    Feature("baseColorFactor", _APPLIED, "linear"),
    Feature("baseColorTexture", _APPLIED, "with any set of texture coordinates"),
    Feature("wrapS, wrapT", _APPLIED, "repeated, mirrored or clamped"),
    Feature(
        "magFilter: 9728", _LEFT_OUT, "textures are filtered linearly, not by the nearest texel",
        "samplers", lambda sampler: sampler.integer("magFilter", 0) == _NEAREST,
    ),
    Feature("alphaMode, alphaCutoff", _APPLIED, "opaque, mask and blend"),
    Feature("doubleSided", _APPLIED, "both sides; or the front alone"),
    Feature(
        "metallicFactor", _LEFT_OUT, "metals are drawn as matt surfaces of their colour",
        "materials", _is_metal,
    ),
    Feature(
        "roughnessFactor", _LEFT_OUT, "without a notice: at most 4 % of the light that a surface "
        "reflects ahead, if it is no metal",
    ),
    Feature(
        "metallicRoughnessTexture", _LEFT_OUT, "maps of metal and roughness are not drawn",
        "materials", _has_metal_map,
    ),
    _map("normalTexture", "scale", "normal maps are not drawn"),
    _map("occlusionTexture", "strength", "occlusion maps are not drawn"),
    Feature(
        "emissiveFactor, emissiveTexture", _LEFT_OUT, "emission is not drawn", "materials", _emits
    ),
    Feature("KHR_texture_transform", _APPLIED, "of the base colour"),
    Feature("EXT_texture_webp", _APPLIED, "WebP images"),
    Feature("KHR_texture_basisu", _REFUSED, "KTX 2 images; where not required, the plain image"),
    Feature("KHR_mesh_quantization", _APPLIED, "vertices of 8 and 16 bits"),
    Feature("KHR_draco_mesh_compression", _APPLIED, "where DracoPy is installed, else refused"),
    *(
        Feature(name, _REFUSED, "where not required, the plain data are read")
        for name in ("EXT_meshopt_compression", "KHR_meshopt_compression")
    ),
    Feature(
        "EXT_mesh_gpu_instancing", _LEFT_OUT,
        "EXT_mesh_gpu_instancing is not read: one of each is drawn", "nodes",
        _has_extension("EXT_mesh_gpu_instancing"),
    ),
    Feature("KHR_node_visibility", _LEFT_OUT, "hidden nodes are drawn", "nodes", _is_hidden),
    Feature("KHR_lights_punctual", _APPLIED, "directional, point and spot, without shadows"),
    Feature("KHR_materials_unlit", _APPLIED, "its other properties do not count"),
    Feature("KHR_materials_pbrSpecularGlossiness", _APPLIED, "its diffuse factor and texture"),
    Feature(
        "specularFactor, specularGlossinessTexture", _LEFT_OUT,
        "specular colour and glossiness are not drawn", "materials", _is_glossy,
    ),
    _extension("KHR_materials_anisotropy", "anisotropyStrength", "anisotropy is not drawn"),
    _extension("KHR_materials_clearcoat", "clearcoatFactor", "clear coats are not drawn"),
    _extension(
        "KHR_materials_diffuse_transmission", "diffuseTransmissionFactor",
        "diffuse transmission is not drawn",
    ),
    _extension("KHR_materials_dispersion", "dispersion", "dispersion is not drawn"),
    Feature(
        "KHR_materials_emissive_strength", _LEFT_OUT, "strength of emission is not drawn",
        "materials", _emits_strongly,
    ),
    _extension("KHR_materials_ior", "ior", "refractive indices are not used", _MATTE_IOR),
    _extension("KHR_materials_iridescence", "iridescenceFactor", "iridescence is not drawn"),
    Feature("KHR_materials_sheen", _LEFT_OUT, "sheen is not drawn", "materials", _has_sheen),
    Feature(
        "KHR_materials_specular", _LEFT_OUT, "specular strength and colour are not drawn",
        "materials", _has_specular,
    ),
    _extension(
        "KHR_materials_transmission", "transmissionFactor",
        "transmission is not drawn: glass is opaque",
    ),
    _extension("KHR_materials_volume", "thicknessFactor", "volumes are not drawn"),
    Feature(
        "KHR_materials_variants", _LEFT_OUT, "variants of materials are not used: the default is",
        "primitives", _has_extension("KHR_materials_variants"),
    ),
)  # fmt: skip
SUPPORTED_EXTENSIONS = frozenset(
    feature.name for feature in FEATURES if feature.is_extension and feature.support is _APPLIED
)
# Metadata, behaviour, and parts of what has its own notice.
_INVISIBLE_EXTENSIONS = frozenset(
    (
        "EXT_mesh_features", "EXT_structural_metadata", "EXT_texture_avif",
        "EXT_instance_features", "KHR_animation_pointer", "KHR_audio_emitter",
        "KHR_implicit_shapes", "KHR_interactivity", "KHR_node_hoverability",
        "KHR_node_selectability", "KHR_physics_rigid_bodies", "KHR_xmp", "KHR_xmp_json_ld",
        "MSFT_lod", "MSFT_texture_dds",
    )
)  # fmt: skip
