"""Materials on the GPU: textures of their maps, of baked light and environment, and factors."""

from __future__ import annotations

import weakref
from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.arrays import Bytes, Floats32
from omnisim.core.errors import GraphicsError
from omnisim.rendering.opengl.gl.buffers import gpu_allocation
from omnisim.rendering.opengl.gl.gpu_textures import (
    RGBA8,
    SRGB8_ALPHA8,
    AnyTexture,
    bind_texture,
    byte_textures,
    texture_2d,
    texture_3d,
    upload,
)
from omnisim.rendering.opengl.gl.shader_files import set_uniforms
from omnisim.scene.light.baked_light import BakedLight
from omnisim.scene.mipmaps import masked_mipmaps, mipmaps
from omnisim.scene.model import AlphaMode, Material, Mesh, Texture, Wrap
from omnisim.scene.surface_kind import SurfaceKind, kind_of, pane_transmission
from omnisim.scene.surface_reflectance import dielectric_f0, tinted_reflectance

MAP_UNITS = 1, 2, 3, 4, 9, 14, 15  # in the order of `Material.maps`


class TextureArray:
    """Array of equally sized RGBA textures with mip levels, stored as sRGB or linear.

    Args:
        layers: mip levels (height, width, 4) of each, from full size to one texel.
        repeats: repeat to the right and down; otherwise clamp to the edge.
        is_linear: linear values instead of sRGB colors.

    Attributes:
        layers: each layer as a texture view, without a copy.
    """

    def __init__(
        self,
        context: moderngl.Context,
        layers: Sequence[Sequence[Bytes]],
        repeats: tuple[bool, bool],
        is_linear: bool = False,
    ):
        stored = RGBA8 if is_linear else SRGB8_ALPHA8
        height, width = layers[0][0].shape[:2]
        levels = len(layers[0])
        with gpu_allocation(
            f"{len(layers)} textures of {width} × {height} texels", "make the scene smaller"
        ):
            size = width, height, len(layers)
            self.array, self.layers = byte_textures(context, size, levels, stored)
        for layer, pixels in enumerate(layers):
            for level, texels in enumerate(pixels):
                upload(self.array.glo, level, texels, layer)
        textures: list[moderngl.Texture | moderngl.TextureArray] = [self.array, *self.layers]
        for texture in textures:
            texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            texture.repeat_x, texture.repeat_y = repeats
        # moderngl does not free the layers, and they hold the array's memory
        names = [layer.glo for layer in self.layers]
        dropped = weakref.finalize(self, context.extra.dropped_textures.extend, names)
        dropped.atexit = False  # the end of the process frees them


def bind_maps(maps: Sequence[TextureArray | None]) -> None:
    """Bind the arrays of a material's maps, after that of its base color."""
    for unit, texture in zip(MAP_UNITS, maps, strict=True):
        if texture is not None:
            bind_texture(unit, texture.array.glo)


# Textures of baked light: the lightmap, and the probes as blocks of four numbers along z.
_LIGHTMAP_UNIT, _PROBES_UNIT = 7, 8
_BLOCK = 4  # as in shaders/scene/baked_light.glsl


def baked_textures(context: moderngl.Context, baked: BakedLight) -> dict[int, AnyTexture]:
    """Textures of a scene's baked light by unit, for connected programs.

    Raises:
        GraphicsError: larger than the GPU allows.
    """
    height, width = baked.irradiance.shape[:2]
    # four numbers per texel, which are fetched faster than three
    texels = np.ones((height, width, 4), dtype=np.float16)
    texels[..., :3] = baked.irradiance
    with gpu_allocation(f"baked light of {width} × {height} texels", "bake it coarser"):
        lightmap = texture_2d(context, (width, height), 4, texels, dtype="f2", is_linear=True)
    columns, rows, layers, numbers = baked.probes.texels.shape
    blocks = baked.probes.texels.reshape(columns, rows, layers, numbers // _BLOCK, _BLOCK)
    ordered = np.ascontiguousarray(blocks.transpose(3, 2, 1, 0, 4))
    with gpu_allocation(f"{baked.probes.valid.size} probes of baked light", "bake it coarser"):
        probes = texture_3d(context, (columns, rows, layers * len(ordered)), ordered)
    return {_LIGHTMAP_UNIT: lightmap, _PROBES_UNIT: probes}


def connect_baked_light(program: moderngl.Program, baked: BakedLight) -> None:
    """Set the samplers and uniforms of a program that looks up baked light."""
    per_m = (1.0 / baked.probes.spacing_m).astype(np.float32)
    units = {"u_lightmap": _LIGHTMAP_UNIT, "u_probes": _PROBES_UNIT}
    set_uniforms(program, {**units, "u_probes_per_m": per_m})


_MAX_HALF = 65504.0  # largest half float


def environment_texture(context: moderngl.Context, levels: Sequence[Floats32]) -> moderngl.Texture:
    """Texture of an environment map, given the mip levels of the sky or of its reflections."""
    height, width = levels[0].shape[:2]
    with gpu_allocation(f"an environment map of {width} × {height} texels", "make it smaller"):
        texture = texture_2d(context, (width, height), 3, dtype="f2", levels=len(levels))
    for level, pixels in enumerate(levels):
        half = np.minimum(pixels, _MAX_HALF).astype(np.float16)
        upload(texture.glo, level, half)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x, texture.repeat_y = True, False
    return texture


# Material textures on the GPU, with mip levels; each is uploaded once.
#
# Textures of equal size and wrapping are layers of one array, so that a call draws many materials.

# Identity of a texture's pixels, alpha cutoff of its mip levels, storage and wrapping.
_Key = tuple[int, float | None, bool, tuple[bool, bool]]


class MaterialTexture(NamedTuple):
    """Texture of a material as a layer of an array, and its reflectance."""

    array: TextureArray | None  # shared with textures of the same size; None: untextured
    layer: int  # index in the array
    texture: moderngl.Texture  # the layer as a texture; white for untextured materials
    reflectance: ReflectanceMaps | None = None  # reflectance on its mesh; None: matte

    @property
    def arrays(self) -> tuple[TextureArray | None, ...]:
        """Array of the base color, then those of the maps."""
        return self.array, *(() if self.reflectance is None else self.reflectance.maps)


class MaterialTextures:
    """Textures of all requested materials; `table`: records of the materials that are not matte."""

    def __init__(self, context: moderngl.Context, is_matte: bool = False):
        self._context, self._is_matte = context, is_matte
        self.table = MaterialRecords(context)
        self._reflectances: dict[tuple[object, ...], tuple[Material, ReflectanceMaps]] = {}
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
        key = _base_key(material, mesh)
        if any(use not in self._layers for use in self._uses(material, mesh)):
            self.share([(material, mesh)])
        texture = self._white if key is None else self._layers[key]
        return texture._replace(reflectance=self._reflectance(material, mesh))

    def keep(self, used: Collection[MaterialTexture]) -> None:
        """Drop all textures but the used ones; an array goes with its last layer."""
        if not used:
            self.table, self._reflectances = MaterialRecords(self._context), {}
        arrays = {id(array) for texture in used for array in texture.arrays}
        self._layers = {
            key: layer for key, layer in self._layers.items() if id(layer.array) in arrays
        }
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
                some = keys[first : first + limit]
                levels = [_levels(textures[key], key[1]) for key in some]
                _, _, is_linear, repeats = some[0]
                array = TextureArray(self._context, levels, repeats, is_linear)
                for layer, key in enumerate(some):
                    self._sources[key] = textures[key]
                    self._layers[key] = MaterialTexture(array, layer, array.layers[layer])

    def _reflectance(self, material: Material, mesh: Mesh) -> ReflectanceMaps | None:
        """Reflectance of a material on a mesh, whose maps are uploaded."""
        if SurfaceKind.MATTE in kind_of(material, self._is_matte):
            return None
        keys = [_map_key(texture, mesh) for texture in material.maps]
        name = id(material), *keys
        if name not in self._reflectances:
            textures = [None if key is None else self._layers[key] for key in keys]
            record = self.table.append(
                material, [texture and texture.layer for texture in textures]
            )
            maps = tuple(None if texture is None else texture.array for texture in textures)
            second = any(
                texture is not None and key is not None and texture.uv_set
                for texture, key in zip(material.maps, keys, strict=True)
            )
            self._reflectances[name] = material, ReflectanceMaps(record, maps, second)
        return self._reflectances[name][1]

    def _uses(self, material: Material, mesh: Mesh) -> dict[_Key, Texture]:
        """Textures of a material on a mesh."""
        is_matte = SurfaceKind.MATTE in kind_of(material, self._is_matte)
        maps = () if is_matte else material.maps
        pairs = [(material.texture, _base_key(material, mesh))]
        pairs += [(texture, _map_key(texture, mesh)) for texture in maps]
        return {key: texture for texture, key in pairs if texture is not None and key is not None}

    def _check_size(self, material: Material, texture: Texture) -> None:
        height, width = texture.pixels.shape[:2]
        limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        if max(height, width) > limit:
            raise GraphicsError(
                f"a texture of {material.name!r} has {width} × {height} texels: this GPU takes at "
                f"most {limit}"
            )


def _base_key(material: Material, mesh: Mesh) -> _Key | None:
    """Key of a material's base color; None: it has no texture on the mesh."""
    if material.texture is None or mesh.texture_coordinates is None:
        return None
    is_masked = material.alpha_mode is AlphaMode.MASK
    return _key(material.texture, material.alpha_cutoff if is_masked else None)


def _map_key(texture: Texture | None, mesh: Mesh) -> _Key | None:
    return None if texture is None or mesh.coordinates_of(texture) is None else _key(texture)


def _key(texture: Texture, cutoff: float | None = None) -> _Key:
    wraps = texture.wrap_u, texture.wrap_v
    repeats = wraps[0] is not Wrap.CLAMP_TO_EDGE, wraps[1] is not Wrap.CLAMP_TO_EDGE
    return id(texture.pixels), cutoff, texture.is_linear, repeats


def _levels(texture: Texture, cutoff: float | None) -> list[Bytes]:
    """All mip levels of a texture."""
    pixels = texture.pixels
    if cutoff is None:
        return [pixels, *mipmaps(pixels, texture.is_linear)]
    return [pixels, *masked_mipmaps(pixels, cutoff)]


# Reflectance tables for shaders: records of materials, and details of vertices.

# As in shaders/scene/reflective_material.glsl.
_TEXELS, _FIRST_MAP, _IN_ROW = 20, 5, 256
_ROW_VERTICES = 4096


class ReflectanceMaps(NamedTuple):
    """Reflectance of a glossy, metallic or mapped material on a mesh."""

    record: int  # index of its record in the table
    maps: tuple[TextureArray | None, ...]  # arrays of `Material.maps`; None for missing maps
    second_coordinates: bool  # True if a map uses the second texture coordinates


class MaterialRecords:
    """Records of materials; grows with new materials."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._records: list[Floats32] = []
        self._uploaded = 0
        self._texture: moderngl.Texture | None = None

    def append(self, material: Material, layers: Sequence[int | None]) -> int:
        """Append a material, given the array layers of its maps; return the index of its record."""
        record = np.zeros((_TEXELS, 4), dtype=np.float32)
        f0 = dielectric_f0(material.ior, material.specular, material.specular_color)
        record[0] = *f0, material.specular
        record[1] = (
            material.metallic, material.roughness, material.normal_scale,
            material.occlusion_strength,
        )  # fmt: skip
        record[2] = *material.emissive, pane_transmission(material)
        record[3] = (
            material.clearcoat, material.clearcoat_roughness, material.clearcoat_normal_scale,
            material.ior,
        )  # fmt: skip
        is_slab = SurfaceKind.SLAB in kind_of(material)
        record[4] = *tinted_reflectance(material.ior, material.specular_color), is_slab
        record[19, :3] = material.optical_depths
        for number, (texture, layer) in enumerate(zip(material.maps, layers, strict=True)):
            if texture is not None and layer is not None:
                across, down = texture.uv_transform
                record[_FIRST_MAP + 2 * number] = *across, layer
                record[_FIRST_MAP + 2 * number + 1] = *down, texture.uv_set
        self._records.append(record)
        return len(self._records) - 1

    @property
    def texture(self) -> moderngl.Texture | None:
        """Texture of the table; None while it is empty."""
        if self._uploaded != len(self._records):
            rows = -(-len(self._records) // _IN_ROW)
            values = np.zeros((rows * _IN_ROW, _TEXELS, 4), dtype=np.float32)
            values[: len(self._records)] = self._records
            size = (_IN_ROW * _TEXELS, rows)
            self._texture = texture_2d(self._context, size, 4, values)
            self._uploaded = len(self._records)
        return self._texture


def vertex_details(
    context: moderngl.Context, meshes: Sequence[tuple[Mesh, int, int]]
) -> moderngl.Texture:
    """Second texture coordinates and material of each vertex, by mesh, record and first vertex."""
    count = max(base + len(mesh.positions) for mesh, _, base in meshes)
    rows = max(1, -(-count // _ROW_VERTICES))
    values = np.zeros((rows * _ROW_VERTICES, 4), dtype=np.float32)
    for mesh, record, base in meshes:
        part = values[base : base + len(mesh.positions)]
        if mesh.second_texture_coordinates is not None:
            part[:, :2] = mesh.second_texture_coordinates
        part[:, 2] = record
    return texture_2d(context, (_ROW_VERTICES, rows), 4, values)
