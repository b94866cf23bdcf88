"""Clustered geometry: opaque and masked instances as clusters of one object and one bucket.

Draw items have their own matrices, materials and calls. Here the vertices carry the material, so
that one call draws all clusters of a bucket, which share program and texture array.

On a flat triangle Lambert's cosine is constant and does not depend on the camera: without punctual
lights, its light is baked once instead of per texel and frame.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Floats32, Indices, Ints32, Uints32
from omnisim.rendering.opengl.culling.cluster_culling import ClusterBuffers
from omnisim.rendering.opengl.culling.clusters import (
    MAX_COPIED_TRIANGLES,
    ClusterHierarchy,
    Clusters,
    build_clusters,
)
from omnisim.rendering.opengl.culling.triangle_culling import (
    CullableTriangles,
    upload_triangles,
)
from omnisim.rendering.opengl.gl.buffers import (
    gpu_allocation,
    gpu_buffer,
    read_buffer,
    written_buffer,
)
from omnisim.rendering.opengl.world.draw_item import DrawItem, LightSource
from omnisim.rendering.opengl.world.scene_textures import TextureArray, vertex_details
from omnisim.rendering.opengl.world.vertex_format import VertexPalette
from omnisim.rendering.opengl.world.vertex_records import (
    CLUSTER_VERTEX,
    NORMAL_BYTES,
    light_coordinates,
)
from omnisim.scene.model import Lighting, LightKind
from omnisim.scene.surface_kind import SurfaceKind

# Unit normals that differ by less count as equal: light then differs by less than a tenth of an
# 8-bit step, even in the dark, where steps are finest, for a light that makes a surface white.
_SAME_NORMAL = 2e-5


class ClusterShading(Enum):
    """Shading of a single-sided triangle."""

    UNKNOWN = 0
    NORMALS_AGREE = 1  # all three normals point to the front side
    BAKED = 2  # flat, one color, no punctual lights, and no shadows from the lights that it faces


def shadings(
    vertices: NDArray[np.void],
    vertex_normals: Floats32,
    triangles: Uints32,
    lighting: Lighting,
    static: Bools,
) -> tuple[NDArray[np.int8], Floats32]:
    """Classify triangles by shading; compute the normals of those whose light can be baked.

    Args:
        vertices: (n,) records of type `CLUSTER_VERTEX`, static ones in world axes.
        vertex_normals: (n, 3) normals of any length; zero: flat.
        triangles: (m, 3) vertex indices.
        static: (m,) mask; light on dynamic triangles changes with their pose.

    Returns:
        Values (m,) of `ClusterShading`, and unit normals (m, 3), valid for baked triangles.
    """
    positions = np.ascontiguousarray(vertices["in_position"])
    units = _units(vertex_normals)
    corners = triangles.T
    origins, seconds, thirds = (np.take(positions, corner, axis=0) for corner in corners)
    fronts: Floats32 = np.cross(seconds - origins, thirds - origins)
    normals, second, third = (np.take(units, corner, axis=0) for corner in corners)
    agree = _dot(normals, fronts) > 0.0
    agree &= _dot(second, fronts) > 0.0
    agree &= _dot(third, fronts) > 0.0
    values: NDArray[np.int8] = agree.astype(np.int8) * np.int8(ClusterShading.NORMALS_AGREE.value)
    if any(light.kind is not LightKind.DIRECTIONAL for light in lighting.lights):
        return values, normals
    bends = (_dot(turned, turned) for turned in (second - normals, third - normals))
    bend = np.maximum(*bends)
    baked = agree & (bend < _SAME_NORMAL**2)
    has_normal: Bools = np.any(units, axis=1)
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
    values[baked & static] = ClusterShading.BAKED.value
    return values, normals


def bake_directional_light(normals: Floats32, lighting: Lighting) -> Floats32:
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


def _dot(one: Floats32, other: Floats32) -> Floats32:
    """Dot products (n,) of vectors (n, 3)."""
    return np.einsum("nc,nc->n", one, other)


def _units(vectors: Floats32) -> Floats32:
    """Normalize vectors (n, 3); zero vectors stay zero."""
    lengths = np.sqrt(_dot(vectors, vectors))[:, None]
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0.0)


class Bucket(NamedTuple):
    """Kind of clusters that one call can draw."""

    # properties of their materials
    kind: SurfaceKind  # unlit or not, with holes or not
    double_sided: bool
    shading: ClusterShading  # shading of their triangles
    array: TextureArray | None  # array of their textures; None: untextured
    maps: tuple[TextureArray | None, ...] | None = None  # see `Reflectance`; None: matte
    second_coordinates: bool = False  # True if a map uses the second texture coordinates
    light: LightSource = LightSource.COMPUTED  # source of the light on them


@dataclass(frozen=True, eq=False)
class ClusteredGeometry:
    """Instances of opaque and masked materials, see `build_clustered_geometry`."""

    buckets: tuple[Bucket, ...]  # buckets in the order of the hierarchy
    anchor_m: Floats  # (3,) float64 world position of the origin of object 0, the static geometry
    objects: int  # number of objects: the static one and the dynamic ones
    hierarchy: ClusterHierarchy  # clusters of one bucket and object each; orders all triangles
    contains: Bools  # (items,), mask of the scene's draw items in here
    vertices: moderngl.Buffer  # buffer of `CLUSTER_VERTEX`, in the frames of their objects
    normals: moderngl.Buffer | None  # buffer of their normals, 3 floats each; None: no mesh has any
    palette: moderngl.Texture  # texture of their palette
    bucket_of_cluster: Indices  # (clusters,) bucket index
    triangles_of_item: Indices  # number of triangles of each contained draw item
    cullable: CullableTriangles  # the triangles, cluster by cluster; degenerate for hidden items
    buffers: ClusterBuffers  # buffers of clusters and groups, for culling
    details: moderngl.Texture | None  # see `vertex_details`; None: all materials are matte
    light_coordinates: moderngl.Buffer | None  # see `light_coordinates`; None: no baked light

    @cached_property
    def triangles(self) -> Uints32:
        """Vertex indices (m, 3) of all triangles, cluster by cluster, hidden or not."""
        read = np.frombuffer(read_buffer(self.indices), dtype="<u4").reshape(-1, 3)
        return read[: self.triangle_count]

    @property
    def indices(self) -> moderngl.Buffer:
        """Buffer of the triangles' vertex indices, and of the room behind them."""
        return self.cullable.indices

    @property
    def triangle_count(self) -> int:
        """Number of triangles."""
        return len(self.hierarchy.order)

    @cached_property
    def item_of_triangle(self) -> Ints32:
        """Draw item (m,) of each triangle, cluster by cluster."""
        items = np.flatnonzero(self.contains).astype(np.int32)
        return np.repeat(items, self.triangles_of_item)[self.hierarchy.order]

    @cached_property
    def item_of_cluster(self) -> Indices:
        """Draw item (clusters,) of each cluster's first triangle."""
        ends = np.cumsum(self.triangles_of_item)
        number = np.searchsorted(ends, self.hierarchy.order[self.clusters.first], side="right")
        return np.flatnonzero(self.contains)[number]

    def show(self, shown: Bools) -> None:
        """Show the selected draw items (items,) only."""
        is_shown = shown[self.item_of_triangle]
        self.indices.write(np.where(is_shown[:, None], self.triangles, np.uint32(0)))

    @property
    def clusters(self) -> Clusters:
        """Clusters of the hierarchy."""
        return self.hierarchy.clusters

    def shown_clusters(self, shown: Bools) -> Bools:
        """Mask (clusters,) of the clusters of shown draw items (items,); static items stay."""
        return shown[self.item_of_cluster]


def build_clustered_geometry(
    context: moderngl.Context,
    items: Sequence[DrawItem],
    lighting: Lighting,
    dynamic_objects: int,
    alone: Collection[int] = (),
) -> ClusteredGeometry | None:
    """Clustered geometry of a scene without the items `alone`; None: none qualifies."""
    static_m = [item.center_m for item in items if item.object_index is None]
    anchor_m = np.zeros(3)
    if static_m:
        anchor_m = 0.5 * (np.min(static_m, axis=0) + np.max(static_m, axis=0))
    contains = _contained(items, anchor_m, alone)
    items = [item for item, is_contained in zip(items, contains, strict=True) if is_contained]
    if not items:
        return None
    counts = np.array([item.triangles for item in items])
    item_of_triangle = np.repeat(np.arange(len(items), dtype=np.int32), counts)
    with gpu_allocation(f"clusters of {counts.sum()} triangles", "make the scene smaller"):
        made = shaded_triangles(context, items, anchor_m, lighting)
    buckets, bucket = _buckets(items, item_of_triangle, made.shading)
    object_of_item = 1 + np.array(
        [-1 if item.object_index is None else item.object_index for item in items], dtype=np.int32
    )
    # parts of dynamic objects can be hidden individually, and items without shadows stay out of
    # shadow maps
    casts = np.array([item.casts_shadow for item in items])
    part = np.where((object_of_item == 0) & casts, 0, 1 + np.arange(len(items), dtype=np.int64))
    objects = 1 + dynamic_objects
    group_key = bucket * objects + object_of_item[item_of_triangle]
    key = part[item_of_triangle]
    key += group_key * np.int64(1 + len(items))
    hierarchy = build_clusters(made.corners, key, group_key)
    first = hierarchy.clusters.first[hierarchy.groups.first]
    group_key = group_key[hierarchy.order[first]]
    bucket_of_group, object_of_group = group_key // objects, group_key % objects
    double_sided = np.array([bucket.double_sided for bucket in buckets])[bucket_of_group]
    with gpu_allocation(f"clusters of {counts.sum()} triangles", "make the scene smaller"):
        cullable = upload_triangles(context, made.triangles, made.corners, hierarchy)
    reflectances, details = [item.texture_layer.reflectance for item in items], None
    if any(reflectances):
        records = [0 if reflectance is None else reflectance.record for reflectance in reflectances]
        details = vertex_details(
            context, list(zip([item.mesh for item in items], records, _bases(items), strict=True))
        )
    return ClusteredGeometry(
        buckets=buckets,
        anchor_m=anchor_m,
        objects=objects,
        hierarchy=hierarchy,
        contains=contains,
        vertices=made.vertices,
        normals=made.normals,
        palette=made.palette.texture(context),
        bucket_of_cluster=np.repeat(bucket_of_group, hierarchy.groups.children),
        triangles_of_item=counts,
        cullable=cullable,
        buffers=ClusterBuffers(
            context,
            hierarchy,
            np.repeat(double_sided, hierarchy.groups.children),
            object_of_group,
            bucket_of_group,
        ),
        details=details,
        light_coordinates=item_light_coordinates(context, items),
    )


def _buckets(
    items: Sequence[DrawItem], item_of_triangle: Ints32, shading_of_triangle: NDArray[np.int8]
) -> tuple[tuple[Bucket, ...], Ints32]:
    """Buckets, and the bucket index of each triangle (n,)."""
    kinds = len(ClusterShading) * item_of_triangle + shading_of_triangle
    of_kind: dict[int, Bucket] = {}
    for kind in np.flatnonzero(np.bincount(kinds)).tolist():
        item, shading = (
            items[kind // len(ClusterShading)],
            ClusterShading(kind % len(ClusterShading)),
        )
        material, reflectance = item.material, item.texture_layer.reflectance
        of_kind[kind] = Bucket(
            item.kind & (SurfaceKind.UNLIT | SurfaceKind.CUTOUT), material.double_sided,
            shading, item.texture_layer.array, reflectance and reflectance.maps,
            reflectance is not None and reflectance.second_coordinates, item.light,
        )  # fmt: skip
    buckets = sorted(set(of_kind.values()), key=_state_order)
    numbers = np.zeros(len(ClusterShading) * len(items), dtype=np.int32)
    for kind, bucket in of_kind.items():
        numbers[kind] = buckets.index(bucket)
    return tuple(buckets), numbers[kinds]


def _state_order(bucket: Bucket) -> tuple[object, ...]:
    """Sort key that minimizes state changes: program first, then texture."""
    arrays = [
        0 if texture is None else texture.array.glo
        for texture in (bucket.array, *(bucket.maps or ()))
    ]
    return (
        SurfaceKind.CUTOUT in bucket.kind, bucket.double_sided, SurfaceKind.UNLIT in bucket.kind,
        bucket.shading.value, bucket.maps is not None, bucket.light.value, arrays,
        bucket.second_coordinates,
    )  # fmt: skip


def _contained(items: Sequence[DrawItem], anchor_m: Floats, alone: Collection[int]) -> Bools:
    contained = np.zeros(len(items), dtype=np.bool_)
    meshes = set[int]()  # ids of those that are contained
    copied = 0
    for index, item in enumerate(items):
        added = item.triangles if id(item.mesh) in meshes else 0
        # a mesh without triangles has no cluster
        fits = item.triangles and copied + added <= MAX_COPIED_TRIANGLES
        is_rigid = item.mesh.deformation is None and index not in alone
        if is_rigid and not item.is_blended and fits and item.is_near(anchor_m):
            meshes.add(id(item.mesh))
            copied += added
            contained[index] = True
    return contained


def item_light_coordinates(
    context: moderngl.Context, items: Sequence[DrawItem]
) -> moderngl.Buffer | None:
    """Lightmap coordinates of the vertices of `object_triangles`; None: no baked light."""
    if not any(item.light.is_baked for item in items):
        return None
    parts = [
        (base, item.mesh, item.light_rectangles)
        for base, item in zip(_bases(items), items, strict=True)
    ]
    count = sum(len(item.mesh.positions) for item in items)
    return gpu_buffer(context, light_coordinates(parts, count))


def _bases(items: Sequence[DrawItem]) -> list[int]:
    """First vertex of each item, if they follow one another."""
    counts = [len(item.mesh.positions) for item in items]
    return [0, *np.cumsum(counts[:-1]).tolist()]


# Triangles of draw items for clusters: in the frames of their objects, with baked light.
#
# They are made batch by batch, so that intermediate arrays stay small.


# Relative to white: a third of an 8-bit step in the dark, where steps are finest; a hundredth at
# white.
_SAME_LIGHT = 1e-4
_VERTEX_BYTES = CLUSTER_VERTEX.itemsize
# Share of the vertices that are expected to need copies at most; more of them cost another buffer.
_ROOM_FOR_COPIES = 64
_BATCH_VERTICES = 1 << 18  # keeps intermediate arrays small


class ShadedTriangles(NamedTuple):
    """Triangles of draw items, item by item."""

    vertices: moderngl.Buffer  # buffer of `CLUSTER_VERTEX`
    normals: moderngl.Buffer | None  # buffer of the vertices' normals; None: no mesh has any
    palette: VertexPalette  # palette of the vertices
    triangles: Uints32  # (m, 3) indices of the vertices
    corners: Floats32  # (m, 3, 3) positions of the three corners per triangle
    shading: NDArray[np.int8]  # (m,) values of `ClusterShading`


def shaded_triangles(
    context: moderngl.Context, items: Sequence[DrawItem], anchor_m: Floats, lighting: Lighting
) -> ShadedTriangles:
    """Triangles of items, relative to the anchor (3,), with light baked in where it can be."""
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
        baked = shading == ClusterShading.BAKED.value
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
    vertex_normals: Floats32,
    triangles: Uints32,
    lighting: Lighting,
) -> tuple[NDArray[np.int8], Floats32]:
    """Values (m,) of `ClusterShading`, and unit normals (m, 3), valid for baked triangles."""
    item_of_triangle = np.repeat(
        np.arange(len(items), dtype=np.int32), [item.triangles for item in items]
    )
    is_bakeable = [item.object_index is None and lighting.baked is None for item in items]
    static = np.array(is_bakeable)[item_of_triangle]
    shading, normals = shadings(vertices, vertex_normals, triangles, lighting, static)
    reflective = np.array([item.texture_layer.reflectance is not None for item in items])
    # view-dependent light cannot be baked
    unknown = reflective[item_of_triangle] & (shading == ClusterShading.BAKED.value)
    # double-sided or unlit: facts about the front face do not apply; and the lightmap holds all
    # light of matte surfaces, for any normals
    ignores = [
        item.material.double_sided
        or item.material.unlit
        or (item.light is LightSource.LIGHTMAP and item.texture_layer.reflectance is None)
        for item in items
    ]
    shading[unknown | np.array(ignores)[item_of_triangle]] = ClusterShading.UNKNOWN.value
    return shading, normals


def object_triangles(
    items: Sequence[DrawItem], anchor_m: Floats, palette: VertexPalette, kinds: Sequence[float] = ()
) -> tuple[NDArray[np.void], Floats32, Uints32]:
    """Vertices (n,) of type `CLUSTER_VERTEX`, their normals (n, 3), and triangles (m, 3) of items.

    Vertices of dynamic objects are in the object's frame, static ones relative to the anchor.
    Normals have any length; zero: flat. All triangles have the same winding.

    Args:
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
    triangles: Uints32,
    baked: Bools,
    lights: Floats32,
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
