"""Lights of a MuJoCo model, and its background.

Levels follow MuJoCo's renderer: a white surface is white where the levels add up to 1.
"""

from __future__ import annotations

import math
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.scene.formats.mjcf.textures import Textures
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING
from omnisim.scene.parts import MAX_LIGHTS, Light, Lighting, LightKind

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
    notices = ["lights of images are not drawn"] if images else []
    lamps = [light for light in active if light not in images]
    if not lamps:
        return DEFAULT_LIGHTING, notices
    if len(lamps) > MAX_LIGHTS:
        notices.append(f"has {len(lamps)} lights: the first {MAX_LIGHTS} shine")
        lamps = lamps[:MAX_LIGHTS]
    ambient = model.light_ambient[lamps].sum(axis=0, dtype=np.float64)
    headlight = model.vis.headlight
    if headlight.active:
        ambient = ambient + headlight.ambient + _HEADLIGHT_SHARE * headlight.diffuse
        if headlight.diffuse.any():
            notices.append("the headlight shines from everywhere")
    lights = [_light(model, data, light) for light in lamps]
    if any(light.kind is not LightKind.DIRECTIONAL for light in lights) and (
        model.light_attenuation[lamps, :2].any()
    ):
        notices.append(
            "attenuation of lamps is drawn as that of 1/distance², equal where they point to"
        )
    red, green, blue = ambient.tolist()
    return Lighting((red, green, blue), tuple(lights)), notices


def read_background(
    model: mujoco.MjModel, textures: Textures
) -> tuple[tuple[float, float, float], list[str]]:
    """Linear RGB of rays without a hit, the mean of the sky box; and notices."""
    for texture in range(model.ntex):
        if int(model.tex_type[texture]) == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            return textures.mean_color(texture), ["the sky box is drawn in its mean color"]
    return DEFAULT_BACKGROUND, []


def transformed(lighting: Lighting, world_from_file: NDArray[np.float64]) -> Lighting:
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
    cones = _cone_cosines(cutoff_deg, float(model.light_exponent[light]))
    return Light(
        LightKind.SPOT, color, candela, position, direction,
        cone_cosines=cones, casts_shadow=shadows,
    )  # fmt: skip


def _distance_m(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    position: NDArray[np.float64],
    direction: NDArray[np.float64],
) -> float:
    """Distance at which a lamp's axis meets the model, or else that of the model's center."""
    geom = np.array([-1], dtype=np.int32)
    distance_m = mujoco.mj_ray(model, data, position, direction, _VISIBLE, 1, -1, geom)
    if distance_m >= 0.0:
        return distance_m
    return float(np.linalg.norm(position - model.stat.center))


def _cone_cosines(cutoff_deg: float, exponent: float) -> tuple[float, float]:
    """Cosines of the inner and outer cones, matched to OpenGL's spot at half its level.

    OpenGL's spot falls with a power of the cosine up to the cutoff; glTF's falls with the square of
    the cosine's share between the cones.
    """
    outer = math.cos(math.radians(min(max(cutoff_deg, 0.0), 90.0)))
    half = 0.5 ** (1.0 / exponent) if exponent > 0.0 else 0.0
    inner = outer + (half - outer) / math.sqrt(0.5)
    return min(max(inner, outer + 1e-3), 1.0), outer


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.array([0.0, 0.0, -1.0])
