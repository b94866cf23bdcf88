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
from omnisim.rendering.opengl.geometry.vertex_palette import VertexPalette
from omnisim.rendering.opengl.geometry.vertex_records import CLUSTER_VERTEX, NORMAL_BYTES
from omnisim.rendering.opengl.gl.buffers import written_buffer
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
        normals: buffer of the vertices' normals; None: no mesh has any.
        palette: palette of the vertices.
        triangles: (m, 3) indices of the vertices.
        corners: (m, 3, 3) positions of the three corners per triangle.
        shading: (m,) values of `Shading`.
    """

    vertices: moderngl.Buffer
    normals: moderngl.Buffer | None
    palette: VertexPalette
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
    room = next_copy + next_copy // _ROOM_FOR_COPIES
    has_normals = any(item.mesh.normals is not None for item in items)
    made = ShadedTriangles(
        written_buffer(context, _VERTEX_BYTES * room),
        written_buffer(context, NORMAL_BYTES * room) if has_normals else None,
        VertexPalette(),
        np.empty((total, 3), dtype="<u4"),
        np.empty((total, 3, 3), dtype=np.float32),
        np.empty(total, dtype=np.int8),
    )
    first, base, copies = 0, 0, []
    for batch in _batches(items):
        vertices, vertex_normals, triangles = object_triangles(batch, anchor_m, made.palette)
        own = slice(first, first + len(triangles))
        made.corners[own] = np.ascontiguousarray(vertices["in_position"])[triangles]
        shading, normals = _shading(batch, vertices, vertex_normals, triangles, lighting)
        baked = shading == Shading.BAKED.value
        lights = bake_directional_light(normals[baked], lighting)
        # copies follow the vertices of all items
        copies.append(_bake(vertices, triangles, baked, lights, next_copy - base, made.palette))
        made.vertices.write(vertices, offset=base * _VERTEX_BYTES)
        if made.normals is not None:
            made.normals.write(vertex_normals, offset=base * NORMAL_BYTES)
        np.add(triangles, np.uint32(base), out=made.triangles[own])
        made.shading[own] = shading
        first, base = own.stop, base + len(vertices)
        next_copy += len(copies[-1])
    vertices = np.concatenate(copies)
    made = made._replace(vertices=_appended(made.vertices, _VERTEX_BYTES * base, vertices))
    if made.normals is None:
        return made
    none = np.zeros((len(vertices), 3), dtype=np.float32)  # copies are baked: none is needed
    return made._replace(normals=_appended(made.normals, NORMAL_BYTES * base, none))


def _appended(buffer: moderngl.Buffer, used: int, values: NDArray[np.generic]) -> moderngl.Buffer:
    """Buffer with more values behind its used bytes; a larger one if it has no room."""
    if used + values.nbytes > buffer.size:
        larger = written_buffer(buffer.ctx, used + values.nbytes)
        buffer.ctx.copy_buffer(larger, buffer, size=used)
        buffer = larger
    if values.nbytes:
        buffer.write(values, offset=used)
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
    vertex_normals: NDArray[np.float32],
    triangles: NDArray[np.uint32],
    lighting: Lighting,
) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Values (m,) of `Shading`, and unit normals (m, 3), valid for baked triangles."""
    item_of_triangle = np.repeat(
        np.arange(len(items), dtype=np.int32), [item.triangles for item in items]
    )
    is_static = np.array([item.object_index is None for item in items])
    is_bakeable = is_static & (lighting.baked is None)
    static = is_bakeable[item_of_triangle]
    shading, normals = shadings(vertices, vertex_normals, triangles, lighting, static)
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
    items: Sequence[DrawItem],
    anchor_m: NDArray[np.float64],
    palette: VertexPalette,
    kinds: Sequence[float] = (),
) -> tuple[NDArray[np.void], NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices (n,) of type `CLUSTER_VERTEX`, their normals (n, 3), and triangles (m, 3) of items.

    Vertices of dynamic objects are in the object's frame, static ones relative to the anchor.
    Normals have any length; zero: flat. All triangles have the same winding.

    Args:
        items: draw items.
        anchor_m: (3,) anchor, world.
        palette: palette that gets the materials of the vertices.
        kinds: kinds of blended materials, in place of alpha cutoffs.
    """
    vertices = np.zeros(sum(len(item.mesh.positions) for item in items), dtype=CLUSTER_VERTEX)
    normals = np.zeros((len(vertices), 3), dtype=np.float32)
    triangles = []
    base = 0
    cutoffs = kinds or [item.material.hit_cutoff for item in items]
    for item, cutoff in zip(items, cutoffs, strict=True):
        mesh, matrix = item.mesh, item.object_from_mesh
        part = vertices[base : base + len(mesh.positions)]
        origin_m = anchor_m if item.object_index is None else np.zeros(3)
        part["in_position"] = mesh.positions @ matrix[:3, :3].T + (matrix[:3, 3] - origin_m)
        if mesh.normals is not None:
            normals[base : base + len(part)] = mesh.normals @ item.normal_from_mesh.T
        if mesh.texture_coordinates is not None:
            part["in_texture_coordinate"] = mesh.texture_coordinates
        part["in_material"] = palette.add(
            mesh.colors, item.material.base_color, item.texture_layer.layer, cutoff
        )
        own = mesh.triangles[:, (0, 2, 1)] if item.flips_winding else mesh.triangles
        triangles.append(own + np.uint32(base))
        base += len(part)
    joined = np.ascontiguousarray(np.concatenate(triangles))  # flipped ones are not
    return vertices, normals, joined


def _bake(
    vertices: NDArray[np.void],
    triangles: NDArray[np.uint32],
    baked: NDArray[np.bool_],
    lights: NDArray[np.float32],
    first_copy: int,
    palette: VertexPalette,
) -> NDArray[np.void]:
    """Bake lights (k, 3) into the vertices of the triangles that `baked` (m,) selects.

    Vertices and triangles are changed in place.

    Returns:
        Copies of those vertices that need two lights; `first_copy` is the index of the first.
    """
    own = triangles[baked].ravel()
    lights = np.repeat(lights, 3, axis=0)
    light_at_vertex = np.zeros((len(vertices), 3), dtype=np.float32)
    light_at_vertex[own] = lights  # of one of the triangles that share the vertex
    fits = (np.abs(np.take(light_at_vertex, own, axis=0) - lights) < _SAME_LIGHT).all(axis=1)
    copies: NDArray[np.void] = vertices[own[~fits]]
    copies["in_material"] = palette.lit(copies["in_material"], lights[~fits])
    is_lit = np.zeros(len(vertices), dtype=np.bool_)
    is_lit[own] = True
    lit = palette.lit(vertices["in_material"][is_lit], light_at_vertex[is_lit])
    vertices["in_material"][is_lit] = lit
    own[~fits] = np.arange(first_copy, first_copy + len(copies))
    triangles[baked] = own.reshape(-1, 3)
    return copies
