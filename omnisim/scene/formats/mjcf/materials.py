"""Materials of a MuJoCo model, combined with the colors of its geoms.

Colors of a model are sRGB, as its own renderer displays them.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.short_repr import counted
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene.formats.mjcf.textures import Textures
from omnisim.scene.parts import AlphaMode, Material, Texture

NO_MATERIAL = -1
_MIRROR_IOR = 1e6  # reflects all but 4e-6 at normal incidence
_OPAQUE_FROM = 0.995  # threshold of MuJoCo's renderer
_GEOM_GRAY = (0.5, 0.5, 0.5, 1.0)  # default color of a geom
_Role = mujoco.mjtTextureRole
_COLORS = (_Role.mjTEXROLE_RGB, _Role.mjTEXROLE_RGBA)

Rgba = tuple[float, float, float, float]


def own_or_material_rgba(model: mujoco.MjModel, rgba: NDArray[np.float32], material: int) -> Rgba:
    """Effective color (4,): the material's, unless the geom or skin states another."""
    own = tuple(rgba.tolist())
    if material != NO_MATERIAL and own == _GEOM_GRAY:
        own = tuple(model.mat_rgba[material].tolist())
    red, green, blue, alpha = own
    return red, green, blue, alpha


def _mirror(material: Material, reflectance: float) -> Material:
    """Material whose plane mirrors the scene with a reflectance at all angles.

    A dielectric of a very large index reflects its `specular` at all angles, and the body below has
    the rest of the light. MuJoCo adds this share of the mirrored geoms to the plane's full color,
    and does not mirror the sky.
    """
    return dataclasses.replace(
        material, specular=reflectance, ior=_MIRROR_IOR, metallic=0.0, roughness=0.0
    )


class Materials:
    """Materials of a model, each created once per color and cube face.

    Attributes:
        entries: materials created so far.
    """

    def __init__(self, model: mujoco.MjModel):
        self.entries: list[Material] = []
        self.textures = Textures(model)
        self._model = model
        self._index_of: dict[tuple[int, Rgba, int | None, bool, bool], int] = {}

    def color_texture(self, material: int) -> int | None:
        """Index of a material's base color texture; None: no texture."""
        if material == NO_MATERIAL:
            return None
        textures = [int(self._model.mat_texid[material, role]) for role in _COLORS]
        return next((texture for texture in textures if texture >= 0), None)

    def index(
        self,
        material: int,
        rgba: Rgba,
        face: int | None,
        is_solid: bool,
        is_plane: bool = False,
    ) -> int:
        """Index of a material in `entries`.

        Args:
            material: material index in the model, or `NO_MATERIAL`.
            rgba: effective color.
            face: face of its cube texture; None: an image, or no texture.
            is_solid: visible from outside only.
            is_plane: of a plane, which mirrors the scene by the reflectance if it is opaque.
        """
        is_mirror = is_plane and rgba[3] >= _OPAQUE_FROM and self._reflectance(material) > 0.0
        key = (material, rgba, face, is_solid, is_mirror)
        if key not in self._index_of:
            made = self._make(material, rgba, face, is_solid)
            self._index_of[key] = len(self.entries)
            self.entries.append(_mirror(made, self._reflectance(material)) if is_mirror else made)
        return self._index_of[key]

    def _reflectance(self, material: int) -> float:
        if material == NO_MATERIAL:
            return 0.0
        return min(max(float(self._model.mat_reflectance[material]), 0.0), 1.0)

    def _make(self, material: int, rgba: Rgba, face: int | None, is_solid: bool) -> Material:
        red, green, blue = np.asarray(linear_from_srgb(np.clip(rgba[:3], 0.0, 1.0))).tolist()
        alpha = float(np.clip(rgba[3], 0.0, 1.0))
        mode = AlphaMode.OPAQUE if alpha >= _OPAQUE_FROM else AlphaMode.BLEND
        if material == NO_MATERIAL:
            return Material("", (red, green, blue, alpha), None, mode, double_sided=not is_solid)
        model = self._model
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_MATERIAL, material)
        texture = self.color_texture(material)
        if texture is not None and face is None and self.textures.is_cube(texture):
            plain = self.textures.plain_color(texture) or (1.0, 1.0, 1.0)
            red, green, blue = (a * b for a, b in zip((red, green, blue), plain, strict=True))
        emission = max(float(model.mat_emission[material]), 0.0)
        metallic, roughness = (
            float(values[material]) for values in (model.mat_metallic, model.mat_roughness)
        )
        return Material(
            name or f"material_{material}",
            (red, green, blue, alpha),
            self._color_texture(material, face),
            mode,
            double_sided=not is_solid,
            metallic=min(max(metallic, 0.0), 1.0),  # negative means unspecified
            roughness=min(roughness, 1.0) if roughness >= 0.0 else 1.0,
            emissive=(emission * red, emission * green, emission * blue),
            normal_map=self._map(material, _Role.mjTEXROLE_NORMAL),
            emissive_map=self._map(material, _Role.mjTEXROLE_EMISSIVE),
            metallic_roughness_map=self._map(material, _Role.mjTEXROLE_ORM),
            occlusion_map=self._map(material, _Role.mjTEXROLE_ORM),
        )

    def _color_texture(self, material: int, face: int | None) -> Texture | None:
        texture = self.color_texture(material)
        if texture is None:
            return None
        if self.textures.is_cube(texture):
            return None if face is None else self.textures.face(texture, face)
        return self.textures.image(texture)

    def _map(self, material: int, role: int) -> Texture | None:
        texture = int(self._model.mat_texid[material, role])
        if texture < 0 or self.textures.is_cube(texture):
            return None
        return self.textures.image(texture, is_linear=role != _Role.mjTEXROLE_EMISSIVE)

    @property
    def notices(self) -> list[str]:
        """Notices for unsupported features of the created materials, one line each."""
        used = sorted({material for material, *_ in self._index_of if material != NO_MATERIAL})
        model = self._model
        mirrors = len(
            {
                material
                for material, *_, is_mirror in self._index_of
                if self._reflectance(material) > 0.0 and not is_mirror
            }
        )
        roles = (
            _Role.mjTEXROLE_OCCLUSION, _Role.mjTEXROLE_ROUGHNESS,
            _Role.mjTEXROLE_METALLIC, _Role.mjTEXROLE_OPACITY,
        )  # fmt: skip
        single = sum(
            int(model.mat_texid[material, role]) >= 0 for material in used for role in roles
        )
        notices = []
        if mirrors:
            notices.append(
                f"not drawn: mirror images in {counted(mirrors, 'material')} of geoms that are no "
                "opaque planes"
            )
        if single:
            notices.append(
                f"not drawn: {counted(single, 'texture')} of occlusion, roughness, metallic or "
                "opacity alone; those of role orm are"
            )
        return notices
