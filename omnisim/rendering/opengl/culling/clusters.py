"""Clusters of triangles and their groups: a two-level hierarchy for culling."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats32, Indices, Ints, Uints32

# Triangles per cluster, see `spatial_clusters`. Smaller clusters are culled more tightly, but each
# has to be tested, and is a draw command. In a large scene most are invisible, and the triangles of
# the others are culled one by one.
MAX_TRIANGLES, MIN_TRIANGLES, TRIANGLE_SPLIT_FACTOR = 64, 4, 8.0
LARGE_SCENE, MIN_TRIANGLES_IN_LARGE = 80_000, 24
# Each instance has its own triangles in clusters. Beyond this number of copies' triangles, further
# instances of a mesh are drawn one by one, as are instances that are too far away.
MAX_COPIED_TRIANGLES = 8_000_000
# Maximum number of culled triangles that there is room for, and bytes of a triangle's corners.
MAX_ROOM, CORNERS_BYTES = 1 << 20, 16
_BOUND_AT_ONCE = 1 << 18  # triangles, or boxes; keeps intermediate arrays small
# Clusters per group. None is tested if its group is culled; the visible ones are the bits of a
# word.
MAX_CHILDREN, MIN_CHILDREN, GROUP_SPLIT_FACTOR = 32, 8, 8.0
WIDTHS = 17  # classes of the widths of clusters


class Clusters(NamedTuple):
    """Clusters of consecutive triangles."""

    first: Ints  # (n,) first triangle
    triangles: Ints  # (n,) number of triangles
    aabb_min: Floats32  # (n, 3) corners of the bounding boxes
    aabb_max: Floats32
    cone_axes: Floats32  # (n, 3) unit, mean normal
    # (n,) sine of the largest angle between the axis and a normal; above 1 for 90° or more
    cone_sines: Floats32
    # (n,) side of a square as large as the mean triangle; reduced for clusters of many triangles,
    # since a wall of two occludes more than a bush of twenty
    widths: Floats32


class ClusterGroups(NamedTuple):
    """Groups of consecutive clusters."""

    first: Ints  # (n,) first cluster
    children: Ints  # (n,) number of clusters
    aabb_min: Floats32  # (n, 3) corners of the bounding boxes
    aabb_max: Floats32


class ClusterHierarchy(NamedTuple):
    """Clusters of triangles and their groups."""

    order: Uints32  # (n,) triangle indices sorted by cluster
    clusters: Clusters  # clusters of the triangles, sorted by group
    groups: ClusterGroups  # groups of consecutive clusters


def build_clusters(
    corners: Floats32, keys: NDArray[np.integer], group_keys: NDArray[np.integer]
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
    ends, parts = np.append(first, len(order)), []
    # from the first cluster behind each multiple to the next; two multiples may have the same
    splits = np.searchsorted(first, np.arange(0, len(order), _BOUND_AT_ONCE))
    for start, stop in pairwise(np.unique([*splits, len(first)]).tolist()):
        own = order[ends[start] : ends[stop]]
        part = bound_clusters(corners[own], first[start:stop] - first[start], min_triangles)
        parts.append(part._replace(first=first[start:stop]))
    clusters = Clusters(*map(np.concatenate, zip(*parts, strict=True)))
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


def _firsts(count: Ints) -> Ints:
    return np.cumsum(count) - count


def ranges(first: Ints, count: Ints) -> Ints:
    """Concatenated ranges of `count` (n,) consecutive numbers, each starting at `first` (n,)."""
    numbers = np.repeat(first - _firsts(count), count)
    numbers += np.arange(len(numbers))
    return numbers


def bound_clusters(
    corners: Floats32, first: Indices, min_triangles: int = MIN_TRIANGLES
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


def _bounds(corners: Floats32) -> Floats32:
    """Bounds (6, n) of triangles: negated minimum corners, then maximum corners."""
    bounds = np.empty((6, len(corners)), dtype=np.float32)
    for start in range(0, len(corners), _BOUND_AT_ONCE):
        own = slice(start, start + _BOUND_AT_ONCE)
        one, two, three = np.moveaxis(corners[own], 1, 0)
        np.negative(np.minimum(np.minimum(one, two), three).T, out=bounds[:3, own])
        bounds[3:, own] = np.maximum(np.maximum(one, two), three).T
    return bounds


# Spatial clustering: sorts boxes so that neighbors are adjacent, and splits the order into runs.
#
# Boxes are sorted along a Morton curve. Its cells, each half of a larger one, are visited bottom
# up: two halves stay together if one box around both is hardly larger than a box around each.
# Source: cells of the curve as a tree, Lauterbach et al. 2009, "Fast BVH construction on GPUs";
# the surface area heuristic, Goldsmith & Salmon 1987, "Automatic creation of object hierarchies".
# Bits per axis; all that a code has if more boxes share a cell than a cluster may hold.
MORTON_BITS, MAX_MORTON_BITS = 12, 20
# Shifts and masks that spread a number's bits, so that the bits of two others fit in between.
_SPREAD_STEPS = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def spatial_clusters(
    bounds: Floats32, keys: NDArray[np.integer], min_size: int, max_size: int, split_factor: float
) -> tuple[Indices, Indices]:
    """Order boxes so that neighbors are adjacent, key by key, and split the order into clusters.

    Args:
        bounds: (6, n) negated minimum corners, then maximum corners. The maximum of several columns
            bounds all of their boxes.
        keys: (n,) from 0; a cluster's boxes have equal keys.
        min_size: cells with at most this many boxes are not split.
        max_size: maximum number of boxes per cluster.
        split_factor: split a cell if the best split divides surface area times content by this
            factor. Fewer clusters cost less to test; more clusters cull more tightly.

    Returns:
        The order (n,), and the position of each cluster's first box in it.
    """
    total = bounds.shape[1]
    order, codes, bits = _order(bounds, keys, MORTON_BITS)
    runs = np.flatnonzero(np.append(True, codes[1:] != codes[:-1]))
    if np.diff(runs, append=total).max() > max_size:
        keys = np.unique(keys, return_inverse=True)[1]  # leaves more bits for the codes
        order, codes, bits = _order(bounds, keys, MAX_MORTON_BITS)
    levels, last_level = _levels(codes, bits, min_size, max_size)
    first, levels = _merge_small_cells(levels, last_level, min_size)
    cell_bounds = np.stack([np.maximum.reduceat(bound[order], first) for bound in bounds])
    starts, counts = _merge_cells(
        cell_bounds, first, levels, total, last_level, max_size, split_factor
    )
    # merged boxes are not split after their first, whatever was merged before
    merged = np.bincount(starts + 1, minlength=total + 1)
    merged -= np.bincount(starts + counts, minlength=total + 1)
    first = first[np.cumsum(merged)[first] == 0]
    # split those that are too large
    parts = -(-np.diff(first, append=total) // max_size)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return order, np.repeat(first, parts) + max_size * number


def _levels(
    codes: NDArray[np.uint64], bits: int, min_size: int, max_size: int
) -> tuple[NDArray[np.int8], int]:
    """Level (n,) at which each box begins, by its sorted code; and the last level.

    It is the level of the smallest cell that a box shares with its predecessor. Boxes in the same
    smallest cell form runs of `min_size` and then `max_size`, which count as the lowest levels.
    """
    total, last_level = len(codes), 3 * bits + 1
    # the first box shares no cell, nor do boxes of different keys
    levels = np.full(total, last_level + 1, dtype=np.int8)
    for start in range(0, total - 1, _BOUND_AT_ONCE):
        some = codes[start : start + _BOUND_AT_ONCE + 1]
        differing = (some[1:] ^ some[:-1]).astype(np.float64)
        exponents = np.minimum(np.frexp(differing)[1] + 1, last_level + 1)
        levels[start + 1 : start + len(some)] = np.where(differing > 0.0, exponents, 0)
    numbers = np.arange(total, dtype=np.uint32)
    in_cell = numbers - np.maximum.accumulate(np.where(levels > 0, numbers, 0))
    for level, size in ((1, min_size), (2, max_size)):
        levels[(in_cell > 0) & (in_cell % size == 0)] = level
    return levels, last_level


def _merge_small_cells(
    levels: NDArray[np.int8], last_level: int, min_size: int
) -> tuple[Indices, NDArray[np.int8]]:
    """First box of each maximal cell of at most `min_size` boxes, and its first level."""
    first, total = np.arange(len(levels)), len(levels)
    for level in range(last_level + 1):
        heads = np.flatnonzero(levels > level)
        if len(heads) == len(levels):
            continue
        counts = np.diff(first[heads], append=total)
        stays = np.repeat(counts > min_size, np.diff(heads, append=len(levels)))
        stays[heads] = True
        if counts.min() > min_size:
            break
        first, levels = first[stays], levels[stays]
    return first, levels


def _merge_cells(
    bounds: Floats32,
    first: Indices,
    levels: NDArray[np.int8],
    total: int,
    last_level: int,
    max_size: int,
    split_factor: float,
) -> tuple[Indices, Indices]:
    """First box and size of each undivided cell, at any level: splitting it brings no gain.

    Args:
        bounds: (6, n) bounds of small cells, in order.
        first: (n,) first box of each small cell.
        levels: (n,) level at which each small cell begins.
        total: number of boxes.
        last_level: highest level.
        max_size, split_factor: see `spatial_clusters`.
    """
    counts = np.diff(first, append=total)
    costs = _half_areas(bounds) * counts
    starts, sizes = [first[:0]], [counts[:0]]
    for level in range(last_level + 1):
        heads = np.flatnonzero(levels > level)
        if len(heads) == len(levels):
            continue
        children = np.diff(heads, append=len(levels))
        bounds = np.maximum.reduceat(bounds, heads, axis=1)
        counts, costs = np.add.reduceat(counts, heads), np.add.reduceat(costs, heads)
        first, levels = first[heads], levels[heads]
        whole = _half_areas(bounds) * counts
        better = (children > 1) & (counts <= max_size) & (whole <= split_factor * costs)
        costs = np.minimum(whole, costs)
        starts.append(first[better])
        sizes.append(counts[better])
        if counts.min() > max_size:
            break
    return np.concatenate(starts), np.concatenate(sizes)


def _order(
    bounds: Floats32, keys: NDArray[np.integer], max_bits: int
) -> tuple[Indices, NDArray[np.uint64], int]:
    """Order of boxes (6, n) by key and Morton code, the sorted codes, and bits per axis."""
    bits = min(max_bits, (64 - int(keys.max()).bit_length()) // 3)
    codes = keys.astype(np.uint64)
    codes <<= np.uint64(3 * bits)
    slices = [slice(at, at + _BOUND_AT_ONCE) for at in range(0, bounds.shape[1], _BOUND_AT_ONCE)]
    centers = [0.5 * (bounds[3:, own] - bounds[:3, own]) for own in slices]
    starts = np.min([center.min(axis=1) for center in centers], axis=0)
    ends = np.max([center.max(axis=1) for center in centers], axis=0)
    scale = ((1 << bits) - 1) / max(float((ends - starts).max()), 1e-9)
    for own, some in zip(slices, centers, strict=True):
        for axis in range(3):
            cell = ((some[axis] - starts[axis]) * scale).astype(np.uint64)
            for shift, mask in _SPREAD_STEPS:
                cell |= cell << np.uint64(shift)
                cell &= np.uint64(mask)
            codes[own] |= cell << np.uint64(axis)
    order = np.argsort(codes, kind="stable")
    return order, codes[order], bits


def _half_areas(bounds: Floats32) -> Floats32:
    """Half the surface area (n,) of boxes (6, n)."""
    x, y, z = bounds[:3] + bounds[3:]
    return x * y + y * z + z * x
