"""Scenes of a few plain shapes at exactly known positions, on black."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose

WHITE = (1.0, 1.0, 1.0, 1.0)
BLACK = (0.0, 0.0, 0.0, 1.0)


def plain_scene(name: str, *colored: tuple[Mesh, tuple[float, float, float, float]]) -> Scene:
    """Scene of meshes in the world frame, each in one linear RGBA color, on black."""
    return Scene(
        name=name,
        meshes=tuple(mesh for mesh, _ in colored),
        materials=tuple(
            Material(base_color=color, double_sided=True, unlit=True) for _, color in colored
        ),
        instances=tuple(
            Instance(mesh.name, index, np.eye(4)) for index, (mesh, _) in enumerate(colored)
        ),
        lighting=Lighting((1.0, 1.0, 1.0), ()),
        background=(0.0, 0.0, 0.0),
        start=StartPose((0.0, 0.0, 0.0)),
    )


def discs(
    name: str,
    middles_m: NDArray[np.float64],
    viewpoint_m: ArrayLike,
    angular_radius_rad: float,
    material: int = 0,
    corners: int = 24,
) -> Mesh:
    """Mesh of discs at points (n, 3), world frame, of equal angular size, facing the viewpoint."""
    toward = middles_m - np.asarray(viewpoint_m, dtype=np.float64)
    ranges = np.linalg.norm(toward, axis=1, keepdims=True)
    toward = toward / ranges
    helper = np.where(np.abs(toward[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.cross(helper, toward)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(toward, across)
    angles = 2.0 * np.pi * np.arange(corners) / corners
    circle = np.cos(angles)[:, None, None] * across + np.sin(angles)[:, None, None] * up
    rims = middles_m + circle * ranges * np.tan(angular_radius_rad)
    count = len(middles_m)
    positions = np.concatenate((middles_m, rims.reshape(-1, 3)))
    disc = np.arange(count)
    triangles = [
        np.stack((disc, count * (1 + k) + disc, count * (1 + (k + 1) % corners) + disc), axis=1)
        for k in range(corners)
    ]
    return Mesh(name, positions.astype("f4"), np.concatenate(triangles).astype("u4"), material)


def quads(name: str, corners_m: ArrayLike, material: int = 0) -> Mesh:
    """Mesh of quadrilaterals with corners (n, 4, 3) in the world frame, in order around each."""
    corners = np.asarray(corners_m, dtype=np.float64)
    first = 4 * np.arange(len(corners))[:, None]
    triangles = np.concatenate((first + [0, 1, 2], first + [0, 2, 3]))
    return Mesh(name, corners.reshape(-1, 3).astype("f4"), triangles.astype("u4"), material)
