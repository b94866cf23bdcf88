"""Features of glTF: applied, omitted with a notice, ignored or refused.

`FEATURES` is the source of the notices, of the table in the documentation and of its tests.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from omnisim.core.errors import SceneError
from omnisim.core.short_repr import counted
from omnisim.scene.formats.features import Feature, Support
from omnisim.scene.formats.gltf.further_extensions import IGNORED, LEFT_OUT, OTHER_IMAGES
from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.formats.gltf.materials.reflectance import has_transmission_map
from omnisim.scene.formats.gltf.primitives import POINTS_AND_LINES, TRIANGLES

_GROUPS_OF_NODES = ("shining",)
_NEAREST = 9728  # OpenGL's constant


@dataclass(frozen=True)
class DrawnObjects:
    """Objects of a file that its scene draws.

    Attributes:
        nodes: nodes of the scene.
        primitives: primitives of the nodes' meshes.
        materials: materials of the primitives, except unlit ones, which have a base color only.
        samplers: texture samplers of the file.
        animations: animations that are not played, if none was chosen by name.
        channels: channels of the played animation.
        shining: nodes with lights that the animation would move.
    """

    nodes: Sequence[JsonObject] = ()
    primitives: Sequence[JsonObject] = ()
    materials: Sequence[JsonObject] = ()
    samplers: Sequence[JsonObject] = ()
    animations: Sequence[JsonObject] = ()
    channels: Sequence[JsonObject] = ()
    shining: Sequence[JsonObject] = ()


def feature_notices(drawn: DrawnObjects, used_extensions: Sequence[str]) -> list[str]:
    """Notices for used features that are not drawn, one line each."""
    notices = []
    for feature in FEATURES:
        if feature.support is Support.LEFT_OUT and feature.group:
            count = sum(_uses(entry, feature) for entry in getattr(drawn, feature.group))
            if count:
                noun = "node" if feature.group in _GROUPS_OF_NODES else feature.group[:-1]
                notices.append(f"{feature.effect} ({counted(count, noun)})")
    known = {name for one in FEATURES if not _is_noted_by_name(one) for name in one.extensions}
    return notices + [f"{name} is not read" for name in used_extensions if name not in known]


def _is_noted_by_name(feature: Feature) -> bool:
    return feature.support is Support.LEFT_OUT and not feature.group


def _uses(entry: JsonObject, feature: Feature) -> bool:
    try:
        return feature.is_used(entry)
    except SceneError:  # a damaged value of a feature that is not read
        return True


def _extension(name: str, key: str, effect: str, neutral: float = 0.0) -> Feature:
    """Omitted material extension; the neutral value of its key has no effect."""

    def is_used(material: JsonObject) -> bool:
        extension = material.extension(name)
        return extension is not None and extension.number(key, neutral) != neutral

    return Feature(name, Support.LEFT_OUT, effect, "materials", is_used)


def _color(entry: JsonObject, key: str, default: float) -> tuple[float, ...]:
    return entry.numbers(key, 3) or (default, default, default)


def _has_map(extension: str, *names: str) -> Callable[[JsonObject], bool]:
    def is_used(material: JsonObject) -> bool:
        entry = material.extension(extension)
        return entry is not None and any(entry.has(name) for name in names)

    return is_used


def _has_sheen(material: JsonObject) -> bool:
    sheen = material.extension("KHR_materials_sheen")
    return sheen is not None and any(_color(sheen, "sheenColorFactor", 0.0))


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
    Feature("COLOR_0", _APPLIED, "linear, times the base color"),
    Feature("skins", _APPLIED, "linear blend skinning"),
    Feature("JOINTS_1", _APPLIED, "up to eight joints a vertex"),
    Feature(
        "JOINTS_2", _LEFT_OUT, "joints beyond the eighth of a vertex are not applied",
        "primitives", lambda primitive: primitive.object("attributes").has("JOINTS_2"),
    ),
    Feature("weights", _APPLIED, "of morph targets: positions and normals"),
    Feature("animations", _APPLIED, "the first, or that of the scene's TOML; it repeats"),
    Feature("interpolation", _APPLIED, "in steps, linear (slerp) and cubic splines"),
    Feature(
        "further animations", _LEFT_OUT, "animations are not played",
        "animations", lambda _: True,
    ),
    Feature("target: translation, rotation", _APPLIED, "nodes move as objects; joints bend skins"),
    Feature("target: scale", _APPLIED, "meshes deform"),
    Feature("target: weights", _APPLIED, "meshes deform"),
    Feature(
        "target: lights", _LEFT_OUT, "lights of animated nodes rest", "shining",
        lambda _: True,
    ),
    Feature(
        "KHR_animation_pointer", _LEFT_OUT, "animations of what is no node are not played",
        "channels",
        lambda channel: channel.object("target").text("path", "") == "pointer",
    ),
    Feature("camera", _APPLIED, "a viewpoint, with a perspective lens: `--at-camera`"),
    Feature("baseColorFactor", _APPLIED, "linear"),
    Feature("baseColorTexture", _APPLIED, "with any set of texture coordinates"),
    Feature("wrapS, wrapT", _APPLIED, "repeated, mirrored or clamped"),
    Feature(
        "magFilter: 9728", _LEFT_OUT, "textures are filtered linearly, not by the nearest texel",
        "samplers", lambda sampler: sampler.integer("magFilter", 0) == _NEAREST,
    ),
    Feature("alphaMode, alphaCutoff", _APPLIED, "opaque, mask and blend"),
    Feature("doubleSided", _APPLIED, "both sides; or the front alone"),
    Feature("metallicFactor, roughnessFactor", _APPLIED, "without a material: matte"),
    Feature("metallicRoughnessTexture", _APPLIED, "linear, times the factors"),
    Feature("normalTexture", _APPLIED, "with its scale; tangents are the triangles'"),
    Feature(
        "TANGENT", _LEFT_OUT, "without a notice: tangents follow from the texture coordinates, of "
        "each triangle",
    ),
    Feature("occlusionTexture", _APPLIED, "with its strength, of light from everywhere"),
    Feature("emissiveFactor, emissiveTexture", _APPLIED, "1 is white, whatever the exposure"),
    Feature("KHR_texture_transform", _APPLIED, "of the base color and of all maps"),
    Feature("EXT_texture_webp", _APPLIED, "WebP images"),
    Feature("KHR_texture_basisu", _REFUSED, "KTX 2 images; where not required, the plain image"),
    Feature("KHR_mesh_quantization", _APPLIED, "vertices of 8 and 16 bits"),
    Feature("KHR_draco_mesh_compression", _APPLIED, "with the extra `draco`, else refused"),
    *(
        Feature(name, _APPLIED, "with the extra `meshopt`; else refused without plain data")
        for name in ("EXT_meshopt_compression", "KHR_meshopt_compression")
    ),
    Feature("EXT_mesh_gpu_instancing", _APPLIED, "each copy is an instance; copies do not deform"),
    Feature("KHR_node_visibility", _LEFT_OUT, "hidden nodes are drawn", "nodes", _is_hidden),
    Feature("KHR_lights_punctual", _APPLIED, "directional, point and spot"),
    Feature("KHR_materials_unlit", _APPLIED, "its other properties do not count"),
    Feature("KHR_materials_pbrSpecularGlossiness", _APPLIED, "as a dielectric"),
    Feature(
        "specularGlossinessTexture", _LEFT_OUT, "maps of specular color and gloss are not drawn",
        "materials", _has_map("KHR_materials_pbrSpecularGlossiness", "specularGlossinessTexture"),
    ),
    _extension("KHR_materials_anisotropy", "anisotropyStrength", "anisotropy is not drawn"),
    Feature(
        "KHR_materials_clearcoat", _APPLIED,
        "its factors and maps, of which the first two are placed alike",
    ),
    _extension(
        "KHR_materials_diffuse_transmission", "diffuseTransmissionFactor",
        "diffuse transmission is not drawn",
    ),
    Feature("KHR_materials_dispersion", _APPLIED, "of thick glass, with `--backend rays`"),
    Feature("KHR_materials_emissive_strength", _APPLIED, "times the emission"),
    Feature("KHR_materials_ior", _APPLIED, "of the gloss of a dielectric, and of glass"),
    _extension("KHR_materials_iridescence", "iridescenceFactor", "iridescence is not drawn"),
    Feature("KHR_materials_sheen", _LEFT_OUT, "sheen is not drawn", "materials", _has_sheen),
    Feature(
        "KHR_materials_specular", _APPLIED, "its factors and maps, which are placed alike"
    ),
    Feature(
        "KHR_materials_transmission", _APPLIED,
        "of clear panes and clear, thick glass; of frosted panes with `--backend rays`",
    ),
    Feature(
        "transmissionTexture", _LEFT_OUT, "maps of transmission are not drawn: glass is opaque",
        "materials", has_transmission_map,
    ),
    Feature(
        "KHR_materials_volume", _APPLIED,
        "of thick, clear glass, whose mesh is the body; `cube` approximates it",
    ),
    Feature(
        "KHR_materials_variants", _LEFT_OUT, "variants of materials are not used: the default is",
        "primitives", _has_extension("KHR_materials_variants"),
    ),
    *(
        Feature(name, _REFUSED, "where not required, the plain image is read")
        for name in OTHER_IMAGES
    ),
    *(Feature(name, _LEFT_OUT, effect) for name, effect in LEFT_OUT.items()),
    *(Feature(name, Support.IGNORED, effect) for name, effect in IGNORED.items()),
)  # fmt: skip
# Extensions that a file may require: applied ones, and those that only change the appearance.
SUPPORTED_EXTENSIONS = frozenset(
    name
    for feature in FEATURES
    for name in feature.extensions
    if feature.support in (_APPLIED, Support.IGNORED)
    or (feature.support is _LEFT_OUT and re.match(r"[A-Z]+_(materials|lights)_", name))
)
