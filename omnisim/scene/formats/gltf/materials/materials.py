"""Materials with their textures and images."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.files.asset_resolver import AssetResolver
from omnisim.scene.files.imported_scene import MAX_COORDINATE
from omnisim.scene.formats.gltf.accessors import Accessors, read_uri
from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.formats.gltf.materials.factors import Factors, factor_notices
from omnisim.scene.formats.gltf.materials.packed_maps import PackedMaps
from omnisim.scene.formats.gltf.materials.reflectance import with_reflectance
from omnisim.scene.formats.gltf.primitives import Primitive
from omnisim.scene.model import AlphaMode, Material, Texture, Wrap
from omnisim.scene.textures import NO_IMAGE, TextureStore, unreadable_image

if TYPE_CHECKING:
    from PIL import Image

_REPEAT, _MIRRORED_REPEAT, _CLAMP_TO_EDGE = 10497, 33648, 33071  # OpenGL's constants
_ALPHA_MODES = {mode.name: mode for mode in AlphaMode}


class _Place(NamedTuple):
    """Placement of a texture: set of texture coordinates, and affine transform (2, 3)."""

    channel: int
    transform: NDArray[np.float64]


class Materials:
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
        self._packs = PackedMaps()
        self._store, self._assets = textures, assets
        self._textures, self._samplers = root.objects("textures"), root.objects("samplers")
        self._image_entries = root.objects("images")
        self._reasons: dict[str, str] = {}
        self._images = [self._open(entry, accessors) for entry in self._image_entries]

    def uv(self, primitive: Primitive, material: int) -> NDArray[np.float64] | None:
        """Texture coordinates (n, 2) of a primitive for the base color texture; None: missing."""
        place = self._place(_base_color(self.entries[material])[1])
        uv = _coordinates(primitive, place.channel)
        return None if uv is None else uv @ place.transform[:, :2].T + place.transform[:, 2]

    def second_uv(self, primitive: Primitive, material: int) -> NDArray[np.float64] | None:
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
        self.notices += factor_notices(changed)
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
        gloss, clear = (
            ((color, (0, 1, 2)), (strength, (3,))),
            ((coat, (0,)), (coat_roughness, (1,))),
        )
        packed = list(plain)
        for what, parts in (("specular", gloss), ("clearcoat", clear)):
            try:
                packed.append(self._packs.pack(parts))
            except ValueError:
                packed.append(None)
                self.notices.append(
                    f"{what} maps of {material!r} are placed differently: not drawn"
                )
        return [*packed, coat_normal]

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
        """OpenGL constants of the wrapping modes along u and v."""
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
        """Image, not yet decoded; None: missing or in an unknown format."""
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
    """Factor and texture of a material's base color."""
    if glossy := material.extension("KHR_materials_pbrSpecularGlossiness"):
        return glossy.numbers("diffuseFactor", 4), glossy.object("diffuseTexture")
    metallic = material.object("pbrMetallicRoughness")
    return metallic.numbers("baseColorFactor", 4), metallic.object("baseColorTexture")


def _maps(material: JsonObject) -> tuple[tuple[JsonObject, bool], ...]:
    """Texture references of all maps, each with a flag that is true for linear data.

    `Materials._packed` relies on their order.
    """
    specular, coat = (
        material.extension(f"KHR_materials_{name}") or JsonObject({}, material.place)
        for name in ("specular", "clearcoat")
    )
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


def _coordinates(primitive: Primitive, channel: int) -> NDArray[np.float64] | None:
    uv = primitive.attribute(f"TEXCOORD_{channel}")
    return None if uv is None or uv.shape[1] != 2 else uv


@np.errstate(all="ignore")
def _relative(own: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Affine map (2, 3) from coordinates placed by `base` to those placed by `own`."""
    a, b, c, d = base[:, :2].ravel()
    linear: NDArray[np.float64] = own[:, :2] @ np.array([[d, -b], [-c, a]]) / (a * d - b * c)
    return np.column_stack((linear, own[:, 2] - linear @ base[:, 2]))


def _wrap(number: int) -> Wrap:
    return Wrap.CLAMP_TO_EDGE if number == _CLAMP_TO_EDGE else Wrap.REPEAT
