"""Scenes lit by lamps, seen in a mirror or through a fisheye, by Mitsuba 3.

Surfaces are diffuse on both sides, or have glTF materials whose only map is that of the base color,
glass included. They may emit light to the front; lamps are Mitsuba's own.

Mitsuba has no fisheye. It traces the faces of a cube around the viewpoint, finer than the image;
each pixel is the average of the texels that rays through the pixel's square hit. Only the
parameters of omnisim's lens are used; the rays are those of r = f θ, Kannala and Brandt (2006,
Eq. 3).

In scenes of luminous surfaces, unlit surfaces emit their color and are the only light: the image is
then the radiance along reflected and transmitted rays.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import EquidistantCamera, HyperbolicCamera, PerspectiveCamera
from omnisim.core.arrays import Floats, Floats32, Ints
from omnisim.core.errors import SceneError
from omnisim.core.poses import check_pose
from omnisim.scene import Scene
from omnisim.scene.model import Instance, Light, LightKind, Material
from omnisim.scene.surface_kind import SurfaceKind, kind_of
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS
from omnisim.validation.oracles import mitsuba_scene as scenes
from omnisim.validation.oracles.mitsuba_materials import (
    absorbs,
    glass_bsdf,
    medium,
    principled,
    sky,
)
from omnisim.validation.oracles.mitsuba_optics import RIM_UNITS, mirror_of_metal, mirror_pinhole
from omnisim.validation.oracles.surfaces import opaque_only

# Segments of a path from a lamp to the camera: via one surface, and until more add nothing.
DIRECT_DEPTH, ALL_DEPTH = 2, 23
_DARK = (0.0, 0.0, 0.0)
UNITS_PER_M = 100.0
TEXELS = 4  # minimum number along a pixel's side
# Rows: right, down and forward of the faces, optical frame.
_FACES = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
    ],
    dtype=np.float64,
)
DEPTH = 12  # maximum number of segments of a path


def matte_on_both_sides(scene: Scene) -> Scene:
    """Scene with opaque, matte and double-sided surfaces only, which both renderers show alike.

    Meshes with a texture lose their vertex colors: Mitsuba does not support both.
    """
    scene = opaque_only(scene)
    materials = [
        dataclasses.replace(material, double_sided=True, unlit=False)
        for material in scene.materials
    ]
    meshes = []
    for mesh in scene.meshes:
        is_textured = scene.materials[mesh.material].texture is not None
        meshes.append(dataclasses.replace(mesh, colors=None) if is_textured else mesh)
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
) -> Floats32:
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
    with scenes.scalar_variant():
        content = lit_world(scene, pose[:3, 3], units_per_m, depth + 1)
        content["sensor"] = mirror_pinhole(camera, pose[:3, :3], units_per_m, samples)
        content["mirror"] = mirror_of_metal(camera.mirror, pose[:3, :3], units_per_m)
        return scenes.rendered(content, samples, seed)


def lit_world(scene: Scene, viewpoint_m: Floats, units_per_m: float, depth: int) -> dict[str, Any]:
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
        absorbs(material) or (lamps and kind_of(material) & SurfaceKind.PANE)
        for material in scene.materials
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
        meshes = _surfaces(scene, instance, viewpoint_m, units_per_m, bsdfs)
        content |= {f"surface {number}, {part}": mesh for part, mesh in enumerate(meshes)}
    if scene.lighting.environment is not None:
        content["sky"] = sky(scene.lighting.environment)
    elif any(scene.lighting.ambient):
        content["sky"] = {"type": "constant", "radiance": scenes.rgb(scene.lighting.ambient)}
    return content


def _lamp(light: Light, exposure: float, viewpoint_m: Floats, units_per_m: float) -> dict[str, Any]:
    """Emitter of a lamp, times π: Mitsuba's white surface in one lux has a radiance of 1/π."""
    level = math.pi * light.intensity * exposure
    if light.kind is LightKind.DIRECTIONAL:
        color = scenes.rgb(tuple(level * share for share in light.color))
        return {"type": "directional", "direction": light.direction.tolist(), "irradiance": color}
    if light.kind is LightKind.SPOT:
        raise SceneError("spot light: Mitsuba's edge falls off in another way: expected none")
    color = scenes.rgb(tuple(level * units_per_m**2 * share for share in light.color))
    position = ((light.position_m - viewpoint_m) * units_per_m).tolist()
    return {"type": "point", "position": position, "intensity": color}


def _surfaces(
    scene: Scene,
    instance: Instance,
    viewpoint_m: Floats,
    units_per_m: float,
    bsdfs: dict[tuple[int, str], mi.BSDF],
) -> list[mi.Mesh]:
    """Mesh of an instance; one per color if it is unlit, and so emits its color.

    Adds the BSDF of its material to `bsdfs` if it is not there.
    """
    mesh = scene.meshes[instance.mesh]
    material = scene.materials[mesh.material]
    linear = instance.world_from_mesh[:3, :3]
    positions_m = mesh.positions @ linear.T + (instance.world_from_mesh[:3, 3] - viewpoint_m)
    vertices, triangles = positions_m * units_per_m, mesh.triangles.astype(np.int64)
    if material.unlit:
        return _shining(material, vertices, triangles, mesh.colors)
    coordinates = colors = normals = None
    kind = "plain"
    if material.texture is not None and mesh.texture_coordinates is not None:
        coordinates, kind = mesh.texture_coordinates, "textured"
    elif mesh.colors is not None:
        colors = mesh.colors[:, :3] * np.array(material.base_color[:3], dtype=np.float32)
        kind = "colored"
    if mesh.normals is not None:
        normals = mesh.normals @ np.linalg.inv(linear)
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    dark = dataclasses.replace(material, emissive=_DARK)
    is_matte = SurfaceKind.MATTE in kind_of(dark, scene.lighting.is_matte)
    key = id(material), kind
    if key not in bsdfs:
        bsdfs[key] = mi.load_dict(_bsdf(material, kind, is_matte))
    properties: dict[str, Any] = {"mesh_bsdf": bsdfs[key], "face_normals": normals is None}
    if not is_matte and absorbs(material):
        properties["interior"] = mi.load_dict(medium(material, units_per_m))
    if any(material.emissive) and not scene.lighting.is_matte:
        if material.emissive_map is not None:
            raise SceneError(f"material {material.name!r}: emissive_map: expected none for Mitsuba")
        light = {"type": "area", "radiance": scenes.rgb(material.emissive)}
        properties["mesh_emitter"] = mi.load_dict(light)
    return [scenes.mesh_of(vertices, triangles, properties, normals, coordinates, colors)]


def _shining(
    material: Material, vertices: Floats, triangles: Ints, colors: Floats32 | None
) -> list[mi.Mesh]:
    """One-sided emitters, one per triangle color: Mitsuba 3.9 crashes on vertex colors."""
    own = np.tile(np.array(material.base_color[:3], dtype=np.float32), (len(triangles), 1))
    if colors is not None:
        own *= colors[triangles[:, 0], :3]
    distinct, groups = np.unique(own, axis=0, return_inverse=True)
    meshes = []
    for number, color in enumerate(distinct):
        corners = triangles[groups.ravel() == number].ravel()
        faces = np.arange(len(corners)).reshape(-1, 3)
        light = scenes.emitter(scenes.rgb(tuple(color.tolist())))
        meshes.append(scenes.mesh_of(vertices[corners], faces, light))
    return meshes


def _bsdf(material: Material, kind: str, is_matte: bool) -> dict[str, Any]:
    """BSDF of a material; its kind says whether a texture or vertex colors are its base color."""
    if not is_matte and material.transmission > 0.0:
        return glass_bsdf(material)
    reflectance = scenes.rgb(material.base_color[:3])
    if kind == "textured":
        assert material.texture is not None
        reflectance = scenes.bitmap(material.texture, material.base_color)
    elif kind == "colored":
        reflectance = {"type": "mesh_attribute", "name": scenes.VERTEX_COLOR}
    if is_matte:
        nested = {"type": "diffuse", "reflectance": reflectance}
    elif material.metallic == 1.0 and material.roughness <= MIN_ROUGHNESS:
        nested = scenes.metal(1.0) | {"specular_reflectance": reflectance}
    else:
        nested = principled(material) | {"base_color": reflectance}
    return {"type": "twosided", "nested": nested}


def trace_lit_fisheye(
    scene: Scene,
    camera: EquidistantCamera,
    world_from_optical: ArrayLike,
    samples: int,
    seed: int = 0,
    depth: int = DIRECT_DEPTH,
) -> Floats32:
    """Trace the image (height, width, 3), linear RGB, of a fisheye in a scene lit by its lamps.

    Args:
        scene: see `lit_world`.
        camera: camera model of the lens.
        world_from_optical: (4, 4) pose of the optical frame.
        samples: rays per texel, with 16 texels or more per pixel; a square number.
        seed: equal seeds give equal images.
        depth: maximum number of segments of a path from a lamp to the lens.

    Raises:
        OmnisimError: a matrix that is not a pose.
        SceneError: see `lit_world`.
    """
    pose = check_pose(world_from_optical)
    size_px = 2 * math.ceil(TEXELS * camera.focal_length_px)  # of a face, 2 wide at distance 1
    face = PerspectiveCamera.with_field_of_view(size_px, size_px, 0.5 * math.pi)
    side = 2 * TEXELS  # rays are evenly spaced over the pixels, as many per pixel's side
    sizes_px = camera.width_px, camera.height_px
    u, v = ((np.arange(count * side) + 0.5) / side - 0.5 for count in sizes_px)
    x, y = np.meshgrid(u - camera.principal_point_px[0], v - camera.principal_point_px[1])
    angle = np.minimum(np.hypot(x, y) / camera.focal_length_px, camera.theta_max_rad)
    azimuth, across = np.arctan2(y, x), np.sin(angle)
    rays = np.stack((across * np.cos(azimuth), across * np.sin(azimuth), np.cos(angle)), axis=-1)
    faces = np.argmax(rays @ _FACES[:, 2].T, axis=-1)
    local = np.einsum("...ij,...j->...i", _FACES[faces], rays)
    tangents = local[..., :2] / local[..., 2:]
    texels = np.floor(0.5 * (tangents + 1.0) * size_px).astype(np.intp).clip(0, size_px - 1)
    samples_rgb = np.zeros((*faces.shape, 3), dtype=np.float32)
    with scenes.scalar_variant():
        loaded = mi.load_dict(lit_world(scene, pose[:3, 3], UNITS_PER_M, depth))
        for number in np.unique(faces).tolist():
            on_face = faces == number
            low, high = texels[on_face].min(axis=0), texels[on_face].max(axis=0) + 1
            units_from_face = np.eye(4)
            units_from_face[:3, :3] = pose[:3, :3] @ _FACES[number].T
            whole = scenes.pinhole(face, units_from_face, 1e-3 * UNITS_PER_M, samples)
            sensor = scenes.cropped(whole, *low.tolist(), *(high - low).tolist())
            sensor["far_clip"] = 1e5 * UNITS_PER_M
            image = scenes.rendered(loaded, samples, seed + number, sensor)
            column, row = (texels[on_face] - low).T
            samples_rgb[on_face] = image[row, column]
    height, width = camera.height_px, camera.width_px
    return samples_rgb.reshape(height, side, width, side, 3).mean(axis=(1, 3))


def trace_reflections(
    scene: Scene, camera: PerspectiveCamera, world_from_base: Floats, samples: int, seed: int = 0
) -> Floats32:
    """Trace an image (height, width, 3), linear RGB; the camera looks along its base's x.

    Args:
        scene: scene from `omnisim.validation.reflective_rooms`.
        camera: camera at the base's origin.
        world_from_base: (4, 4) pose of the base.
        samples: samples per pixel; a square number.
        seed: equal seeds give equal images.
    """
    forward, left, up, position = world_from_base[:3].T
    to_world = np.stack((-left, -up, forward, position), axis=1)
    with scenes.scalar_variant():
        content = lit_world(scene, np.zeros(3), 1.0, DEPTH)
        content["sensor"] = scenes.pinhole(camera, to_world, 0.01, samples)
        return scenes.rendered(content, samples, seed)
