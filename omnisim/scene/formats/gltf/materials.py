"""Materials with their textures and images."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.scene.formats.gltf.document import Accessors, JsonObject, read_uri
from omnisim.scene.formats.gltf.primitives import Primitive
from omnisim.scene.formats.imported_scene import MAX_COORDINATE
from omnisim.scene.formats.resources import AssetResolver
from omnisim.scene.model import AlphaMode, Material, Texture, Wrap
from omnisim.scene.textures import NO_IMAGE, TextureStore, unreadable_image

if TYPE_CHECKING:
    from PIL import Image


_REPEAT, _MIRRORED_REPEAT, _CLAMP_TO_EDGE = 10497, 33648, 33071  # OpenGL's constants
_ALPHA_MODES = {mode.name: mode for mode in AlphaMode}
# Texture and its used channels; None: all channels are 1.
Part = tuple[Texture | None, tuple[int, ...]]


class _Place(NamedTuple):
    """Placement of a texture: set of texture coordinates, and affine transform (2, 3)."""

    channel: int
    transform: Floats


class GltfMaterials:
    """Materials of a file, followed by the default material for primitives without one.

    Attributes:
        entries: JSON of the materials.
        notices: one line for each texture that cannot be decoded, for each map that is not drawn,
            and for all factors of used materials that are out of range.
    """

    def __init__(
        self, root: JsonObject, accessors: Accessors, textures: TextureStore, assets: AssetResolver
    ):
        """Open all images; unreadable ones are recorded in `assets.faults`."""
        self.entries = [*root.objects("materials"), JsonObject({}, "materials")]
        self.notices: list[str] = []
        self._packs: dict[tuple[object, ...], tuple[Texture, Sequence[Part]]] = {}
        self._store, self._assets = textures, assets
        self._textures, self._samplers = root.objects("textures"), root.objects("samplers")
        self._image_entries = root.objects("images")
        self._reasons: dict[str, str] = {}
        self._images = [self._open(entry, accessors) for entry in self._image_entries]

    def uv(self, primitive: Primitive, material: int) -> Floats | None:
        """Texture coordinates (n, 2) of a primitive for the base color texture; None: missing."""
        place = self._place(_base_color(self.entries[material])[1])
        uv = _coordinates(primitive, place.channel)
        return None if uv is None else uv @ place.transform[:, :2].T + place.transform[:, 2]

    def second_uv(self, primitive: Primitive, material: int) -> Floats | None:
        """Texture coordinates (n, 2) for maps that use a second set; None: no such map."""
        channel = self._second_channel(self.entries[material])
        return None if channel is None else _coordinates(primitive, channel)

    def _place(self, info: JsonObject) -> _Place:
        """Placement of a texture by its texture coordinates and transform.

        Source: KHR_texture_transform, translation · rotation · scale.
        """
        transform = info.extension("KHR_texture_transform")
        channel, matrix = info.integer("texCoord", 0), np.eye(2, 3)
        if transform is not None:
            channel = transform.integer("texCoord", channel)
            angle = transform.number("rotation", 0.0)
            rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            matrix[:, :2] = rotation * (transform.numbers("scale", 2) or (1.0, 1.0))
            matrix[:, 2] = transform.numbers("offset", 2) or (0.0, 0.0)
        # a mirrored texture is stored next to its mirror image
        mirrored = np.where([wrap == _MIRRORED_REPEAT for wrap in self._wraps(info)], 0.5, 1.0)
        return _Place(channel, matrix * mirrored[:, None])

    def _second_channel(self, entry: JsonObject) -> int | None:
        """Second set of texture coordinates, besides the base color's; maps use at most one."""
        first = self._place(_base_color(entry)[1]).channel
        others = [self._place(info).channel for info, _ in _maps(entry)]
        return next((channel for channel in others if channel != first), None)

    def read(self, used: set[int]) -> tuple[Material, ...]:
        """All materials, with textures for the used ones only."""
        changed: list[str] = []
        materials = []
        for index, entry in enumerate(self.entries):
            factors = Factors(entry.text("name", f"material {index}"))
            materials.append(self._read(index, index in used, factors))
            changed += factors.changed if index in used else []
        if changed:
            more = len(changed) - _MAX_NAMED
            rest = f", and {more} more" if more > 0 else ""
            named = f"{', '.join(changed[:_MAX_NAMED])}{rest}"
            self.notices.append(f"factors of materials out of range: {named}")
        return tuple(materials)

    def _read(self, index: int, is_used: bool, factors: Factors) -> Material:
        entry = self.entries[index]
        name, (factor, info) = factors.material, _base_color(entry)
        red, green, blue, alpha = factor or (1.0, 1.0, 1.0, 1.0)
        plain = Material(
            name=name,
            base_color=(red, green, blue, alpha),
            texture=self._decode(info, name) if is_used and info.has("index") else None,
            alpha_mode=_ALPHA_MODES.get(entry.text("alphaMode", ""), AlphaMode.OPAQUE),
            alpha_cutoff=factors.number(entry, "alphaCutoff", 0.5, 0.0),
            double_sided=entry.flag("doubleSided"),
            unlit=is_unlit(entry),
        )
        if plain.unlit or index == len(self.entries) - 1:
            return plain  # without a material, glTF's metallic default does not apply
        maps = [self._map(entry, info, linear, name) for info, linear in _maps(entry)]
        packed = self._packed(maps if is_used else [None] * 9, name)
        return with_reflectance(plain, entry, packed, factors)

    def _packed(self, maps: Sequence[Texture | None], material: str) -> list[Texture | None]:
        """Maps in the order of `Material.maps`, packed from maps in the order of `_maps`."""
        *plain, strength, color, coat, coat_roughness, coat_normal = maps
        gloss = (color, (0, 1, 2)), (strength, (3,))
        clear = (coat, (0,)), (coat_roughness, (1,))
        packed = self._pack("specular", gloss, material), self._pack("clearcoat", clear, material)
        return [*plain, *packed, coat_normal]

    def _pack(self, what: str, parts: Sequence[Part], material: str) -> Texture | None:
        """Texture with the channels of all parts, packed once for all materials; None: no map."""
        given = [texture for texture, _ in parts if texture is not None]
        places = {
            (texture.uv_set, texture.uv_transform, texture.wrap_u, texture.wrap_v)
            for texture in given
        }
        if len(places) > 1:
            notice = f"{what} maps of {material!r} are placed differently: not drawn"
            self.notices.append(notice)
        if len(places) != 1:
            return None
        if len(given) == len(parts) and len({id(texture.pixels) for texture in given}) == 1:
            return given[0]
        key = (
            *(None if texture is None else id(texture.pixels) for texture, _ in parts),
            places.pop(),
        )
        if key not in self._packs:  # storing the parts keeps their ids from being reused
            from PIL import Image  # slow to import

            height, width = np.max([texture.pixels.shape[:2] for texture in given], axis=0).tolist()
            pixels = np.full((height, width, 4), 255, dtype=np.uint8)
            for texture, channels in parts:
                for channel in channels if texture is not None else ():
                    assert texture is not None
                    plane = Image.fromarray(np.ascontiguousarray(texture.pixels[..., channel]))
                    plane = plane.resize((width, height), Image.Resampling.BILINEAR)
                    pixels[..., channel] = plane
            self._packs[key] = replace(given[0], pixels=pixels), parts
        return self._packs[key][0]

    def _map(
        self, entry: JsonObject, info: JsonObject, is_linear: bool, material: str
    ) -> Texture | None:
        """Texture of a map, placed relative to the first or the second texture coordinates."""
        texture = self._decode(info, material, is_linear) if info.has("index") else None
        if texture is None:
            return None
        base, own = self._place(_base_color(entry)[1]), self._place(info)
        matrix = own.transform
        if own.channel == base.channel:
            matrix = _relative(own.transform, base.transform)
        elif own.channel != self._second_channel(entry):
            self.notices.append(f"third set of texture coordinates of {material!r} is not read")
            return None
        if not np.abs(matrix).max() < MAX_COORDINATE:  # false for NaN as well
            self.notices.append(f"map of {material!r} cannot be placed: it is not drawn")
            return None
        (a, b, c), (d, e, f) = matrix.tolist()
        return replace(
            texture, uv_set=int(own.channel != base.channel), uv_transform=((a, b, c), (d, e, f))
        )

    def _texture(self, info: JsonObject) -> JsonObject:
        return self._textures[info.index("index", self._textures)]

    def _wraps(self, info: JsonObject) -> tuple[int, int]:
        if not info.has("index") or not self._texture(info).has("sampler"):
            return _REPEAT, _REPEAT
        sampler = self._samplers[self._texture(info).index("sampler", self._samplers)]
        return sampler.integer("wrapS", _REPEAT), sampler.integer("wrapT", _REPEAT)

    def _decode(self, info: JsonObject, material: str, is_linear: bool = False) -> Texture | None:
        texture, image, uri, reason = self._texture(info), None, "", "has no image"
        source = texture.extension("EXT_texture_webp") or texture
        if not source.has("source"):  # KHR_texture_basisu may omit the plain image
            source = texture.extension("KHR_texture_basisu") or texture
        if source.has("source"):
            index = source.index("source", self._images)
            image, uri = self._images[index], self._image_entries[index].text("uri", "")
            reason = self._reasons.get(self._image_entries[index].place, NO_IMAGE)
        if image is not None:
            u, v = self._wraps(info)
            mirrored = (u == _MIRRORED_REPEAT, v == _MIRRORED_REPEAT)
            return self._store.texture(image, material, (_wrap(u), _wrap(v)), mirrored, is_linear)
        if uri not in self._assets.faults:
            self.notices.append(f"texture of {material!r} {reason}: its plain color is drawn")
        return None

    def _open(self, entry: JsonObject, accessors: Accessors) -> Image.Image | None:
        uri, data = entry.text("uri", ""), b""
        from PIL import Image  # slow to import

        with suppress(Exception):  # Pillow's readers raise exceptions of any type
            if entry.has("bufferView"):
                data = bytes(accessors.view(entry))
            elif uri:
                data = read_uri(uri, self._assets)
            return Image.open(io.BytesIO(data))
        if uri in self._assets.read:
            self._assets.faults[uri] = unreadable_image(data)
        elif data:
            self._reasons[entry.place] = unreadable_image(data)
        return None


def is_unlit(material: JsonObject) -> bool:
    """True for a material rendered in its base color, without lighting."""
    return material.extension("KHR_materials_unlit") is not None


def _base_color(material: JsonObject) -> tuple[tuple[float, ...] | None, JsonObject]:
    if glossy := material.extension("KHR_materials_pbrSpecularGlossiness"):
        return glossy.numbers("diffuseFactor", 4), glossy.object("diffuseTexture")
    metallic = material.object("pbrMetallicRoughness")
    return metallic.numbers("baseColorFactor", 4), metallic.object("baseColorTexture")


def _maps(material: JsonObject) -> tuple[tuple[JsonObject, bool], ...]:
    """Texture references of all maps, each with a flag that is true for linear data.

    `GltfMaterials._packed` relies on their order.
    """
    specular = material.extension_or_empty("KHR_materials_specular")
    coat = material.extension_or_empty("KHR_materials_clearcoat")
    metallic = material.object("pbrMetallicRoughness")
    if material.extension("KHR_materials_pbrSpecularGlossiness") is not None:
        metallic = JsonObject({}, metallic.place)
    return (
        (metallic.object("metallicRoughnessTexture"), True),
        (material.object("normalTexture"), True),
        (material.object("occlusionTexture"), True),
        (material.object("emissiveTexture"), False),
        (specular.object("specularTexture"), False),
        (specular.object("specularColorTexture"), False),
        (coat.object("clearcoatTexture"), True),
        (coat.object("clearcoatRoughnessTexture"), True),
        (coat.object("clearcoatNormalTexture"), True),
    )


def _coordinates(primitive: Primitive, channel: int) -> Floats | None:
    uv = primitive.attribute(f"TEXCOORD_{channel}")
    return None if uv is None or uv.shape[1] != 2 else uv


@np.errstate(all="ignore")
def _relative(own: Floats, base: Floats) -> Floats:
    """Affine map (2, 3) from coordinates placed by `base` to those placed by `own`."""
    a, b, c, d = base[:, :2].ravel()
    linear: Floats = own[:, :2] @ np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    return np.column_stack((linear, own[:, 2] - linear @ base[:, 2]))


def _wrap(number: int) -> Wrap:
    return Wrap.CLAMP_TO_EDGE if number == _CLAMP_TO_EDGE else Wrap.REPEAT


# Factors of materials within the ranges that glTF gives them.

_MAX_NAMED = 5
_ROUNDING = 1e-6  # of exporters, which write float32
Color = tuple[float, float, float]


class Factors:
    """Limits factors of one material, and records the values outside their ranges as texts."""

    def __init__(self, material: str):
        self.changed: list[str] = []
        self.material = material

    def number(
        self, entry: JsonObject, key: str, default: float, low: float, high: float = math.inf
    ) -> float:
        """Number of a property, limited to [low, high]."""
        value = entry.number(key, default)
        return self.replaced(_name(entry, key), value, min(max(value, low), high))

    def share(self, entry: JsonObject, key: str, default: float) -> float:
        """Number of a property, limited to [0, 1]."""
        return self.number(entry, key, default, 0.0, 1.0)

    def color(self, entry: JsonObject, key: str, default: float, high: float = math.inf) -> Color:
        """Linear RGB of a property, each channel limited to [0, high]."""
        values = entry.numbers(key, 3) or (default, default, default)
        red, green, blue = (
            self.replaced(f"{_name(entry, key)}[{index}]", value, min(max(value, 0.0), high))
            for index, value in enumerate(values)
        )
        return red, green, blue

    def replaced(self, name: str, value: float, used: float) -> float:
        """Record a value that is replaced by another, and return the substitute."""
        if not math.isclose(used, value, rel_tol=_ROUNDING):
            self.changed.append(f"{self.material!r} {name} {value:g} (used: {used:g})")
        return used


def _name(entry: JsonObject, key: str) -> str:
    """Key, with the texture that it belongs to."""
    parent = entry.place.rpartition(".")[2]
    return f"{parent}.{key}" if parent.endswith("Texture") else key


# Reflectance of materials: metal, roughness, gloss, clear coat and emission.

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
    if glossy := entry.extension("KHR_materials_pbrSpecularGlossiness"):
        # a dielectric whose reflectance at normal incidence is the specular factor
        red, green, blue = factors.color(glossy, "specularFactor", 1.0, 1.0)
        roughness = 1.0 - factors.share(glossy, "glossinessFactor", 1.0)
        tint = _tint_of(red, green, blue)
        return replace(common, roughness=roughness, specular=1.0, specular_color=tint)
    coat, specular, ior, volume, dispersion, transmission = (
        entry.extension_or_empty(f"KHR_materials_{name}")
        for name in ("clearcoat", "specular", "ior", "volume", "dispersion", "transmission")
    )
    strength = factors.share(specular, "specularFactor", 1.0)
    coating = factors.share(coat, "clearcoatFactor", 0.0)
    coat_scale = _scale(coat.object("clearcoatNormalTexture"), factors)
    gives_reflectance = ior.number("ior", DEFAULT_IOR) == 0.0
    is_opaque = gives_reflectance or has_transmission_map(entry)
    red, green, blue = factors.color(specular, "specularColorFactor", 1.0)
    return replace(
        common,
        metallic=factors.share(metallic, "metallicFactor", 1.0),
        roughness=factors.share(metallic, "roughnessFactor", 1.0),
        specular=strength,
        specular_color=_tint_of(red, green, blue) if gives_reflectance else (red, green, blue),
        ior=DEFAULT_IOR if gives_reflectance else factors.number(ior, "ior", DEFAULT_IOR, 1.0),
        transmission=0.0 if is_opaque else factors.share(transmission, "transmissionFactor", 0.0),
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
    transmission = entry.extension_or_empty("KHR_materials_transmission")
    is_used = transmission.number("transmissionFactor", 0.0) > 0.0
    return is_used and transmission.has("transmissionTexture")


def _attenuation_distance_m(volume: JsonObject, factors: Factors) -> float:
    if not volume.has("attenuationDistance"):
        return math.inf
    distance_m = volume.number("attenuationDistance", 0.0)
    used_m = distance_m if distance_m > 0.0 else math.inf
    return factors.replaced("attenuationDistance", distance_m, used_m)


def _tint_of(red: float, green: float, blue: float) -> Color:
    return _WHOLE * red, _WHOLE * green, _WHOLE * blue


def _emissive(entry: JsonObject, factors: Factors) -> Color:
    strength = entry.extension_or_empty("KHR_materials_emissive_strength")
    factor = factors.number(strength, "emissiveStrength", 1.0, 0.0)
    bright = [factor * channel for channel in factors.color(entry, "emissiveFactor", 0.0)]
    peak = max(bright)
    if peak > _BRIGHTEST:
        factors.replaced("emissiveFactor · emissiveStrength", peak, _BRIGHTEST)
    red, green, blue = (min(channel, _BRIGHTEST) for channel in bright)
    return red, green, blue


def _scale(texture: JsonObject, factors: Factors) -> float:
    return factors.number(texture, "scale", 1.0, -_MAX_SCALE, _MAX_SCALE)
