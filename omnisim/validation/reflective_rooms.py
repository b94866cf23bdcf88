"""Test rooms: reflective surfaces amid luminous walls, and a window with a frosted lamp."""

from __future__ import annotations

import dataclasses
import itertools
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from omnisim.cameras import PerspectiveCamera
from omnisim.core.arrays import Floats
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.scene.model import Light, Lighting, LightKind, Material, Mesh, Scene, StartPose
from omnisim.validation.material_chart import sphere
from omnisim.validation.plain_scenes import quads, scene_at_rest

HALF_M = np.array((3.0, 2.5, 1.5))  # half the room's length, width and height
SQUARES = 6  # along a wall
_CHROME = Material("chrome", (1.0, 1.0, 1.0, 1.0), metallic=1.0, roughness=0.0, double_sided=True)
_PANE = Material(
    "pane", (0.7, 0.9, 0.8, 1.0), roughness=0.0, specular=1.0, transmission=1.0, double_sided=True
)
_GLASS = dataclasses.replace(
    _PANE, name="glass", base_color=(0.95, 0.97, 1.0, 1.0), thickness_m=1.4,
    attenuation_color=(0.9, 0.75, 0.6), attenuation_distance_m=1.0,
)  # fmt: skip
_FLOOR = dataclasses.replace(_CHROME, name="floor", base_color=(0.9, 0.85, 0.8, 1.0))
WINDOW_X_M, WINDOW_Z_M = (-2.4, 2.2), (-1.0, 1.2)  # in the wall at the end of y
SKY = (0.55, 0.7, 0.9)
_WINDOW_PANE = dataclasses.replace(_PANE, base_color=(0.85, 0.95, 0.9, 1.0))
# thick: drawn by its baked light, as by Lambert's law, in both back ends
_FROSTED = Material("frosted", roughness=0.8, transmission=1.0, thickness_m=0.01, double_sided=True)
_WALL_MIRROR = dataclasses.replace(_CHROME, base_color=(0.9, 0.9, 0.9, 1.0))
Color = tuple[float, float, float]  # linear RGB
Span = tuple[float, float]
_GRAY, _RED, _WOOD = (0.7, 0.7, 0.7), (0.7, 0.15, 0.1), (0.55, 0.4, 0.25)
_LAMP_M, _SHADE_M, _SHADE_HALF_M = (-1.4, -1.0, 1.1), 0.8, 0.6


def rooms() -> dict[str, Scene]:
    """Rooms by the name of their reflective surface."""

    def floor(roughness: float) -> Scene:
        corners = np.array([(-2.9, -2.4), (2.9, -2.4), (2.9, 2.4), (-2.9, 2.4)])
        level = np.column_stack((corners, np.full(4, -1.2)))
        return _room(dataclasses.replace(_FLOOR, roughness=roughness), quads("floor", [level]))

    ball = _moved(sphere(0.7, 96), pose((1.2, 0.0, 0.0)))
    return {
        "planar mirror": _room(_CHROME, _panel((2.0, 0.0, -0.1), 25.0)),
        "floor of roughness 0.1": floor(0.1),
        "floor of roughness 0.3": floor(0.3),
        "chrome ball": _room(_CHROME, ball),
        "ball of roughness 0.3": _room(dataclasses.replace(_CHROME, roughness=0.3), ball),
        "thick glass ball": _room(_GLASS, ball),
        "thin pane": _room(_PANE, _panel((1.0, 0.3, -0.1), 55.0)),
    }


def camera(width_px: int, supersampling: int) -> OmniCamera:
    """Perspective camera with an aspect ratio of 4 : 3."""
    height_px = width_px * 3 // 4
    middle = 0.5 * (width_px - 1), 0.5 * (height_px - 1)
    model = PerspectiveCamera(width_px, height_px, 0.6 * width_px, middle)
    return OmniCamera(model, supersampling=supersampling, near_m=0.01)


def camera_pose() -> Floats:
    """Pose (4, 4) of the camera's base in the world, near the back wall and looking along x."""
    return pose((-1.5, 0.3, 0.1), pitch_deg=8.0)


def _room(material: Material, mesh: Mesh) -> Scene:
    """Room with colored squares on its walls, a post, and a mesh with the tested material."""
    shining = Material("walls", unlit=True, double_sided=True)
    post = _moved(_box((0.15, 0.15, 0.6), (1.0, 0.5, 0.1)), pose((0.6, -1.1, -0.4)))
    meshes = (_walls(), post, dataclasses.replace(mesh, material=1))
    return scene_at_rest(material.name, meshes, (shining, material), ambient=(0.0, 0.0, 0.0))


@cache  # every room has them
def _walls() -> Mesh:
    """Walls, floor and ceiling of squares, each with one color by its position."""
    squares, colors = [], []
    edges = np.linspace(-1.0, 1.0, SQUARES + 1)
    for axis, side in itertools.product(range(3), (-1.0, 1.0)):
        first, second = (other for other in range(3) if other != axis)
        for i, j in itertools.product(range(SQUARES), repeat=2):
            corners = np.full((4, 3), side)
            corners[:, first] = edges[[i, i + 1, i + 1, i]]
            corners[:, second] = edges[[j, j, j + 1, j + 1]]
            squares.append(_facing(corners * HALF_M, inward=True))
            color = 0.45 + 0.3 * corners.mean(axis=0) + (0.15 if (i + j) % 2 else -0.1)
            colors.append(np.tile(color, (4, 1)))
    return quads("walls", squares, colors=np.array(colors))


def _box(half_m: tuple[float, float, float], color: tuple[float, float, float]) -> Mesh:
    sides = []
    for axis, side in itertools.product(range(3), (-1.0, 1.0)):
        first, second = (other for other in range(3) if other != axis)
        corners = np.full((4, 3), side)
        corners[:, first], corners[:, second] = (-1, 1, 1, -1), (-1, -1, 1, 1)
        sides.append(_facing(corners * half_m, inward=False))
    shades = np.linspace(0.5, 1.0, 6)[:, None, None] * np.array(color)
    return quads("post", sides, colors=np.broadcast_to(shades, (6, 4, 3)))


def _facing(corners_m: Floats, inward: bool) -> Floats:
    """Corners (4, 3) of a quad, ordered so that its front faces the origin, or away from it."""
    normal = np.cross(corners_m[1] - corners_m[0], corners_m[2] - corners_m[0])
    is_inward = float(normal @ corners_m.mean(axis=0)) < 0.0
    return corners_m if is_inward == inward else corners_m[::-1]


def _panel(center_m: tuple[float, float, float], yaw_deg: float) -> Mesh:
    """Upright panel of 2.4 m × 1.8 m, perpendicular to x and then rotated about z."""
    corners = np.array([(0, -1, -1), (0, 1, -1), (0, 1, 1), (0, -1, 1)]) * (1, 1.2, 0.9)
    return _moved(quads("panel", [corners]), pose(center_m, yaw_deg=yaw_deg))


def _moved(mesh: Mesh, by: Floats) -> Mesh:
    positions = mesh.positions @ by[:3, :3].T + by[:3, 3]
    normals = None if mesh.normals is None else (mesh.normals @ by[:3, :3].T).astype(np.float32)
    return dataclasses.replace(mesh, positions=positions.astype(np.float32), normals=normals)


def window_room() -> Scene:
    """Room whose window lets in sun and sky, with a wall mirror and a lamp in a frosted box."""
    x, y, z = HALF_M
    (left, right), (low, high) = WINDOW_X_M, WINDOW_Z_M
    x_lamp, y_lamp, _ = _LAMP_M
    room = _quad("floor", (0, 0, -z), (x, 0, 0), (0, y, 0), _WOOD)
    parts = [
        _quad("ceiling", (0, 0, z), (x, 0, 0), (0, y, 0), _GRAY),
        _quad("red wall", (-x, 0, 0), (0, y, 0), (0, 0, z), _RED),
        _quad("far wall", (x, 0, 0), (0, y, 0), (0, 0, z), _GRAY),
        _quad("back wall", (0, -y, 0), (x, 0, 0), (0, 0, z), _GRAY),
        _upright("below", (-x, x), (-z, low), y),
        _upright("above", (-x, x), (high, z), y),
        _upright("left", (-x, left), (low, high), y),
        _upright("right", (right, x), (low, high), y),
        _made_of(_WINDOW_PANE, _upright("window", WINDOW_X_M, WINDOW_Z_M, y)),
        _made_of(_WALL_MIRROR, _quad("mirror", (x - 0.02, -0.3, 0.0), (0, 1.4, 0), (0, 0, 0.9))),
        _made_of(_FROSTED, _level("shade", (x_lamp, y_lamp, _SHADE_M), _SHADE_HALF_M)),
        *_sides("housing", (x_lamp, y_lamp), _SHADE_HALF_M, (_SHADE_M, z)),
        *_sides("crate", (1.2, 1.0), 0.35, (-z, -z + 0.8), _WOOD),
        _level("lid", (1.2, 1.0, -z + 0.8), 0.35, _RED),
    ]
    for part in parts:
        room = room.added(part.name, part)
    toward = np.array((0.25, 0.7, 0.55))
    down = -toward / np.linalg.norm(toward)
    sun = Light(LightKind.DIRECTIONAL, (1.0, 0.9, 0.75), 1.6, direction=down)
    lamp = Light(LightKind.POINT, (1.0, 0.8, 0.6), 1.6, position_m=np.array(_LAMP_M))
    return dataclasses.replace(
        room,
        lighting=Lighting(SKY, (sun, lamp), exposure=1.0),
        background=SKY,
        start=StartPose((0.3, -0.4, -0.2)),
    )


def _quad(
    name: str, center_m: ArrayLike, half_u_m: ArrayLike, half_v_m: ArrayLike, color: Color = _GRAY
) -> Scene:
    """Rectangle, visible from both sides, by its middle and half of two sides."""
    center, u, v = (np.asarray(x, dtype=np.float64) for x in (center_m, half_u_m, half_v_m))
    corners = [center - u - v, center + u - v, center + u + v, center - u + v]
    return Scene.from_arrays(name, corners, [(0, 1, 2), (0, 2, 3)], base_color=color)


def _level(name: str, center_m: ArrayLike, half_m: float, color: Color = _GRAY) -> Scene:
    return _quad(name, center_m, (half_m, 0, 0), (0, half_m, 0), color)


def _upright(name: str, x_m: Span, z_m: Span, y_m: float) -> Scene:
    (left, right), (low, high) = x_m, z_m
    center = 0.5 * (left + right), y_m, 0.5 * (low + high)
    return _quad(name, center, (0.5 * (right - left), 0, 0), (0, 0, 0.5 * (high - low)))


def _sides(
    name: str, center_m: tuple[float, float], half_m: float, z_m: Span, color: Color = _GRAY
) -> list[Scene]:
    low, high = z_m
    sides: list[Scene] = []
    for number in range(4):
        angle = 0.5 * np.pi * number
        out = half_m * np.array((np.cos(angle), np.sin(angle), 0.0))
        across: Floats = np.cross((0, 0, 1), out)
        middle = out + (*center_m, 0.5 * (low + high))
        upward = (0, 0, 0.5 * (high - low))
        sides.append(_quad(f"{name} {number}", middle, across, upward, color))
    return sides


def _made_of(material: Material, part: Scene) -> Scene:
    return dataclasses.replace(part, materials=(material,))
