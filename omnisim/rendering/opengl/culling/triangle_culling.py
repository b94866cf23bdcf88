"""Triangles for culling one by one: corners within their clusters' boxes, and room for the kept.

A pass first culls clusters. Of those that it shows, only triangles that may cover a sample are
drawn: their vertex indices are copied into the room behind those of all triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from omnisim.core.arrays import Floats32, Uints32
from omnisim.rendering.opengl.culling.clusters import MAX_ROOM, MAX_TRIANGLES, ClusterHierarchy
from omnisim.rendering.opengl.gl.buffers import written_buffer
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d

# Steps along a side of a cluster's box, and bits of a step, in shaders/culling/triangles.comp.
STEPS, _BITS, _LOW_BITS = 16383, 14, 10
_MAX_PLACES = 1 << 25  # first triangle and number of triangles are packed into a word
_INDEX_BYTES = 12  # per triangle
_ROW, _AT_ONCE = 1 << 12, 1 << 18  # entries of the texture's rows; keeps intermediate arrays small
assert MAX_TRIANGLES * _MAX_PLACES < 1 << 32


@dataclass(frozen=True)
class CullableTriangles:
    """Triangles of clusters, which all cullers share.

    Attributes:
        corners: texture of their corners, see `packed_corners`, cluster by cluster; None: too many
            triangles for a texture, a storage buffer, or a word.
        indices: buffer of their vertex indices, then the room.
        count: number of triangles.
        room: number of triangles for which there is room.
    """

    corners: moderngl.Texture | None
    indices: moderngl.Buffer
    count: int
    room: int


def upload_triangles(
    context: moderngl.Context, triangles: Uints32, corners: Floats32, hierarchy: ClusterHierarchy
) -> CullableTriangles:
    """Upload triangles for culling and drawing.

    Args:
        triangles: (n, 3) vertex indices.
        corners: (n, 3, 3) positions of their corners.
        hierarchy: their clusters.
    """
    order, count = hierarchy.order, len(triangles)
    room = min(count, MAX_ROOM)
    limit = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
    rows = -(-count // _ROW)
    if (
        _INDEX_BYTES * (count + room) > limit
        or count + room > _MAX_PLACES
        or rows > int(context.info["GL_MAX_TEXTURE_SIZE"])
    ):
        return CullableTriangles(None, written_buffer(context, triangles[order]), count, 0)
    indices = written_buffer(context, _INDEX_BYTES * (count + room))
    indices.write(triangles[order])
    packed = np.zeros((rows * _ROW, 4), dtype="<u4")
    packed[:count] = packed_corners(corners, hierarchy)
    texture = texture_2d(context, (_ROW, rows), 4, packed, dtype="u4")
    return CullableTriangles(texture, indices, count, room)


def packed_corners(corners: Floats32, hierarchy: ClusterHierarchy) -> Uints32:
    """Corners (n, 3, 3) as words (n, 4), cluster by cluster, in steps within their cluster's box.

    The first words have a corner each, 14 bits of x and of y and the upper four of z; the last one
    has the other bits of z.
    """
    clusters, order = hierarchy.clusters, hierarchy.order
    low, extent = clusters.aabb_min, clusters.aabb_max - clusters.aabb_min
    scale = np.divide(np.float32(STEPS), extent, out=np.zeros_like(extent), where=extent > 0.0)
    cluster_of = np.repeat(np.arange(len(low), dtype=np.uint32), clusters.triangles)
    packed = np.empty((len(order), 4), dtype="<u4")
    for start in range(0, len(order), _AT_ONCE):
        own = slice(start, start + _AT_ONCE)
        cluster = cluster_of[own]
        steps = (corners[order[own]] - low[cluster, None]) * scale[cluster, None]
        x, y, z = np.moveaxis(np.rint(steps).astype(np.uint32), -1, 0)
        packed[own, :3] = x | y << _BITS | z >> _LOW_BITS << 2 * _BITS
        z &= (1 << _LOW_BITS) - 1
        packed[own, 3] = z[:, 0] | z[:, 1] << _LOW_BITS | z[:, 2] << 2 * _LOW_BITS
    return packed
