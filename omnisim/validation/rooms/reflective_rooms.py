"""Test rooms: luminous walls and a mirror, a reflective floor, a ball or a pane."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose
from omnisim.validation.material_chart import sphere

HALF_M = np.array((3.0, 2.5, 1.5))  # half the room's length, width and height
SQUARES = 6  # along a wall
_CHROME = Material("chrome", (1.0, 1.0, 1.0, 1.0), metallic=1.0, roughness=0.0, double_sided=True)
_PANE = Material(
    "pane", (0.7, 0.9, 0.8, 1.0), roughness=0.0, specular=1.0, transmission=1.0, double_sided=True
)
_GLASS = dataclasses.replace(
    _PANE,
    name="glass",
    base_color=(0.95, 0.97, 1.0, 1.0),
    thickness_m=1.4,
    attenuation_color=(0.9, 0.75, 0.6),
    attenuation_distance_m=1.0,
)
_FLOOR = dataclasses.replace(_CHROME, name="floor", base_color=(0.9, 0.85, 0.8, 1.0))


def rooms() -> dict[str, Scene]:
    """Rooms by the name of their reflective surface."""
    return {
        "planar mirror": _room(_CHROME, _panel(1.2, 0.9, (2.0, 0.0, -0.1), 25.0)),
        "floor of roughness 0.1": _room(
            dataclasses.replace(_FLOOR, roughness=0.1), _level(2.9, 2.4, -1.2)
        ),
        "floor of roughness 0.3": _room(
            dataclasses.replace(_FLOOR, roughness=0.3), _level(2.9, 2.4, -1.2)
        ),
        "chrome ball": _room(_CHROME, _ball()),
        "ball of roughness 0.3": _room(dataclasses.replace(_CHROME, roughness=0.3), _ball()),
        "thick glass ball": _room(_GLASS, _ball()),
        "thin pane": _room(_PANE, _panel(1.2, 0.9, (1.0, 0.3, -0.1), 55.0)),
    }


def camera(width_px: int, supersampling: int) -> OmniCamera:
    """Perspective camera with an aspect ratio of 4 : 3."""
    height_px = width_px * 3 // 4
    middle = 0.5 * (width_px - 1), 0.5 * (height_px - 1)
    model = PerspectiveCamera(width_px, height_px, 0.6 * width_px, middle)
    return OmniCamera(model, supersampling=supersampling, near_m=0.01)


def camera_pose() -> NDArray[np.float64]:
    """Pose (4, 4) of the camera's base in the world, near the back wall and looking along x."""
    return pose((-1.5, 0.3, 0.1), pitch_deg=8.0)


def _room(material: Material, mesh: Mesh) -> Scene:
    """Room with colored squares on its walls, a post, and a mesh with the tested material."""
    shining = Material("walls", unlit=True, double_sided=True)
    post = _moved(_box((0.15, 0.15, 0.6), (1.0, 0.5, 0.1)), pose((0.6, -1.1, -0.4)))
    meshes = (_walls(), post, dataclasses.replace(mesh, material=1))
    rest = np.eye(4)
    return Scene(
        name=material.name,
        meshes=meshes,
        materials=(shining, material),
        instances=tuple(Instance(one.name, i, rest, rest) for i, one in enumerate(meshes)),
        lighting=Lighting((0.0, 0.0, 0.0), ()),
        background=(0.0, 0.0, 0.0),
        start=StartPose((0.0, 0.0, 0.0)),
    )


@cache  # every room has them
def _walls() -> Mesh:
    """Walls, floor and ceiling of squares, each with one color by its position."""
    quads, colors = [], []
    edges = np.linspace(-1.0, 1.0, SQUARES + 1)
    for axis in range(3):
        others = [one for one in range(3) if one != axis]
        for side in (-1.0, 1.0):
            for i in range(SQUARES):
                for j in range(SQUARES):
                    corners = np.full((4, 3), side)
                    corners[:, others[0]] = edges[[i, i + 1, i + 1, i]]
                    corners[:, others[1]] = edges[[j, j, j + 1, j + 1]]
                    quads.append(_facing(corners * HALF_M, inward=True))
                    color = 0.45 + 0.3 * corners.mean(axis=0) + (0.15 if (i + j) % 2 else -0.1)
                    colors.append(np.tile(color, (4, 1)))
    return _quads("walls", np.array(quads), np.array(colors))


def _box(half_m: tuple[float, float, float], color: tuple[float, float, float]) -> Mesh:
    quads = []
    for axis in range(3):
        first, second = (one for one in range(3) if one != axis)
        for side in (-1.0, 1.0):
            corners = np.full((4, 3), side)
            corners[:, first], corners[:, second] = (-1, 1, 1, -1), (-1, -1, 1, 1)
            quads.append(_facing(corners * half_m, inward=False))
    shades = np.linspace(0.5, 1.0, 6)[:, None, None] * np.array(color)
    return _quads("post", np.array(quads), np.broadcast_to(shades, (6, 4, 3)))


def _facing(corners_m: NDArray[np.float64], inward: bool) -> NDArray[np.float64]:
    """Corners (4, 3) of a quad, ordered so that its front faces the origin, or away from it."""
    normal = np.cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0])
    is_inward = float(normal @ corners_m.mean(axis=0)) < 0.0
    return corners_m if is_inward == inward else corners_m[::-1]


def _quads(name: str, corners_m: NDArray[np.float64], colors: NDArray[np.float64]) -> Mesh:
    """Mesh of quads with corners (n, 4, 3) in meters and vertex colors (n, 4, 3), linear RGB."""
    first = 4 * np.arange(len(corners_m))[:, None, None]
    triangles = (first + np.array(((0, 1, 2), (0, 2, 3)))).reshape(-1, 3)
    rgba = np.concatenate((colors, np.ones((*colors.shape[:2], 1))), axis=-1)
    return Mesh(
        name,
        corners_m.reshape(-1, 3).astype(np.float32),
        triangles.astype(np.uint32),
        0,
        colors=rgba.reshape(-1, 4).astype(np.float32),
    )


def _panel(
    half_y_m: float, half_z_m: float, center_m: tuple[float, float, float], yaw_deg: float
) -> Mesh:
    """Upright panel perpendicular to x, rotated about z."""
    corners = np.array([(0, -1, -1), (0, 1, -1), (0, 1, 1), (0, -1, 1)]) * (1, half_y_m, half_z_m)
    return _moved(_plain("panel", corners), pose(center_m, yaw_deg=yaw_deg))


def _level(half_x_m: float, half_y_m: float, z_m: float) -> Mesh:
    corners = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]) * (half_x_m, half_y_m, z_m)
    return _plain("floor", corners)


def _plain(name: str, corners_m: NDArray[np.float64]) -> Mesh:
    triangles = np.array(((0, 1, 2), (0, 2, 3)), dtype=np.uint32)
    return Mesh(name, corners_m.astype(np.float32), triangles, 0)


def _ball() -> Mesh:
    return _moved(sphere(0.7, 96), pose((1.2, 0.0, 0.0)))


def _moved(mesh: Mesh, by: NDArray[np.float64]) -> Mesh:
    positions = mesh.positions @ by[:3, :3].T + by[:3, 3]
    normals = None if mesh.normals is None else (mesh.normals @ by[:3, :3].T).astype(np.float32)
    return dataclasses.replace(mesh, positions=positions.astype(np.float32), normals=normals)
