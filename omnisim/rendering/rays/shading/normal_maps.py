"""Normal mapping with the tangents of the triangles.

The twin of shaders/scene/reflective_material.glsl.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.rays.shading.ray_reflectance import Floats


def mapped_normals(
    normals: NDArray[np.float32],
    corners_m: NDArray[np.float64],
    coordinates: NDArray[np.float32],
    planes: NDArray[np.float32],
    texels: NDArray[np.float32],
    scales: NDArray[np.float32],
) -> Floats:
    """Apply normal maps: unit normals (n, 3).

    Args:
        normals: (n, 3) unit, before mapping, on the visible side.
        corners_m: (n, 3, 3) triangle corners, counter-clockwise seen from the front.
        coordinates: (n, 3, 2) texture coordinates at the corners.
        planes: (n, 3) plane normals on the visible side.
        texels: (n, 4) texels of the normal maps.
        scales: (n,) scales of the normal maps.
    """
    edges_m, edges = corners_m[:, 1:] - corners_m[:, :1], coordinates[:, 1:] - coordinates[:, :1]
    (u1, v1), (u2, v2) = edges[:, 0].T, edges[:, 1].T
    sign = np.sign(u1 * v2 - u2 * v1)[:, None]
    along_u = sign * (edges_m[:, 0] * v2[:, None] - edges_m[:, 1] * v1[:, None])
    along_v = sign * (edges_m[:, 1] * u1[:, None] - edges_m[:, 0] * u2[:, None])
    along_u -= normals * _dot(normals, along_u)
    lengths = np.linalg.norm(along_u, axis=1, keepdims=True)
    tangents = along_u / np.where(lengths > 0.0, lengths, 1.0)
    bitangents = np.cross(normals, tangents)
    # v points down in a texture
    bitangents *= np.where(_dot(bitangents, along_v) > 0.0, -1.0, 1.0)
    is_front = _dot(np.cross(edges_m[:, 0], edges_m[:, 1]), planes) > 0.0
    bumps = 2.0 * texels[:, :3] - 1.0
    bumps[:, :2] *= scales[:, None] * np.where(is_front, 1.0, -1.0)
    mapped = bumps[:, :1] * tangents + bumps[:, 1:2] * bitangents + bumps[:, 2:] * normals
    mapped /= np.maximum(np.linalg.norm(mapped, axis=1, keepdims=True), 1e-20)
    return np.where(lengths > 0.0, mapped, normals)


def _dot(one: Floats, other: Floats) -> Floats:
    products: Floats = np.einsum("nc,nc->n", one, other)
    return products[:, None]
