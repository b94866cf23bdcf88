"""Triangles of draw items for clusters: in the frames of their objects, with baked light.

They are made batch by batch, so that intermediate arrays stay small.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.geometry.draw_item import DrawItem, LightSource
from omnisim.rendering.opengl.geometry.light_baking import Shading, bake_directional_light, shadings
from omnisim.rendering.opengl.geometry.vertex_records import CLUSTER_VERTEX, fill_vertices
from omnisim.scene.model import Lighting

# Relative to white: a third of an 8-bit step in the dark, where steps are finest; a hundredth at
# white.
_SAME_LIGHT = 1e-4
_VERTEX_BYTES = CLUSTER_VERTEX.itemsize
# Share of the vertices that are expected to need copies at most; more of them cost another buffer.
_ROOM_FOR_COPIES = 64
_BATCH_VERTICES = 1 << 18  # keeps intermediate arrays small


class ShadedTriangles(NamedTuple):
    """Triangles of draw items, item by item.

    Attributes:
        vertices: buffer of `CLUSTER_VERTEX`.
        triangles: (m, 3) indices of the vertices.
        corners: (m, 3, 3) positions of the three corners per triangle.
        shading: (m,) values of `Shading`.
    """

    vertices: moderngl.Buffer
    triangles: NDArray[np.uint32]
    corners: NDArray[np.float32]
    shading: NDArray[np.int8]


def shaded_triangles(
    context: moderngl.Context,
    items: Sequence[DrawItem],
    anchor_m: NDArray[np.float64],
    lighting: Lighting,
) -> ShadedTriangles:
    """Triangles of items, with light baked into those whose shading allows it.

    Args:
        context: OpenGL context.
        items: draw items.
        anchor_m: (3,) world position that static vertices are relative to.
        lighting: lighting of the scene.
    """
    total = sum(item.triangles for item in items)
    next_copy = sum(len(item.mesh.positions) for item in items)
    made = ShadedTriangles(
        context.buffer(reserve=_VERTEX_BYTES * (next_copy + next_copy // _ROOM_FOR_COPIES)),
        np.empty((total, 3), dtype="<u4"),
        np.empty((total, 3, 3), dtype=np.float32),
        np.empty(total, dtype=np.int8),
    )
    first, base, copies = 0, 0, []
    for batch in _batches(items):
        vertices, triangles = object_triangles(batch, anchor_m)
        own = slice(first, first + len(triangles))
        made.corners[own] = np.ascontiguousarray(vertices["in_position"])[triangles]
        shading, normals = _shading(batch, vertices, triangles, lighting)
        baked = shading == Shading.BAKED.value
        lights = bake_directional_light(normals[baked], lighting)
        # copies follow the vertices of all items
        copies.append(_bake(vertices, triangles, baked, lights, next_copy - base))
        made.vertices.write(vertices, offset=base * _VERTEX_BYTES)
        np.add(triangles, np.uint32(base), out=made.triangles[own])
        made.shading[own] = shading
        first, base = own.stop, base + len(vertices)
        next_copy += len(copies[-1])
    vertices = np.concatenate(copies)
    return made._replace(vertices=_appended(made.vertices, _VERTEX_BYTES * base, vertices))


def _appended(buffer: moderngl.Buffer, used: int, vertices: NDArray[np.void]) -> moderngl.Buffer:
    """Buffer with more vertices behind its used bytes; a larger one if it has no room."""
    if used + vertices.nbytes > buffer.size:
        larger = buffer.ctx.buffer(reserve=used + vertices.nbytes)
        buffer.ctx.copy_buffer(larger, buffer, size=used)
        buffer = larger
    if vertices.nbytes:
        buffer.write(vertices, offset=used)
    return buffer


def _batches(items: Sequence[DrawItem]) -> Iterator[list[DrawItem]]:
    """Consecutive items with about `_BATCH_VERTICES` vertices."""
    batch, vertices = list[DrawItem](), 0
    for item in items:
        batch.append(item)
        vertices += len(item.mesh.positions)
        if vertices >= _BATCH_VERTICES:
            yield batch
            batch, vertices = [], 0
    if batch:
        yield batch


def _shading(
    items: Sequence[DrawItem],
    vertices: NDArray[np.void],
    triangles: NDArray[np.uint32],
    lighting: Lighting,
) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Values (m,) of `Shading`, and unit normals (m, 3), valid for baked triangles."""
    item_of_triangle = np.repeat(
        np.arange(len(items), dtype=np.int32), [item.triangles for item in items]
    )
    is_static = np.array([item.object_index is None for item in items])
    is_bakeable = is_static & (lighting.baked is None)
    shading, normals = shadings(vertices, triangles, lighting, is_bakeable[item_of_triangle])
    # double-sided or unlit: facts about the front face do not apply
    ignores = [item.material.double_sided or item.material.unlit for item in items]
    shading[np.array(ignores)[item_of_triangle]] = Shading.UNKNOWN.value
    # view-dependent light cannot be baked
    reflective = np.array([item.texture_layer.reflectance is not None for item in items])
    shading[reflective[item_of_triangle] & (shading == Shading.BAKED.value)] = Shading.UNKNOWN.value
    # the lightmap holds all light of matte surfaces, for any normals
    in_lightmap = np.array([item.light is LightSource.LIGHTMAP for item in items])
    shading[(in_lightmap & ~reflective)[item_of_triangle]] = Shading.UNKNOWN.value
    return shading, normals


def object_triangles(
    items: Sequence[DrawItem], anchor_m: NDArray[np.float64]
) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Vertices (n,) of type `CLUSTER_VERTEX` and triangles (m, 3) of items, with equal winding.

    Vertices of dynamic objects are in the object's frame, static ones relative to the anchor (3,).
    """
    vertices = np.zeros(sum(len(item.mesh.positions) for item in items), dtype=CLUSTER_VERTEX)
    triangles = []
    base = 0
    for item in items:
        mesh, matrix = item.mesh, item.object_from_mesh
        part = vertices[base : base + len(mesh.positions)]
        fill_vertices(part, mesh)
        origin_m = anchor_m if item.object_index is None else np.zeros(3)
        part["in_position"] = mesh.positions @ matrix[:3, :3].T + (matrix[:3, 3] - origin_m)
        # vertex colors are half floats, as in the scene's vertex buffer
        colors = part["in_color"].astype(np.float16).astype(np.float32)
        part["in_color"] = colors * np.array(item.material.base_color, dtype=np.float32)
        part["in_material"] = item.texture_layer.layer, item.material.hit_cutoff
        if mesh.normals is not None:
            part["in_normal"] = mesh.normals @ item.normal_from_mesh.T
        own = mesh.triangles[:, (0, 2, 1)] if item.flips_winding else mesh.triangles
        triangles.append(own + np.uint32(base))
        base += len(part)
    return vertices, np.ascontiguousarray(np.concatenate(triangles))  # flipped ones are not


def _bake(
    vertices: NDArray[np.void],
    triangles: NDArray[np.uint32],
    baked: NDArray[np.bool_],
    lights: NDArray[np.float32],
    first_copy: int,
) -> NDArray[np.void]:
    """Bake lights (k, 3) into the vertices of the triangles that `baked` (m,) selects.

    Vertices and triangles are changed in place.

    Returns:
        Copies of those vertices that need two lights, or light and a normal; `first_copy` is the
            index of the first.
    """
    own = triangles[baked].ravel()
    lights = np.repeat(lights, 3, axis=0)
    light_at_vertex = np.zeros((len(vertices), 3), dtype=np.float32)
    light_at_vertex[own] = lights  # of one of the triangles that share the vertex
    light_at_vertex[triangles[~baked].ravel()] = np.inf  # these keep their normal
    fits = (np.abs(np.take(light_at_vertex, own, axis=0) - lights) < _SAME_LIGHT).all(axis=1)
    fitting = own[fits]
    vertices["in_normal"][fitting] = np.take(light_at_vertex, fitting, axis=0)
    copies: NDArray[np.void] = vertices[own[~fits]]
    copies["in_normal"] = lights[~fits]
    own[~fits] = np.arange(first_copy, first_copy + len(copies))
    triangles[baked] = own.reshape(-1, 3)
    return copies
