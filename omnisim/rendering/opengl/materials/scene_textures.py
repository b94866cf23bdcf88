"""Material textures on the GPU, with mip levels; each is uploaded once.

Textures of equal size and wrapping are layers of one array, so that a call draws many materials.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.materials.material_table import MaterialTable, Reflectance
from omnisim.rendering.opengl.materials.texture_array import TextureArray
from omnisim.scene.mipmaps import masked_mipmaps, mipmaps
from omnisim.scene.model import AlphaMode, Material, Mesh, Texture, Wrap

# Identity of a texture's pixels, alpha cutoff of its mip levels, storage and wrapping.
_Key = tuple[int, float | None, bool, tuple[bool, bool]]


class MaterialTexture(NamedTuple):
    """Texture of a material as a layer of an array, and its reflectance.

    Attributes:
        array: array shared with textures of the same size; None: an untextured material.
        layer: index in the array.
        texture: the layer as a texture; white for untextured materials.
        reflectance: reflectance on its mesh; None: matte.
    """

    array: TextureArray | None
    layer: int
    texture: moderngl.Texture
    reflectance: Reflectance | None = None

    @property
    def arrays(self) -> tuple[TextureArray | None, ...]:
        """Array of the base color, then those of the maps."""
        return self.array, *(() if self.reflectance is None else self.reflectance.maps)


class MaterialTextures:
    """Textures of all requested materials.

    Args:
        context: OpenGL context.
        is_matte: all materials are matte.

    Attributes:
        table: records of the materials that are not matte.
    """

    def __init__(self, context: moderngl.Context, is_matte: bool = False):
        self._context, self._is_matte = context, is_matte
        self.table = MaterialTable(context)
        self._reflectances: dict[tuple[object, ...], tuple[Material, Reflectance]] = {}
        self._layers: dict[_Key, MaterialTexture] = {}
        self._sources: dict[_Key, Texture] = {}  # kept alive, so that their identities stay unique
        pixels = np.full((1, 1, 4), 255, dtype=np.uint8)
        self._white_array = TextureArray(context, [[pixels]], (True, True))
        self._white = MaterialTexture(None, 0, self._white_array.layers[0])

    def find(self, material: Material, mesh: Mesh) -> MaterialTexture:
        """Texture of a material on a mesh.

        Raises:
            GraphicsError: larger than the GPU allows.
        """
        key = _key(material, mesh)
        if any(one not in self._layers for one in self._uses(material, mesh)):
            self.share([(material, mesh)])
        texture = self._white if key is None else self._layers[key]
        return texture._replace(reflectance=self._reflectance(material, mesh))

    def keep(self, used: Collection[MaterialTexture]) -> None:
        """Drop all textures but the used ones; an array goes with its last layer."""
        if not used:
            self.table, self._reflectances = MaterialTable(self._context), {}
        arrays = {id(array) for one in used for array in one.arrays}
        self._layers = {key: one for key, one in self._layers.items() if id(one.array) in arrays}
        self._sources = {key: self._sources[key] for key in self._layers}

    def share(self, used: Iterable[tuple[Material, Mesh]]) -> None:
        """Upload new textures, those of equal size and wrapping as one array.

        Raises:
            GraphicsError: a texture larger than the GPU allows.
        """
        classes: dict[tuple[object, ...], dict[_Key, Texture]] = {}
        for material, mesh in used:
            for key, texture in self._uses(material, mesh).items():
                if key not in self._layers:
                    self._check_size(material, texture)
                    of_class = (texture.pixels.shape, *key[2:])
                    classes.setdefault(of_class, {}).setdefault(key, texture)
        limit = int(self._context.info["GL_MAX_ARRAY_TEXTURE_LAYERS"])
        for textures in classes.values():
            keys = list(textures)
            for first in range(0, len(keys), limit):
                self._upload_array({key: textures[key] for key in keys[first : first + limit]})

    def _upload_array(self, textures: dict[_Key, Texture]) -> None:
        levels = [_levels(texture, key[1]) for key, texture in textures.items()]
        _, _, is_linear, repeats = next(iter(textures))
        array = TextureArray(self._context, levels, repeats, is_linear)
        self._sources |= textures
        for layer, key in enumerate(textures):
            self._layers[key] = MaterialTexture(array, layer, array.layers[layer])

    def _reflectance(self, material: Material, mesh: Mesh) -> Reflectance | None:
        """Reflectance of a material on a mesh, whose maps are uploaded."""
        if self._is_matte or material.is_matte:
            return None
        keys = [None if one is None else _map_key(one, mesh) for one in material.maps]
        name = id(material), *keys
        if name not in self._reflectances:
            textures = [None if key is None else self._layers[key] for key in keys]
            record = self.table.append(material, [one and one.layer for one in textures])
            maps = tuple(None if one is None else one.array for one in textures)
            second = any(
                one is not None and key is not None and one.uv_set
                for one, key in zip(material.maps, keys, strict=True)
            )
            self._reflectances[name] = material, Reflectance(record, maps, second)
        return self._reflectances[name][1]

    def _uses(self, material: Material, mesh: Mesh) -> dict[_Key, Texture]:
        """Textures of a material on a mesh."""
        maps = () if self._is_matte or material.is_matte else material.maps
        pairs = [(material.texture, _key(material, mesh))]
        pairs += [(one, None if one is None else _map_key(one, mesh)) for one in maps]
        return {key: one for one, key in pairs if one is not None and key is not None}

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
    texture = material.texture
    return id(texture.pixels), cutoff, texture.is_linear, _repeats(texture)


def _map_key(texture: Texture, mesh: Mesh) -> _Key | None:
    if mesh.coordinates_of(texture) is None:
        return None
    return id(texture.pixels), None, texture.is_linear, _repeats(texture)


def _repeats(texture: Texture) -> tuple[bool, bool]:
    return texture.wrap_u is not Wrap.CLAMP_TO_EDGE, texture.wrap_v is not Wrap.CLAMP_TO_EDGE


def _levels(texture: Texture, cutoff: float | None) -> list[NDArray[np.uint8]]:
    """All mip levels of a texture."""
    pixels = texture.pixels
    if cutoff is None:
        return [pixels, *mipmaps(pixels, texture.is_linear)]
    return [pixels, *masked_mipmaps(pixels, cutoff)]
