"""Exposure for the lights of a file, and default lighting for files without lights."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from omnisim.core.arrays import Floats, Floats32, triangle_crosses
from omnisim.scene import parts
from omnisim.scene.light.environment import Environment

# A pale clear sky near the horizon, linear RGB.
DEFAULT_BACKGROUND = (0.56, 0.71, 0.87)
# Ambient light for files with lights: keeps a white surface visible where no light reaches.
FILL_AMBIENT = (0.25, 0.25, 0.25)
# Files without lights: bright overcast daylight from everywhere, a sun from behind the left
# shoulder and a weaker one from the other side, so that no two walls of a corner are equally
# bright.
DEFAULT_LIGHTING = parts.Lighting(
    (0.38, 0.39, 0.42),
    tuple(
        parts.Light(
            parts.LightKind.DIRECTIONAL,
            color,
            intensity,
            direction=direction / np.linalg.norm(direction),
            casts_shadow=False,
        )
        for direction, color, intensity in (
            (np.array((0.45, -0.30, -0.85)), (1.0, 0.97, 0.90), 0.56),
            (np.array((-0.60, 0.45, -0.30)), (0.85, 0.92, 1.0), 0.18),
        )
    ),
)
# Share of the lit surface area that is at most white; the rest is overexposed.
WHITE_SHARE = 0.9
SAMPLED_TRIANGLES = 20_000


def expose(
    lights: tuple[parts.Light, ...],
    meshes: tuple[parts.Mesh, ...],
    instances: tuple[parts.Instance, ...],
    dome: tuple[float, float, float] | None = None,
) -> parts.Lighting:
    """Lighting by a file's lights, with an exposure that overexposes little of the lit surface.

    Files state lights in lux and candela, but images have no such scale. The exposure maps a
    reference illuminance, plus the fill light, to white; `WHITE_SHARE` of the lit surface stays
    below that illuminance. The exposure depends on the scene only, not on the viewpoint, so that
    the frames of a drive match. Beyond `MAX_LIGHTS` lights, only those that light the scene most
    are kept.

    Args:
        lights: lights of the file, world frame.
        meshes, instances: surfaces of the scene.
        dome: luminance of uniform light from all directions, cd/m², in place of the fill light;
            None: the fill light.
    """
    sky_lux = math.pi * np.array(dome or (0.0, 0.0, 0.0))
    if not lights:
        return _ambient_only(sky_lux) if sky_lux.any() else DEFAULT_LIGHTING
    centers, normals, areas = _surface_samples(meshes, instances)
    by_light = np.array([illuminance(light, centers, normals) for light in lights])
    strongest = np.sort(np.argsort(-(by_light @ areas), kind="stable")[: parts.MAX_LIGHTS])
    lights = tuple(lights[index] for index in strongest)
    total = by_light[strongest].sum(axis=0)
    lit = total > 0.0
    if not lit.any():
        return replace(_ambient_only(sky_lux), lights=lights)
    order = np.argsort(total[lit])
    share = np.cumsum(areas[lit][order])
    white = total[lit][order][np.searchsorted(share, WHITE_SHARE * share[-1])]
    if sky_lux.any():
        exposure = 1.0 / float(white + sky_lux.max())
        red, green, blue = (exposure * sky_lux).tolist()
        return parts.Lighting((red, green, blue), lights, exposure)
    return parts.Lighting(FILL_AMBIENT, lights, exposure=(1.0 - max(FILL_AMBIENT)) / float(white))


def _ambient_only(lux: Floats) -> parts.Lighting:
    """Lighting by ambient light only, whose brightest channel is white."""
    if not lux.any():
        return parts.Lighting(FILL_AMBIENT, ())
    red, green, blue = (lux / lux.max()).tolist()
    return parts.Lighting((red, green, blue), (), exposure=1.0 / float(lux.max()))


def _surface_samples(
    meshes: tuple[parts.Mesh, ...], instances: tuple[parts.Instance, ...]
) -> tuple[Floats, Floats, Floats]:
    """Centers (n, 3), unit normals (n, 3) and areas (n,) of triangles sampled over the scene."""
    total = sum(len(meshes[instance.mesh].triangles) for instance in instances)
    step = max(1, total // SAMPLED_TRIANGLES)
    corners = np.concatenate(
        [
            meshes[instance.mesh].positions[meshes[instance.mesh].triangles[::step]]
            @ instance.world_from_mesh[:3, :3].T
            + instance.world_from_mesh[:3, 3]
            for instance in instances
        ]
    )
    doubled = triangle_crosses(corners)
    length = np.linalg.norm(doubled, axis=1)
    keep = length > 0.0
    return corners.mean(axis=1)[keep], doubled[keep] / length[keep, None], 0.5 * length[keep]


@np.errstate(over="ignore")
def illuminance(light: parts.Light, centers: Floats, normals: Floats) -> Floats:
    """Illuminance (n,), lx, of surfaces from either side; reference for `lighting.glsl`."""
    level = light.intensity * max(light.color)
    falloff: Floats
    if light.kind is parts.LightKind.DIRECTIONAL:
        falloff = np.abs(normals @ light.direction)
        return level * falloff
    away = centers - light.position_m
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
    away = away / distance[:, None]
    falloff = np.abs(np.sum(normals * away, axis=1)) / distance**2
    if math.isfinite(light.range_m):
        falloff *= np.clip(1.0 - (distance / light.range_m) ** 4, 0.0, 1.0)
    if light.kind is parts.LightKind.SPOT:
        inner, outer = light.cone_cosines
        falloff *= np.clip((away @ light.direction - outer) / max(inner - outer, 1e-3), 0, 1) ** 2
    return level * falloff


def is_even(lighting: parts.Lighting) -> bool:
    """True for even light, the substitute for lamps in scenes without any, whatever its shadows."""
    found, even = (
        [(light.kind, light.color, light.intensity, *light.direction.tolist()) for light in lights]
        for lights in (lighting.lights, DEFAULT_LIGHTING.lights)
    )
    return found == even


def light_summary(lighting: parts.Lighting) -> str:
    """Text that lists the lamps by type, or describes the light of a scene without lamps."""
    kinds = [light.kind.value for light in lighting.lights]
    if kinds and not is_even(lighting):
        return ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    if lighting.baked is not None:
        return "none: baked light of emissive surfaces"
    if lighting.environment is not None:
        return "none: lit by its sky"
    if kinds:
        return "none: even light, without shadows"
    return "none: light from everywhere" if any(lighting.ambient) else "none: only emission"


def background_light(color: tuple[float, float, float]) -> tuple[float, float, float]:
    """Uniform light of a background, for baking scenes without lamps.

    A background brighter than white is a luminous sky; any other is an image.
    """
    return color if max(color) > 1.0 else (0.0, 0.0, 0.0)


def is_bright(material: parts.Material) -> bool:
    """True for emission brighter than white: a lamp's tubes, but not a screen."""
    return not material.unlit and max(material.emissive) > 1.0


def with_environment(lighting: parts.Lighting, luminance: Floats32) -> parts.Lighting:
    """Lighting with an environment map, cd/m², in place of its ambient light."""
    radiance = (math.pi * lighting.exposure * luminance).astype(np.float32)
    return replace(lighting, ambient=(0.0, 0.0, 0.0), environment=Environment(radiance))
