"""Pictures on the walls and screens, and their places in an atlas.

Float images (rows, columns, 3) of sRGB values in 0..1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import ImageDraw

from scenes.modeling.geometry import Patch, polygon
from scenes.modeling.lettering import draw_word
from scenes.modeling.painting import Color, painted, rgb

Canvas = ImageDraw.ImageDraw
CELL = 256
COLUMNS, ROWS = 4, 3
INSET = 2 / CELL  # keeps neighboring cells from bleeding in
# Column, row from the top and width, in cells.
PLACES = {
    "robot": (0, 0, 1),
    "goal": (1, 0, 1),
    "optics": (2, 0, 1),
    "map": (3, 0, 1),
    "whiteboard": (0, 1, 2),
    "cork": (2, 1, 1),
    "clock": (3, 1, 1),
    "mirror": (0, 2, 1),
    "results": (1, 2, 1),
    "calendar": (2, 2, 1),
    "tower": (3, 2, 1),
}
SCREENS = ("terminal", "plot", "camera", "editor")
INK: Color = (0.16, 0.18, 0.22)


def picture(name: str, width: float, height: float) -> Patch:
    """One of `PLACES` on a wall, facing -y, centered on the origin."""
    column, row, cells = PLACES[name]
    return _framed(width, height, column / COLUMNS, row / ROWS, cells / COLUMNS, 1 / ROWS)


def screen(name: str, width: float, height: float) -> Patch:
    """One of `SCREENS`, facing -y, centered on the origin."""
    index = SCREENS.index(name)
    return _framed(width, height, index % 2 / 2, index // 2 / 2, 0.5, 0.5)


def atlas(rng: np.random.Generator) -> np.ndarray:
    """All wall pictures."""
    painters: dict[str, Callable[[Canvas, float], None]] = {
        "robot": _robot, "goal": _goal, "optics": _optics, "map": _map_painter(rng),
        "whiteboard": _whiteboard_painter(rng), "cork": _cork_painter(rng), "clock": _clock,
        "mirror": _mirror, "results": _results, "calendar": _calendar, "tower": _tower,
    }  # fmt: skip
    image = np.ones((ROWS * CELL, COLUMNS * CELL, 3))
    for name, (column, row, cells) in PLACES.items():
        left, top = column * CELL, row * CELL
        cell, _ = painted(cells * CELL, CELL, painters[name])
        image[top : top + CELL, left : left + cells * CELL] = cell
    return image


def screens(rng: np.random.Generator) -> np.ndarray:
    """Four monitors' pictures in a square."""
    painters = (_terminal_painter(rng), _plot, _camera, _editor_painter(rng))
    cells = [painted(CELL, CELL, painter)[0] for painter in painters]
    rows = [np.concatenate(cells[i : i + 2], axis=1) for i in (0, 2)]
    return np.concatenate(rows, axis=0)


def _framed(
    width: float, height: float, left: float, top: float, wide: float, tall: float
) -> Patch:
    x, z = width / 2, height / 2
    dx, dy = INSET * wide, INSET * tall
    u0, u1, v0, v1 = left + dx, left + wide - dx, 1 - top - tall + dy, 1 - top - dy
    corners = [(-x, 0, -z), (x, 0, -z), (x, 0, z), (-x, 0, z)]
    return polygon(corners, [(u0, v0), (u1, v0), (u1, v1), (u0, v1)])


def _fill(draw: Canvas, s: float, color: Color, wide: float = 1.0) -> None:
    draw.rectangle((0, 0, wide * s, wide * s), fill=rgb(color))


def _lines(draw: Canvas, s: float, x: float, y: float, wide: float, count: int) -> None:
    """Text too small to read."""
    for index in range(count):
        end = x + wide * (1.0 if index % 4 != 3 else 0.6)
        top = y + 0.022 * index
        draw.rectangle((x * s, top * s, end * s, (top + 0.010) * s), fill=rgb((0.45, 0.46, 0.48)))


def _robot(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.86, 0.77, 0.47))  # yellowish, yet no landmark's yellow
    draw_word(draw, "ROBOT", (0.5 * s, 0.16 * s), 0.15 * s, rgb(INK))
    draw.rounded_rectangle((0.26 * s, 0.32 * s, 0.74 * s, 0.62 * s), 0.05 * s, fill=rgb(INK))
    for x in (0.38, 0.62):
        draw.ellipse(
            ((x - 0.05) * s, 0.40 * s, (x + 0.05) * s, 0.50 * s), fill=rgb((0.90, 0.87, 0.75))
        )
    for x in (0.20, 0.70):
        draw.ellipse((x * s, 0.62 * s, (x + 0.10) * s, 0.72 * s), fill=rgb((0.45, 0.25, 0.18)))
    _lines(draw, s, 0.2, 0.78, 0.6, 7)


def _goal(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.52, 0.66, 0.74))  # bluish, yet no landmark's blue
    draw.rectangle((0, 0.66 * s, s, s), fill=rgb((0.30, 0.44, 0.30)))
    draw.rectangle(
        (0.2 * s, 0.38 * s, 0.8 * s, 0.70 * s), outline=rgb((0.93, 0.93, 0.90)), width=20
    )
    draw.ellipse((0.42 * s, 0.72 * s, 0.54 * s, 0.84 * s), fill=rgb((0.85, 0.42, 0.13)))
    draw_word(draw, "GOAL", (0.5 * s, 0.18 * s), 0.17 * s, rgb((0.95, 0.95, 0.92)))


def _optics(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.94, 0.93, 0.90))
    draw.rectangle((0, 0, s, 0.16 * s), fill=rgb((0.42, 0.12, 0.16)))
    draw_word(draw, "OPTICS", (0.5 * s, 0.08 * s), 0.09 * s, rgb((0.95, 0.93, 0.88)))
    for x in (0.06, 0.37, 0.68):
        _lines(draw, s, x, 0.20, 0.26, 14)
        _lines(draw, s, x, 0.80, 0.26, 7)
    draw.rectangle((0.06 * s, 0.54 * s, 0.48 * s, 0.76 * s), fill=rgb((0.70, 0.76, 0.72)))
    draw.arc((0.54 * s, 0.52 * s, 0.92 * s, 0.92 * s), 200, 340, fill=rgb(INK), width=12)
    for x in (0.60, 0.73, 0.86):
        draw.line((0.73 * s, 0.78 * s, x * s, 0.55 * s), fill=rgb((0.72, 0.36, 0.14)), width=6)


def _map_painter(rng: np.random.Generator) -> Callable[[Canvas, float], None]:
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    blobs = [
        (cx, cy, size * (1 + 0.35 * np.cumsum(rng.normal(0, 0.15, 40)).clip(-1, 1)))
        for cx, cy, size in (
            (0.25, 0.35, 0.14),
            (0.35, 0.70, 0.11),
            (0.62, 0.38, 0.19),
            (0.8, 0.7, 0.09),
        )
    ]

    def paint(draw: Canvas, s: float) -> None:
        _fill(draw, s, (0.66, 0.76, 0.78))
        for cx, cy, radii in blobs:
            outline = [
                ((cx + r * np.cos(a)) * s, (cy + 0.8 * r * np.sin(a)) * s)
                for r, a in zip(radii, angles, strict=True)
            ]
            draw.polygon(outline, fill=rgb((0.78, 0.72, 0.52)), outline=rgb((0.45, 0.40, 0.30)))
        for step in range(1, 8):
            draw.line((step * s / 8, 0, step * s / 8, s), fill=rgb((0.55, 0.62, 0.64)), width=2)
            draw.line((0, step * s / 8, s, step * s / 8), fill=rgb((0.55, 0.62, 0.64)), width=2)
        draw.rectangle((0, 0, s - 1, s - 1), outline=rgb((0.30, 0.25, 0.20)), width=18)

    return paint


def _whiteboard_painter(rng: np.random.Generator) -> Callable[[Canvas, float], None]:
    curve = np.cumsum(rng.normal(0, 0.02, 30))

    def paint(draw: Canvas, s: float) -> None:
        _fill(draw, s, (0.93, 0.94, 0.94))
        pens = ((0.14, 0.20, 0.45), (0.60, 0.12, 0.12), (0.12, 0.36, 0.20))
        draw_word(draw, "MIRROR", (0.15 * s, 0.05 * s), 0.045 * s, rgb(pens[0]), weight=0.12)
        draw.line((0.06 * s, 0.40 * s, 0.40 * s, 0.40 * s), fill=rgb(INK), width=7)
        draw.line((0.08 * s, 0.42 * s, 0.08 * s, 0.12 * s), fill=rgb(INK), width=7)
        t = np.linspace(0, 1, 30)
        hyperbola = [((0.08 + 0.3 * a) * s, (0.36 - 0.22 * np.hypot(a, 0.3)) * s) for a in t]
        noisy = [
            ((0.08 + 0.3 * a) * s, (0.30 - 0.1 * a + b) * s) for a, b in zip(t, curve, strict=True)
        ]
        draw.line(hyperbola, fill=rgb(pens[1]), width=8)
        draw.line(noisy, fill=rgb(pens[2]), width=6)
        for row, width in enumerate((0.34, 0.22, 0.40, 0.28, 0.18)):
            y, x = (0.10 + 0.06 * row) * s, 0.50 * s
            while x < (0.50 + width) * s:
                word = 0.02 * s + 0.02 * s * ((row * 7 + round(x)) % 3)
                draw.line((x, y, x + word, y + 0.004 * s), fill=rgb(pens[row % 3]), width=9)
                x += word + 0.014 * s

    return paint


def _cork_painter(rng: np.random.Generator) -> Callable[[Canvas, float], None]:
    papers = ((0.93, 0.92, 0.88), (0.84, 0.80, 0.62), (0.80, 0.62, 0.66), (0.70, 0.78, 0.82))
    notes = [(rng.uniform(0.05, 0.72), rng.uniform(0.05, 0.70), index % 4) for index in range(11)]

    def paint(draw: Canvas, s: float) -> None:
        _fill(draw, s, (0.67, 0.51, 0.34))
        for x, y, kind in notes:
            high = 0.26 if kind == 0 else 0.16
            draw.rectangle((x * s, y * s, (x + 0.20) * s, (y + high) * s), fill=rgb(papers[kind]))
            _lines(draw, s, x + 0.02, y + 0.04, 0.15, 9 if kind == 0 else 4)
            draw.ellipse(
                ((x + 0.09) * s, y * s, (x + 0.12) * s, (y + 0.03) * s), fill=(150, 40, 35)
            )

    return paint


def _clock(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.94, 0.94, 0.92))
    for hour in range(12):
        a = np.radians(30 * hour)
        reach = 0.34 if hour % 3 else 0.30
        _hand(draw, s, a, reach, 0.42, 0.03)
    _hand(draw, s, np.radians(47), -0.05, 0.24, 0.045)
    _hand(draw, s, np.radians(200), -0.05, 0.36, 0.03)


def _hand(draw: Canvas, s: float, angle: float, start: float, end: float, width: float) -> None:
    x, y = np.sin(angle), -np.cos(angle)
    ends = [(s * (0.5 + x * r), s * (0.5 + y * r)) for r in (start, end)]
    draw.line(ends, fill=rgb(INK), width=round(width * s))


def _mirror(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.20, 0.22, 0.26))
    for index in range(9, 0, -1):
        r = 0.045 * index
        shade = 0.30 + 0.06 * index
        draw.ellipse(
            ((0.5 - r) * s, (0.56 - r) * s, (0.5 + r) * s, (0.56 + r) * s),
            fill=rgb((shade, 0.9 * shade, 0.8 * shade)),
        )
    draw_word(draw, "CAMERA", (0.5 * s, 0.07 * s), 0.08 * s, rgb((0.88, 0.86, 0.80)))


def _results(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.93, 0.93, 0.95))
    draw_word(draw, "RESULTS", (0.5 * s, 0.08 * s), 0.08 * s, rgb((0.26, 0.20, 0.40)))
    for x, y in ((0.08, 0.18), (0.55, 0.18), (0.08, 0.60), (0.55, 0.60)):
        draw.rectangle((x * s, y * s, (x + 0.37) * s, (y + 0.26) * s), fill=rgb((0.99, 0.99, 0.98)))
        for bar in range(6):
            tall = 0.22 * (0.3 + 0.7 * abs(np.sin(1.7 * bar + 9 * x + 5 * y)))
            left = x + 0.02 + 0.058 * bar
            hue = ((0.35, 0.40, 0.62), (0.70, 0.42, 0.30), (0.42, 0.56, 0.40))[bar % 3]
            shape = (left * s, (y + 0.25 - tall) * s, (left + 0.04) * s, (y + 0.25) * s)
            draw.rectangle(shape, fill=rgb(hue))
        _lines(draw, s, x, y + 0.28, 0.37, 5)


def _calendar(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.95, 0.94, 0.91))
    draw.rectangle((0, 0, s, 0.45 * s), fill=rgb((0.46, 0.58, 0.62)))
    draw.polygon([(0, 0.45 * s), (0.35 * s, 0.12 * s), (0.7 * s, 0.45 * s)], fill=(84, 92, 84))
    draw.polygon([(0.4 * s, 0.45 * s), (0.72 * s, 0.2 * s), (s, 0.45 * s)], fill=(104, 108, 96))
    for row in range(5):
        for column in range(7):
            x, y = 0.05 + 0.13 * column, 0.52 + 0.09 * row
            hue = (0.72, 0.28, 0.24) if column == 6 else (0.80, 0.80, 0.78)
            draw.rectangle((x * s, y * s, (x + 0.10) * s, (y + 0.06) * s), fill=rgb(hue))


def _tower(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.80, 0.52, 0.40))
    draw.ellipse((0.55 * s, 0.10 * s, 0.85 * s, 0.40 * s), fill=rgb((0.90, 0.80, 0.60)))
    draw.polygon(
        [(0.2 * s, s), (0.28 * s, 0.3 * s), (0.42 * s, 0.3 * s), (0.5 * s, s)], fill=rgb(INK)
    )
    draw.polygon(
        [(0.2 * s, 0.32 * s), (0.35 * s, 0.12 * s), (0.5 * s, 0.32 * s)], fill=(96, 48, 40)
    )
    draw_word(draw, "SOCCER", (0.5 * s, 0.86 * s), 0.10 * s, rgb((0.95, 0.92, 0.84)))


def _terminal_painter(rng: np.random.Generator) -> Callable[[Canvas, float], None]:
    ends = rng.uniform(0.2, 0.9, 24)

    def paint(draw: Canvas, s: float) -> None:
        _fill(draw, s, (0.08, 0.09, 0.11))
        for index, end in enumerate(ends):
            y = (0.04 + 0.039 * index) * s
            hue = (0.45, 0.75, 0.48) if index % 5 == 0 else (0.70, 0.72, 0.72)
            draw.line((0.04 * s, y, end * s, y), fill=rgb(hue), width=9)

    return paint


def _plot(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.88, 0.89, 0.90))
    draw.rectangle((0, 0, s, 0.06 * s), fill=rgb((0.36, 0.40, 0.46)))
    draw.rectangle((0.12 * s, 0.14 * s, 0.94 * s, 0.88 * s), fill=(255, 255, 255), outline=rgb(INK))
    t = np.linspace(0, 1, 80)
    for phase, hue in (
        (0.0, (0.25, 0.35, 0.60)),
        (1.2, (0.70, 0.35, 0.20)),
        (2.1, (0.25, 0.50, 0.30)),
    ):
        wave = 0.5 + 0.25 * np.sin(9 * t + phase) * np.exp(-t)
        points = [((0.13 + 0.8 * a) * s, b * s) for a, b in zip(t, wave, strict=True)]
        draw.line(points, fill=rgb(hue), width=8)


def _camera(draw: Canvas, s: float) -> None:
    _fill(draw, s, (0.24, 0.26, 0.30))
    draw.ellipse((0.1 * s, 0.1 * s, 0.9 * s, 0.9 * s), fill=rgb((0.62, 0.60, 0.55)))
    draw.ellipse((0.2 * s, 0.2 * s, 0.8 * s, 0.8 * s), fill=rgb((0.25, 0.45, 0.28)))
    draw.line((0.2 * s, 0.5 * s, 0.8 * s, 0.5 * s), fill=rgb((0.85, 0.85, 0.85)), width=8)
    draw.ellipse((0.42 * s, 0.42 * s, 0.58 * s, 0.58 * s), fill=rgb((0.12, 0.12, 0.13)))


def _editor_painter(rng: np.random.Generator) -> Callable[[Canvas, float], None]:
    rows = [(0.05 * rng.integers(1, 5), rng.uniform(0.3, 0.85), rng.integers(3)) for _ in range(22)]

    def paint(draw: Canvas, s: float) -> None:
        _fill(draw, s, (0.95, 0.94, 0.90))
        draw.rectangle((0, 0, 0.16 * s, s), fill=rgb((0.80, 0.80, 0.78)))
        hues = ((0.30, 0.32, 0.36), (0.36, 0.26, 0.52), (0.20, 0.42, 0.36))
        for index, (indent, end, kind) in enumerate(rows):
            y = (0.05 + 0.042 * index) * s
            draw.line(((0.18 + indent) * s, y, end * s, y), fill=rgb(hues[kind]), width=9)

    return paint
