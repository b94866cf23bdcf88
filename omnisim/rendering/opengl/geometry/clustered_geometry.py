"""Clustered geometry: opaque and masked instances as clusters of one object and one bucket.

Draw items have their own matrices, materials and calls. Here the vertices carry the material, so
that one call draws all clusters of a bucket, which share program and texture array.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.culling.cluster_buffers import ClusterBuffers
from omnisim.rendering.opengl.culling.clusters import (
    MAX_COPIED_TRIANGLES,
    ClusterHierarchy,
    Clusters,
    build_clusters,
)
from omnisim.rendering.opengl.geometry.cluster_triangles import shaded_triangles
from omnisim.rendering.opengl.geometry.draw_item import DrawItem, LightSource
from omnisim.rendering.opengl.geometry.light_baking import Shading
from omnisim.rendering.opengl.geometry.vertex_records import light_coordinates
from omnisim.rendering.opengl.gl.buffers import gpu_buffer, read_buffer, written_buffer
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.materials.material_table import vertex_details
from omnisim.rendering.opengl.materials.texture_array import TextureArray
from omnisim.scene.model import AlphaMode, Lighting


class Bucket(NamedTuple):
    """Kind of clusters that one call can draw.

    Attributes:
        unlit, alpha_mode, double_sided: properties of their materials.
        cutoff: their materials discard low alpha.
        shading: shading of their triangles.
        array: array of their textures; None: untextured.
        maps: arrays of their maps, see `Reflectance`; None: matte.
        second_coordinates: True if a map uses the second texture coordinates.
        light: source of the light on them.
    """

    unlit: bool
    alpha_mode: AlphaMode
    double_sided: bool
    cutoff: bool
    shading: Shading
    array: TextureArray | None
    maps: tuple[TextureArray | None, ...] | None = None
    second_coordinates: bool = False
    light: LightSource = LightSource.COMPUTED


@dataclass(frozen=True, eq=False)
class ClusteredGeometry:
    """Instances of opaque and masked materials, see `build_clustered_geometry`.

    Attributes:
        buckets: buckets in the order of the hierarchy.
        anchor_m: (3,) float64 world position of the origin of object 0, the static geometry.
        objects: number of objects: the static one and the dynamic ones.
        hierarchy: clusters of one bucket and one object each; it orders the triangles of all
            contained draw items.
        contains: (items,), mask of the scene's draw items in here.
        vertices: buffer of `CLUSTER_VERTEX`, in the frames of their objects.
        normals: buffer of their normals, 3 floats each; None: no mesh has any.
        palette: texture of their palette.
        bucket_of_cluster: (clusters,) bucket index.
        triangles_of_item: number of triangles of each contained draw item.
        indices: index buffer of the triangles, cluster by cluster; degenerate for hidden items.
        buffers: buffers of clusters and groups, for culling.
        details: vertex details, see `vertex_details`; None: all materials are matte.
        light_coordinates: lightmap coordinates of the vertices; None: no baked light.
    """

    buckets: tuple[Bucket, ...]
    anchor_m: NDArray[np.float64]
    objects: int
    hierarchy: ClusterHierarchy
    contains: NDArray[np.bool_]
    vertices: moderngl.Buffer
    normals: moderngl.Buffer | None
    palette: moderngl.Texture
    bucket_of_cluster: NDArray[np.intp]
    triangles_of_item: NDArray[np.intp]
    indices: moderngl.Buffer
    buffers: ClusterBuffers
    details: moderngl.Texture | None
    light_coordinates: moderngl.Buffer | None

    @cached_property
    def triangles(self) -> NDArray[np.uint32]:
        """Vertex indices (m, 3) of all triangles, cluster by cluster, hidden or not."""
        return np.frombuffer(read_buffer(self.indices), dtype="<u4").reshape(-1, 3)

    @property
    def triangle_count(self) -> int:
        """Number of triangles."""
        return len(self.hierarchy.order)

    @cached_property
    def item_of_triangle(self) -> NDArray[np.int32]:
        """Draw item (m,) of each triangle, cluster by cluster."""
        items = np.flatnonzero(self.contains).astype(np.int32)
        return np.repeat(items, self.triangles_of_item)[self.hierarchy.order]

    @cached_property
    def item_of_cluster(self) -> NDArray[np.intp]:
        """Draw item (clusters,) of each cluster's first triangle."""
        ends = np.cumsum(self.triangles_of_item)
        number = np.searchsorted(ends, self.hierarchy.order[self.clusters.first], side="right")
        return np.flatnonzero(self.contains)[number]

    def show(self, shown: NDArray[np.bool_]) -> None:
        """Show the selected draw items (items,) only."""
        is_shown = shown[self.item_of_triangle]
        self.indices.write(np.where(is_shown[:, None], self.triangles, np.uint32(0)))

    @property
    def clusters(self) -> Clusters:
        """Clusters of the hierarchy."""
        return self.hierarchy.clusters

    def shown_clusters(self, shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Mask (clusters,) of the clusters of shown draw items (items,); static items stay."""
        return shown[self.item_of_cluster]


def build_clustered_geometry(
    context: moderngl.Context,
    items: Sequence[DrawItem],
    lighting: Lighting,
    dynamic_objects: int,
    alone: Collection[int] = (),
) -> ClusteredGeometry | None:
    """Build the clustered geometry of a scene; None if no instance qualifies.

    Args:
        context: OpenGL context.
        items: all draw items.
        lighting: lighting of the scene.
        dynamic_objects: number of dynamic objects.
        alone: indices of items to draw one by one.
    """
    anchor_m = _anchor(items)
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
        [-1 if one.object_index is None else one.object_index for one in items], dtype=np.int32
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
    double_sided = np.array([one.double_sided for one in buckets])[bucket_of_group]
    with gpu_allocation(f"clusters of {counts.sum()} triangles", "make the scene smaller"):
        index_buffer = written_buffer(context, made.triangles[hierarchy.order])
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
        indices=index_buffer,
        buffers=ClusterBuffers(
            context,
            hierarchy,
            np.repeat(double_sided, hierarchy.groups.children),
            object_of_group,
            bucket_of_group,
        ),
        details=_details(context, items),
        light_coordinates=item_light_coordinates(context, items),
    )


def _details(context: moderngl.Context, items: Sequence[DrawItem]) -> moderngl.Texture | None:
    """Vertex details of items; None: all are matte."""
    reflectances = [item.texture_layer.reflectance for item in items]
    if all(one is None for one in reflectances):
        return None
    return vertex_details(
        context,
        [
            (item.mesh, 0 if found is None else found.record)
            for item, found in zip(items, reflectances, strict=True)
        ],
    )


def _buckets(
    items: Sequence[DrawItem],
    item_of_triangle: NDArray[np.int32],
    shading_of_triangle: NDArray[np.int8],
) -> tuple[tuple[Bucket, ...], NDArray[np.int32]]:
    """Buckets, and the bucket index of each triangle (n,)."""
    kinds = len(Shading) * item_of_triangle + shading_of_triangle
    of_kind: dict[int, Bucket] = {}
    for kind in np.flatnonzero(np.bincount(kinds)).tolist():
        item, shading = items[kind // len(Shading)], Shading(kind % len(Shading))
        material, reflectance = item.material, item.texture_layer.reflectance
        maps, second = (
            (None, False)
            if reflectance is None
            else (reflectance.maps, reflectance.second_coordinates)
        )
        of_kind[kind] = Bucket(
            material.unlit, material.alpha_mode, material.double_sided,
            material.hit_cutoff > 0.0, shading, item.texture_layer.array, maps, second, item.light,
        )  # fmt: skip
    buckets = sorted(set(of_kind.values()), key=_state_order)
    numbers = np.zeros(len(Shading) * len(items), dtype=np.int32)
    for kind, bucket in of_kind.items():
        numbers[kind] = buckets.index(bucket)
    return tuple(buckets), numbers[kinds]


def _state_order(bucket: Bucket) -> tuple[object, ...]:
    """Sort key that minimizes state changes: program first, then texture."""
    arrays = [0 if one is None else one.array.glo for one in (bucket.array, *(bucket.maps or ()))]
    return (
        bucket.alpha_mode.value != AlphaMode.OPAQUE.value, bucket.double_sided, bucket.unlit,
        bucket.shading.value, bucket.maps is not None, bucket.light.value, arrays,
        bucket.second_coordinates,
    )  # fmt: skip


def _anchor(items: Sequence[DrawItem]) -> NDArray[np.float64]:
    """Center (3,) of the static items, world."""
    static = [item.center_m for item in items if item.object_index is None]
    if not static:
        return np.zeros(3)
    return 0.5 * (np.min(static, axis=0) + np.max(static, axis=0))


def _contained(
    items: Sequence[DrawItem], anchor_m: NDArray[np.float64], alone: Collection[int]
) -> NDArray[np.bool_]:
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
    bases = np.cumsum([0, *(len(item.mesh.positions) for item in items)]).tolist()
    parts = [
        (base, item.mesh, item.light_rectangles) for base, item in zip(bases, items, strict=False)
    ]
    return gpu_buffer(context, light_coordinates(parts, bases[-1]))
