"""Light baking: directional light on flat triangles, computed once instead of per texel.

On a flat triangle Lambert's cosine is constant and does not depend on the camera: without punctual
lights, its light need not be recomputed per texel and frame.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from omnisim.core.array_types import Float32s, Mask, UInt32s
from omnisim.scene.model import Lighting, LightKind

# Unit normals that differ by less count as equal: light then differs by less than a tenth of an
# 8-bit step, even in the dark, where steps are finest, for a light that makes a surface white.
_SAME_NORMAL = 2e-5


class Shading(Enum):
    """Shading of a single-sided triangle."""

    UNKNOWN = 0
    NORMALS_AGREE = 1  # all three normals point to the front side
    BAKED = 2  # flat, one color, no punctual lights, and no shadows from the lights that it faces


def shadings(
    vertices: NDArray[np.void],
    vertex_normals: Float32s,
    triangles: UInt32s,
    lighting: Lighting,
    static: Mask,
) -> tuple[NDArray[np.int8], Float32s]:
    """Classify triangles by shading; compute the normals of those whose light can be baked.

    Args:
        vertices: (n,) records of type `CLUSTER_VERTEX`, static ones in world axes.
        vertex_normals: (n, 3) normals of any length; zero: flat.
        triangles: (m, 3) vertex indices.
        static: (m,) mask; light on dynamic triangles changes with their pose.

    Returns:
        Values (m,) of `Shading`, and unit normals (m, 3), valid for baked triangles.
    """
    positions = np.ascontiguousarray(vertices["in_position"])
    units = _units(vertex_normals)
    corners = triangles.T
    origins, seconds, thirds = (np.take(positions, corner, axis=0) for corner in corners)
    fronts: Float32s = np.cross(seconds - origins, thirds - origins)
    normals, second, third = (np.take(units, corner, axis=0) for corner in corners)
    agree = _dot(normals, fronts) > 0.0
    agree &= _dot(second, fronts) > 0.0
    agree &= _dot(third, fronts) > 0.0
    values: NDArray[np.int8] = agree.astype(np.int8) * np.int8(Shading.NORMALS_AGREE.value)
    if any(light.kind is not LightKind.DIRECTIONAL for light in lighting.lights):
        return values, normals
    bend = np.maximum(_squared(second - normals), _squared(third - normals))
    baked = agree & (bend < _SAME_NORMAL**2)
    has_normal: Mask = np.any(units, axis=1)
    if not has_normal.all():
        none = ~has_normal[triangles].any(axis=1)
        normals[none] = _units(fronts[none])
        baked |= none & normals.any(axis=1)
    colors = np.ascontiguousarray(vertices["in_material"])
    first, second, third = (np.take(colors, corner) for corner in corners)
    baked &= (first == second) & (first == third)
    for light in lighting.lights:
        if light.casts_shadow:
            baked &= ~(normals @ light.direction < 0.0)
    values[baked & static] = Shading.BAKED.value
    return values, normals


def bake_directional_light(normals: Float32s, lighting: Lighting) -> Float32s:
    """Light on white surfaces, linear RGB (n, 3), for unit world normals (n, 3).

    Twin of shaders/scene/lighting.glsl without punctual lights.
    """
    total = np.tile(np.array(lighting.ambient), (len(normals), 1))
    if lighting.environment is not None:
        total += lighting.environment.ambient(normals)
    for light in lighting.lights:
        color = np.array(light.color) * (light.intensity * lighting.exposure)
        total += np.maximum(-(normals @ light.direction), 0.0)[:, None] * color
    return total.astype(np.float32)


def _dot(one: Float32s, other: Float32s) -> Float32s:
    """Dot products (n,) of vectors (n, 3)."""
    return np.einsum("nc,nc->n", one, other)


def _squared(vectors: Float32s) -> Float32s:
    return _dot(vectors, vectors)


def _units(vectors: Float32s) -> Float32s:
    """Normalize vectors (n, 3); zero vectors stay zero."""
    lengths = np.sqrt(_squared(vectors))[:, None]
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)
