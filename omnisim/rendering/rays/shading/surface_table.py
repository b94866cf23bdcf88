"""Reflectance of hit surfaces: material factors times maps; and their mapped normals.

The twin of shaders/scene/reflective_material.glsl.
Source: glTF 2.0, section 3.9.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Indices, Ints32
from omnisim.rendering.rays.geometry import Surface
from omnisim.rendering.rays.shading.ray_reflectance import Reflectance
from omnisim.rendering.rays.shading.ray_textures import TextureTable
from omnisim.scene.model import Material, Texture
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


class SurfaceTable:
    """Material factors of all surfaces, and the tables of their maps, as in `Material.maps`.

    Args:
        surfaces: all surfaces.
        is_matte: (surfaces,) mask of surfaces without gloss, metal, maps and emission.
    """

    def __init__(self, surfaces: Sequence[Surface], is_matte: Bools):
        materials = [surface.material for surface in surfaces]
        self.is_matte = is_matte
        shown = [] if is_matte.all() else surfaces
        self.maps = tuple(TextureTable(shown, _map_of(slot)) for slot in range(7))

        def column(values: Sequence[object]) -> Floats32:
            return np.array(values, dtype=np.float32)

        self._metallic = column([one.metallic for one in materials])
        self._roughness = column([one.roughness for one in materials])
        self._occlusion = column([one.occlusion_strength for one in materials])
        self._emissive = column([one.emissive for one in materials]).reshape(-1, 3)
        self._f0 = column(
            [dielectric_f0(one.ior, one.specular, one.specular_color) for one in materials]
        ).reshape(-1, 3)
        self._f90 = column([one.specular for one in materials])
        self._coat = column([one.clearcoat for one in materials])
        self._coat_roughness = column([one.clearcoat_roughness for one in materials])
        self._tint = column(
            [tinted_reflectance(one.ior, one.specular_color) for one in materials]
        ).reshape(-1, 3)
        self.normal_scales = {
            slot: column([getattr(one, name) for one in materials])
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


# Normal mapping with the tangents of the triangles.
#
# The twin of shaders/scene/reflective_material.glsl.


def mapped_normals(
    normals: Floats32,
    corners_m: Floats,
    coordinates: Floats32,
    planes: Floats32,
    texels: Floats32,
    scales: Floats32,
) -> AnyFloats:
    """Apply normal maps: unit normals (n, 3).

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
