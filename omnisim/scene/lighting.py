"""The lamps of a glTF file (KHR_lights_punctual), and the exposure that suits them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import MAX_LIGHTS, Instance, Light, Lighting, LightKind, Mesh

# A white surface with no lamp near it is still seen: what stands in for light from all around.
AMBIENT_BESIDE_LAMPS = (0.25, 0.25, 0.25)
# With no lamps in the file: bright overcast daylight from everywhere, a sun from behind the left
# shoulder and a weak one from the other side, so that no two walls of a corner look the same.
DEFAULT_AMBIENT = (0.38, 0.39, 0.42)
DEFAULT_LAMPS = (
    ((0.45, -0.30, -0.85), (1.0, 0.97, 0.90), 0.56),
    ((-0.60, 0.45, -0.30), (0.85, 0.92, 1.0), 0.18),
)
# So much of the lit surface is no brighter than white; what is nearer to a lamp is overexposed.
WHITE_SHARE = 0.9
SAMPLED_TRIANGLES = 20_000


def default_lighting() -> Lighting:
    """Ambient light and two directional lamps, for files that bring none."""
    lights = tuple(
        Light(
            LightKind.DIRECTIONAL,
            color,
            intensity,
            direction=np.array(direction) / np.linalg.norm(direction),
        )
        for direction, color, intensity in DEFAULT_LAMPS
    )
    return Lighting(DEFAULT_AMBIENT, lights)


def lighting_for(
    lights: tuple[Light, ...], meshes: tuple[Mesh, ...], instances: tuple[Instance, ...]
) -> Lighting:
    """Lighting by the file's lamps, exposed so that most of what they light is not overexposed.

    Files give lamps in lux and candela, for which no picture has a scale of its own. The
    exposure makes the illuminance that nine tenths of the lit surface stay below equal to what a
    white surface shows as white beside the ambient light. It depends on the scene alone, not on
    the viewpoint, so that frames of a drive match. Of more than `MAX_LIGHTS` lamps those stay that
    give the scene most light.
    """
    if not lights:
        return default_lighting()
    centres, normals, areas = _surface_samples(meshes, instances)
    given = np.array([_illuminance(light, centres, normals) for light in lights])
    strongest = np.sort(np.argsort(-(given @ areas), kind="stable")[:MAX_LIGHTS])
    lights = tuple(lights[index] for index in strongest)
    illuminance = given[strongest].sum(axis=0)
    lit = illuminance > 0.0
    if not lit.any():
        return Lighting(AMBIENT_BESIDE_LAMPS, lights)
    order = np.argsort(illuminance[lit])
    share = np.cumsum(areas[lit][order])
    white = illuminance[lit][order][np.searchsorted(share, WHITE_SHARE * share[-1])]
    return Lighting(
        AMBIENT_BESIDE_LAMPS, lights, exposure=(1.0 - max(AMBIENT_BESIDE_LAMPS)) / float(white)
    )


def _surface_samples(
    meshes: tuple[Mesh, ...], instances: tuple[Instance, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Centres (n, 3), unit normals (n, 3) and areas (n,) of triangles spread over the scene."""
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
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(doubled, axis=1)
    keep = length > 0.0
    return corners.mean(axis=1)[keep], doubled[keep] / length[keep, None], 0.5 * length[keep]


def _illuminance(
    light: Light, centres: NDArray[np.float64], normals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Lux (n,) at surfaces, either side; the reference of `shaders/scene/lighting.glsl`."""
    level = light.intensity * max(light.color)
    falloff: NDArray[np.float64]
    if light.kind is LightKind.DIRECTIONAL:
        falloff = np.abs(normals @ light.direction)
        return level * falloff
    away = centres - light.position_m
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
    away = away / distance[:, None]
    falloff = np.abs(np.sum(normals * away, axis=1)) / distance**2
    if math.isfinite(light.range_m):
        falloff *= np.clip(1.0 - (distance / light.range_m) ** 4, 0.0, 1.0)
    if light.kind is LightKind.SPOT:
        inner, outer = light.cone_cosines
        falloff *= np.clip((away @ light.direction - outer) / max(inner - outer, 1e-3), 0, 1) ** 2
    return level * falloff
