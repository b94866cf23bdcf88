"""Clusters of triangles, and a hierarchy of cluster groups: what culling tests, node by node."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.culling.spatial_clustering import spatial_clusters

# Triangles of a cluster, see `spatial_clusters`. Smaller clusters are culled more tightly, but each
# has to be tested.
MAX_TRIANGLES, MIN_TRIANGLES, TRIANGLE_SPLIT_FACTOR = 64, 4, 8.0
# Likewise, children of a cluster group: none is tested where the group is culled. Groups are put
# into groups until there are so few of them, but not forever.
MAX_CHILDREN, MIN_CHILDREN, GROUP_SPLIT_FACTOR = 32, 8, 8.0
MAX_ROOTS, MAX_LEVELS = 500, 3


class Clusters(NamedTuple):
    """Clusters of consecutive triangles.

    Attributes:
        first: (n,) first triangle.
        triangles: (n,) how many.
        aabb_min, aabb_max: (n, 3) corners of their bounding boxes.
        cone_axes: (n, 3) unit, mean normal.
        cone_sines: (n,) sine of the largest angle between the axis and a normal; above 1 where that
            is a right angle or more.
        widths: (n,) side of a square as large as their mean triangle; less where they are many: a
            wall of two occludes more than a bush of twenty.
    """

    first: NDArray[np.int64]
    triangles: NDArray[np.int64]
    aabb_min: NDArray[np.float32]
    aabb_max: NDArray[np.float32]
    cone_axes: NDArray[np.float32]
    cone_sines: NDArray[np.float32]
    widths: NDArray[np.float32]


class ClusterGroups(NamedTuple):
    """Nodes of a bounding volume hierarchy, of consecutive children, whatever their materials.

    Attributes:
        first: (n,) first child: a cluster, or a smaller group.
        children: (n,) how many.
        triangles: (n,) of all of them.
        aabb_min, aabb_max: (n, 3) corners of their bounding boxes.
        widths: (n,) the largest of their clusters.
    """

    first: NDArray[np.int64]
    children: NDArray[np.int64]
    triangles: NDArray[np.int64]
    aabb_min: NDArray[np.float32]
    aabb_max: NDArray[np.float32]
    widths: NDArray[np.float32]


class ClusterHierarchy(NamedTuple):
    """Clusters of triangles, and the groups above them.

    Attributes:
        order: (n,) of the triangles, by cluster.
        clusters: by group.
        cluster_groups: of clusters, then of groups of clusters, ...; each ordered by the next.
    """

    order: NDArray[np.intp]
    clusters: Clusters
    cluster_groups: tuple[ClusterGroups, ...]


def build_clusters(corners: NDArray[np.float32], batches: NDArray[np.integer]) -> ClusterHierarchy:
    """Cluster triangles of one material batch each, and group the clusters.

    Args:
        corners: (n, 3, 3), a triangle's three in a row.
        batches: (n,) from 0.
    """
    order, first = spatial_clusters(
        _bounds(corners), batches, MIN_TRIANGLES, MAX_TRIANGLES, TRIANGLE_SPLIT_FACTOR
    )
    clusters = bound_clusters(corners[order], first)
    counts = [clusters.triangles]
    numbers = np.arange(len(first))  # of the clusters, as they follow each other in the end
    bounds = np.concatenate((-clusters.aabb_min.T, clusters.aabb_max.T))
    # wide clusters are drawn first, and their groups are visited before others
    keys = np.clip(np.frexp(clusters.widths)[1] // 2 + 8, 0, 16)
    for _ in range(MAX_LEVELS):
        total = len(first)
        children, first = spatial_clusters(
            bounds, keys, MIN_CHILDREN, MAX_CHILDREN, GROUP_SPLIT_FACTOR
        )
        bounds = np.maximum.reduceat(bounds[:, children], first, axis=1)
        keys = np.zeros(len(first), dtype=np.int64)
        # the levels below follow
        for level in reversed(range(len(counts))):
            count = counts[level]
            counts[level] = count[children]
            if level == 0:
                numbers = numbers[children]
            children = ranges(_firsts(count)[children], count[children])
        order = order[children]
        counts.append(np.diff(first, append=total))
        if len(first) <= MAX_ROOTS:
            break
    clusters = Clusters(
        _firsts(counts[0]), counts[0], clusters.aabb_min[numbers], clusters.aabb_max[numbers],
        clusters.cone_axes[numbers], clusters.cone_sines[numbers], clusters.widths[numbers],
    )  # fmt: skip
    groups: list[ClusterGroups] = []
    for children in counts[1:]:
        below, first = (groups[-1] if groups else clusters), _firsts(children)
        groups.append(
            ClusterGroups(
                first, children, np.add.reduceat(below.triangles, first),
                np.minimum.reduceat(below.aabb_min, first),
                np.maximum.reduceat(below.aabb_max, first),
                np.maximum.reduceat(below.widths, first),
            )
        )  # fmt: skip
    return ClusterHierarchy(order, clusters, tuple(groups))


def _firsts(count: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.cumsum(count) - count


def ranges(first: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.int64]:
    """Ranges of `count` consecutive numbers from each of `first` on, concatenated."""
    numbers = np.repeat(first - _firsts(count), count)
    numbers += np.arange(len(numbers))
    return numbers


def bound_clusters(corners: NDArray[np.float32], first: NDArray[np.intp]) -> Clusters:
    """Clusters of consecutive triangles, with their bounding boxes and normal cones.

    Args:
        corners: (n, 3, 3), a triangle's three in a row.
        first: (m,) first triangle of each cluster.
    """
    count = np.diff(first, append=len(corners))
    bounds = np.maximum.reduceat(_bounds(corners), first, axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.sqrt(np.einsum("nc,nc->n", normals, normals))
    normals /= np.where(lengths > 0.0, lengths, 1.0)[:, None]
    axes = np.add.reduceat(normals, first)
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
    cosines = np.einsum("nc,nc->n", normals, np.repeat(axes, count, axis=0))
    cosines[lengths == 0.0] = 1.0  # a triangle without an area is not drawn
    cosines = np.minimum.reduceat(cosines, first)
    sines = np.where(cosines > 0.0, np.sqrt(np.maximum(1.0 - cosines**2, 0.0)), 2.0)
    widths = np.sqrt(np.add.reduceat(0.5 * lengths, first) / count)
    widths *= np.minimum(MIN_TRIANGLES / count, 1.0) ** 0.25
    return Clusters(
        first, count, -bounds[:3].T, bounds[3:].T.copy(), axes,
        sines.astype(np.float32), widths.astype(np.float32),
    )  # fmt: skip


def _bounds(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Least corners of the boxes around triangles times −1, then the largest: (6, n)."""
    one, two, three = np.moveaxis(corners, 1, 0)
    bounds = np.empty((6, len(corners)), dtype=np.float32)
    np.negative(np.minimum(np.minimum(one, two), three).T, out=bounds[:3])
    bounds[3:] = np.maximum(np.maximum(one, two), three).T
    return bounds
