"""Test room in light through a window, by a mirror, and from a lamp behind frosted glass."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.scene.model import Light, Lighting, LightKind, Material, Scene, StartPose

HALF_M = np.array((3.0, 2.5, 1.5))  # half the room's length, width and height
WINDOW_X_M, WINDOW_Z_M = (-2.4, 2.2), (-1.0, 1.2)  # in the wall at the end of y
SKY = (0.55, 0.7, 0.9)
_PANE = Material(
    "pane", (0.85, 0.95, 0.9, 1.0), roughness=0.0, specular=1.0, transmission=1.0, double_sided=True
)
# thick: drawn by its baked light, as by Lambert's law, in both back ends
_FROSTED = Material("frosted", roughness=0.8, transmission=1.0, thickness_m=0.01, double_sided=True)
_CHROME = Material("chrome", (0.9, 0.9, 0.9, 1.0), metallic=1.0, roughness=0.0, double_sided=True)
_GRAY, _RED, _WOOD = (0.7, 0.7, 0.7), (0.7, 0.15, 0.1), (0.55, 0.4, 0.25)
_LAMP_M, _SHADE_M, _SHADE_HALF_M = (-1.4, -1.0, 1.1), 0.8, 0.6


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
        _made_of(_PANE, _upright("window", WINDOW_X_M, WINDOW_Z_M, y)),
        _made_of(_CHROME, _quad("mirror", (x - 0.02, -0.3, 0.0), (0, 1.4, 0), (0, 0, 0.9))),
        _made_of(
            _FROSTED,
            _level("shade", (x_lamp, y_lamp, _SHADE_M), _SHADE_HALF_M),
        ),
        *_box("housing", (x_lamp, y_lamp), _SHADE_HALF_M, (_SHADE_M, z)),
        *_box("crate", (1.2, 1.0), 0.35, (-z, -z + 0.8), _WOOD),
        _level("lid", (1.2, 1.0, -z + 0.8), 0.35, _RED),
    ]
    for part in parts:
        room = room.added(part.name, part)
    toward = np.array((0.25, 0.7, 0.55))
    sun = Light(
        LightKind.DIRECTIONAL, (1.0, 0.9, 0.75), 1.6, direction=-toward / np.linalg.norm(toward)
    )
    lamp = Light(LightKind.POINT, (1.0, 0.8, 0.6), 1.6, position_m=np.array(_LAMP_M))
    return dataclasses.replace(
        room,
        lighting=Lighting(SKY, (sun, lamp), exposure=1.0),
        background=SKY,
        start=StartPose((0.3, -0.4, -0.2)),
    )


def _quad(
    name: str,
    center_m: ArrayLike,
    half_u_m: ArrayLike,
    half_v_m: ArrayLike,
    color: tuple[float, float, float] = _GRAY,
) -> Scene:
    """Rectangle, visible from both sides, by its middle and half of two sides."""
    center, u, v = (np.asarray(one, dtype=np.float64) for one in (center_m, half_u_m, half_v_m))
    corners = [center - u - v, center + u - v, center + u + v, center - u + v]
    return Scene.from_arrays(name, corners, [(0, 1, 2), (0, 2, 3)], base_color=color)


def _level(
    name: str,
    center_m: tuple[float, float, float],
    half_m: float,
    color: tuple[float, float, float] = _GRAY,
) -> Scene:
    """Level square."""
    return _quad(name, center_m, (half_m, 0, 0), (0, half_m, 0), color)


def _upright(name: str, x_m: tuple[float, float], z_m: tuple[float, float], y_m: float) -> Scene:
    """Rectangle across y."""
    (left, right), (low, high) = x_m, z_m
    center = 0.5 * (left + right), y_m, 0.5 * (low + high)
    return _quad(name, center, (0.5 * (right - left), 0, 0), (0, 0, 0.5 * (high - low)))


def _box(
    name: str,
    center_m: tuple[float, float],
    half_m: float,
    z_m: tuple[float, float],
    color: tuple[float, float, float] = _GRAY,
) -> list[Scene]:
    """Four sides of a square box."""
    low, high = z_m
    sides: list[Scene] = []
    for number in range(4):
        angle = 0.5 * np.pi * number
        out = half_m * np.array((np.cos(angle), np.sin(angle), 0.0))
        across: NDArray[np.float64] = np.cross((0, 0, 1), out)
        middle = out + (*center_m, 0.5 * (low + high))
        upward = (0, 0, 0.5 * (high - low))
        sides.append(_quad(f"{name} {number}", middle, across, upward, color))
    return sides


def _made_of(material: Material, part: Scene) -> Scene:
    return dataclasses.replace(part, materials=(material,))
