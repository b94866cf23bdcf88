"""Physical mirror in front of a pinhole camera, traced by Mitsuba 3.

Of omnisim's optics only Eq. 1 goes in: the mirror's surface with its normals, and the pinhole in
its other focus. Which way a pixel looks is for Mitsuba to find out, by reflecting its own camera's
rays off a mesh of metal.

Surfaces shine in their base colour and reflect nothing: a colour tells where a ray has gone, and
no shading hides it. They are float32, not filtered and not clamped; a pixel is the average over
its square. Nothing is too near to be seen. Around the rim the camera looks past the mirror at the
scene: compare inside the rim.

Coordinates run along the world's axes from the effective viewpoint, in hundredths of the rim's
radius. Mitsuba begins a reflected ray 9e-5 (1 + coordinate) off the surface: in metres that is
0.1 mm and 0.012 px on a scene 1 m away, in these units 1 µm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import HyperbolicCamera
from omnisim.errors import SceneError
from omnisim.frames import MIRROR_FROM_OPTICAL
from omnisim.mirrors import HyperbolicMirror
from omnisim.poses import check_pose
from omnisim.scene import Scene
from omnisim.scene.model import Texture, Wrap
from omnisim.srgb import linear_from_srgb
from omnisim.validation.oracles.surfaces import Surface, visible_surfaces

# Needs no LLVM: Dr.Jit 1.5 on Debian 12's LLVM 15 aborts the whole process.
VARIANT = "scalar_rgb"
MIRROR_RINGS, MIRROR_SECTORS = 256, 1024
RIM_UNITS = 100.0
_VERTEX_COLOR = "vertex_color"


def trace_mirror(
    scene: Scene,
    camera: HyperbolicCamera,
    world_from_optical: ArrayLike,
    samples: int,
    seed: int = 0,
) -> NDArray[np.float32]:
    """Trace the picture (height, width, 3), linear RGB, that a camera takes of a mirror.

    The mirror has flat facets with interpolated normals. For the paper's at 512 × 512 they move a
    ray by 0.0005 px on average and 0.0012 px at most; Mitsuba's rays as traced, in float32, to a
    scene 1 m away, are off by 0.0006 and 0.0014 px (`tests/validation/oracles`). A few in 100 000
    slip through between two facets.

    Args:
        scene: opaque surfaces, see `opaque_only`.
        camera: mirror and pinhole camera.
        world_from_optical: (4, 4) pose of the optical frame.
        samples: rays a pixel; a square, or Mitsuba warns that it rounds up to what it can stratify.
        seed: same seed, same picture.

    Raises:
        OmnisimError: a matrix that is not a pose.
        SceneError: a material that is not opaque, or that Mitsuba cannot show.
    """
    pose = check_pose(world_from_optical)
    mirror = camera.mirror
    reach_m = float(mirror.rho_m(mirror.theta_max_rad))  # its farthest points are the rim's
    surfaces = visible_surfaces(scene, pose[:3, 3], reach_m)
    units_per_m = RIM_UNITS / mirror.rim_radius_m
    with _variant():
        content = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},  # one reflection
            "sensor": pinhole(camera, pose[:3, :3], units_per_m, samples),
            "mirror": mirror_of_metal(mirror, pose[:3, :3], units_per_m),
            "sky": {"type": "constant", "radiance": _rgb(scene.background)},
        }
        for number, surface in enumerate(surfaces):
            content[f"surface {number}"] = _shining(surface, units_per_m)
        picture = mi.render(mi.load_dict(content), spp=samples, seed=mi.UInt32(seed))
        return np.array(picture, dtype=np.float32)[..., :3]


def pinhole(
    camera: HyperbolicCamera,
    world_from_optical: NDArray[np.float64],
    units_per_m: float,
    samples: int,
) -> dict[str, Any]:
    """Mitsuba's perspective camera in the mirror's other focus, for `mitsuba.load_dict`.

    It is placed with `look_at`, which can turn a camera but not mirror it: its up is the top of
    our picture, −y of the optical frame, and right and left are as anybody who looks along it has
    them.

    Args:
        world_from_optical: (3, 3) rotation.
    """
    to_world = mi.ScalarTransform4f().look_at(
        origin=list(-camera.mirror.c_m * units_per_m * world_from_optical[:, 2]),
        target=[0.0, 0.0, 0.0],
        up=list(-world_from_optical[:, 1]),
    )
    u, v = camera.principal_point_px
    return {
        "type": "perspective",
        "to_world": to_world,
        "fov_axis": "x",
        "fov": math.degrees(2.0 * math.atan(0.5 * camera.width_px / camera.focal_length_px)),
        # from the principal point to the middle of the picture, in widths and heights
        "principal_point_offset_x": 0.5 - (u + 0.5) / camera.width_px,
        "principal_point_offset_y": 0.5 - (v + 0.5) / camera.height_px,
        "near_clip": 0.1 * camera.mirror.c_m * units_per_m,
        "far_clip": 1e3 * camera.mirror.c_m * units_per_m,  # of what is seen past the mirror
        "film": {
            "type": "hdrfilm",
            "width": camera.width_px,
            "height": camera.height_px,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "multijitter", "sample_count": samples},
    }


def mirror_of_metal(
    mirror: HyperbolicMirror, world_from_optical: NDArray[np.float64], units_per_m: float
) -> mi.Mesh:
    """The mirror as a mesh that reflects all light.

    Args:
        world_from_optical: (3, 3) rotation.
    """
    vertices_m, triangles = mirror_mesh(mirror)
    world_from_mirror = world_from_optical @ MIRROR_FROM_OPTICAL.T
    return _mesh(
        vertices_m @ world_from_mirror.T * units_per_m,
        triangles,
        {"mesh_bsdf": mi.load_dict(_metal(1.0))},
        normals=mirror.normals(vertices_m) @ world_from_mirror.T,
    )


def mirror_mesh(
    mirror: HyperbolicMirror, rings: int = MIRROR_RINGS, sectors: int = MIRROR_SECTORS
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) on Eq. 1 up to the rim, mirror frame, metres, and triangles (m, 3).

    Rings are equally wide seen along the axis.
    """
    radius_m = np.linspace(0.0, mirror.rim_radius_m, rings + 1)[:, None]
    azimuth = np.arange(sectors) * (2.0 * math.pi / sectors)
    x, y = radius_m * np.cos(azimuth), radius_m * np.sin(azimuth)
    z = np.broadcast_to(mirror.height_from_radius_m(radius_m), x.shape)
    sector = np.arange(sectors)
    following = (sector + 1) % sectors
    inner = sectors * np.arange(rings)[:, None]
    outer = inner + sectors
    lower = np.stack((inner + sector, outer + sector, outer + following), axis=-1)
    upper = np.stack((inner + sector, outer + following, inner + following), axis=-1)
    upper = upper[1:]  # at the axis all azimuths are one point
    triangles = np.concatenate((lower.reshape(-1, 3), upper.reshape(-1, 3)))
    return np.stack((x, y, z), axis=-1).reshape(-1, 3), triangles


def _shining(surface: Surface, units_per_m: float) -> mi.Mesh:
    material, texture = surface.material, surface.material.texture
    coordinates = colors = None
    if surface.texture_coordinates is not None and texture is not None:
        if surface.colors is not None:
            raise SceneError(
                f"material {material.name!r}: Mitsuba has no texture times vertex colours"
            )
        if texture.wrap_u is not texture.wrap_v:
            raise SceneError(
                f"material {material.name!r}: Mitsuba wraps u and v of a texture alike"
            )
        coordinates = surface.texture_coordinates.reshape(-1, 2)
        radiance = _bitmap(texture, material.base_color[:3])
    elif surface.colors is not None:
        factor = np.array(material.base_color[:3], dtype=np.float32)
        colors = surface.colors.reshape(-1, 3) * factor
        radiance = {"type": "mesh_attribute", "name": _VERTEX_COLOR}
    else:
        radiance = _rgb(material.base_color[:3])
    corners = surface.triangles_m.reshape(-1, 3) * units_per_m
    return _mesh(
        corners,
        np.arange(len(corners)).reshape(-1, 3),
        {
            "mesh_bsdf": mi.load_dict(_metal(0.0)),
            "mesh_emitter": mi.load_dict({"type": "area", "radiance": radiance}),
            "face_normals": True,
        },
        coordinates=coordinates,
        colors=colors,
    )


def _bitmap(texture: Texture, factor: tuple[float, ...]) -> dict[str, Any]:
    pixels = linear_from_srgb(texture.pixels[..., :3] / 255.0) * factor
    return {
        "type": "bitmap",
        "data": mi.TensorXf(pixels.astype(np.float32)),
        "raw": True,  # linear already
        "format": "variant",  # float32, not half floats
        "wrap_mode": "clamp" if texture.wrap_u is Wrap.CLAMP_TO_EDGE else "repeat",
    }


def _metal(reflectance: float) -> dict[str, Any]:
    """Smooth metal. With 0 it is the black of all surfaces: on anything rough Mitsuba 3.9 looks for
    light, and crashes on emitters with vertex colours (`scalar_rgb`).
    """
    return {
        "type": "conductor",
        "material": "none",
        "specular_reflectance": _rgb((reflectance,) * 3),
    }


def _rgb(color: tuple[float, ...]) -> dict[str, Any]:
    return {"type": "rgb", "value": list(color)}


def _mesh(
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int64],
    properties: dict[str, Any],
    normals: NDArray[np.float64] | None = None,
    coordinates: NDArray[np.float32] | None = None,
    colors: NDArray[np.float32] | None = None,
) -> mi.Mesh:
    held = mi.Properties()
    for key, value in properties.items():
        held[key] = value
    mesh = mi.Mesh(
        "mesh", len(vertices), len(triangles), held, normals is not None, coordinates is not None
    )
    if colors is not None:
        mesh.add_attribute(_VERTEX_COLOR, 3, colors.ravel().tolist())
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"] = vertices.astype(np.float32).ravel()
    buffers["faces"] = triangles.astype(np.uint32).ravel()
    if normals is not None:
        buffers["vertex_normals"] = normals.astype(np.float32).ravel()
    if coordinates is not None:
        buffers["vertex_texcoords"] = coordinates.astype(np.float32).ravel()
    buffers.update()
    return mesh


@contextmanager
def _variant() -> Iterator[None]:
    """Choose Mitsuba's variant, which is global, and put back what was chosen before."""
    before = mi.variant()
    mi.set_variant(VARIANT)
    try:
        yield
    finally:
        if before is not None:
            mi.set_variant(before)
