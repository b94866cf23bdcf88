"""Materials, their textures and images."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from omnisim.scene.asset_resolver import AssetResolver
from omnisim.scene.gltf import schema
from omnisim.scene.gltf.accessors import Accessors, read_uri
from omnisim.scene.gltf.primitives import Primitive
from omnisim.scene.model import AlphaMode, Material, Texture, Wrap
from omnisim.scene.textures import TextureStore

_MIRRORED_REPEAT, _CLAMP_TO_EDGE = 33648, 33071  # OpenGL's numbers; all others repeat
_ALPHA_MODES = {mode.name: mode for mode in AlphaMode}


class Materials:
    """Materials of a document; after the last comes the default of primitives without any.

    Attributes:
        notices: one line for each texture that cannot be decoded.
    """

    def __init__(
        self,
        document: schema.Document,
        accessors: Accessors,
        textures: TextureStore,
        resolver: AssetResolver,
    ):
        """Open all images; those that are not there are then in `resolver.missing`.

        Raises:
            SceneError: a damaged buffer view.
        """
        self._document, self._textures, self._resolver = document, textures, resolver
        self._entries = (*document.materials, schema.Material())
        self._images = tuple(
            self._open(entry, accessors, f"images[{index}].bufferView")
            for index, entry in enumerate(document.images)
        )
        self.notices: list[str] = []

    def texture_coordinates(
        self, primitive: Primitive, material: int
    ) -> NDArray[np.float64] | None:
        """Texture coordinates (n, 2) of a primitive for the texture that its material stores.

        Source: KHR_texture_transform, translation · rotation · scale.
        """
        info = self._texture_info(material)
        transform = info.transform if info else None
        channel = info.tex_coord if info else 0
        if transform is not None and transform.tex_coord is not None:
            channel = transform.tex_coord
        uv = primitive.floats(f"TEXCOORD_{channel}")
        if uv is None or uv.shape[1:] != (2,):
            return None
        if transform is not None:
            cos, sin = np.cos(transform.rotation), np.sin(transform.rotation)
            uv = uv * transform.scale @ np.array([[cos, -sin], [sin, cos]]) + transform.offset
        if info is None:
            return uv
        # a mirrored texture is stored with its mirror image beside it
        mirrored = [wrap == _MIRRORED_REPEAT for wrap in self._wraps(self._texture(info))]
        return uv * np.where(mirrored, 0.5, 1.0)

    def read(self, used: set[int]) -> tuple[Material, ...]:
        """All materials; textures of the used ones only."""
        return tuple(
            self._material(index, entry, index in used) for index, entry in enumerate(self._entries)
        )

    def _material(self, index: int, entry: schema.Material, is_used: bool) -> Material:
        name = f"material {index}" if entry.name is None else entry.name
        info, glossy = self._texture_info(index), entry.specular_glossiness
        return Material(
            name=name,
            base_color=(
                glossy.diffuse_factor if glossy else entry.metallic_roughness.base_color_factor
            ),
            texture=self._decode(info, name) if info and is_used else None,
            alpha_mode=_ALPHA_MODES.get(entry.alpha_mode, AlphaMode.OPAQUE),
            alpha_cutoff=entry.alpha_cutoff,
            double_sided=entry.double_sided,
            unlit=entry.unlit is not None,
        )

    def _texture_info(self, material: int) -> schema.TextureInfo | None:
        entry = self._entries[material]
        if entry.specular_glossiness is not None:
            return entry.specular_glossiness.diffuse_texture
        return entry.metallic_roughness.base_color_texture

    def _texture(self, info: schema.TextureInfo) -> schema.Texture:
        return schema.lookup(self._document.textures, info.index, "baseColorTexture.index")

    def _wraps(self, texture: schema.Texture) -> tuple[int, int]:
        """Wrapping modes along u and v."""
        sampler = schema.Sampler()
        if texture.sampler is not None:
            sampler = schema.lookup(self._document.samplers, texture.sampler, "textures.sampler")
        return sampler.wrap_s, sampler.wrap_t

    def _decode(self, info: schema.TextureInfo, material: str) -> Texture | None:
        texture = self._texture(info)
        source = texture.source if texture.webp is None else texture.webp
        image = None if source is None else schema.lookup(self._images, source, "textures.source")
        if image is not None:
            u, v = self._wraps(texture)
            mirrored = (u == _MIRRORED_REPEAT, v == _MIRRORED_REPEAT)
            return self._textures.texture(image, material, (_wrap(u), _wrap(v)), mirrored)
        if source is None or self._document.images[source].uri not in self._resolver.missing:
            self.notices.append(
                f"texture of {material!r} cannot be decoded: its plain colour is drawn"
            )
        return None

    def _open(self, entry: schema.Image, accessors: Accessors, place: str) -> Image.Image | None:
        """Image, not yet decoded; None where it is missing or of an unknown format."""
        if entry.buffer_view is None and entry.uri is None:
            return None
        view = None if entry.buffer_view is None else accessors.view(entry.buffer_view, place)
        try:
            data = read_uri(entry.uri or "", self._resolver) if view is None else view
            return Image.open(io.BytesIO(data))
        except Exception:  # Pillow's readers raise all kinds
            return None


def _wrap(number: int) -> Wrap:
    return Wrap.CLAMP_TO_EDGE if number == _CLAMP_TO_EDGE else Wrap.REPEAT
