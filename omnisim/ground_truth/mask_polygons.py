"""COCO polygons of masks, exact along pixel edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy  # loads its submodules on first use
from numpy.typing import NDArray

Loop = list[tuple[int, int]]  # corners (x, y)


def mask_from_runs(height: int, width: int, counts: Sequence[int]) -> NDArray[np.bool_]:
    """Mask (height, width) from COCO run lengths, column-major, starting with the background."""
    flat = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return flat.reshape(width, height).T


def polygons_of_mask(mask: NDArray[np.bool_]) -> list[list[float]]:
    """Polygons of a mask, one per region: x, y, x, y … in px from the image's top left corner.

    Pixels that share only a corner are in different regions. A polygon excludes a hole by a line to
    the hole and back.

    Args:
        mask: (height, width) mask.
    """
    regions, count = scipy.ndimage.label(mask)
    polygons: list[list[float]] = []
    for region, (rows, columns) in enumerate(scipy.ndimage.find_objects(regions), start=1):
        outer, *holes = _loops(regions[rows, columns] == region)
        start = outer[:1] if holes else []
        outer += start
        for hole in holes:
            outer += [*hole, hole[0], *start]
        corner = columns.start, rows.start
        polygons.append([float(value + offset) for point in outer
                         for value, offset in zip(point, corner, strict=True)])  # fmt: skip
    assert len(polygons) == count
    return polygons


def _loops(region: NDArray[np.bool_]) -> list[Loop]:
    """Loops around a region and its holes, outer loop first; the region is on their right."""
    edges = _edges(region)
    loops = []
    while edges:
        start = next(iter(edges))  # in the first remaining row
        point, direction = start, edges[start][0]
        loop: Loop = []
        while True:
            ways = edges[point]
            # where two pixels touch at a corner, turn right to stay on the same pixel
            turned = (-direction[1], direction[0])
            way = turned if turned in ways else ways[0]
            if way != direction or not loop:
                loop.append(point)
            ways.remove(way)
            if not ways:
                del edges[point]
            point, direction = (point[0] + way[0], point[1] + way[1]), way
            if point == start:
                break
        loops.append(loop)
    return loops


def _edges(region: NDArray[np.bool_]) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """Directions of the edges that start at each corner, row by row."""
    padded = np.pad(region, 1)
    inside = padded[1:-1, 1:-1]
    sides = (
        (padded[:-2, 1:-1], (0, 0), (1, 0)),  # top edge: from the left corner to the right
        (padded[1:-1, 2:], (1, 0), (0, 1)),
        (padded[2:, 1:-1], (1, 1), (-1, 0)),
        (padded[1:-1, :-2], (0, 1), (0, -1)),
    )
    directed = []
    for neighbor, (right, down), way in sides:
        rows, columns = np.nonzero(inside & ~neighbor)
        directed += [
            (y + down, x + right, way) for y, x in zip(rows.tolist(), columns.tolist(), strict=True)
        ]
    edges: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for y, x, way in sorted(directed):
        edges.setdefault((x, y), []).append(way)
    return edges
