"""Features of glTF: applied, omitted with a notice, ignored or refused.

`FEATURES` is the source of the notices, of the table in the documentation and of its tests.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from omnisim.core.errors import SceneError
from omnisim.core.short_repr import counted
from omnisim.scene.formats.features import Feature, Support, feature_table
from omnisim.scene.formats.gltf.document import JsonObject
from omnisim.scene.formats.gltf.materials import has_transmission_map
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


def _differs(name: str, key: str) -> Callable[[JsonObject], bool]:
    """Predicate for materials with an extension whose factor is not 0."""

    def is_used(material: JsonObject) -> bool:
        extension = material.extension(name)
        return extension is not None and extension.number(key, 0.0) != 0.0

    return is_used


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


# Predicates for the objects of a feature's group; by default, all use it.
_USES: dict[str, Callable[[JsonObject], bool]] = {
    "mode: 0, 1, 2, 3": lambda one: one.integer("mode", TRIANGLES) in POINTS_AND_LINES,
    "JOINTS_2": lambda primitive: primitive.object("attributes").has("JOINTS_2"),
    "KHR_animation_pointer": (
        lambda channel: channel.object("target").text("path", "") == "pointer"
    ),
    "magFilter: 9728": lambda sampler: sampler.integer("magFilter", 0) == _NEAREST,
    "KHR_node_visibility": _is_hidden,
    "specularGlossinessTexture": _has_map(
        "KHR_materials_pbrSpecularGlossiness", "specularGlossinessTexture"
    ),
    "KHR_materials_anisotropy": _differs("KHR_materials_anisotropy", "anisotropyStrength"),
    "KHR_materials_diffuse_transmission": _differs(
        "KHR_materials_diffuse_transmission", "diffuseTransmissionFactor"
    ),
    "KHR_materials_iridescence": _differs("KHR_materials_iridescence", "iridescenceFactor"),
    "KHR_materials_sheen": _has_sheen,
    "transmissionTexture": has_transmission_map,
    "KHR_materials_variants": lambda one: one.extension("KHR_materials_variants") is not None,
}
FEATURES = tuple(
    replace(one, is_used=_USES.get(one.name, one.is_used)) for one in feature_table("gltf")
)
# Extensions that a file may require: applied ones, and those that only change the appearance.
SUPPORTED_EXTENSIONS = frozenset(
    name
    for feature in FEATURES
    for name in feature.extensions
    if feature.support in (Support.APPLIED, Support.IGNORED)
    or (feature.support is Support.LEFT_OUT and re.match(r"[A-Z]+_(materials|lights)_", name))
)
