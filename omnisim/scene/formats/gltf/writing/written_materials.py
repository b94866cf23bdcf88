"""Materials, textures and images of an exported glTF file."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from PIL import Image

from omnisim.scene.formats.gltf.materials.reflectance import DEFAULT_IOR
from omnisim.scene.parts import IDENTITY_UV, AlphaMode, Material, Texture, Wrap

_WRAPS = {Wrap.REPEAT: 10497, Wrap.CLAMP_TO_EDGE: 33071}  # OpenGL's constants
_SHEAR = 1e-9
Entry = dict[str, Any]


class WrittenMaterials:
    """Materials of a scene as JSON, with their textures, samplers and images.

    Attributes:
        entries, textures, samplers, images: JSON lists.
        extensions: names of the used extensions.
        notices: one line for each property that glTF cannot represent.
    """

    def __init__(self, add_view: Callable[[bytes], int]):
        """Initialize with `add_view`, which stores an image and returns its view index."""
        self.entries: list[Entry] = []
        self.textures: list[Entry] = []
        self.samplers: list[Entry] = []
        self.images: list[Entry] = []
        self.extensions: set[str] = set()
        self.notices: list[str] = []
        self._add_view = add_view
        self._rows: dict[object, int] = {}

    def add(self, material: Material) -> None:
        """Append a material; its index follows the order of the calls."""
        surface: Entry = {
            "baseColorFactor": list(material.base_color),
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        }
        entry: Entry = {"name": material.name, "pbrMetallicRoughness": surface}
        entry["doubleSided"] = material.double_sided
        if material.alpha_mode is not AlphaMode.OPAQUE:
            entry["alphaMode"] = material.alpha_mode.name
        if material.alpha_mode is AlphaMode.MASK:
            entry["alphaCutoff"] = material.alpha_cutoff
        self._put(surface, "baseColorTexture", material.texture, material.name)
        self._put(
            surface, "metallicRoughnessTexture", material.metallic_roughness_map, material.name
        )
        self._put(
            entry, "normalTexture", material.normal_map, material.name, scale=material.normal_scale
        )
        self._put(
            entry, "occlusionTexture", material.occlusion_map, material.name,
            strength=material.occlusion_strength,
        )  # fmt: skip
        self._put(entry, "emissiveTexture", material.emissive_map, material.name)
        brightest = max(material.emissive)
        if brightest > 0.0:
            entry["emissiveFactor"] = [one / max(brightest, 1.0) for one in material.emissive]
        if extensions := self._extensions(material):
            self.extensions |= extensions.keys()
            entry["extensions"] = extensions
        self.entries.append(entry)

    def _extensions(self, material: Material) -> dict[str, Entry]:
        if material.unlit:
            return {"KHR_materials_unlit": {}}
        extensions: dict[str, Entry] = {}
        if max(material.emissive) > 1.0:
            strength = {"emissiveStrength": max(material.emissive)}
            extensions["KHR_materials_emissive_strength"] = strength
        if material.ior != DEFAULT_IOR:
            extensions["KHR_materials_ior"] = {"ior": material.ior}
        if (material.specular, *material.specular_color) != (1.0, 1.0, 1.0, 1.0):
            extensions["KHR_materials_specular"] = {
                "specularFactor": material.specular,
                "specularColorFactor": list(material.specular_color),
            }
        if material.specular_map is not None:
            gloss = extensions.setdefault("KHR_materials_specular", {})
            for key in ("specularTexture", "specularColorTexture"):
                self._put(gloss, key, material.specular_map, material.name)
        if material.transmission > 0.0:
            transmission = {"transmissionFactor": material.transmission}
            extensions["KHR_materials_transmission"] = transmission
        if material.thickness_m > 0.0:
            volume: Entry = {"thicknessFactor": material.thickness_m}
            if material.attenuation_distance_m < math.inf:
                volume["attenuationDistance"] = material.attenuation_distance_m
                volume["attenuationColor"] = list(material.attenuation_color)
            extensions["KHR_materials_volume"] = volume
        if material.dispersion > 0.0:
            extensions["KHR_materials_dispersion"] = {"dispersion": material.dispersion}
        if material.clearcoat > 0.0:
            extensions["KHR_materials_clearcoat"] = {
                "clearcoatFactor": material.clearcoat,
                "clearcoatRoughnessFactor": material.clearcoat_roughness,
            }
            coat = extensions["KHR_materials_clearcoat"]
            for key in ("clearcoatTexture", "clearcoatRoughnessTexture"):
                self._put(coat, key, material.clearcoat_map, material.name)
            self._put(
                coat, "clearcoatNormalTexture", material.clearcoat_normal_map, material.name,
                scale=material.clearcoat_normal_scale,
            )  # fmt: skip
        return extensions

    def _put(
        self, owner: Entry, key: str, texture: Texture | None, material: str, **values: float
    ) -> None:
        """Reference a texture in a material's JSON."""
        if texture is None:
            return
        info: Entry = {"index": self._texture(texture), **values}
        if texture.uv_set:
            info["texCoord"] = texture.uv_set
        if texture.uv_transform != IDENTITY_UV:
            transform = _texture_transform(texture)
            if transform is None:
                self.notices.append(f"sheared {key} of {material!r} is left out")
                return
            self.extensions.add("KHR_texture_transform")
            info["extensions"] = {"KHR_texture_transform": transform}
        owner[key] = info

    def _texture(self, texture: Texture) -> int:
        wraps = (texture.wrap_u, texture.wrap_v)
        key = ("texture", id(texture.pixels), wraps)
        if key not in self._rows:
            entry = {"source": self._image(texture), "sampler": self._sampler(wraps)}
            self._rows[key] = _append(self.textures, entry)
        return self._rows[key]

    def _sampler(self, wraps: tuple[Wrap, Wrap]) -> int:
        key = ("sampler", wraps)
        if key not in self._rows:
            entry = {"wrapS": _WRAPS[wraps[0]], "wrapT": _WRAPS[wraps[1]]}
            self._rows[key] = _append(self.samplers, entry)
        return self._rows[key]

    def _image(self, texture: Texture) -> int:
        key = ("image", id(texture.pixels))
        if key not in self._rows:
            pixels = texture.pixels
            has_alpha = bool((pixels[..., 3] < 255).any())
            file = io.BytesIO()
            Image.fromarray(pixels if has_alpha else np.ascontiguousarray(pixels[..., :3])).save(
                file, "PNG"
            )
            view = self._add_view(file.getvalue())
            self._rows[key] = _append(self.images, {"bufferView": view, "mimeType": "image/png"})
        return self._rows[key]


def matte(material: Material) -> Material:
    """Material with the base color only, as in scenes with matte materials."""
    return Material(
        material.name, material.base_color, material.texture, material.alpha_mode,
        material.alpha_cutoff, material.double_sided, material.unlit,
    )  # fmt: skip


def _append(entries: list[Entry], entry: Entry) -> int:
    entries.append(entry)
    return len(entries) - 1


def _texture_transform(texture: Texture) -> Entry | None:
    """KHR_texture_transform entry: translation · rotation · scale; None: a shear."""
    (a, b, c), (d, e, f) = texture.uv_transform
    if abs(a * b + d * e) > _SHEAR * (a * a + b * b + d * d + e * e):
        return None
    width = math.hypot(a, d)
    sign = math.copysign(1.0, a * e - b * d)
    return {
        "offset": [c, f],
        "rotation": math.atan2(-d, a),
        "scale": [width, sign * math.hypot(b, e)],
    }
