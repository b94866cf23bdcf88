"""Materials of a MuJoCo model, combined with the colors of its geoms.

Colors of a model are sRGB, as its own renderer displays them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np

from omnisim.core.arrays import Bytes, Floats, Floats32
from omnisim.core.short_repr import counted
from omnisim.core.srgb import linear_from_srgb, linear_from_srgb8
from omnisim.scene.light.lighting import DEFAULT_LIGHTING
from omnisim.scene.parts import (
    MAX_LIGHTS,
    AlphaMode,
    Light,
    Lighting,
    LightKind,
    Material,
    Texture,
    Wrap,
)

NO_MATERIAL = -1
_MIRROR_IOR = 1e6  # reflects all but 4e-6 at normal incidence
_OPAQUE_FROM = 0.995  # threshold of MuJoCo's renderer
_GEOM_GRAY = (0.5, 0.5, 0.5, 1.0)  # default color of a geom
_Role = mujoco.mjtTextureRole
_COLORS = (_Role.mjTEXROLE_RGB, _Role.mjTEXROLE_RGBA)

Rgba = tuple[float, float, float, float]


def own_or_material_rgba(model: mujoco.MjModel, rgba: Floats32, material: int) -> Rgba:
    """Effective color (4,): the material's, unless the geom or skin states another."""
    own = tuple(rgba.tolist())
    if material != NO_MATERIAL and own == _GEOM_GRAY:
        own = tuple(model.mat_rgba[material].tolist())
    red, green, blue, alpha = own
    return red, green, blue, alpha


class ModelMaterials:
    """Materials of a model, each created once per color and cube face."""

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
        self, material: int, rgba: Rgba, face: int | None, is_solid: bool, is_plane: bool = False
    ) -> int:
        """Index in `entries` of a material in the model, or of `NO_MATERIAL`, with a color.

        `face` is that of its cube texture. A solid is visible from outside only; a plane mirrors
        the scene by the reflectance if it is opaque.
        """
        is_mirror = is_plane and rgba[3] >= _OPAQUE_FROM and self._reflectance(material) > 0.0
        key = (material, rgba, face, is_solid, is_mirror)
        if key not in self._index_of:
            made = self._make(material, rgba, face, is_solid)
            if is_mirror:
                # A dielectric of a very large index reflects its `specular` at all angles, and the
                # body below has the rest of the light. MuJoCo adds this share of the mirrored geoms
                # to the plane's full color, and does not mirror the sky.
                made = replace(
                    made, specular=self._reflectance(material), ior=_MIRROR_IOR,
                    metallic=0.0, roughness=0.0,
                )  # fmt: skip
            self._index_of[key] = len(self.entries)
            self.entries.append(made)
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
        texture, image = self.color_texture(material), None
        if texture is not None and not self.textures.is_cube(texture):
            image = self.textures.image(texture)
        elif texture is not None and face is not None:
            image = self.textures.image(texture, face)
        elif texture is not None:
            plain = self.textures.plain_color(texture) or (1.0, 1.0, 1.0)
            red, green, blue = (a * b for a, b in zip((red, green, blue), plain, strict=True))
        emission = max(float(model.mat_emission[material]), 0.0)
        metallic, roughness = (
            float(values[material]) for values in (model.mat_metallic, model.mat_roughness)
        )
        return Material(
            name or f"material_{material}",
            (red, green, blue, alpha),
            image,
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
                f"not drawn: mirror images in {counted(mirrors, 'material')} of geoms that are not "
                "opaque planes"
            )
        if single:
            notices.append(
                f"not drawn: {counted(single, 'texture')} of occlusion, roughness, metallic or "
                "opacity alone; those of role orm are"
            )
        return notices


# Textures of a MuJoCo model: flat images, and the six faces of cubes.


class Textures:
    """Textures of a model, each created once."""

    def __init__(self, model: mujoco.MjModel):
        self._model = model
        self._made: dict[tuple[int, int | None, bool], Texture] = {}
        self._plain: dict[int, tuple[float, float, float] | None] = {}

    def is_cube(self, texture: int) -> bool:
        """True for a cube with six faces, false for a flat image."""
        return int(self._model.tex_type[texture]) != mujoco.mjtTexture.mjTEXTURE_2D

    def image(self, texture: int, face: int | None = None, is_linear: bool = False) -> Texture:
        """Flat image, which repeats, or a face of a cube.

        Faces are in OpenGL's order (+x, −x, +y, …); a square image serves all six.
        """
        if face is not None and self._model.tex_height[texture] == self._model.tex_width[texture]:
            face = 0
        key = (texture, face, is_linear)
        if key not in self._made:
            pixels, wrap = texture_pixels(self._model, texture), Wrap.REPEAT
            if face is not None:
                side = pixels.shape[1]
                pixels, wrap = pixels[face * side : (face + 1) * side], Wrap.CLAMP_TO_EDGE
            self._made[key] = Texture(np.ascontiguousarray(pixels), wrap, wrap, is_linear=is_linear)
        return self._made[key]

    def plain_color(self, texture: int) -> tuple[float, float, float] | None:
        """Linear RGB of a single-color texture; None: several colors."""
        if texture not in self._plain:
            pixels = texture_pixels(self._model, texture).reshape(-1, 4)
            is_plain = bool((pixels == pixels[0]).all())
            self._plain[texture] = self.mean_color(texture) if is_plain else None
        return self._plain[texture]

    def mean_color(self, texture: int) -> tuple[float, float, float]:
        """Mean linear RGB of a texture."""
        pixels = texture_pixels(self._model, texture)[..., :3]
        red, green, blue = linear_from_srgb8(pixels).mean(axis=(0, 1)).tolist()
        return red, green, blue


def texture_pixels(model: mujoco.MjModel, texture: int) -> Bytes:
    """Pixels (height, width, 4) of a texture; the faces of a cube are stacked vertically."""
    height, width = int(model.tex_height[texture]), int(model.tex_width[texture])
    channels, start = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    flat = model.tex_data[start : start + height * width * channels]
    pixels = flat.reshape(height, width, channels)
    rgba = np.full((height, width, 4), 255, dtype=np.uint8)
    rgba[..., : min(channels, 4)] = pixels[..., :4]
    if channels < 3:  # gray, copied to all three channels
        rgba[..., :3] = pixels[..., :1]
    return rgba


# Lights of a MuJoCo model, and its background.
#
# Levels follow MuJoCo's renderer: a white surface is white where the levels add up to 1.

_Type = mujoco.mjtLightType
# Mean cosine over the visible half of a distant ball: the effect of a light at the eye.
_HEADLIGHT_SHARE = 2.0 / 3.0
_NEAREST_M = 0.1
_VISIBLE = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)  # mask of the visible geom groups
_FULL_TURN_DEG = 180.0


def read_lighting(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Lighting, list[str]]:
    """Lighting of a model, or daylight for a model without lights; and notices."""
    active = [light for light in range(model.nlight) if model.light_active[light]]
    images = [light for light in active if int(model.light_type[light]) == _Type.mjLIGHT_IMAGE]
    notices = ["image-textured lights are not drawn"] if images else []
    lamps = [light for light in active if light not in images]
    if not lamps:
        return DEFAULT_LIGHTING, notices
    if len(lamps) > MAX_LIGHTS:
        notices.append(f"has {len(lamps)} lights: only the first {MAX_LIGHTS} are used")
        lamps = lamps[:MAX_LIGHTS]
    ambient = model.light_ambient[lamps].sum(axis=0, dtype=np.float64)
    headlight = model.vis.headlight
    if headlight.active:
        ambient = ambient + headlight.ambient + _HEADLIGHT_SHARE * headlight.diffuse
        if headlight.diffuse.any():
            notices.append("the headlight is drawn as ambient light")
    lights = [_light(model, data, light) for light in lamps]
    if any(light.kind is not LightKind.DIRECTIONAL for light in lights) and (
        model.light_attenuation[lamps, :2].any()
    ):
        notices.append(
            "attenuation of lamps is drawn as 1/distance², matched at the points they aim at"
        )
    red, green, blue = ambient.tolist()
    return Lighting((red, green, blue), tuple(lights)), notices


def transformed(lighting: Lighting, world_from_file: Floats) -> Lighting:
    """Lighting transformed to the world, equally bright in any unit; daylight stays unchanged."""
    if lighting is DEFAULT_LIGHTING:
        return lighting
    rotation, offset = world_from_file[:3, :3], world_from_file[:3, 3]
    scale = float(np.linalg.norm(rotation[:, 0]))
    lights = tuple(
        replace(
            light,
            intensity=light.intensity * (1.0 if light.kind is LightKind.DIRECTIONAL else scale**2),
            position_m=rotation @ light.position_m + offset,
            direction=rotation @ light.direction / scale,
        )
        for light in lighting.lights
    )
    return replace(lighting, lights=lights)


def _light(model: mujoco.MjModel, data: mujoco.MjData, light: int) -> Light:
    diffuse = np.maximum(model.light_diffuse[light].astype(np.float64), 0.0)
    level = float(diffuse.max())
    red, green, blue = (diffuse / level if level > 0.0 else diffuse).tolist()
    color, kind = (red, green, blue), int(model.light_type[light])
    shadows = bool(model.light_castshadow[light])
    position, direction = data.light_xpos[light].copy(), _unit(data.light_xdir[light])
    if kind == _Type.mjLIGHT_DIRECTIONAL:
        return Light(LightKind.DIRECTIONAL, color, level, direction=direction, casts_shadow=shadows)
    distance_m = max(_distance_m(model, data, position, direction), _NEAREST_M)
    constant, linear, square = model.light_attenuation[light].tolist()
    loss = constant + linear * distance_m + square * distance_m**2
    candela = level * distance_m**2 / max(loss, 1e-6)
    cutoff_deg = float(model.light_cutoff[light])
    if kind == _Type.mjLIGHT_POINT or cutoff_deg >= _FULL_TURN_DEG:
        return Light(LightKind.POINT, color, candela, position, casts_shadow=shadows)
    # cones whose light is half as bright where OpenGL's spot is: that falls with a power of the
    # cosine up to the cutoff, glTF's with the square of the cosine's share between the cones
    exponent = float(model.light_exponent[light])
    outer = math.cos(math.radians(min(max(cutoff_deg, 0.0), 90.0)))
    half = 0.5 ** (1.0 / exponent) if exponent > 0.0 else 0.0
    inner = outer + (half - outer) / math.sqrt(0.5)
    cones = min(max(inner, outer + 1e-3), 1.0), outer
    return Light(
        LightKind.SPOT, color, candela, position, direction,
        cone_cosines=cones, casts_shadow=shadows,
    )  # fmt: skip


def _distance_m(
    model: mujoco.MjModel, data: mujoco.MjData, position: Floats, direction: Floats
) -> float:
    """Distance at which a lamp's axis meets the model, or else that of the model's center."""
    geom = np.array([-1], dtype=np.int32)
    distance_m = mujoco.mj_ray(model, data, position, direction, _VISIBLE, 1, -1, geom)
    if distance_m >= 0.0:
        return distance_m
    return float(np.linalg.norm(position - model.stat.center))


def _unit(vector: Floats) -> Floats:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.array([0.0, 0.0, -1.0])
