"""Material chart by Mitsuba 3: spheres of its principled BSDF under a lamp or an environment.

Its metals and gloss are those of glTF: GGX with alpha = roughness², Schlick's Fresnel for metals.
It differs in three ways: facets are shadowed separately in each direction; a dielectric's Fresnel
term is exact, and takes no light from the diffuse reflection; and the diffuse reflection is
Disney's. At grazing angles, Disney's is brighter than Lambert's on a rough surface, and darker on a
smooth one.

Each sphere is traced alone: no sphere is reflected in another.
"""

from __future__ import annotations

import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.scene.light.environment import Environment
from omnisim.scene.model import Light, Lighting, Material
from omnisim.validation.oracles.mitsuba_scene import film, rgb, scalar_variant


def trace_sphere(
    material: Material,
    center_m: NDArray[np.float64],
    radius_m: float,
    lighting: Lighting,
    camera: PerspectiveCamera,
    crop_px: tuple[int, int, int, int],
    samples: int,
) -> NDArray[np.float32]:
    """Trace a part (height, width, 3), linear RGB, of the image of a camera that looks along x.

    Args:
        material: metal or dielectric with the default index, without maps.
        center_m: (3,) center of the sphere, world.
        radius_m: radius of the sphere.
        lighting: directional lamps and ambient light, or a map.
        camera: camera at the origin.
        crop_px: left, top, width and height of the part.
        samples: rays per pixel.
    """
    with scalar_variant():
        content = _content(material, center_m, radius_m, lighting)
        content["sensor"] = _sensor(camera, crop_px, samples)
        return np.array(mi.render(mi.load_dict(content), seed=mi.UInt32(0)))[..., :3]


def _content(
    material: Material, center_m: NDArray[np.float64], radius_m: float, lighting: Lighting
) -> dict[str, Any]:
    content: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2, "hide_emitters": True},
        "sphere": {
            "type": "sphere",
            "center": center_m.tolist(),
            "radius": radius_m,
            "bsdf": principled(material),
        },
    }
    for number, light in enumerate(lighting.lights):
        content[f"lamp {number}"] = _lamp(light, lighting.exposure)
    if any(lighting.ambient):
        content["even light"] = {"type": "constant", "radiance": rgb(lighting.ambient)}
    if lighting.environment is not None:
        content["sky"] = sky(lighting.environment)
    return content


def _lamp(light: Light, exposure: float) -> dict[str, Any]:
    """Lamp, times π: a white surface is then as bright in Mitsuba as in omnisim."""
    level = np.array(light.color) * (light.intensity * exposure * math.pi)
    return {
        "type": "directional",
        "direction": light.direction.tolist(),
        "irradiance": rgb(tuple(level.tolist())),
    }


def principled(material: Material) -> dict[str, Any]:
    """Mitsuba's BSDF of a metal or dielectric without maps."""
    return {
        "type": "principled",
        "base_color": rgb(material.base_color[:3]),
        "metallic": material.metallic,
        "roughness": material.roughness,
        "eta": material.ior,
    }


def sky(environment: Environment) -> dict[str, Any]:
    """Environment map for Mitsuba, whose maps have up along y, and their middle along +z."""
    pixels = np.ascontiguousarray(environment.radiance)
    world_from_sky = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(pixels),
        "to_world": mi.ScalarTransform4f(world_from_sky),
    }


def _sensor(
    camera: PerspectiveCamera, crop_px: tuple[int, int, int, int], samples: int
) -> dict[str, Any]:
    (u, v), width, height = camera.principal_point_px, camera.width_px, camera.height_px
    left, top, wide, high = crop_px
    return {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=[0, 0, 0], target=[1, 0, 0], up=[0, 0, 1]
        ),
        "fov_axis": "x",
        "fov": math.degrees(2.0 * math.atan(0.5 * width / camera.focal_length_px)),
        "principal_point_offset_x": 0.5 - (u + 0.5) / width,
        "principal_point_offset_y": 0.5 - (v + 0.5) / height,
        "near_clip": 0.01,
        "film": film(width, height)
        | {
            "crop_offset_x": left,
            "crop_offset_y": top,
            "crop_width": wide,
            "crop_height": high,
        },
        "sampler": {"type": "multijitter", "sample_count": samples},
    }
