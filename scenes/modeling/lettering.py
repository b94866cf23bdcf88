"""Block capitals drawn as thick strokes, so that a scene needs no font file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import ImageDraw

Point = tuple[float, float]


def _arc(cx: float, cy: float, rx: float, ry: float, start: float, end: float) -> list[Point]:
    angles = np.radians(np.linspace(start, end, 25))
    return [(cx + rx * np.cos(a), cy + ry * np.sin(a)) for a in angles]


# Center lines in a box one unit high, x to the right, y up; strokes of one letter may cross.
_STROKES: dict[str, tuple[float, list[list[Point]]]] = {
    " ": (0.18, []),
    "-": (0.40, [[(0, 0.48), (0.40, 0.48)]]),
    "0": (0.62, [_arc(0.31, 0.5, 0.31, 0.5, 0, 360)]),
    "1": (0.30, [[(0, 0.76), (0.26, 1), (0.26, 0)]]),
    "2": (0.58, [[*_arc(0.29, 0.71, 0.29, 0.29, 165, -40), (0, 0), (0.58, 0)]]),
    "3": (
        0.56,
        [_arc(0.27, 0.755, 0.27, 0.245, 150, -90) + _arc(0.27, 0.26, 0.29, 0.26, 90, -150)],
    ),
    "4": (0.66, [[(0.48, 0), (0.48, 1), (0, 0.30), (0.66, 0.30)]]),
    "5": (
        0.56,
        [[(0.50, 1), (0.07, 1), (0.04, 0.54), *_arc(0.26, 0.31, 0.30, 0.31, 120, -150)]],
    ),
    "6": (0.60, [[(0.46, 1), (0.05, 0.46), *_arc(0.30, 0.30, 0.30, 0.30, 150, -210)]]),
    "7": (0.56, [[(0, 1), (0.56, 1), (0.18, 0)]]),
    "8": (
        0.58,
        [_arc(0.29, 0.755, 0.25, 0.245, 0, 360), _arc(0.29, 0.26, 0.29, 0.26, 0, 360)],
    ),
    "9": (0.60, [[(0.14, 0), (0.55, 0.54), *_arc(0.30, 0.70, 0.30, 0.30, -30, 330)]]),
    "A": (0.74, [[(0, 0), (0.37, 1), (0.74, 0)], [(0.14, 0.34), (0.60, 0.34)]]),
    "B": (
        0.62,
        [
            [(0, 0), (0, 1), (0.30, 1), *_arc(0.32, 0.765, 0.25, 0.235, 90, -90), (0, 0.53)],
            [(0.30, 0.53), *_arc(0.33, 0.265, 0.29, 0.265, 90, -90), (0, 0)],
        ],
    ),
    "C": (0.72, [_arc(0.41, 0.5, 0.41, 0.5, 42, 318)]),
    "D": (0.72, [[(0, 0), (0, 1), (0.24, 1), *_arc(0.26, 0.5, 0.46, 0.5, 90, -90), (0, 0)]]),
    "E": (0.58, [[(0.58, 1), (0, 1), (0, 0), (0.58, 0)], [(0, 0.52), (0.48, 0.52)]]),
    "F": (0.56, [[(0.56, 1), (0, 1), (0, 0)], [(0, 0.52), (0.46, 0.52)]]),
    "G": (0.78, [[*_arc(0.41, 0.5, 0.41, 0.5, 42, 325), (0.76, 0.46), (0.46, 0.46)]]),
    "H": (0.70, [[(0, 0), (0, 1)], [(0.70, 0), (0.70, 1)], [(0, 0.5), (0.70, 0.5)]]),
    "I": (0.08, [[(0.04, 0), (0.04, 1)]]),
    "J": (0.50, [[(0.50, 1), (0.50, 0.27), *_arc(0.25, 0.27, 0.25, 0.27, 0, -170)]]),
    "K": (0.66, [[(0, 0), (0, 1)], [(0.62, 1), (0, 0.40)], [(0.20, 0.58), (0.66, 0)]]),
    "L": (0.54, [[(0, 1), (0, 0), (0.54, 0)]]),
    "M": (0.84, [[(0, 0), (0, 1), (0.42, 0.24), (0.84, 1), (0.84, 0)]]),
    "N": (0.72, [[(0, 0), (0, 1), (0.72, 0), (0.72, 1)]]),
    "O": (0.82, [_arc(0.41, 0.5, 0.41, 0.5, 0, 360)]),
    "P": (
        0.60,
        [[(0, 0), (0, 1), (0.30, 1), *_arc(0.32, 0.735, 0.28, 0.265, 90, -90), (0, 0.47)]],
    ),
    "Q": (0.84, [_arc(0.41, 0.5, 0.41, 0.5, 0, 360), [(0.50, 0.26), (0.84, -0.04)]]),
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
    "V": (0.74, [[(0, 1), (0.37, 0), (0.74, 1)]]),
    "W": (1.04, [[(0, 1), (0.26, 0), (0.52, 0.92), (0.78, 0), (1.04, 1)]]),
    "X": (0.70, [[(0, 0), (0.70, 1)], [(0, 1), (0.70, 0)]]),
    "Y": (0.70, [[(0, 1), (0.35, 0.48), (0.70, 1)], [(0.35, 0.48), (0.35, 0)]]),
    "Z": (0.64, [[(0, 1), (0.64, 1), (0, 0), (0.64, 0)]]),
}


_GAP = 0.36  # between letters


def word_width(word: str, height: float, weight: float = 0.17) -> float:
    """Width in pixels that `draw_word` needs."""
    widths = [_STROKES[letter][0] for letter in word]
    return height * ((1 - weight) * (sum(widths) + _GAP * (len(word) - 1)) + weight)


def draw_word(
    draw: ImageDraw.ImageDraw,
    word: str,
    center: Point,
    height: float,
    fill: Sequence[int],
    weight: float = 0.17,
) -> None:
    """Draw a word centered on a pixel position; `weight` is the stroke width over the height."""
    widths = [_STROKES[letter][0] for letter in word]
    span = height * (1 - weight)  # strokes stick out of their center lines by half a weight
    cursor = center[0] - span * (sum(widths) + _GAP * (len(word) - 1)) / 2
    bottom = center[1] + span / 2
    thickness = height * weight
    for letter, width in zip(word, widths, strict=True):
        for stroke in _STROKES[letter][1]:
            pixels = [(cursor + span * x, bottom - span * y) for x, y in stroke]
            draw.line(pixels, fill=tuple(fill), width=round(thickness))
            for x, y in pixels:
                half = thickness / 2
                draw.ellipse((x - half, y - half, x + half, y + half), fill=tuple(fill))
        cursor += span * (width + _GAP)


def word_strokes(word: str, height: float) -> list[list[Point]]:
    """Center lines of a word's strokes, x to the right and y up, its middle at the origin."""
    widths = [_STROKES[letter][0] for letter in word]
    cursor = -height * (sum(widths) + _GAP * (len(word) - 1)) / 2
    strokes = []
    for letter, width in zip(word, widths, strict=True):
        for stroke in _STROKES[letter][1]:
            strokes.append([(cursor + height * x, height * (y - 0.5)) for x, y in stroke])
        cursor += height * (width + _GAP)
    return strokes
