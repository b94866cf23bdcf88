"""Static geometry: instances that do not move, in the world's axes, as clusters of one material.

The scene's draw items have matrices of their own: hundreds of draw calls a tile, each culled as a
whole. Here instances of one material are one batch of geometry, of which a tile draws the clusters
that it sees, with one call: their indices are put together anew in every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.clusters import ClusterHierarchy, Clusters, build_clusters, ranges
from omnisim.gpu.scene.draw_item import DrawItem
from omnisim.gpu.scene.light_baking import Shading, bake_directional_light, shadings
from omnisim.gpu.scene.vertex_format import VERTEX, fill_vertices
from omnisim.scene.model import AlphaMode, Lighting, Material

# Each instance has its own copy here: one that would take more triangles than this is drawn on its
# own, as are instances so far away that a float32 does not resolve a tenth of a millimetre there.
MAX_TRIANGLES = 8_000_000
MAX_DISTANCE_M = 1500.0
# Of white: a third of a step of 255 in the dark, where these are finest, a hundredth at white.
_SAME_LIGHT = 1e-4
TRIANGLE = np.dtype([("vertices", "<u4", 3)])  # moved as a whole


class MaterialBatch(NamedTuple):
    """Material and shading that clusters of one draw call share.

    Attributes:
        material, texture: bound for them.
        shading: of their triangles.
        number: into `StaticGeometry.batches`.
    """

    material: Material
    texture: moderngl.Texture
    shading: Shading
    number: int


@dataclass(frozen=True, eq=False)
class StaticGeometry:
    """Static instances of opaque and masked materials, see `build_static_geometry`.

    Attributes:
        batches: materials of the clusters.
        anchor_m: (3,) float64, origin of the positions, world.
        hierarchy: clusters of one batch each, counted from the anchor; its order is of the
            triangles of all contained draw items.
        batch_of_cluster: (n,).
        contains: (items,), mask of the scene's draw items.
        vertices: buffer of `VERTEX`.
        item_of_triangle: (m,) draw item of each, likewise.
        triangles: (m,) of `TRIANGLE`, cluster by cluster; those of hidden items have no area.
    """

    batches: tuple[MaterialBatch, ...]
    anchor_m: NDArray[np.float64]
    hierarchy: ClusterHierarchy
    batch_of_cluster: NDArray[np.intp]
    contains: NDArray[np.bool_]
    vertices: moderngl.Buffer
    item_of_triangle: NDArray[np.int32]
    triangles: NDArray[np.void]

    @cached_property
    def _all_triangles(self) -> NDArray[np.void]:
        return self.triangles.copy()

    def show(self, shown: NDArray[np.bool_]) -> None:
        """Show some of the draw items (items,), and no others."""
        is_shown = shown[self.item_of_triangle]
        np.copyto(self.triangles, self._all_triangles)
        self.triangles[~is_shown] = 0

    @property
    def clusters(self) -> Clusters:
        """Clusters of the hierarchy."""
        return self.hierarchy.clusters

    def triangles_of(self, clusters: NDArray[np.intp]) -> NDArray[np.int64]:
        """Numbers (n,) of the triangles of clusters, in their order."""
        return ranges(self.clusters.first[clusters], self.clusters.triangles[clusters])


def build_static_geometry(
    context: moderngl.Context, items: Sequence[DrawItem], lighting: Lighting
) -> StaticGeometry | None:
    """Build the static geometry of a scene; None where nothing is static.

    Args:
        context: where.
        items: all draw items.
        lighting: of the scene.
    """
    anchor_m = _anchor(items)
    contains = _contained(items, anchor_m)
    items = [item for item, is_contained in zip(items, contains, strict=True) if is_contained]
    if not items:
        return None
    item_of_triangle = np.repeat(np.arange(len(items)), [item.triangles for item in items])
    vertices, triangles = _world_triangles(items, anchor_m)
    corners = vertices["in_position"][triangles]
    shading, normals = shadings(vertices, triangles, lighting)
    # both sides are seen, or no light: what is known of a front is of no use
    ignores = [item.material.double_sided or item.material.unlit for item in items]
    shading[np.array(ignores)[item_of_triangle]] = Shading.UNKNOWN.value
    baked = shading == Shading.BAKED.value
    lights = bake_directional_light(normals[baked], lighting)
    vertices, triangles[baked] = _bake(vertices, triangles, baked, lights)
    batches, batch_of_triangle = _material_batches(items, len(Shading) * item_of_triangle + shading)
    hierarchy = build_clusters(corners, batch_of_triangle)
    return StaticGeometry(
        batches=batches,
        anchor_m=anchor_m,
        hierarchy=hierarchy,
        batch_of_cluster=batch_of_triangle[hierarchy.order[hierarchy.clusters.first]],
        contains=contains,
        vertices=context.buffer(vertices),
        item_of_triangle=np.flatnonzero(contains)[item_of_triangle[hierarchy.order]].astype(
            np.int32
        ),
        triangles=triangles[hierarchy.order].astype("<u4").view(TRIANGLE)[:, 0],
    )


def _material_batches(
    items: Sequence[DrawItem], kinds: NDArray[np.intp]
) -> tuple[tuple[MaterialBatch, ...], NDArray[np.intp]]:
    """Batches of triangles (n,), by item times the number of shadings plus shading, and of each."""
    batches: dict[tuple[object, ...], MaterialBatch] = {}
    batch_of_kind = np.zeros(len(Shading) * len(items), dtype=np.intp)
    for kind in np.flatnonzero(np.bincount(kinds)).tolist():
        item, shading = items[kind // len(Shading)], Shading(kind % len(Shading))
        material = item.material
        cutoff = material.alpha_cutoff if material.alpha_mode is AlphaMode.MASK else None
        key = (
            item.texture.glo, material.base_color, material.alpha_mode, cutoff,
            material.double_sided, material.unlit, shading,
        )  # fmt: skip
        batch = MaterialBatch(material, item.texture, shading, len(batches))
        batch_of_kind[kind] = batches.setdefault(key, batch).number
    return tuple(batches.values()), batch_of_kind[kinds]


def _anchor(items: Sequence[DrawItem]) -> NDArray[np.float64]:
    """Middle (3,) of the static items, world."""
    static = [item.centre_m for item in items if item.object_index is None]
    if not static:
        return np.zeros(3)
    middle: NDArray[np.float64] = 0.5 * (np.min(static, axis=0) + np.max(static, axis=0))
    return middle


def _contained(items: Sequence[DrawItem], anchor_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    contained = np.zeros(len(items), dtype=np.bool_)
    triangles = 0
    for index, item in enumerate(items):
        # a mesh without triangles has no cluster
        fits = item.triangles and triangles + item.triangles <= MAX_TRIANGLES
        far_m = np.linalg.norm(item.centre_m - anchor_m) + item.radius_m
        is_static = item.object_index is None and not item.is_blended
        if is_static and fits and far_m <= MAX_DISTANCE_M:
            triangles += item.triangles
            contained[index] = True
    return contained


def _world_triangles(
    items: Sequence[DrawItem], anchor_m: NDArray[np.float64]
) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Vertices (n,) in the world's axes, origin at the anchor, and triangles (m, 3), item by item,
    all wound the same way."""  # fmt: skip
    vertices = np.zeros(sum(len(item.mesh.positions) for item in items), dtype=VERTEX)
    triangles = []
    base = 0
    for item in items:
        mesh, matrix = item.mesh, item.object_from_mesh
        part = vertices[base : base + len(mesh.positions)]
        fill_vertices(part, mesh)
        part["in_position"] = mesh.positions @ matrix[:3, :3].T + (matrix[:3, 3] - anchor_m)
        if mesh.normals is not None:
            part["in_normal"] = mesh.normals @ item.normal_from_mesh.T
        own = mesh.triangles[:, (0, 2, 1)] if item.flips_winding else mesh.triangles
        triangles.append(own + np.uint32(base))
        base += len(part)
    return vertices, np.concatenate(triangles)


def _bake(
    vertices: NDArray[np.void],
    triangles: NDArray[np.uint32],
    baked: NDArray[np.bool_],
    lights: NDArray[np.float32],
) -> tuple[NDArray[np.void], NDArray[np.uint32]]:
    """Bake lights (k, 3) into the vertices of the triangles that `baked` (m,) marks.

    Returns:
        The vertices, and copies of those that have two lights, or light and a normal; and the
        baked triangles (k, 3).
    """
    own = triangles[baked].ravel()
    lights = np.repeat(lights, 3, axis=0)
    light_at_vertex = np.zeros((len(vertices), 3), dtype=np.float32)
    light_at_vertex[own] = lights  # one of all that share the vertex
    light_at_vertex[triangles[~baked].ravel()] = np.inf  # it has to keep its normal
    fits = (np.abs(np.take(light_at_vertex, own, axis=0) - lights) < _SAME_LIGHT).all(axis=1)
    fitting = own[fits]
    vertices["in_normal"][fitting] = np.take(light_at_vertex, fitting, axis=0)
    if fits.all():
        return vertices, own.reshape(-1, 3)
    copies = vertices[own[~fits]]
    copies["in_normal"] = lights[~fits]
    own[~fits] = np.arange(len(vertices), len(vertices) + len(copies))
    return np.concatenate((vertices, copies)), own.reshape(-1, 3)
