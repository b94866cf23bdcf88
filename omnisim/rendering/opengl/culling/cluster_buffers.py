"""GPU buffers of clusters and their groups, laid out as in shaders/culling/views.glsl."""

from __future__ import annotations

from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.culling.clusters import ClusterHierarchy
from omnisim.rendering.opengl.gl.buffers import gpu_buffer
from omnisim.rendering.opengl.gl.gpu_textures import texture_2d
from omnisim.rendering.opengl.gl.shader_files import build_compute_shader

# Texture of bounds: entries of four words, see shaders/culling/bounds.glsl.
_GROUP = np.dtype(
    [
        ("aabb_min", "<f4", 3),
        ("first_cluster", "<u4"),
        ("aabb_max", "<f4", 3),
        ("object", "<u4"),
    ]
)
_CLUSTER = np.dtype(
    [
        ("aabb_min", "<f4", 3),
        ("width", "<f4"),
        ("aabb_max", "<f4", 3),
        ("unused", "<u4"),
        ("cone_axis", "<f4", 3),
        ("cone_sine", "<f4"),
    ]
)
_BLOCK = np.dtype(
    [
        ("aabb_min", "<f4", 3),
        ("first_group", "<u4"),
        ("aabb_max", "<f4", 3),
        ("groups", "<u4"),
    ]
)
_MAX_GROUPS = 8  # per block: software drivers test eight blocks at once
_ENTRY, _ROW = np.dtype("<u4, <u4, <u4, <u4"), 1 << 12  # entries per row
# Texture units that no drawing program uses: its own textures stay bound during culling.
DEPTH_UNIT, BOUNDS_UNIT = 16, 17


class CullingShaders:
    """Compute shaders of culling, each compiled when it is first needed.

    Args:
        context: OpenGL context.
    """

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._cull: dict[int, moderngl.ComputeShader] = {}

    @cached_property
    def instances(self) -> moderngl.ComputeShader:
        """Shader that writes the matrices of objects in views."""
        return build_compute_shader(self._context, "culling/instances.comp")

    @cached_property
    def groups(self) -> moderngl.ComputeShader:
        """Shader that culls groups; remaining groups become candidates of the first pass."""
        return self._with_bounds("groups.comp")

    def cull(self, number: int) -> moderngl.ComputeShader:
        """Shader that culls clusters in the only pass (0), the first (1) or a later one (2)."""
        if number not in self._cull:
            self._cull[number] = self._with_bounds("cull.comp", f"PASS {number}")
        return self._cull[number]

    @cached_property
    def commands(self) -> moderngl.ComputeShader:
        """Shader that writes the draw commands of visible clusters."""
        return self._with_bounds("commands.comp")

    @cached_property
    def hi_z(self) -> tuple[moderngl.ComputeShader, moderngl.ComputeShader]:
        """Shaders of hierarchical depth between two passes, for fine and coarse levels."""
        return self._hi_z()

    @cached_property
    def layered_hi_z(self) -> tuple[moderngl.ComputeShader, moderngl.ComputeShader]:
        """Shaders of hierarchical depth for cameras with one layer each."""
        return self._hi_z("LAYERED")

    def _with_bounds(self, name: str, *defines: str) -> moderngl.ComputeShader:
        shader = build_compute_shader(self._context, f"culling/{name}", defines)
        shader["u_bounds"] = BOUNDS_UNIT
        return shader

    def _hi_z(self, *defines: str) -> tuple[moderngl.ComputeShader, moderngl.ComputeShader]:
        fine = build_compute_shader(self._context, "culling/hi_z.comp", defines)
        fine["u_atlas_depth"] = DEPTH_UNIT
        return fine, build_compute_shader(self._context, "culling/hi_z.comp", ("COARSE", *defines))


class ClusterBuffers:
    """Cluster buffers that all cameras share.

    Args:
        context: OpenGL context.
        hierarchy: clusters and groups.
        double_sided: (clusters,) draw back faces, too.
        objects: (groups,) index of each group's object.
        buckets: (groups,) bucket of each group, ascending.

    Attributes:
        index_ranges: buffer with the first index of each cluster and its number of indices.
        bounds: texture of the groups' bounds, then the clusters', then the blocks'.
        clusters_of_group: (groups,) number of clusters per group.
        groups_of_bucket: (buckets,) number of groups per bucket.
        cluster_count, group_count, block_count: total numbers.
    """

    def __init__(
        self,
        context: moderngl.Context,
        hierarchy: ClusterHierarchy,
        double_sided: NDArray[np.bool_],
        objects: NDArray[np.intp],
        buckets: NDArray[np.intp],
    ):
        self._context = context
        clusters, groups = hierarchy.clusters, hierarchy.groups
        self.cluster_count, self.group_count = len(clusters.first), len(groups.first)
        self._first = groups.first
        group = np.repeat(np.arange(self.group_count), groups.children)
        self._bits = np.uint32(1) << (np.arange(self.cluster_count) - groups.first[group]).astype(
            np.uint32
        )
        index_ranges = np.stack((3 * clusters.first, 3 * clusters.triangles), axis=1)
        self.index_ranges = gpu_buffer(context, index_ranges.astype("<u4"))
        of_groups = np.zeros(self.group_count, dtype=_GROUP)
        of_groups["first_cluster"], of_groups["object"] = groups.first, objects
        of_clusters = np.zeros(self.cluster_count, dtype=_CLUSTER)
        for name in ("aabb_min", "aabb_max"):
            of_groups[name], of_clusters[name] = getattr(groups, name), getattr(clusters, name)
        of_clusters["width"], of_clusters["cone_axis"] = clusters.widths, clusters.cone_axes
        of_clusters["cone_sine"] = np.where(double_sided, np.float32(2.0), clusters.cone_sines)
        of_blocks = _blocks(of_groups, buckets)
        self.block_count = len(of_blocks)
        entries = [one.view(_ENTRY) for one in (of_groups, of_clusters, of_blocks)]
        self.bounds = _table(context, np.concatenate(entries))
        self.clusters_of_group, self.groups_of_bucket = groups.children, np.bincount(buckets)
        self.all_shown = self.masks_of_groups(np.ones(self.cluster_count, dtype=np.bool_))

    def masks_of_groups(self, clusters: NDArray[np.bool_]) -> NDArray[np.uint32]:
        """Bit mask per group (groups,) of the selected clusters (clusters,)."""
        bits = np.where(clusters, self._bits, np.uint32(0))
        return np.bitwise_or.reduceat(bits, self._first).astype("<u4")

    @cached_property
    def shaders(self) -> CullingShaders:
        """Shaders of all cullers."""
        return CullingShaders(self._context)


def _blocks(groups: NDArray[np.void], buckets: NDArray[np.intp]) -> NDArray[np.void]:
    """Blocks of consecutive groups of one object and bucket, which mostly are neighbors."""
    numbers = np.arange(len(groups))
    keys = np.stack((groups["object"], buckets))
    starts_run = np.append(True, (keys[:, 1:] != keys[:, :-1]).any(axis=0))
    start_of_run = np.maximum.accumulate(np.where(starts_run, numbers, 0))
    first = np.flatnonzero((numbers - start_of_run) % _MAX_GROUPS == 0)
    blocks = np.zeros(len(first), dtype=_BLOCK)
    blocks["first_group"], blocks["groups"] = first, np.diff(first, append=len(groups))
    blocks["aabb_min"] = np.minimum.reduceat(groups["aabb_min"], first)
    blocks["aabb_max"] = np.maximum.reduceat(groups["aabb_max"], first)
    return blocks


def _table(context: moderngl.Context, entries: NDArray[np.void]) -> moderngl.Texture:
    """Texture that holds entries row by row."""
    rows = max(1, -(-len(entries) // _ROW))
    padded = np.zeros(rows * _ROW, dtype=_ENTRY)
    padded[: len(entries)] = entries
    return texture_2d(context, (_ROW, rows), 4, padded, dtype="u4")
