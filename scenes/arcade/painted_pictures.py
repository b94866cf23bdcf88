"""Pictures of the arcade: facades, posters, covers, a clock's face."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import ImageDraw

from scenes.modeling.lettering import draw_word
from scenes.modeling.painting import painted, rgb
from scenes.modeling.pbr_materials import Color

_INK: Color = (0.12, 0.12, 0.14)


def make_pictures(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """All pictures by name, (height, width, 3) of sRGB values in 0..1."""
    return {
        "upper_window": _image(150, 120, _upper_window),
        "facade": _image(240, 160, _facade),
        "clock": _image(112, 112, _clock),
        "poster_sphere": _image(84, 116, _poster_sphere),
        "poster_waves": _image(84, 116, _poster_waves),
        "eye_chart": _image(72, 112, _eye_chart),
        "menu": _image(80, 112, _menu),
        "spines": _spines(192, 72, rng),
        "covers": _covers(160, 80, rng),
        "lift_plate": _image(48, 24, _lift_plate),
    }


def _image(
    width: int, height: int, paint: Callable[[ImageDraw.ImageDraw, float, float], None]
) -> np.ndarray:
    def on_canvas(draw: ImageDraw.ImageDraw, wide: float) -> None:
        paint(draw, wide, wide * height / width)

    return painted(width, height, on_canvas)[0]


def _fill(draw: ImageDraw.ImageDraw, box: tuple, color: Color) -> None:
    draw.rectangle(box, fill=rgb(color))


def _upper_window(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Shuttered window of the upper floor."""
    _fill(draw, (0, 0, w, h), (0.78, 0.72, 0.60))
    _fill(draw, (0.28 * w, 0.06 * h, 0.72 * w, 0.96 * h), (0.90, 0.87, 0.79))
    _fill(draw, (0.31 * w, 0.10 * h, 0.69 * w, 0.93 * h), (0.15, 0.19, 0.23))
    for x in (0.49, 0.51):
        _fill(draw, ((x - 0.012) * w, 0.10 * h, (x + 0.012) * w, 0.93 * h), (0.88, 0.86, 0.80))
    _fill(draw, (0.31 * w, 0.36 * h, 0.69 * w, 0.385 * h), (0.88, 0.86, 0.80))
    for left in (0.04, 0.74):
        _fill(draw, (left * w, 0.08 * h, (left + 0.22) * w, 0.95 * h), (0.22, 0.38, 0.33))
        for k in range(15):
            y = (0.12 + 0.054 * k) * h
            _fill(draw, ((left + 0.02) * w, y, (left + 0.20) * w, y + 0.02 * h), (0.15, 0.28, 0.25))


def _facade(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """House across the street."""
    _fill(draw, (0, 0, w, h), (0.72, 0.60, 0.47))
    _fill(draw, (0, 0.72 * h, w, h), (0.50, 0.46, 0.42))
    for row in range(3):
        for column in range(6):
            x, y = (0.05 + 0.16 * column) * w, (0.07 + 0.22 * row) * h
            _fill(draw, (x, y, x + 0.09 * w, y + 0.15 * h), (0.86, 0.82, 0.74))
            _fill(draw, (x + 0.01 * w, y + 0.01 * h, x + 0.08 * w, y + 0.14 * h), (0.2, 0.24, 0.29))
    for column in range(3):
        x = (0.07 + 0.32 * column) * w
        _fill(draw, (x, 0.77 * h, x + 0.22 * w, 0.97 * h), (0.18, 0.20, 0.22))
        _fill(draw, (x, 0.73 * h, x + 0.22 * w, 0.79 * h), ((0.6, 0.2, 0.4)[column], 0.25, 0.2))


def _clock(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Dial without numbers, at ten past ten."""
    _fill(draw, (0, 0, w, h), (0.93, 0.91, 0.84))
    for hour in range(12):
        turn = np.radians(30 * hour)
        x, y = np.sin(turn), -np.cos(turn)
        inner = 0.36 if hour % 3 else 0.31
        ends = [(w * (0.5 + r * x), h * (0.5 + r * y)) for r in (inner, 0.43)]
        draw.line(ends, fill=rgb(_INK), width=round(w * (0.025 if hour % 3 else 0.045)))
    for degrees, length, wide in ((305, 0.24, 0.05), (60, 0.36, 0.03)):
        turn = np.radians(degrees)
        tip = (w * (0.5 + length * np.sin(turn)), h * (0.5 - length * np.cos(turn)))
        draw.line([(w / 2, h / 2), tip], fill=rgb(_INK), width=round(w * wide))


def _poster_sphere(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Poster: a ball that mirrors a horizon."""
    _fill(draw, (0, 0, w, h), (0.10, 0.24, 0.32))
    _fill(draw, (0, 0.60 * h, w, h), (0.88, 0.55, 0.25))
    draw.ellipse((0.18 * w, 0.22 * h, 0.82 * w, 0.22 * h + 0.64 * w), fill=rgb((0.85, 0.88, 0.87)))
    draw.pieslice(
        (0.24 * w, 0.26 * h, 0.76 * w, 0.26 * h + 0.52 * w), 0, 180, fill=rgb((0.66, 0.40, 0.20))
    )
    draw_word(draw, "MIRROR", (w / 2, 0.87 * h), 0.13 * w, rgb((0.98, 0.95, 0.88)))


def _poster_waves(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Poster: stripes that swing."""
    _fill(draw, (0, 0, w, h), (0.93, 0.88, 0.76))
    hues = ((0.75, 0.20, 0.15), (0.88, 0.55, 0.15), (0.13, 0.42, 0.45), (0.16, 0.20, 0.38))
    x = np.linspace(0, w, 40)
    for k in range(8):
        y = (0.10 + 0.09 * k) * h + 0.035 * h * np.sin(6.5 * x / w + 0.7 * k)
        line = list(zip(x.tolist(), y.tolist(), strict=True))
        draw.line(line, fill=rgb(hues[k % 4]), width=round(0.05 * h))
    draw_word(draw, "CONCERT", (w / 2, 0.91 * h), 0.12 * w, rgb(_INK))


def _eye_chart(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Letters that get smaller."""
    _fill(draw, (0, 0, w, h), (0.96, 0.96, 0.94))
    rows = (("E", 0.22), ("FP", 0.15), ("TOZ", 0.11), ("LPED", 0.085), ("PECFD", 0.065))
    for (word, size), y in zip(rows, (0.15, 0.36, 0.54, 0.70, 0.84), strict=True):
        draw_word(draw, word, (w / 2, y * h), size * h, rgb(_INK))


def _menu(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Blackboard."""
    _fill(draw, (0, 0, w, h), (0.40, 0.26, 0.16))
    _fill(draw, (0.06 * w, 0.04 * h, 0.94 * w, 0.96 * h), (0.10, 0.12, 0.12))
    for word, y in (("MENU", 0.14), ("TEA 2", 0.36), ("CAKE 4", 0.56), ("SOUP 5", 0.76)):
        size = 0.11 if word == "MENU" else 0.085
        draw_word(draw, word, (w / 2, y * h), size * h, rgb((0.92, 0.90, 0.82)))


def _lift_plate(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    _fill(draw, (0, 0, w, h), (0.05, 0.05, 0.06))
    draw_word(draw, "0", (0.5 * w, h / 2), 0.7 * h, rgb((1.0, 0.45, 0.15)))


def _spines(width: int, height: int, rng: np.random.Generator) -> np.ndarray:
    """Row of books."""
    image = np.zeros((height, width, 3))
    image[:] = (0.10, 0.08, 0.06)
    left = 0
    while left < width:
        wide = int(rng.integers(4, 11))
        hue = rng.uniform(0.15, 0.75) * np.array([1.0, rng.uniform(0.3, 1), rng.uniform(0.2, 0.9)])
        top = int(rng.integers(0, height // 4))
        image[top:, left : left + wide - 1] = hue
        for y in (0.25, 0.8):
            row = top + int(y * (height - top))
            image[row : row + 2, left : left + wide - 1] = np.minimum(1.7 * hue, 0.9)
        left += wide
    return image


def _covers(width: int, height: int, rng: np.random.Generator) -> np.ndarray:
    """Two rows of record covers."""
    image = np.full((height, width, 3), 0.08)
    side = height // 2
    y, x = np.mgrid[: side - 3, : side - 3] / side - 0.5
    for row in range(2):
        for column in range(width // side):
            first, second = rng.uniform(0.1, 0.9, (2, 3))
            turn = rng.uniform(0, 2 * np.pi)
            kind = (row + column) % 3
            mask = (np.hypot(x, y) < 0.3, np.sin(20 * (x * np.cos(turn) + y * np.sin(turn))) > 0)
            shape = mask[kind] if kind < 2 else x * np.cos(turn) + y * np.sin(turn) > 0
            top, left = side * row, side * column
            image[top : top + side - 3, left : left + side - 3] = np.where(
                shape[..., None], first, second
            )
    return image
