"""Physical mirror in front of a pinhole camera, traced by Mitsuba 3.

Only Eq. 1 of omnisim's optics is used: the mirror's surface with its normals, and the pinhole in
its other focus. Mitsuba itself determines the direction of a pixel, by reflecting its camera's rays
off a mesh of metal.

A pixel is the average over its square. There is no near plane. Around the rim the camera sees the
scene directly: compare inside the rim.

Coordinates are along the world's axes from the effective viewpoint, in hundredths of the rim's
radius. Mitsuba starts a reflected ray 9e-5 (1 + coordinate) off the surface: 1 µm in these units.
If coordinates were in meters, it would be 0.1 mm, which is 0.012 px on a scene 1 m away.
"""

from __future__ import annotations

import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.arrays import Floats, Floats32, Ints
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.core.poses import check_pose
from omnisim.scene import Scene
from omnisim.validation.oracles import mitsuba_scene as scenes
from omnisim.validation.oracles.surfaces import visible_surfaces

RIM_UNITS = 100.0


def trace_mirror(
    scene: Scene,
    camera: HyperbolicCamera,
    world_from_optical: ArrayLike,
    samples: int,
    seed: int = 0,
) -> Floats32:
    """Trace the image (height, width, 3), linear RGB, of a camera that looks at a mirror.

    The mirror has flat facets with interpolated normals. For the paper's mirror at 512 × 512 px,
    the facets move a ray by 0.0005 px on average and 0.0012 px at most; Mitsuba's float32 rays to a
    scene 1 m away are off by 0.0006 px on average and 0.0014 px at most
    (`tests/validation/oracles`). A few rays in 100 000 pass between two facets.

    Args:
        scene: scene with opaque surfaces only, see `opaque_only`.
        camera: mirror and pinhole camera.
        world_from_optical: (4, 4) pose of the optical frame.
        samples: rays per pixel; a square number, or Mitsuba warns that it rounds up.
        seed: equal seeds give equal images.

    Raises:
        OmnisimError: a matrix that is not a pose.
        SceneError: a material that is not opaque, or that Mitsuba does not support.
    """
    pose = check_pose(world_from_optical)
    mirror = camera.mirror
    reach_m = float(mirror.rho_m(mirror.theta_max_rad))  # the rim is farthest
    surfaces = visible_surfaces(scene, pose[:3, 3], reach_m)
    units_per_m = RIM_UNITS / mirror.rim_radius_m
    with scenes.scalar_variant():
        content = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},  # one reflection
            "sensor": mirror_pinhole(camera, pose[:3, :3], units_per_m, samples),
            "mirror": mirror_of_metal(mirror, pose[:3, :3], units_per_m),
            "sky": {"type": "constant", "radiance": scenes.rgb(scene.background)},
        }
        for number, surface in enumerate(surfaces):
            content[f"surface {number}"] = scenes.shining(surface, units_per_m)
        return scenes.rendered(content, samples, seed)


def mirror_pinhole(
    camera: HyperbolicCamera, world_from_optical: Floats, units_per_m: float, samples: int
) -> dict[str, Any]:
    """Mitsuba's perspective camera in the mirror's other focus, for `mitsuba.load_dict`.

    Args:
        world_from_optical: (3, 3) rotation.
    """
    c = camera.mirror.c_m * units_per_m
    to_world = np.column_stack((world_from_optical, -c * world_from_optical[:, 2]))
    # of the scene seen past the mirror
    return scenes.pinhole(camera, to_world, 0.1 * c, samples) | {"far_clip": 1e3 * c}


def mirror_of_metal(
    mirror: HyperbolicMirror, world_from_optical: Floats, units_per_m: float
) -> mi.Mesh:
    """Mesh of the mirror that reflects all light.

    Args:
        world_from_optical: (3, 3) rotation.
    """
    vertices_m, triangles = mirror_mesh(mirror)
    world_from_mirror = world_from_optical @ MIRROR_FROM_OPTICAL.T
    return scenes.mesh_of(
        vertices_m @ world_from_mirror.T * units_per_m,
        triangles,
        {"mesh_bsdf": mi.load_dict(scenes.metal(1.0))},
        normals=mirror.normals(vertices_m) @ world_from_mirror.T,
    )


def mirror_mesh(
    mirror: HyperbolicMirror, rings: int = scenes.RINGS, sectors: int = scenes.SECTORS
) -> tuple[Floats, Ints]:
    """Vertices (n, 3) on Eq. 1 up to the rim, mirror frame, meters, and triangles (m, 3).

    Rings have equal width seen along the axis.
    """
    radius_m = np.linspace(0.0, mirror.rim_radius_m, rings + 1)[:, None]
    azimuth = np.arange(sectors) * (2.0 * math.pi / sectors)
    x, y = radius_m * np.cos(azimuth), radius_m * np.sin(azimuth)
    z = np.broadcast_to(mirror.height_from_radius_m(radius_m), x.shape)
    return np.stack((x, y, z), axis=-1).reshape(-1, 3), scenes.triangles_of_rings(rings, sectors)
