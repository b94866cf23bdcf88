"""Textures of materials on the GPU, each uploaded once, with mip levels.

Textures of one size and wrapping are layers of one array: a draw call shows many materials.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.scene.texture_array import TextureArray
from omnisim.scene.masked_mipmaps import masked_mipmaps
from omnisim.scene.mipmaps import mipmaps
from omnisim.scene.model import AlphaMode, Material, Mesh, Texture, Wrap

_Key = tuple[int, float | None]  # identity of a texture, and the cutoff of its mip levels


class MaterialTexture(NamedTuple):
    """Texture of a material: a layer of an array.

    Attributes:
        array: shared with others of its size; None: the material has no texture.
        layer: in the array.
        texture: the layer alone; white where the material has no texture.
    """

    array: TextureArray | None
    layer: int
    texture: moderngl.Texture


class MaterialTextures:
    """Textures of the materials that were asked for.

    Args:
        context: where.
    """

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._layers: dict[_Key, MaterialTexture] = {}
        self._sources: dict[_Key, Texture] = {}  # kept, so that no other gets the same identity
        white = TextureArray(context, [[np.full((1, 1, 4), 255, dtype=np.uint8)]], (True, True))
        self._white = MaterialTexture(None, 0, white.layers[0])

    def find(self, material: Material, mesh: Mesh) -> MaterialTexture:
        """Texture of a material on a mesh.

        Raises:
            GraphicsError: it is larger than the GPU allows.
        """
        key = _key(material, mesh)
        if key is None:
            return self._white
        if key not in self._layers:
            self.share([(material, mesh)])
        return self._layers[key]

    def keep(self, used: Collection[MaterialTexture]) -> None:
        """Forget all textures but the used ones; an array goes with the last of its layers."""
        arrays = {id(one.array) for one in used}
        for one in {id(one.array): one.array for one in self._layers.values()}.values():
            if one is not None and id(one) not in arrays:
                one.release_layers()
        self._layers = {key: one for key, one in self._layers.items() if id(one.array) in arrays}
        self._sources = {key: self._sources[key] for key in self._layers}

    def share(self, used: Iterable[tuple[Material, Mesh]]) -> None:
        """Upload new textures of materials on meshes, those of one size and wrapping as an array.

        Raises:
            GraphicsError: one is larger than the GPU allows.
        """
        classes: dict[tuple[object, ...], dict[_Key, Material]] = {}
        for material, mesh in used:
            key, texture = _key(material, mesh), material.texture
            if key is not None and texture is not None and key not in self._layers:
                self._check_size(material, texture)
                of_class = (texture.pixels.shape, *_repeats(texture))
                classes.setdefault(of_class, {}).setdefault(key, material)
        limit = int(self._context.info["GL_MAX_ARRAY_TEXTURE_LAYERS"])
        for materials in classes.values():
            keys = list(materials)
            for first in range(0, len(keys), limit):
                self._upload_array({key: materials[key] for key in keys[first : first + limit]})

    def _upload_array(self, materials: dict[_Key, Material]) -> None:
        textures = {key: one.texture for key, one in materials.items() if one.texture is not None}
        levels = [_levels(texture.pixels, cutoff) for (_, cutoff), texture in textures.items()]
        array = TextureArray(self._context, levels, _repeats(next(iter(textures.values()))))
        self._sources |= textures
        for layer, key in enumerate(textures):
            self._layers[key] = MaterialTexture(array, layer, array.layers[layer])

    def _check_size(self, material: Material, texture: Texture) -> None:
        height, width = texture.pixels.shape[:2]
        limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        if max(height, width) > limit:
            raise GraphicsError(
                f"a texture of {material.name!r} has {width} × {height} texels: this GPU takes at "
                f"most {limit}"
            )


def _key(material: Material, mesh: Mesh) -> _Key | None:
    if material.texture is None or mesh.texture_coordinates is None:
        return None
    cutoff = material.alpha_cutoff if material.alpha_mode is AlphaMode.MASK else None
    return id(material.texture), cutoff


def _repeats(texture: Texture) -> tuple[bool, bool]:
    return texture.wrap_u is not Wrap.CLAMP_TO_EDGE, texture.wrap_v is not Wrap.CLAMP_TO_EDGE


def _levels(pixels: NDArray[np.uint8], cutoff: float | None) -> list[NDArray[np.uint8]]:
    """All mip levels of a texture."""
    return [pixels, *(mipmaps(pixels) if cutoff is None else masked_mipmaps(pixels, cutoff))]
