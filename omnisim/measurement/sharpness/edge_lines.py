"""Approximate edges in an image: between the corners of a board, or all straight edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from omnisim.cameras.optics.boards.board_corners import BoardCorners
from omnisim.measurement.sharpness.edge_fit import MIN_LENGTH_PX, MIN_SLANT_DEG, EdgeLine, Floats

MAX_LENGTH_PX = 60.0  # longer ones are cut, so that each has one position in the field
MAX_EDGES = 120  # per image
_MIN_REACH_PX, _MAX_REACH_PX = 6.0, 20.0
_REACH = 0.4  # of the length of an edge: squares are as wide as long
_CORNER = 0.12  # share of a square's edge that its corners blur, at each end
_CORNER_PX = 1.5


def board_edges(board: BoardCorners) -> list[EdgeLine]:
    """Edges between neighboring corners of a board of squares."""
    tree = cKDTree(board.points_m)
    square_m = float(np.median(np.asarray(tree.query(board.points_m, k=[2])[0])))
    pairs = tree.query_pairs(1.2 * square_m)
    return [
        line
        for first, second in sorted(pairs)
        if (line := _between(board.pixels_px[first], board.pixels_px[second]))
    ]


def find_edges(light: Floats) -> list[EdgeLine]:
    """Straight edges in an image (height, width), slanted edges first, longer ones before shorter.

    Source: Grompone von Gioi et al., "LSD: a Line Segment Detector", IPOL, 2012.
    """
    import cv2

    top = float(np.percentile(light, 99.5))
    # dark edges are found as well as bright ones
    gray = np.sqrt(np.clip(light / max(top, 1e-6), 0.0, 1.0))
    found = cv2.createLineSegmentDetector().detect(np.rint(255.0 * gray).astype(np.uint8))[0]
    segments = np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(np.float64)
    along = np.abs(segments[:, 1] - segments[:, 0])
    lengths = np.hypot(along[:, 0], along[:, 1])
    is_straight = along.min(axis=1) < lengths * np.sin(np.radians(MIN_SLANT_DEG))
    edges: list[EdgeLine] = []
    for index in np.lexsort((-lengths, is_straight)).tolist():
        if lengths[index] >= MIN_LENGTH_PX:
            edges += _pieces(*segments[index])
    return edges[:MAX_EDGES]


def _pieces(start_px: Floats, end_px: Floats) -> list[EdgeLine]:
    length = float(np.hypot(*(end_px - start_px)))
    count = int(np.ceil(length / MAX_LENGTH_PX))
    ends = start_px + np.linspace(0.0, 1.0, count + 1)[:, None] * (end_px - start_px)
    pieces = (_between(ends[index], ends[index + 1]) for index in range(count))
    return [piece for piece in pieces if piece]


def _between(start_px: NDArray[np.float64], end_px: NDArray[np.float64]) -> EdgeLine | None:
    """Edge between two corners, shortened at both ends, where the corners blur; None: too short."""
    length = float(np.hypot(*(end_px - start_px)))
    cut = max(_CORNER, _CORNER_PX / max(length, 1e-9))
    if length * (1.0 - 2.0 * cut) <= 1.0:
        return None
    offset = cut * (end_px - start_px)
    reach = float(np.clip(_REACH * length, _MIN_REACH_PX, _MAX_REACH_PX))
    return EdgeLine(start_px + offset, end_px - offset, reach)
