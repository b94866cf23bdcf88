"""Texture coordinates for geoms without their own, matching MuJoCo's renderer.

A flat image is projected along z, a cube texture from the geom's center.

Source: MuJoCo, render_gl3.c, settexture (object-linear texture coordinates); OpenGL 4.6, table 8.19
(faces of a cube).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.formats.mjcf.geometry import Shape
from omnisim.scene.primitives import Surface

# Axis of each cube face, and the axes and signs of right and down in its image.
_FACES = (
    (0, 1.0, (2, -1.0), (1, -1.0)),
    (0, -1.0, (2, 1.0), (1, -1.0)),
    (1, 1.0, (0, 1.0), (2, 1.0)),
    (1, -1.0, (0, 1.0), (2, -1.0)),
    (2, 1.0, (0, 1.0), (1, -1.0)),
    (2, -1.0, (0, -1.0), (1, -1.0)),
)
_EDGES = np.array([(1.0, -1, 0), (1, 1, 0), (1, 0, -1), (1, 0, 1), (0, 1, -1), (0, 1, 1)])


class MappedSurface(NamedTuple):
    """Part of a surface with texture coordinates.

    Attributes:
        face: face of the cube; None: a flat image.
        surface, texture_coordinates: triangles and texture coordinates of the part.
    """

    face: int | None
    surface: Surface
    texture_coordinates: NDArray[np.float64] | None


def map_plane(
    shape: Shape, repeat: NDArray[np.float32], sizes: NDArray[np.float64], is_uniform: bool
) -> MappedSurface:
    """Texture coordinates of an image projected along z.

    Args:
        shape: shape of the geom.
        repeat: number of repetitions along x and y, across the geom or across 2 m.
        sizes: sizes of the geom.
        is_uniform: repeat across 2 m instead of across the geom.
    """
    scale = np.asarray(repeat, dtype=np.float64)
    if is_uniform:
        scale = scale * np.where(sizes[:2] > 0.0, sizes[:2], 1.0)
    return MappedSurface(None, shape.surface, shape.scaled[:, :2] * scale * (0.5, -0.5) - 0.5)


def map_cube(shape: Shape, sizes: NDArray[np.float64], is_uniform: bool) -> list[MappedSurface]:
    """Texture coordinates of a cube projected from the center; triangles are cut at its edges.

    Args:
        shape: shape of the geom.
        sizes: (3,) sizes of the geom.
        is_uniform: True: project positions in meters; False: positions divided by the sizes.
    """
    ray = shape.scaled * np.where(sizes > 0.0, sizes, 1.0) if is_uniform else shape.scaled
    surface = shape.surface
    has_normals = surface.normals is not None
    columns = [surface.positions, ray] + ([surface.normals] if surface.normals is not None else [])
    corners = np.concatenate(columns, axis=1)[surface.triangles]
    for edge in _EDGES:
        is_done = _is_on_one_face(corners[:, :, 3:6])
        rest = corners[~is_done]
        corners = np.concatenate((corners[is_done], _cut(rest, rest[:, :, 3:6] @ edge)))
    middles = corners[:, :, 3:6].sum(axis=1)
    axis = np.argmax(np.abs(middles), axis=1)
    sign = np.where(np.take_along_axis(middles, axis[:, None], 1)[:, 0] < 0.0, -1.0, 1.0)
    mapped = []
    for face, (of_axis, of_sign, right, down) in enumerate(_FACES):
        part = corners[(axis == of_axis) & (sign == of_sign)].reshape(-1, corners.shape[2])
        if not len(part):
            continue
        rays = part[:, 3:6]
        depth = np.maximum(np.abs(rays[:, of_axis]), 1e-12)
        places = [rays[:, k] * s / depth for k, s in (right, down)]
        mapped.append(
            MappedSurface(
                face,
                Surface(
                    part[:, :3],
                    np.arange(len(part)).reshape(-1, 3),
                    part[:, 6:] if has_normals else None,
                ),
                0.5 * np.clip(np.stack(places, axis=1), -1.0, 1.0) + 0.5,
            )
        )
    return mapped


def _is_on_one_face(rays: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (m,) of triangles (m, 3, 3) whose corners all project to one face of the cube."""
    reach = np.abs(rays).max(axis=2, keepdims=True) * (1.0 - 1e-9)
    is_far = np.concatenate((rays >= reach, rays <= -reach), axis=2)  # along +x, …, −z
    most: NDArray[np.int64] = is_far.sum(axis=1).max(axis=1, initial=0)
    on_one: NDArray[np.bool_] = most == 3
    return on_one


def _cut(corners: NDArray[np.float64], sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cut triangles (m, 3, k) where a value (m, 3) given at their corners changes sign."""
    level = np.abs(sides).max(initial=0.0) * 1e-9
    sides = np.where(np.abs(sides) <= level, 0.0, sides)
    is_cut = (sides.min(axis=1) < 0.0) & (sides.max(axis=1) > 0.0)
    if not is_cut.any():
        return corners
    tri, side = corners[is_cut], sides[is_cut]
    # Rotates the corner alone on its side to the front; if one is on the edge, the positive one.
    signs = np.sign(side)
    alone = np.argmax(signs * np.sign(signs.sum(axis=1, keepdims=True)) < 0.0, axis=1)
    on_edge = (signs == 0.0).any(axis=1)
    alone = np.where(on_edge, np.argmax(signs > 0.0, axis=1), alone)
    order = (alone[:, None] + np.arange(3)) % 3
    tri = np.take_along_axis(tri, order[:, :, None], axis=1)
    side = np.take_along_axis(side, order, axis=1)
    a, b, c = tri[:, 0], tri[:, 1], tri[:, 2]
    ab, ac = _crossing(a, b, side[:, 0], side[:, 1]), _crossing(a, c, side[:, 0], side[:, 2])
    pieces = np.concatenate(
        [np.stack(one, axis=1) for one in ((a, ab, ac), (ab, b, c), (ab, c, ac))]
    )
    points = pieces[:, :, :3]
    areas = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    return np.concatenate((corners[~is_cut], pieces[(areas != 0.0).any(axis=1)]))


def _crossing(
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    first_side: NDArray[np.float64],
    second_side: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Points (m, k) between two corners where the value is zero; an end without a sign change."""
    difference = first_side - second_side
    share = np.clip(first_side / np.where(difference == 0.0, 1.0, difference), 0.0, 1.0)[:, None]
    return first + share * (second - first)
