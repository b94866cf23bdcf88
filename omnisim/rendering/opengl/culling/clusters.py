"""Clusters of triangles and their groups: a two-level hierarchy for culling."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.culling.spatial_clustering import spatial_clusters

# Triangles per cluster, see `spatial_clusters`. Smaller clusters are culled more tightly, but each
# has to be tested, and in a large scene most are invisible.
MAX_TRIANGLES, MIN_TRIANGLES, TRIANGLE_SPLIT_FACTOR = 64, 4, 8.0
LARGE_SCENE, MIN_TRIANGLES_IN_LARGE = 200_000, 24
# Each instance has its own triangles in clusters. Beyond this number of copies' triangles, further
# instances of a mesh are drawn one by one, as are instances that are too far away.
MAX_COPIED_TRIANGLES = 8_000_000
_BOUND_AT_ONCE = 1 << 18  # triangles; keeps intermediate arrays small
# Clusters per group. None is tested if its group is culled; the visible ones are the bits of a
# word.
MAX_CHILDREN, MIN_CHILDREN, GROUP_SPLIT_FACTOR = 32, 8, 8.0
WIDTHS = 17  # classes of the widths of clusters


class Clusters(NamedTuple):
    """Clusters of consecutive triangles.

    Attributes:
        first: (n,) first triangle.
        triangles: (n,) number of triangles.
        aabb_min, aabb_max: (n, 3) corners of the bounding boxes.
        cone_axes: (n, 3) unit, mean normal.
        cone_sines: (n,) sine of the largest angle between the axis and a normal; above 1 for angles
            of 90° or more.
        widths: (n,) side of a square as large as the mean triangle; reduced for clusters
            of many triangles, since a wall of two occludes more than a bush of twenty.
    """

    first: NDArray[np.int64]
    triangles: NDArray[np.int64]
    aabb_min: NDArray[np.float32]
    aabb_max: NDArray[np.float32]
    cone_axes: NDArray[np.float32]
    cone_sines: NDArray[np.float32]
    widths: NDArray[np.float32]


class ClusterGroups(NamedTuple):
    """Groups of consecutive clusters.

    Attributes:
        first: (n,) first cluster.
        children: (n,) number of clusters.
        aabb_min, aabb_max: (n, 3) corners of the bounding boxes.
    """

    first: NDArray[np.int64]
    children: NDArray[np.int64]
    aabb_min: NDArray[np.float32]
    aabb_max: NDArray[np.float32]


class ClusterHierarchy(NamedTuple):
    """Clusters of triangles and their groups.

    Attributes:
        order: (n,) triangle indices sorted by cluster.
        clusters: clusters of the triangles, sorted by group.
        groups: groups of consecutive clusters.
    """

    order: NDArray[np.uint32]
    clusters: Clusters
    groups: ClusterGroups


def build_clusters(
    corners: NDArray[np.float32], keys: NDArray[np.integer], group_keys: NDArray[np.integer]
) -> ClusterHierarchy:
    """Cluster triangles, and group the clusters.

    Args:
        corners: (n, 3, 3), one triangle's three corners per row.
        keys: (n,) from 0; a cluster's triangles have equal keys.
        group_keys: (n,) from 0; a group's triangles have equal keys, and so have triangles with
            equal `keys`. Groups are sorted by key.
    """
    min_triangles = MIN_TRIANGLES if len(corners) < LARGE_SCENE else MIN_TRIANGLES_IN_LARGE
    order, first = spatial_clusters(
        _bounds(corners), keys, min_triangles, MAX_TRIANGLES, TRIANGLE_SPLIT_FACTOR
    )
    clusters = _bound_in_order(corners, order, first, min_triangles)
    bounds = np.concatenate((-clusters.aabb_min.T, clusters.aabb_max.T))
    # clusters of similar width are drawn in the same pass
    widths = np.clip(np.frexp(clusters.widths)[1] // 2 + 8, 0, WIDTHS - 1)
    children, first_child = spatial_clusters(
        bounds, group_keys[order[first]] * WIDTHS + widths,
        MIN_CHILDREN, MAX_CHILDREN, GROUP_SPLIT_FACTOR,
    )  # fmt: skip
    order = order[ranges(first[children], clusters.triangles[children])]
    counts = clusters.triangles[children]
    clusters = Clusters(
        _firsts(counts), counts, clusters.aabb_min[children], clusters.aabb_max[children],
        clusters.cone_axes[children], clusters.cone_sines[children], clusters.widths[children],
    )  # fmt: skip
    groups = ClusterGroups(
        first_child, np.diff(first_child, append=len(children)),
        np.minimum.reduceat(clusters.aabb_min, first_child),
        np.maximum.reduceat(clusters.aabb_max, first_child),
    )  # fmt: skip
    return ClusterHierarchy(order.astype(np.uint32), clusters, groups)


def _firsts(count: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.cumsum(count) - count


def ranges(first: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Concatenated ranges of `count` (n,) consecutive numbers, each starting at `first` (n,)."""
    numbers = np.repeat(first - _firsts(count), count)
    numbers += np.arange(len(numbers))
    return numbers


def _bound_in_order(
    corners: NDArray[np.float32],
    order: NDArray[np.intp],
    first: NDArray[np.intp],
    min_triangles: int,
) -> Clusters:
    """Bound the clusters of triangles in an order, see `bound_clusters`."""
    ends = np.append(first, len(order))
    # the first cluster behind each multiple; two multiples may have the same
    splits = np.searchsorted(first, np.arange(0, len(order), _BOUND_AT_ONCE))
    parts = []
    for start, stop in pairwise(np.unique([*splits, len(first)]).tolist()):
        own = order[ends[start] : ends[stop]]
        part = bound_clusters(corners[own], first[start:stop] - first[start], min_triangles)
        parts.append(part._replace(first=first[start:stop]))
    return Clusters(*map(np.concatenate, zip(*parts, strict=True)))


def bound_clusters(
    corners: NDArray[np.float32], first: NDArray[np.intp], min_triangles: int = MIN_TRIANGLES
) -> Clusters:
    """Clusters of consecutive triangles, with their bounding boxes and normal cones.

    Args:
        corners: (n, 3, 3), one triangle's three corners per row.
        first: (m,) first triangle of each cluster.
        min_triangles: number of triangles above which a cluster's width is reduced.
    """
    count = np.diff(first, append=len(corners))
    bounds = np.maximum.reduceat(_bounds(corners), first, axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.sqrt(np.einsum("nc,nc->n", normals, normals))
    normals /= np.where(lengths > 0.0, lengths, 1.0)[:, None]
    axes = np.add.reduceat(normals, first)
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
    cosines = np.einsum("nc,nc->n", normals, np.repeat(axes, count, axis=0))
    cosines[lengths == 0.0] = 1.0  # a degenerate triangle is not drawn
    cosines = np.minimum.reduceat(cosines, first)
    sines = np.where(cosines > 0.0, np.sqrt(np.maximum(1.0 - cosines**2, 0.0)), 2.0)
    widths = np.sqrt(np.add.reduceat(0.5 * lengths, first) / count)
    widths *= np.minimum(min_triangles / count, 1.0) ** 0.25
    return Clusters(
        first, count, -bounds[:3].T, bounds[3:].T.copy(), axes,
        sines.astype(np.float32), widths.astype(np.float32),
    )  # fmt: skip


def _bounds(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Bounds (6, n) of triangles: negated minimum corners, then maximum corners."""
    bounds = np.empty((6, len(corners)), dtype=np.float32)
    for start in range(0, len(corners), _BOUND_AT_ONCE):
        own = slice(start, start + _BOUND_AT_ONCE)
        one, two, three = np.moveaxis(corners[own], 1, 0)
        np.negative(np.minimum(np.minimum(one, two), three).T, out=bounds[:3, own])
        bounds[3:, own] = np.maximum(np.maximum(one, two), three).T
    return bounds
