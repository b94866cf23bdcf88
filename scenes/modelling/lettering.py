"""Block capitals drawn as thick strokes, so that the scene needs no font file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import ImageDraw

Point = tuple[float, float]


def _arc(cx: float, cy: float, rx: float, ry: float, start: float, end: float) -> list[Point]:
    angles = np.radians(np.linspace(start, end, 25))
    return [(cx + rx * np.cos(a), cy + ry * np.sin(a)) for a in angles]


# Centre lines in a box one unit high, x to the right, y up; strokes of one letter may cross.
_STROKES: dict[str, tuple[float, list[list[Point]]]] = {
    " ": (0.20, []),
    "A": (0.74, [[(0, 0), (0.37, 1), (0.74, 0)], [(0.14, 0.34), (0.60, 0.34)]]),
    "B": (
        0.62,
        [
            [(0, 0), (0, 1), (0.30, 1), *_arc(0.32, 0.76, 0.26, 0.24, 90, -90), (0, 0.52)],
            [(0.30, 0.52), *_arc(0.34, 0.26, 0.28, 0.26, 90, -90), (0, 0)],
        ],
    ),
    "C": (0.72, [_arc(0.41, 0.5, 0.41, 0.5, 45, 315)]),
    "D": (0.70, [[(0, 0), (0, 1), *_arc(0.28, 0.5, 0.42, 0.5, 90, -90), (0, 0)]]),
    "E": (0.58, [[(0.58, 1), (0, 1), (0, 0), (0.58, 0)], [(0, 0.52), (0.48, 0.52)]]),
    "G": (0.80, [[*_arc(0.41, 0.5, 0.41, 0.5, 45, 340), (0.80, 0.44), (0.48, 0.44)]]),
    "H": (0.70, [[(0, 0), (0, 1)], [(0.70, 0), (0.70, 1)], [(0, 0.5), (0.70, 0.5)]]),
    "I": (0.0, [[(0, 0), (0, 1)]]),
    "K": (0.66, [[(0, 0), (0, 1)], [(0.64, 1), (0, 0.40)], [(0.20, 0.58), (0.66, 0)]]),
    "L": (0.54, [[(0, 1), (0, 0), (0.54, 0)]]),
    "M": (0.86, [[(0, 0), (0, 1), (0.43, 0.3), (0.86, 1), (0.86, 0)]]),
    "N": (0.72, [[(0, 0), (0, 1), (0.72, 0), (0.72, 1)]]),
    "O": (0.82, [_arc(0.41, 0.5, 0.41, 0.5, 0, 360)]),
    "P": (0.61, [[(0, 0), (0, 1), *_arc(0.34, 0.745, 0.27, 0.255, 90, -90), (0, 0.49)]]),
    "R": (
        0.64,
        [
            [(0, 0), (0, 1), (0.34, 1), *_arc(0.34, 0.745, 0.27, 0.255, 90, -90), (0, 0.49)],
            [(0.30, 0.49), (0.64, 0)],
        ],
    ),
    "S": (
        0.60,
        [_arc(0.30, 0.755, 0.29, 0.245, 30, 270) + _arc(0.30, 0.255, 0.30, 0.255, 90, -150)],
    ),
    "T": (0.68, [[(0, 1), (0.68, 1)], [(0.34, 1), (0.34, 0)]]),
    "U": (0.70, [[(0, 1), (0, 0.35), *_arc(0.35, 0.35, 0.35, 0.35, 180, 360), (0.70, 1)]]),
    "W": (1.04, [[(0, 1), (0.26, 0), (0.52, 0.92), (0.78, 0), (1.04, 1)]]),
}


def draw_word(
    draw: ImageDraw.ImageDraw,
    word: str,
    center: Point,
    height: float,
    fill: Sequence[int],
    weight: float = 0.17,
) -> None:
    """Draw a word centred on a pixel position; `weight` is the stroke width over the height."""
    gap = 0.36
    widths = [_STROKES[letter][0] for letter in word]
    span = height * (1 - weight)  # strokes stick out of their centre lines by half a weight
    cursor = center[0] - span * (sum(widths) + gap * (len(word) - 1)) / 2
    bottom = center[1] + span / 2
    thickness = height * weight
    for letter, width in zip(word, widths, strict=True):
        for stroke in _STROKES[letter][1]:
            pixels = [(cursor + span * x, bottom - span * y) for x, y in stroke]
            draw.line(pixels, fill=tuple(fill), width=round(thickness))
            for x, y in pixels:
                half = thickness / 2
                draw.ellipse((x - half, y - half, x + half, y + half), fill=tuple(fill))
        cursor += span * (width + gap)
