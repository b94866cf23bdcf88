"""Scenes lit by lamps, seen through a fisheye lens, by Mitsuba 3, which has no such lens.

Mitsuba traces the faces of a cube around the viewpoint, finer than the image; each pixel is the
average of the texels that rays through the pixel's square hit. Only the parameters of omnisim's
lens are used; the rays are those of r = f θ, Kannala and Brandt (2006, Eq. 3).
"""

from __future__ import annotations

import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import EquidistantCamera
from omnisim.core.poses import check_pose
from omnisim.scene import Scene
from omnisim.validation.oracles.mitsuba_light import DIRECT_DEPTH, lit_world
from omnisim.validation.oracles.mitsuba_scene import film, scalar_variant

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


def trace_lit_fisheye(
    scene: Scene,
    camera: EquidistantCamera,
    world_from_optical: ArrayLike,
    samples: int,
    seed: int = 0,
    depth: int = DIRECT_DEPTH,
) -> NDArray[np.float32]:
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
    faces, texels = _texels(_rays(camera), size_px)
    samples_rgb = np.zeros((*faces.shape, 3), dtype=np.float32)
    with scalar_variant():
        loaded = mi.load_dict(lit_world(scene, pose[:3, 3], UNITS_PER_M, depth))
        for number in np.unique(faces).tolist():
            on_face = faces == number
            low, high = texels[on_face].min(axis=0), texels[on_face].max(axis=0) + 1
            sensor = mi.load_dict(
                _face(_FACES[number] @ pose[:3, :3].T, size_px, low, high - low, samples)
            )
            image = mi.render(loaded, sensor=sensor, spp=samples, seed=mi.UInt32(seed + number))
            column, row = (texels[on_face] - low).T
            samples_rgb[on_face] = np.array(image, dtype=np.float32)[row, column, :3]
    height, width, side = camera.height_px, camera.width_px, 2 * TEXELS
    return samples_rgb.reshape(height, side, width, side, 3).mean(axis=(1, 3))


def _rays(camera: EquidistantCamera) -> NDArray[np.float64]:
    """Rays (rows, columns, 3) evenly spaced over the pixels, 2 × `TEXELS` per pixel's side."""
    side = 2 * TEXELS
    u, v = (
        (np.arange(count * side) + 0.5) / side - 0.5
        for count in (camera.width_px, camera.height_px)
    )
    x, y = np.meshgrid(u - camera.principal_point_px[0], v - camera.principal_point_px[1])
    angle = np.minimum(np.hypot(x, y) / camera.focal_length_px, camera.theta_max_rad)
    azimuth = np.arctan2(y, x)
    across = np.sin(angle)
    return np.stack((across * np.cos(azimuth), across * np.sin(azimuth), np.cos(angle)), axis=-1)


def _texels(rays: NDArray[np.float64], size_px: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Faces (...,) hit by rays (..., 3), and columns and rows (..., 2) of the hits."""
    faces = np.argmax(rays @ _FACES[:, 2].T, axis=-1)
    local = np.einsum("...ij,...j->...i", _FACES[faces], rays)
    tangents = local[..., :2] / local[..., 2:]
    places = np.floor(0.5 * (tangents + 1.0) * size_px).astype(np.intp)
    return faces, np.clip(places, 0, size_px - 1)


def _face(
    axes: NDArray[np.float64],
    size_px: int,
    corner_px: NDArray[np.intp],
    crop_px: NDArray[np.intp],
    samples: int,
) -> dict[str, Any]:
    """Perspective camera of a part of a face; `axes` has rows right, down and forward."""
    (left, top), (width, height) = corner_px.tolist(), crop_px.tolist()
    crop = {
        "crop_offset_x": left, "crop_offset_y": top, "crop_width": width, "crop_height": height
    }  # fmt: skip
    return {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=[0.0, 0.0, 0.0], target=axes[2].tolist(), up=(-axes[1]).tolist()
        ),
        "fov_axis": "x",
        "fov": 90.0,
        "near_clip": 1e-3 * UNITS_PER_M,
        "far_clip": 1e5 * UNITS_PER_M,
        "film": film(size_px, size_px) | crop,
        "sampler": {"type": "multijitter", "sample_count": samples},
    }
