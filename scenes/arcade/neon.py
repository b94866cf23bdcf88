"""Neon: words of glowing tubes."""

from __future__ import annotations

import itertools

import numpy as np

from scenes.modeling.geometry import Patch, join, tube
from scenes.modeling.lettering import word_strokes

_RADIUS_M = 0.011
_TOLERANCE = 0.02  # of the letters' height, by which a tube may leave its stroke
_SHARP_DEG = 50.0


def neon_word(word: str, height: float) -> Patch:
    """Tubes of a word that faces -y, its middle at the origin."""
    parts = []
    for stroke in word_strokes(word, height):
        line = _thinned(np.array(stroke), _TOLERANCE * height)
        for piece in _between_corners(line):
            points = [(float(x), 0.0, float(z)) for x, z in piece]
            parts.append(tube(points, _RADIUS_M, 4))
    return join(parts)


def _thinned(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Polyline (n, 2) with fewer corners (Douglas and Peucker)."""
    first, last = points[0], points[-1]
    along = last - first
    length = np.hypot(*along)
    offsets = points - first
    if length < 1e-9:
        away = np.hypot(*offsets.T)
    else:
        away = np.abs(offsets[:, 0] * along[1] - offsets[:, 1] * along[0]) / length
    farthest = int(np.argmax(away))
    if away[farthest] <= tolerance:
        return np.array([first, last])
    before = _thinned(points[: farthest + 1], tolerance)
    return np.concatenate([before[:-1], _thinned(points[farthest:], tolerance)])


def _between_corners(line: np.ndarray) -> list[np.ndarray]:
    """Pieces of a polyline that turn gently."""
    steps = np.diff(line, axis=0)
    steps /= np.maximum(np.hypot(*steps.T), 1e-12)[:, None]
    cosines = np.einsum("ij,ij->i", steps[:-1], steps[1:])
    breaks = [0, *(np.flatnonzero(cosines < np.cos(np.radians(_SHARP_DEG))) + 1), len(line) - 1]
    return [line[a : b + 1] for a, b in itertools.pairwise(breaks)]
