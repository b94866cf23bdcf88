"""Chart of materials: a grid of spheres, rough in rows and metallic in columns, for a pinhole."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from omnisim.cameras import CentralCamera, PerspectiveCamera, pixel_grid
from omnisim.core.arrays import Floats, Ints
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose

ROUGHNESS = 0.1, 0.25, 0.4, 0.6, 0.8, 1.0  # from top to bottom
METALLIC = 0.0, 0.5, 1.0  # from left to right
BASE_COLOR = 0.8, 0.3, 0.1
RADIUS_M, DISTANCE_M = 0.4, 6.0
SPHERE_PX = 66  # diameter in the image
CLEAR = 0.93  # of a sphere's radius: pixels inside show only the sphere


def sphere(radius_m: float, rows: int = 64) -> Mesh:
    """Mesh of a sphere with poles on z, normals and texture coordinates, in rows of triangles."""
    polar = np.pi * np.arange(rows + 1) / rows
    azimuth = np.pi * np.arange(2 * rows + 1) / rows
    along = (np.sin(polar)[:, None] * f(azimuth) for f in (np.cos, np.sin))
    height = np.broadcast_to(np.cos(polar)[:, None], (rows + 1, 2 * rows + 1))
    normals = np.stack((*along, height), axis=-1).reshape(-1, 3)
    across = np.tile(azimuth / (2.0 * np.pi), rows + 1)
    down = np.repeat(polar / np.pi, 2 * rows + 1)
    width = 2 * rows + 1
    first = (width * np.arange(rows)[:, None] + np.arange(2 * rows)).ravel()
    corners = (0, width, width + 1), (0, width + 1, 1)
    triangles = np.concatenate([first[:, None] + corner for corner in corners])
    return Mesh(
        "sphere",
        (radius_m * normals).astype(np.float32),
        triangles.astype(np.uint32),
        0,
        normals=normals.astype(np.float32),
        texture_coordinates=np.stack((across, down), axis=-1).astype(np.float32),
    )


def centers_m() -> Floats:
    """Centers (18, 3) of the spheres in the world frame, row by row; the camera looks along x."""
    rows, columns = len(ROUGHNESS), len(METALLIC)
    return np.array(
        [
            (DISTANCE_M, 0.5 * (columns - 1) - column, 0.5 * (rows - 1) - row)
            for row, column in itertools.product(range(rows), range(columns))
        ]
    )


def sphere_of_pixels(model: CentralCamera) -> Ints:
    """Index (height, width) of the sphere in each pixel; −1: none, or too close to its outline.

    Args:
        model: model of a camera like `camera()`, at the origin, with its axis along the world's x.
    """
    rays = model.ray_from_pixel(pixel_grid(model.width_px, model.height_px)).directions
    # right, down and forward of the camera are the world's −y, −z and x
    directions = np.stack((rays[..., 2], -rays[..., 0], -rays[..., 1]), axis=-1)
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    away_m = np.stack(
        [np.linalg.norm(np.cross(center_m, directions), axis=-1) for center_m in centers_m()]
    )
    nearest: Ints = away_m.argmin(axis=0).astype(np.int64)
    nearest[away_m.min(axis=0) > CLEAR * RADIUS_M] = -1
    return nearest


def chart(lighting: Lighting) -> Scene:
    """Scene of the chart in the given lighting."""
    materials, meshes, instances = [], [], []
    shape, color = sphere(RADIUS_M), (*BASE_COLOR, 1.0)
    pairs = itertools.product(ROUGHNESS, METALLIC)
    for number, ((roughness, metallic), center_m) in enumerate(
        zip(pairs, centers_m(), strict=True)
    ):
        name = f"roughness {roughness:g}, metallic {metallic:g}"
        materials.append(
            Material(name, color, metallic=metallic, roughness=roughness, specular=1.0)
        )
        name = f"sphere {number}"
        meshes.append(replace(shape, name=name, material=number))
        world_from_mesh = pose(tuple(center_m.tolist()))
        instances.append(Instance(name, number, world_from_mesh, world_from_mesh))
    black = (0.0, 0.0, 0.0)
    parts = tuple(meshes), tuple(materials), tuple(instances)
    return Scene("material chart", *parts, lighting, black, StartPose(black))


def camera() -> OmniCamera:
    """Pinhole camera that sees the whole chart from the world's origin."""
    focal_px = SPHERE_PX * DISTANCE_M / (2.0 * RADIUS_M)
    width, height = (int((n + 0.2) * focal_px / DISTANCE_M) for n in (3, 6))
    middle = 0.5 * (width - 1), 0.5 * (height - 1)
    return OmniCamera(PerspectiveCamera(width, height, focal_px, middle), supersampling=4)
