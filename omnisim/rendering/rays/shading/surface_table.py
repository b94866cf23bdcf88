"""Materials of hit surfaces: factors times maps, filtered as on a GPU, and mapped normals.

The twin of shaders/scene/reflective_material.glsl.
Source: glTF 2.0, section 3.9.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import AnyFloats, Bools, Bytes, Floats, Floats32, Indices, Ints32
from omnisim.core.srgb import LINEAR_FROM_SRGB8
from omnisim.rendering.rays.geometry import PlacedSurface
from omnisim.rendering.rays.shading.lit_surfaces import Reflectance
from omnisim.scene.mipmaps import masked_mipmaps, mipmaps
from omnisim.scene.model import AlphaMode, Material, Texture, Wrap
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS, dielectric_f0, tinted_reflectance

# In the order of `Material.maps`.
METALLIC_ROUGHNESS, NORMAL, OCCLUSION, EMISSIVE, SPECULAR, CLEARCOAT, CLEARCOAT_NORMAL = range(7)
NORMAL_SCALES = {NORMAL: "normal_scale", CLEARCOAT_NORMAL: "clearcoat_normal_scale"}
Sampler = Callable[[int, Indices], Floats32]


def _map_of(slot: int) -> Callable[[Material], Texture | None]:
    return lambda material: None if material.unlit else material.maps[slot]


class SurfaceValues(NamedTuple):
    """Material factors times maps at hits (n,)."""

    metallic: AnyFloats
    roughness: AnyFloats
    occlusion: AnyFloats
    emissive: AnyFloats


class ReflectanceTable:
    """Material factors of all surfaces, and the tables of their maps, as in `Material.maps`.

    Args:
        surfaces: all surfaces.
        is_matte: (surfaces,) mask of surfaces without gloss, metal, maps and emission.
    """

    def __init__(self, surfaces: Sequence[PlacedSurface], is_matte: Bools):
        materials = [surface.material for surface in surfaces]
        self.is_matte = is_matte
        shown = [] if is_matte.all() else surfaces
        self.maps = tuple(TextureTable(shown, _map_of(slot)) for slot in range(7))

        def column(values: Sequence[object]) -> Floats32:
            return np.array(values, dtype=np.float32)

        self._metallic = column([material.metallic for material in materials])
        self._roughness = column([material.roughness for material in materials])
        self._occlusion = column([material.occlusion_strength for material in materials])
        self._emissive = column([material.emissive for material in materials]).reshape(-1, 3)
        self._f0 = column(
            [
                dielectric_f0(material.ior, material.specular, material.specular_color)
                for material in materials
            ]
        ).reshape(-1, 3)
        self._f90 = column([material.specular for material in materials])
        self._coat = column([material.clearcoat for material in materials])
        self._coat_roughness = column([material.clearcoat_roughness for material in materials])
        self._tint = column(
            [tinted_reflectance(material.ior, material.specular_color) for material in materials]
        ).reshape(-1, 3)
        self.normal_scales = {
            slot: column([getattr(material, name) for material in materials])
            for slot, name in NORMAL_SCALES.items()
        }

    def textured(self, slot: int, surfaces: Ints32) -> tuple[Indices, Indices]:
        """Indices of the surfaces (n,) with a given map, and their textures in it."""
        of_surface = self.maps[slot].texture_of_surface
        textures = of_surface[surfaces] if len(of_surface) else np.full(len(surfaces), -1)
        indices = np.flatnonzero(textures >= 0)
        return indices, textures[indices]

    def values(self, surfaces: Ints32, sampled: Sampler) -> SurfaceValues:
        """Values at hits of surfaces (n,); `sampled` looks up a map at selected hits."""
        metallic, roughness = self._metallic[surfaces], self._roughness[surfaces]
        occlusion = np.ones(len(surfaces), dtype=np.float32)
        emissive = self._emissive[surfaces]
        indices, _ = self.textured(METALLIC_ROUGHNESS, surfaces)
        if len(indices):
            texels = sampled(METALLIC_ROUGHNESS, indices)
            roughness[indices] *= texels[:, 1]
            metallic[indices] *= texels[:, 2]
        indices, _ = self.textured(OCCLUSION, surfaces)
        if len(indices):
            strength = self._occlusion[surfaces[indices]]
            occlusion[indices] += strength * (sampled(OCCLUSION, indices)[:, 0] - 1.0)
        indices, _ = self.textured(EMISSIVE, surfaces)
        if len(indices):
            emissive[indices] *= sampled(EMISSIVE, indices)[:, :3]
        return SurfaceValues(np.clip(metallic, 0.0, 1.0), roughness, occlusion, emissive)

    def reflectance(self, surfaces: Ints32, colors: AnyFloats, sampled: Sampler) -> Reflectance:
        """Reflectance at hits of surfaces (n,) with base colors (n, 3)."""
        values = self.values(surfaces, sampled)
        metallic, share = values.metallic, values.metallic[:, None]
        f0, f90 = self._f0[surfaces], self._f90[surfaces]
        indices, _ = self.textured(SPECULAR, surfaces)
        if len(indices):
            texels = sampled(SPECULAR, indices)
            f90[indices] *= texels[:, 3]
            tinted = np.minimum(self._tint[surfaces[indices]] * texels[:, :3], 1.0)
            f0[indices] = f90[indices, None] * tinted
        coat, coat_roughness = self._coat[surfaces], self._coat_roughness[surfaces]
        indices, _ = self.textured(CLEARCOAT, surfaces)
        if len(indices):
            texels = sampled(CLEARCOAT, indices)
            coat[indices] *= texels[:, 0]
            coat_roughness[indices] *= texels[:, 1]
        return Reflectance(
            body=colors * (1.0 - share),
            dielectric_f0=f0,
            f0=f0 + share * (colors - f0),
            dielectric_f90=f90,
            f90=f90 + metallic * (1.0 - f90),
            roughness=np.clip(values.roughness, MIN_ROUGHNESS, 1.0),
            coat=coat,
            coat_roughness=np.clip(coat_roughness, MIN_ROUGHNESS, 1.0),
            occlusion=values.occlusion,
            emissive=values.emissive,
        )


def mapped_normals(
    normals: Floats32,
    corners_m: Floats,
    coordinates: Floats32,
    planes: Floats32,
    texels: Floats32,
    scales: Floats32,
) -> AnyFloats:
    """Apply normal maps with the tangents of the triangles: unit normals (n, 3).

    Args:
        normals: (n, 3) unit, before mapping, on the visible side.
        corners_m: (n, 3, 3) triangle corners, counter-clockwise seen from the front.
        coordinates: (n, 3, 2) texture coordinates at the corners.
        planes: (n, 3) plane normals on the visible side.
        texels: (n, 4) texels of the normal maps.
        scales: (n,) scales of the normal maps.
    """
    edges_m, edges = corners_m[:, 1:] - corners_m[:, :1], coordinates[:, 1:] - coordinates[:, :1]
    (u1, v1), (u2, v2) = edges[:, 0].T, edges[:, 1].T
    sign = np.sign(u1 * v2 - u2 * v1)[:, None]
    along_u = sign * (edges_m[:, 0] * v2[:, None] - edges_m[:, 1] * v1[:, None])
    along_v = sign * (edges_m[:, 1] * u1[:, None] - edges_m[:, 0] * u2[:, None])
    along_u -= normals * _dot(normals, along_u)
    lengths = np.linalg.norm(along_u, axis=1, keepdims=True)
    tangents = along_u / np.where(lengths > 0.0, lengths, 1.0)
    bitangents = np.cross(normals, tangents)
    # v points down in a texture
    bitangents *= np.where(_dot(bitangents, along_v) > 0.0, -1.0, 1.0)
    is_front = _dot(np.cross(edges_m[:, 0], edges_m[:, 1]), planes) > 0.0
    bumps = 2.0 * texels[:, :3] - 1.0
    bumps[:, :2] *= scales[:, None] * np.where(is_front, 1.0, -1.0)
    mapped = bumps[:, :1] * tangents + bumps[:, 1:2] * bitangents + bumps[:, 2:] * normals
    mapped /= np.maximum(np.linalg.norm(mapped, axis=1, keepdims=True), 1e-20)
    return np.where(lengths > 0.0, mapped, normals)


def _dot(one: AnyFloats, other: AnyFloats) -> AnyFloats:
    products: AnyFloats = np.einsum("nc,nc->n", one, other)
    return products[:, None]


# Textures of materials in NumPy, filtered between texels and mip levels as on a GPU.


_LINEAR = LINEAR_FROM_SRGB8.astype(np.float32)
_ALPHA = (np.arange(256) / 255.0).astype(np.float32)
_MAX_LEVELS = 32


def _base(material: Material) -> Texture | None:
    return material.texture


class TextureTable:
    """Texels of all mip levels of all textures in one array, so that one lookup serves every hit.

    Args:
        texture_of: function from a material to its texture, by default the base color's; all
            textures are linear, or all sRGB.

    Attributes:
        texture_of_surface: (n,) index of each surface's texture; −1: no texture.
    """

    def __init__(
        self,
        surfaces: Iterable[PlacedSurface],
        texture_of: Callable[[Material], Texture | None] = _base,
    ):
        numbers: dict[tuple[int, float | None], int] = {}
        textures: list[tuple[Texture, float | None]] = []
        of_surface = []
        for surface in surfaces:
            texture = texture_of(surface.material)
            if texture is None or not surface.is_placed(texture):
                of_surface.append(-1)
                continue
            is_masked = texture_of is _base and surface.material.alpha_mode is AlphaMode.MASK
            cutoff = surface.material.alpha_cutoff if is_masked else None
            key = (id(texture), cutoff)
            if key not in numbers:
                numbers[key] = len(textures)
                textures.append((texture, cutoff))
            of_surface.append(numbers[key])
        self.texture_of_surface = np.array(of_surface, dtype=np.intp)
        self._first = np.zeros((len(textures), _MAX_LEVELS), dtype=np.intp)
        self._size = np.ones((len(textures), _MAX_LEVELS, 2), dtype=np.intp)  # width, height
        self._last_level = np.zeros(len(textures), dtype=np.float32)
        self._clamps = np.zeros((len(textures), 2), dtype=np.bool_)
        texels: list[Bytes] = [np.empty((0, 4), dtype=np.uint8)]
        count = 0
        for number, (texture, cutoff) in enumerate(textures):
            finer = mipmaps(texture.pixels, texture.is_linear) if cutoff is None else None
            levels = [
                texture.pixels,
                *(masked_mipmaps(texture.pixels, cutoff or 0.0) if finer is None else finer),
            ]
            for level, pixels in enumerate(levels):
                height, width = pixels.shape[:2]
                self._first[number, level], self._size[number, level] = count, (width, height)
                texels.append(pixels.reshape(-1, 4))
                count += width * height
            self._last_level[number] = len(levels) - 1
            self._clamps[number] = [
                wrap is Wrap.CLAMP_TO_EDGE for wrap in (texture.wrap_u, texture.wrap_v)
            ]
        is_linear = any(texture.is_linear for texture, _ in textures)
        self._decoded = _ALPHA if is_linear else _LINEAR
        self._uv_set = np.array([texture.uv_set for texture, _ in textures], dtype=np.intp)
        transforms = [texture.uv_transform for texture, _ in textures]
        self._transforms = np.array(transforms, dtype=np.float32).reshape(-1, 2, 3)
        self._has_transforms = bool(np.any(self._transforms != np.eye(2, 3, dtype=np.float32)))
        # one lookup of four bytes is faster
        self._texels = np.ascontiguousarray(np.concatenate(texels)).view(np.uint32).ravel()

    def sizes_px(self, textures: Indices) -> Floats32:
        """Widths and heights (n, 2) of the finest levels."""
        return self._size[textures, 0].astype(np.float32)

    def place(self, textures: Indices, first: Floats32, second: Floats32 | None) -> Floats32:
        """Coordinates (n, k, 2) of textures (n,), from both coordinate sets (n, k, 2)."""
        if second is not None:
            first = np.where((self._uv_set[textures] == 1)[:, None, None], second, first)
        if not self._has_transforms:
            return first
        matrices = self._transforms[textures, None]  # einsum would take six times as long
        u, v = first[..., :1], first[..., 1:]
        placed: Floats32 = u * matrices[..., 0] + v * matrices[..., 1] + matrices[..., 2]
        return placed

    def lookup(self, textures: Indices, coordinates: Floats32, levels: Floats32) -> Floats32:
        """Linear RGBA (n, 4) at coordinates (n, 2) of textures (n,), trilinear in levels (n,)."""
        levels = np.clip(levels, np.float32(0.0), self._last_level[textures])
        finer = np.floor(levels).astype(np.intp)
        share = (levels - finer).astype(np.float32)
        total = self._bilinear(textures, coordinates, finer)
        between = np.flatnonzero(share > 0.0)
        if len(between):
            coarse = self._bilinear(textures[between], coordinates[between], finer[between] + 1)
            total[between] += share[between, None] * (coarse - total[between])
        return total

    def _bilinear(self, textures: Indices, coordinates: Floats32, levels: Indices) -> Floats32:
        first, clamps = self._first[textures, levels], self._clamps[textures]
        size = self._size[textures, levels]
        position = coordinates.astype(np.float64) * size - 0.5
        low: Floats = np.floor(position)
        weights = (position - low).astype(np.float32)
        low_px = low.astype(np.intp)
        total = np.zeros((len(textures), 4), dtype=np.float32)
        for down in (0, 1):
            row = _wrapped(low_px[:, 1] + down, size[:, 1], clamps[:, 1])
            down_weight = weights[:, 1] if down else 1.0 - weights[:, 1]
            start = first + row * size[:, 0]
            for right in (0, 1):
                column = _wrapped(low_px[:, 0] + right, size[:, 0], clamps[:, 0])
                weight = down_weight * (weights[:, 0] if right else 1.0 - weights[:, 0])
                values = self._texels.take(start + column).view(np.uint8).reshape(-1, 4)
                colors = self._decoded.take(values)
                colors[:, 3] = _ALPHA.take(values[:, 3])
                colors *= weight[:, None]
                total += colors
        return total


def _wrapped(texels: Indices, sizes: Indices, clamps: Bools) -> Indices:
    if (texels >= 0).all() and (texels < sizes).all():  # the common case, and faster
        return texels
    return np.where(clamps, np.clip(texels, 0, sizes - 1), texels % sizes)
