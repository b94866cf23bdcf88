"""Mitsuba 3 as an oracle for scenes of luminous surfaces, mirrors, rough metal and glass.

Unlit surfaces emit their color, and are the only light. Mitsuba's converged image is therefore the
radiance along reflected and transmitted rays.
"""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.scene import Scene
from omnisim.scene.model import Instance, Material
from omnisim.validation.oracles.mitsuba_materials import absorbs, glass_bsdf, medium, principled
from omnisim.validation.oracles.mitsuba_scene import (
    emitter,
    mesh_of,
    metal,
    pinhole,
    rendered,
    rgb,
    scalar_variant,
)

DEPTH = 12  # maximum number of segments of a path


def trace_reflections(
    scene: Scene,
    camera: PerspectiveCamera,
    world_from_base: NDArray[np.float64],
    samples: int,
    seed: int = 0,
) -> NDArray[np.float32]:
    """Trace an image (height, width, 3), linear RGB; the camera looks along its base's x.

    Args:
        scene: scene from `omnisim.validation.reflective_rooms`.
        camera: camera at the base's origin.
        world_from_base: (4, 4) pose of the base.
        samples: samples per pixel; a square number.
        seed: equal seeds give equal images.
    """
    is_absorbing = any(map(absorbs, scene.materials))
    forward, left, up, position = world_from_base[:3].T
    to_world = np.stack((-left, -up, forward, position), axis=1)
    with scalar_variant():
        content: dict[str, Any] = {
            "type": "scene",
            "integrator": {"type": "volpath" if is_absorbing else "path", "max_depth": DEPTH},
            "sensor": pinhole(camera, to_world, 0.01, samples),
        }
        for number, instance in enumerate(scene.instances):
            for part, surface in enumerate(_surfaces(scene, instance)):
                content[f"surface {number}, {part}"] = surface
        return rendered(content, samples, seed)


def _surfaces(scene: Scene, instance: Instance) -> list[mi.Mesh]:
    """Meshes of an instance: one per color if it emits light, else one."""
    mesh = scene.meshes[instance.mesh]
    material = scene.materials[mesh.material]
    linear, offset_m = instance.world_from_mesh[:3, :3], instance.world_from_mesh[:3, 3]
    positions = mesh.positions @ linear.T + offset_m
    triangles = mesh.triangles.astype(np.int64)
    if material.unlit:
        return _shining(material, positions, triangles, mesh.colors)
    bsdf = mi.load_dict(_bsdf(material))
    properties = {"mesh_bsdf": bsdf, "face_normals": mesh.normals is None}
    if absorbs(material):
        properties["interior"] = mi.load_dict(medium(material))
    normals = None if mesh.normals is None else mesh.normals @ linear.T
    return [mesh_of(positions, triangles, properties, normals=normals)]


def _shining(
    material: Material,
    positions: NDArray[np.float64],
    triangles: NDArray[np.int64],
    colors: NDArray[np.float32] | None,
) -> list[mi.Mesh]:
    """One-sided emitters, one per triangle color: Mitsuba 3.9 crashes on vertex colors."""
    factor = np.array(material.base_color[:3], dtype=np.float32)
    white = np.ones((len(triangles), 3), dtype=np.float32)
    own = factor * (white if colors is None else colors[triangles[:, 0], :3])
    distinct, groups = np.unique(own, axis=0, return_inverse=True)
    meshes = []
    for number, color in enumerate(distinct):
        corners = triangles[groups.ravel() == number].ravel()
        faces = np.arange(len(corners)).reshape(-1, 3)
        meshes.append(mesh_of(positions[corners], faces, emitter(rgb(tuple(color.tolist())))))
    return meshes


def _bsdf(material: Material) -> dict[str, Any]:
    """BSDF of glass, of a smooth metal, or of a rough metal with GGX facets."""
    if material.transmission > 0.0:
        return glass_bsdf(material)
    smooth = metal(1.0) | {"specular_reflectance": rgb(material.base_color[:3])}
    nested = principled(material) if material.roughness > 0.0 else smooth
    return {"type": "twosided", "nested": nested}
