"""Scenes lit by lamps, seen in a mirror, by Mitsuba 3.

Surfaces are diffuse on both sides, or have glTF materials whose only map is that of the base color,
glass included. They may emit light to the front; lamps are Mitsuba's own.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import HyperbolicCamera
from omnisim.core.errors import SceneError
from omnisim.core.poses import check_pose
from omnisim.scene import Scene
from omnisim.scene.model import Instance, Light, LightKind, Material
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS
from omnisim.validation.oracles.mitsuba_glass import absorbs, glass_bsdf, medium
from omnisim.validation.oracles.mitsuba_materials import principled, sky
from omnisim.validation.oracles.mitsuba_scene import (
    VERTEX_COLOR,
    bitmap,
    mesh_of,
    metal,
    rgb,
    scalar_variant,
)
from omnisim.validation.oracles.mitsuba_tracer import RIM_UNITS, mirror_of_metal, pinhole
from omnisim.validation.oracles.surfaces import opaque_only

# Segments of a path from a lamp to the camera: via one surface, and until more add nothing.
DIRECT_DEPTH, ALL_DEPTH = 2, 23
_DARK = (0.0, 0.0, 0.0)


def matte_on_both_sides(scene: Scene) -> Scene:
    """Scene with opaque, matte and double-sided surfaces only, which both renderers show alike.

    Meshes with a texture lose their vertex colors: Mitsuba does not support both.
    """
    scene = opaque_only(scene)
    materials = [
        dataclasses.replace(one, double_sided=True, unlit=False) for one in scene.materials
    ]
    meshes = [
        dataclasses.replace(mesh, colors=None)
        if scene.materials[mesh.material].texture is not None
        else mesh
        for mesh in scene.meshes
    ]
    lighting = dataclasses.replace(scene.lighting, is_matte=True)
    return dataclasses.replace(
        scene, materials=tuple(materials), meshes=tuple(meshes), lighting=lighting
    )


def trace_lit_mirror(
    scene: Scene,
    camera: HyperbolicCamera,
    world_from_optical: ArrayLike,
    samples: int,
    seed: int = 0,
    depth: int = DIRECT_DEPTH,
) -> NDArray[np.float32]:
    """Trace the image (height, width, 3), linear RGB, of a mirror in a scene lit by its lamps.

    Args:
        scene: see `lit_world`.
        camera, world_from_optical, samples, seed: see `trace_mirror`.
        depth: maximum number of segments of a path from a lamp to the mirror.

    Raises:
        OmnisimError: a matrix that is not a pose.
        SceneError: see `lit_world`.
    """
    pose = check_pose(world_from_optical)
    units_per_m = RIM_UNITS / camera.mirror.rim_radius_m
    with scalar_variant():
        content = lit_world(scene, pose[:3, 3], units_per_m, depth + 1)
        content["sensor"] = pinhole(camera, pose[:3, :3], units_per_m, samples)
        content["mirror"] = mirror_of_metal(camera.mirror, pose[:3, :3], units_per_m)
        image = mi.render(mi.load_dict(content), spp=samples, seed=mi.UInt32(seed))
        return np.array(image, dtype=np.float32)[..., :3]


def lit_world(
    scene: Scene, viewpoint_m: NDArray[np.float64], units_per_m: float, depth: int
) -> dict[str, Any]:
    """Surfaces and lamps around a viewpoint, and their path tracer, for `mitsuba.load_dict`.

    Args:
        scene: scene from `matte_on_both_sides`, optionally with emissive surfaces, or with
            materials for `principled` or of glass. Ambient light is a uniform sky.
        viewpoint_m: (3,) origin of the coordinates, world.
        units_per_m: scale of the coordinates.
        depth: maximum number of segments of a path.

    Raises:
        SceneError: a spot light, whose edge falls off differently, or a map of light.
    """
    lamps = scene.lighting.lights
    # "volpath" absorbs in glass, and connects surfaces with lamps behind panes
    has_volumes = not scene.lighting.is_matte and any(
        absorbs(one) or (lamps and one.pane_transmission) for one in scene.materials
    )
    content: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "volpath" if has_volumes else "path", "max_depth": depth},
    }
    for number, light in enumerate(lamps):
        level = scene.lighting.exposure
        content[f"lamp {number}"] = _lamp(light, level, viewpoint_m, units_per_m)
    bsdfs: dict[tuple[int, str], mi.BSDF] = {}  # of all instances of a material
    for number, instance in enumerate(scene.instances):
        content[f"surface {number}"] = _surface(scene, instance, viewpoint_m, units_per_m, bsdfs)
    if scene.lighting.environment is not None:
        content["sky"] = sky(scene.lighting.environment)
    elif any(scene.lighting.ambient):
        content["sky"] = {"type": "constant", "radiance": rgb(scene.lighting.ambient)}
    return content


def _lamp(
    light: Light, exposure: float, viewpoint_m: NDArray[np.float64], units_per_m: float
) -> dict[str, Any]:
    """Emitter of a lamp, times π: Mitsuba's white surface in one lux has a radiance of 1/π."""
    level = math.pi * light.intensity * exposure
    if light.kind is LightKind.DIRECTIONAL:
        color = rgb(tuple(level * share for share in light.color))
        return {"type": "directional", "direction": light.direction.tolist(), "irradiance": color}
    if light.kind is LightKind.SPOT:
        raise SceneError("spot light: Mitsuba's edge falls off in another way: expected none")
    color = rgb(tuple(level * units_per_m**2 * share for share in light.color))
    position = ((light.position_m - viewpoint_m) * units_per_m).tolist()
    return {"type": "point", "position": position, "intensity": color}


def _surface(
    scene: Scene,
    instance: Instance,
    viewpoint_m: NDArray[np.float64],
    units_per_m: float,
    bsdfs: dict[tuple[int, str], mi.BSDF],
) -> mi.Mesh:
    """Mesh of an instance; adds the BSDF of its material to `bsdfs` if it is not there."""
    mesh = scene.meshes[instance.mesh]
    material = scene.materials[mesh.material]
    linear = instance.world_from_mesh[:3, :3]
    positions_m = mesh.positions @ linear.T + (instance.world_from_mesh[:3, 3] - viewpoint_m)
    triangles, normals = mesh.triangles.astype(np.int64), None
    coordinates = colors = None
    kind = "plain"
    if material.texture is not None and mesh.texture_coordinates is not None:
        coordinates, kind = mesh.texture_coordinates, "textured"
    elif mesh.colors is not None:
        colors = mesh.colors[:, :3] * np.array(material.base_color[:3], dtype=np.float32)
        kind = "colored"
    if mesh.normals is not None:
        normals = mesh.normals @ np.linalg.inv(linear)
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    is_matte = scene.lighting.is_matte or dataclasses.replace(material, emissive=_DARK).is_matte
    key = id(material), kind
    if key not in bsdfs:
        bsdfs[key] = mi.load_dict(_bsdf(material, kind, is_matte))
    properties: dict[str, Any] = {"mesh_bsdf": bsdfs[key], "face_normals": normals is None}
    if not is_matte and absorbs(material):
        properties["interior"] = mi.load_dict(medium(material, units_per_m))
    if any(material.emissive) and not scene.lighting.is_matte:
        if material.emissive_map is not None:
            raise SceneError(f"material {material.name!r}: emissive_map: expected none for Mitsuba")
        light = {"type": "area", "radiance": rgb(material.emissive)}
        properties["mesh_emitter"] = mi.load_dict(light)
    return mesh_of(
        positions_m * units_per_m,
        triangles,
        properties,
        normals=normals,
        coordinates=coordinates,
        colors=colors,
    )


def _bsdf(material: Material, kind: str, is_matte: bool) -> dict[str, Any]:
    """BSDF of a material; its kind says whether a texture or vertex colors are its base color."""
    if not is_matte and material.transmission > 0.0:
        return glass_bsdf(material)
    reflectance = rgb(material.base_color[:3])
    if kind == "textured":
        assert material.texture is not None
        reflectance = bitmap(material.texture, material.base_color)
    elif kind == "colored":
        reflectance = {"type": "mesh_attribute", "name": VERTEX_COLOR}
    if is_matte:
        nested = {"type": "diffuse", "reflectance": reflectance}
    elif material.metallic == 1.0 and material.roughness <= MIN_ROUGHNESS:
        nested = metal(1.0) | {"specular_reflectance": reflectance}
    else:
        nested = principled(material) | {"base_color": reflectance}
    return {"type": "twosided", "nested": nested}
