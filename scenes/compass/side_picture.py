"""The picture on one side of the room: a word on a plain panel, a grid around it, a border.

Lengths are meters, x from the picture's left edge, y from its lower one.
"""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw

from scenes.modeling.lettering import draw_word

PIXELS_PER_M = 300
OVERSAMPLING = 3  # rounds the letters' edges; all straight edges lie between pixels
INK = (255, 255, 255)
BORDER_M = 0.03
PITCH_M, LINE_M = 0.5, 0.02  # of the grid
PANEL_INSET_M = 0.5  # left and right
TICK_PITCH_M, TICK_M, MIDDLE_TICK_M = 0.1, 0.08, 0.16


def paint_side(
    word: str,
    color: tuple[int, int, int],
    size_m: tuple[float, float],
    panel_m: tuple[float, float],
    letters_m: float,
) -> np.ndarray:
    """Paint one side.

    Args:
        word: in block capitals, in the middle of the panel.
        color: of the ground, sRGB bytes.
        size_m: width and height.
        panel_m: lower and upper end of the panel, multiples of the grid's pitch.
        letters_m: height of the letters.

    Returns:
        (rows, columns, 3) sRGB values in 0..1.
    """
    width, height = size_m
    scale = PIXELS_PER_M * OVERSAMPLING
    canvas = Image.new("RGB", (round(width * scale), round(height * scale)), color)
    draw = ImageDraw.Draw(canvas)

    def fill(left: float, bottom: float, right: float, top: float, ink: tuple = INK) -> None:
        edges = np.round(np.array([left, height - top, right, height - bottom]) * scale)
        draw.rectangle(tuple(edges - (0, 0, 1, 1)), fill=ink)  # the last pixel is included

    for x in np.arange(PITCH_M, width, PITCH_M):
        fill(x - LINE_M / 2, 0, x + LINE_M / 2, height)
    for y in np.arange(PITCH_M, height, PITCH_M):
        fill(0, y - LINE_M / 2, width, y + LINE_M / 2)
    left, right = PANEL_INSET_M + LINE_M / 2, width - PANEL_INSET_M - LINE_M / 2
    bottom, top = panel_m[0] + LINE_M / 2, panel_m[1] - LINE_M / 2
    fill(left, bottom, right, top, color)
    for x in np.arange(PANEL_INSET_M + TICK_PITCH_M, right, TICK_PITCH_M):
        tick = MIDDLE_TICK_M if abs(x - width / 2) < TICK_PITCH_M / 2 else TICK_M
        fill(x - LINE_M / 2, bottom, x + LINE_M / 2, bottom + tick)
    for edges in (
        (0, 0, width, BORDER_M),
        (0, height - BORDER_M, width, height),
        (0, 0, BORDER_M, height),
        (width - BORDER_M, 0, width, height),
    ):
        fill(*edges)
    middle = width / 2 * scale, (height - sum(panel_m) / 2) * scale
    draw_word(draw, word, middle, letters_m * scale, INK)
    return np.asarray(canvas.reduce(OVERSAMPLING), float) / 255
