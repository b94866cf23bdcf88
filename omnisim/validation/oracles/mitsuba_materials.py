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

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Floats, Floats32
from omnisim.scene.light.environment import Environment
from omnisim.scene.model import Lighting, Material
from omnisim.scene.surface_kind import SurfaceKind, kind_of, transmitted
from omnisim.validation.oracles.mitsuba_scene import cropped, pinhole, rendered, rgb, scalar_variant

_ANGLES = 64  # at which reflectance is averaged


def trace_sphere(
    material: Material,
    center_m: Floats,
    radius_m: float,
    lighting: Lighting,
    camera: PerspectiveCamera,
    crop_px: tuple[int, int, int, int],
    samples: int,
) -> Floats32:
    """Trace a part (height, width, 3), linear RGB, of the image of a camera that looks along x.

    Args:
        material: metal or dielectric with the default index, without maps.
        center_m: (3,) center of the sphere, world.
        lighting: directional lamps and ambient light, or a map.
        camera: camera at the origin.
        crop_px: left, top, width and height of the part.
        samples: rays per pixel.
    """
    content: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2, "hide_emitters": True},
    }
    with scalar_variant():
        content["sphere"] = {
            "type": "sphere",
            "center": center_m.tolist(),
            "radius": radius_m,
            "bsdf": principled(material),
        }
        for number, light in enumerate(lighting.lights):
            # times π: a white surface is then as bright in Mitsuba as in omnisim
            level = np.array(light.color) * (light.intensity * lighting.exposure * math.pi)
            content[f"lamp {number}"] = {
                "type": "directional",
                "direction": light.direction.tolist(),
                "irradiance": rgb(tuple(level.tolist())),
            }
        if any(lighting.ambient):
            content["even light"] = {"type": "constant", "radiance": rgb(lighting.ambient)}
        if lighting.environment is not None:
            content["sky"] = sky(lighting.environment)
        axes = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0]])  # along x, z up
        content["sensor"] = cropped(pinhole(camera, axes, 0.01, samples), *crop_px)
        return rendered(content, samples, 0)


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


def glass_bsdf(material: Material) -> dict[str, Any]:
    """BSDF of a material that transmits light, with the same on both of its sides.

    Thick frosted glass reflects as much as a pane on average. It scatters that, and what it
    transmits, by Lambert's law. Mitsuba's lobe of thin frosted panes is narrower than glTF's.
    """
    tint = rgb(tuple(material.transmission * share for share in material.base_color[:3]))
    if kind_of(material) & SurfaceKind.FROSTED_PANE:
        return {
            "type": "principledthin",
            "base_color": tint,
            "roughness": material.roughness,
            "eta": material.ior,
            "spec_trans": 1.0,
        }
    if kind_of(material) & SurfaceKind.FROSTED_GLASS:
        fresnel: Any = mi.fresnel  # of numbers, in the variant that is set
        cosines = np.sqrt((np.arange(_ANGLES) + 0.5) / _ANGLES)  # of Lambertian light
        once = np.array([fresnel(float(cosine), material.ior)[0] for cosine in cosines])
        reflected = float(np.mean(2.0 * once / (1.0 + once)))  # by both interfaces of a pane
        color = (1.0 - reflected) * np.array(material.base_color[:3])
        passing = transmitted(material, SurfaceKind.FROSTED_GLASS) * color
        total = color + reflected
        return {
            "type": "principledthin",
            "base_color": rgb(tuple(total.tolist())),
            "roughness": 0.5,  # has little effect on diffuse reflection
            "eta": material.ior,
            "diff_trans": 2.0 * float(passing.mean() / total.mean()),
        }
    return {
        "type": "dielectric" if kind_of(material) & SurfaceKind.GLASS else "thindielectric",
        "int_ior": material.ior,
        "ext_ior": 1.0,
        "specular_transmittance": tint,
    }


def medium(material: Material, units_per_m: float = 1.0) -> dict[str, Any]:
    """Medium in a body of glass, which absorbs light and scatters none."""
    absorption = tuple(share / units_per_m for share in _absorption_per_m(material))
    most = max(absorption)  # colors are at most 1
    return {
        "type": "homogeneous",
        "albedo": 0.0,
        "scale": most,
        "sigma_t": rgb(tuple(share / most for share in absorption)),
    }


def absorbs(material: Material) -> bool:
    """True for a body of colored glass."""
    is_glass = bool(kind_of(material) & SurfaceKind.GLASS)
    return is_glass and max(_absorption_per_m(material)) > 0.0


def _absorption_per_m(material: Material) -> tuple[float, ...]:
    """Absorption, linear RGB, that leaves the attenuation color after its distance."""
    color, distance_m = material.attenuation_color, material.attenuation_distance_m
    return tuple(-math.log(share) / distance_m for share in color)
