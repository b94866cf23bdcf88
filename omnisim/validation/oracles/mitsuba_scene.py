"""Surfaces and images for Mitsuba 3, in any unit.

Surfaces emit their base color and reflect nothing: a color shows where a ray has gone, without
shading. Images are float32, not filtered and not clamped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mitsuba as mi
import numpy as np

from omnisim.cameras import HyperbolicCamera, PerspectiveCamera
from omnisim.core.arrays import Floats, Floats32, Ints
from omnisim.core.errors import SceneError
from omnisim.core.srgb import linear_from_srgb
from omnisim.scene.model import Texture, Wrap
from omnisim.validation.oracles.surfaces import OracleSurface

# Works without LLVM: Dr.Jit 1.5 with Debian 12's LLVM 15 aborts the process.
VARIANT = "scalar_rgb"
RINGS, SECTORS = 256, 1024  # of a mirror's mesh
VERTEX_COLOR = "vertex_color"


def pinhole(
    camera: PerspectiveCamera | HyperbolicCamera,
    units_from_camera: Floats,
    near: float,
    samples: int,
) -> dict[str, Any]:
    """Perspective camera, for `mitsuba.load_dict`, with the focal length and size of a model.

    It is placed with `look_at`, which can rotate a camera but not mirror it: its up is the top of
    our image, −y of the optical frame, with right and left as seen along the viewing direction.

    Args:
        camera: model with focal length, principal point and size.
        units_from_camera: (3, 4) or (4, 4); columns: right, down and forward of the image, and the
            pinhole.
        near: distance of the near plane, in units.
        samples: samples per pixel.
    """
    origin = units_from_camera[:3, 3]
    (u, v), width, height = camera.principal_point_px, camera.width_px, camera.height_px
    return {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=origin.tolist(),
            target=(origin + units_from_camera[:3, 2]).tolist(),
            up=(-units_from_camera[:3, 1]).tolist(),
        ),
        "fov_axis": "x",
        "fov": math.degrees(2.0 * math.atan(0.5 * width / camera.focal_length_px)),
        # from the principal point to the middle of the image, in widths and heights
        "principal_point_offset_x": 0.5 - (u + 0.5) / width,
        "principal_point_offset_y": 0.5 - (v + 0.5) / height,
        "near_clip": near,
        "film": {  # averages over the squares of pixels
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "multijitter", "sample_count": samples},
    }


def cropped(sensor: dict[str, Any], left: int, top: int, width: int, height: int) -> dict[str, Any]:
    """Part of a perspective camera's image."""
    crop = {"crop_offset_x": left, "crop_offset_y": top, "crop_width": width, "crop_height": height}
    return sensor | {"film": sensor["film"] | crop}


def rendered(
    content: dict[str, Any] | mi.Scene, samples: int, seed: int, sensor: Any = None
) -> Floats32:
    """Image (height, width, 3), linear RGB, of a scene or its dictionary; equal seeds are equal."""
    scene = mi.load_dict(content) if isinstance(content, dict) else content
    options = {} if sensor is None else {"sensor": mi.load_dict(sensor)}
    image = mi.render(scene, spp=samples, seed=mi.UInt32(seed), **options)
    return np.array(image, dtype=np.float32)[..., :3]


def triangles_of_rings(rings: int, sectors: int, has_hole: bool = False) -> Ints:
    """Triangles (m, 3) between `rings` + 1 rings of vertices.

    Args:
        rings: number of rings of triangles.
        has_hole: False: the first ring of vertices is a single point.
    """
    sector = np.arange(sectors)
    following = (sector + 1) % sectors
    inner = sectors * np.arange(rings)[:, None]
    outer = inner + sectors
    lower = np.stack((inner + sector, outer + sector, outer + following), axis=-1)
    upper = np.stack((inner + sector, outer + following, inner + following), axis=-1)
    return np.concatenate((lower.reshape(-1, 3), upper[0 if has_hole else 1 :].reshape(-1, 3)))


def shining(surface: OracleSurface, units_per_m: float) -> mi.Mesh:
    """Emitter with a surface's base color.

    Raises:
        SceneError: a material that Mitsuba does not support.
    """
    material, texture = surface.material, surface.material.texture
    coordinates = colors = None
    if surface.texture_coordinates is not None and texture is not None:
        place = f"material {material.name!r}: Mitsuba"
        if surface.colors is not None:
            raise SceneError(f"{place} has no texture times vertex colors")
        if texture.wrap_u is not texture.wrap_v:
            raise SceneError(f"{place} wraps u and v of a texture alike")
        coordinates = surface.texture_coordinates.reshape(-1, 2)
        radiance = bitmap(texture, material.base_color)
    elif surface.colors is not None:
        factor = np.array(material.base_color[:3], dtype=np.float32)
        colors = surface.colors.reshape(-1, 3) * factor
        radiance = {"type": "mesh_attribute", "name": VERTEX_COLOR}
    else:
        radiance = rgb(material.base_color[:3])
    corners = surface.triangles_m.reshape(-1, 3) * units_per_m
    faces = np.arange(len(corners)).reshape(-1, 3)
    return mesh_of(corners, faces, emitter(radiance), coordinates=coordinates, colors=colors)


def emitter(radiance: dict[str, Any]) -> dict[str, Any]:
    """Properties of a mesh of flat facets that emits light and reflects none."""
    return {
        "mesh_bsdf": mi.load_dict(metal(0.0)),
        "mesh_emitter": mi.load_dict({"type": "area", "radiance": radiance}),
        "face_normals": True,
    }


def bitmap(texture: Texture, factor: tuple[float, ...]) -> dict[str, Any]:
    """Texture times a linear color, without alpha."""
    pixels = linear_from_srgb(texture.pixels[..., :3] / 255.0) * factor[:3]
    return {
        "type": "bitmap",
        "data": mi.TensorXf(pixels.astype(np.float32)),
        "raw": True,  # already linear
        "format": "variant",  # float32, not half floats
        "wrap_mode": "clamp" if texture.wrap_u is Wrap.CLAMP_TO_EDGE else "repeat",
    }


def metal(reflectance: float) -> dict[str, Any]:
    """Smooth metal; with reflectance 0, a black that reflects nothing.

    On rough surfaces Mitsuba 3.9 samples light, and crashes on emitters with vertex colors
    (`scalar_rgb`).
    """
    color = rgb((reflectance,) * 3)
    return {"type": "conductor", "material": "none", "specular_reflectance": color}


def rgb(color: tuple[float, ...]) -> dict[str, Any]:
    """Linear RGB color, for `mitsuba.load_dict`."""
    return {"type": "rgb", "value": list(color)}


def mesh_of(
    vertices: Floats,
    triangles: Ints,
    properties: dict[str, Any],
    normals: Floats | None = None,
    coordinates: Floats32 | None = None,
    colors: Floats32 | None = None,
) -> mi.Mesh:
    """Triangle mesh of vertices (n, 3), in units, with Mitsuba's properties."""
    held = mi.Properties()
    for key, value in properties.items():
        held[key] = value
    mesh = mi.Mesh(
        "mesh", len(vertices), len(triangles), held, normals is not None, coordinates is not None
    )
    if colors is not None:
        mesh.add_attribute(VERTEX_COLOR, 3, colors.ravel().tolist())
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
def scalar_variant() -> Iterator[None]:
    """Set Mitsuba's global variant, and restore the previous one."""
    before = mi.variant()
    mi.set_variant(VARIANT)
    try:
        yield
    finally:
        if before is not None:
            mi.set_variant(before)
