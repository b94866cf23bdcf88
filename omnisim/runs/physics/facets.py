"""Facets of a surface: its triangles merged into planar convex polygons."""

from __future__ import annotations

import numpy as np
import scipy  # its submodules load when first used
from numpy.typing import NDArray

from omnisim.runs.physics.hulls import convex_hull

FLAT_SINE = 0.01  # maximum sine between normals of one facet: half a degree
AREA_SLACK = 1e-3  # relative area by which a hull may exceed its convex polygon

Triangles = NDArray[np.intp]  # (n, 3) indices of vertices


def area_vectors(corners_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals (n, 3) of triangles (n, 3, 3), scaled by their areas."""
    edges = corners_m[:, 1:] - corners_m[:, :1]
    vectors: NDArray[np.float64] = 0.5 * np.cross(edges[:, 0], edges[:, 1])
    return vectors


def connected_parts(triangles: Triangles, vertex_count: int) -> list[Triangles]:
    """Triangles of each connected part; triangles that share a vertex are connected."""
    links = triangles[:, (0, 1)], triangles[:, (1, 2)]
    rows, columns = (np.concatenate(each) for each in zip(*(link.T for link in links), strict=True))
    return _grouped(triangles, _components(rows, columns, vertex_count)[triangles[:, 0]])


def convex_facets(vertices_m: NDArray[np.float64], triangles: Triangles) -> list[Triangles]:
    """Triangles of each facet: merged across shared edges while flat and convex."""
    flat = _joined(vertices_m, triangles) if len(triangles) else []
    return [facet for region in flat for facet in _convex(vertices_m, region)]


def _joined(vertices_m: NDArray[np.float64], triangles: Triangles) -> list[Triangles]:
    """Triangles of each flat region."""
    normals = area_vectors(vertices_m[triangles])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    first, second = _neighbors(triangles)
    flat = np.einsum("ni,ni->n", normals[first], normals[second]) > np.sqrt(1.0 - FLAT_SINE**2)
    numbers = _components(first[flat], second[flat], len(triangles))
    return _grouped(triangles, numbers)


def _convex(vertices_m: NDArray[np.float64], region: Triangles) -> list[Triangles]:
    """Convex polygons of a flat region, grown one triangle at a time.

    Source: Hertel and Mehlhorn, "Fast triangulation of simple polygons" (1983): a triangulation
    without its inessential edges; here in one sweep, edge by edge.
    """
    if len(region) == 1 or _is_convex(vertices_m, region):
        return [region]
    owner = np.arange(len(region))
    members = {k: [k] for k in range(len(region))}
    for first, second in zip(*(each.tolist() for each in _neighbors(region)), strict=True):
        a, b = int(owner[first]), int(owner[second])
        if a == b:
            continue
        both = members[a] + members[b]
        if _is_convex(vertices_m, region[both]):
            owner[members[b]] = a
            members[a] = both
            del members[b]
    return [region[rows] for rows in members.values()]


def _is_convex(vertices_m: NDArray[np.float64], region: Triangles) -> bool:
    """True if a flat region's area equals that of its hull."""
    vectors = area_vectors(vertices_m[region])
    normal = vectors.sum(axis=0)
    area = float(np.linalg.norm(normal))
    points = vertices_m[np.unique(region)]
    axes = np.linalg.svd(normal[None])[2][1:]  # two axes perpendicular to the normal
    hull = convex_hull(points @ axes.T)
    return hull is None or bool(hull.volume <= area * (1.0 + AREA_SLACK))


def _neighbors(triangles: Triangles) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of triangles that share an edge: two index arrays (pairs,), ordered by edge."""
    edges = np.sort(triangles[:, ((0, 1), (1, 2), (2, 0))].reshape(-1, 2), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = np.flatnonzero(np.all(edges[order[1:]] == edges[order[:-1]], axis=1))
    return order[same] // 3, order[same + 1] // 3


def _components(first: NDArray[np.intp], second: NDArray[np.intp], count: int) -> NDArray[np.int32]:
    """Component number (count,) of each node in a graph of `count` nodes."""
    links = scipy.sparse.coo_matrix((np.ones(len(first)), (first, second)), (count, count))
    numbers: NDArray[np.int32] = scipy.sparse.csgraph.connected_components(links, directed=False)[1]
    return numbers


def _grouped(triangles: Triangles, numbers: NDArray[np.int32]) -> list[Triangles]:
    """Triangles grouped by their numbers."""
    order = np.argsort(numbers, kind="stable")
    ends = np.flatnonzero(np.diff(numbers[order])) + 1
    return np.split(triangles[order], ends)
