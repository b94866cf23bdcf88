"""Reflectance of hit surfaces: material factors times maps.

The twin of shaders/scene/reflective_material.glsl.
Source: glTF 2.0, section 3.9.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.geometry import Surface
from omnisim.rendering.rays.shading.ray_reflectance import Floats, Reflectance
from omnisim.rendering.rays.shading.ray_textures import TextureTable
from omnisim.scene.model import Material, Texture
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS, dielectric_f0, tinted_reflectance

# In the order of `Material.maps`.
METALLIC_ROUGHNESS, NORMAL, OCCLUSION, EMISSIVE, SPECULAR, CLEARCOAT, CLEARCOAT_NORMAL = range(7)
NORMAL_SCALES = {NORMAL: "normal_scale", CLEARCOAT_NORMAL: "clearcoat_normal_scale"}
Sampler = Callable[[int, NDArray[np.intp]], NDArray[np.float32]]


def _map_of(slot: int) -> Callable[[Material], Texture | None]:
    return lambda material: None if material.unlit else material.maps[slot]


class SurfaceValues(NamedTuple):
    """Material factors times maps at hits (n,)."""

    metallic: Floats
    roughness: Floats
    occlusion: Floats
    emissive: Floats


class SurfaceTable:
    """Material factors of all surfaces, and the tables of their maps.

    Args:
        surfaces: surfaces of the geometry.
        is_matte: treat all surfaces as matte.

    Attributes:
        is_matte: (surfaces,) mask.
        maps: tables of textures, in the order of `Material.maps`.
        normal_scales: (surfaces,) scales, for each of `NORMAL_SCALES`.
    """

    def __init__(self, surfaces: Sequence[Surface], is_matte: bool):
        materials = [surface.material for surface in surfaces]
        self.is_matte = np.array([is_matte or one.is_matte for one in materials], dtype=np.bool_)
        shown = [] if self.is_matte.all() else surfaces
        self.maps = tuple(TextureTable(shown, _map_of(slot)) for slot in range(7))

        def column(values: Sequence[object]) -> NDArray[np.float32]:
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

    def textured(
        self, slot: int, surfaces: NDArray[np.int32]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the surfaces (n,) with a given map, and their textures in it."""
        of_surface = self.maps[slot].texture_of_surface
        textures = of_surface[surfaces] if len(of_surface) else np.full(len(surfaces), -1)
        indices = np.flatnonzero(textures >= 0)
        return indices, textures[indices]

    def values(self, surfaces: NDArray[np.int32], sampled: Sampler) -> SurfaceValues:
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

    def reflectance(
        self, surfaces: NDArray[np.int32], colors: Floats, sampled: Sampler
    ) -> Reflectance:
        """Reflectance at hits of surfaces (n,) with base colors (n, 3)."""
        values = self.values(surfaces, sampled)
        metallic, (f0, f90) = values.metallic, self._gloss(surfaces, sampled)
        coat, coat_roughness = self._clear_coat(surfaces, sampled)
        share = metallic[:, None]
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

    def _gloss(self, surfaces: NDArray[np.int32], sampled: Sampler) -> tuple[Floats, Floats]:
        """Reflectance of dielectrics at normal (n, 3) and at grazing incidence (n,)."""
        f0, f90 = self._f0[surfaces], self._f90[surfaces]
        indices, _ = self.textured(SPECULAR, surfaces)
        if len(indices):
            texels = sampled(SPECULAR, indices)
            f90[indices] *= texels[:, 3]
            tinted = np.minimum(self._tint[surfaces[indices]] * texels[:, :3], 1.0)
            f0[indices] = f90[indices, None] * tinted
        return f0, f90

    def _clear_coat(self, surfaces: NDArray[np.int32], sampled: Sampler) -> tuple[Floats, Floats]:
        """Strengths and roughnesses (n,) of clear coats."""
        coat, roughness = self._coat[surfaces], self._coat_roughness[surfaces]
        indices, _ = self.textured(CLEARCOAT, surfaces)
        if len(indices):
            texels = sampled(CLEARCOAT, indices)
            coat[indices] *= texels[:, 0]
            roughness[indices] *= texels[:, 1]
        return coat, roughness
