"""Pictures with a meaning: signs, posters, screens, book spines, fronts of appliances.

Float images (rows, columns, 3) of sRGB values in 0..1.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

from scenes.modeling.lettering import draw_word, word_width

Color = tuple[int, int, int]
OVERSAMPLING = 3

WHITE, BLACK, GRAY = (240, 240, 236), (28, 30, 34), (120, 124, 130)
RED, GREEN, BLUE = (196, 40, 36), (24, 128, 76), (32, 84, 156)
YELLOW, ORANGE, TEAL = (240, 196, 40), (226, 116, 34), (28, 128, 132)

# Door signs: word and ground color. The color is that of the part of the building.
ROOM_SIGNS: dict[str, tuple[str, Color]] = {
    "kitchen": ("KITCHEN", GREEN),
    "office_a": ("OFFICE A", GREEN),
    "office_b": ("OFFICE B", GREEN),
    "meeting": ("MEETING", GREEN),
    "lab": ("ROBOT LAB", ORANGE),
    "closed": ("CLOSED", RED),
    "store": ("STORE", BLUE),
    "lounge": ("LOUNGE", ORANGE),
    "studio": ("STUDIO", ORANGE),
    "washroom": ("WC", BLUE),
    "server": ("SERVER", BLUE),
    "office_c": ("OFFICE C", BLUE),
    "first_aid": ("FIRST AID", BLUE),
    "library": ("LIBRARY", BLUE),
    "stairs": ("STAIRS", BLUE),
}


def make_pictures(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Every picture of the atlas by name."""
    made = {f"sign_{name}": _sign(192, 48, *sign) for name, sign in ROOM_SIGNS.items()}
    made |= {
        "sign_exit": _painted(192, 72, _exit),
        "sign_fire": _painted(64, 64, _fire),
        "sign_north": _sign(96, 96, "N", GREEN),
        "sign_middle": _sign(96, 96, "M", ORANGE),
        "sign_south": _sign(96, 96, "S", BLUE),
        "sign_one": _sign(96, 96, "1", GRAY),
        "welcome": _sign(384, 96, "HALL OF MAPS", TEAL),
        "poster_robot": _painted(160, 224, _poster_robot),
        "poster_map": _painted(224, 160, _poster_map),
        "poster_hills": _painted(160, 224, _poster_hills),
        "poster_circles": _painted(160, 224, _poster_circles),
        "poster_mirror": _painted(160, 224, _poster_mirror),
        "poster_chart": _painted(160, 224, _poster_chart),
        "poster_sea": _painted(224, 160, _poster_sea),
        "poster_eyes": _painted(128, 192, _poster_eyes),
        "poster_squares": _painted(160, 160, _poster_squares),
        "whiteboard": _painted(288, 160, _whiteboard),
        "noticeboard": _painted(256, 160, lambda d, w, h: _noticeboard(d, w, h, rng)),
        "calendar": _painted(96, 128, _calendar),
        "clock": _painted(96, 96, _clock),
        "screen_code": _painted(128, 80, lambda d, w, h: _screen_code(d, w, h, rng)),
        "screen_plot": _painted(128, 80, _screen_plot),
        "screen_map": _painted(128, 80, _screen_map),
        "projection": _painted(256, 160, _projection),
        "keyboard": _painted(96, 40, _keyboard),
        "books_a": _painted(192, 64, lambda d, w, h: _books(d, w, h, rng, 26)),
        "books_b": _painted(192, 64, lambda d, w, h: _books(d, w, h, rng, 22)),
        "books_c": _painted(192, 64, lambda d, w, h: _books(d, w, h, rng, 30)),
        "binders": _painted(192, 64, lambda d, w, h: _binders(d, w, h, rng)),
        "server": _painted(96, 288, lambda d, w, h: _server(d, w, h, rng)),
        "vending": _painted(128, 224, lambda d, w, h: _vending(d, w, h, rng)),
        "microwave": _painted(96, 56, _microwave),
        "oven": _painted(64, 64, _oven),
        "fridge": _painted(64, 160, _fridge),
        "lift": _painted(128, 224, _lift),
        "tools": _painted(256, 128, _tools),
        "washer": _painted(64, 64, _washer),
        "label_fragile": _painted(64, 48, _label),
    }
    return made


def _painted(
    width: int, height: int, paint: Callable[[ImageDraw.ImageDraw, float, float], None]
) -> np.ndarray:
    """Run a painter on an enlarged canvas."""
    big = (width * OVERSAMPLING, height * OVERSAMPLING)
    canvas = Image.new("RGB", big, WHITE)
    paint(ImageDraw.Draw(canvas), float(big[0]), float(big[1]))
    return np.asarray(canvas.resize((width, height), Image.Resampling.BOX), float) / 255


def _word(
    draw: ImageDraw.ImageDraw, word: str, x: float, y: float, wide: float, high: float, ink: Color
) -> None:
    """A word as large as fits into a box about (x, y)."""
    height = min(high, high * wide / word_width(word, high))
    draw_word(draw, word, (x, y), height, ink)


def _sign(width: int, height: int, word: str, ground: Color) -> np.ndarray:
    def paint(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
        draw.rectangle((0, 0, w, h), fill=ground)
        draw.rectangle((0.04 * h, 0.04 * h, w - 0.04 * h, h - 0.04 * h), outline=WHITE, width=4)
        _word(draw, word, w / 2, h / 2, 0.86 * w, 0.56 * h, WHITE)

    return _painted(width, height, paint)


def _exit(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=GREEN)
    _word(draw, "EXIT", 0.36 * w, h / 2, 0.52 * w, 0.6 * h, WHITE)
    x, y = 0.82 * w, h / 2
    draw.line((x - 0.16 * w, y, x + 0.02 * w, y), fill=WHITE, width=round(0.10 * h))
    draw.polygon(
        [(x + 0.11 * w, y), (x, y - 0.26 * h), (x, y + 0.26 * h)],
        fill=WHITE,
    )


def _fire(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=RED)
    draw.rounded_rectangle((0.2 * w, 0.32 * h, 0.48 * w, 0.88 * h), 0.06 * w, fill=WHITE)
    draw.rectangle((0.28 * w, 0.2 * h, 0.4 * w, 0.34 * h), fill=WHITE)
    draw.line((0.4 * w, 0.26 * h, 0.56 * w, 0.22 * h), fill=WHITE, width=round(0.06 * w))
    flame = [(0.72, 0.88), (0.58, 0.70), (0.66, 0.50), (0.70, 0.60), (0.78, 0.36), (0.90, 0.70)]
    draw.polygon([(x * w, y * h) for x, y in flame], fill=WHITE)


def _frame(draw: ImageDraw.ImageDraw, w: float, h: float, ground: Color, word: str, ink: Color):
    draw.rectangle((0, 0, w, h), fill=ground)
    _word(draw, word, w / 2, 0.88 * h, 0.8 * w, 0.10 * h, ink)


def _poster_robot(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    _frame(draw, w, h, (236, 178, 52), "ROVER 7", BLACK)
    for x in (0.24, 0.5, 0.76):
        r = 0.11 * w
        draw.ellipse((x * w - r, 0.62 * h - r, x * w + r, 0.62 * h + r), fill=BLACK)
        draw.ellipse((x * w - r / 2, 0.62 * h - r / 2, x * w + r / 2, 0.62 * h + r / 2), fill=GRAY)
    draw.rounded_rectangle((0.14 * w, 0.42 * h, 0.86 * w, 0.57 * h), 0.04 * w, fill=RED)
    draw.rectangle((0.47 * w, 0.22 * h, 0.53 * w, 0.42 * h), fill=GRAY)
    draw.pieslice((0.34 * w, 0.06 * h, 0.66 * w, 0.26 * h), 180, 360, fill=(70, 90, 110))


def _poster_map(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(168, 206, 222))
    land = [
        [(0.06, 0.3), (0.2, 0.12), (0.42, 0.2), (0.46, 0.46), (0.3, 0.62), (0.12, 0.52)],
        [(0.54, 0.5), (0.66, 0.2), (0.9, 0.24), (0.94, 0.6), (0.74, 0.78), (0.6, 0.7)],
        [(0.2, 0.78), (0.4, 0.7), (0.5, 0.86), (0.3, 0.94)],
    ]
    for shape, color in zip(land, ((214, 196, 130), (160, 186, 116), (206, 160, 120)), strict=True):
        draw.polygon([(x * w, y * h) for x, y in shape], fill=color, outline=(110, 96, 70))
    for k in range(1, 6):
        draw.line((k * w / 6, 0, k * w / 6, h), fill=(120, 160, 190), width=3)
        draw.line((0, k * h / 6, w, k * h / 6), fill=(120, 160, 190), width=3)
    draw.line([(0.2 * w, 0.4 * h), (0.48 * w, 0.6 * h), (0.7 * w, 0.45 * h)], fill=RED, width=8)


def _poster_hills(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    _frame(draw, w, h, (246, 206, 160), "DOLINA", (60, 50, 70))
    draw.ellipse((0.54 * w, 0.10 * h, 0.86 * w, 0.33 * h), fill=(220, 80, 50))
    for base, color in ((0.46, (150, 120, 150)), (0.58, (110, 84, 126)), (0.70, (70, 58, 100))):
        shift = 0.4 * base
        points = [(0, 0.78 * h)]
        for k in range(7):
            points.append((k * w / 6, (base - 0.13 * ((k * 5 + shift * 10) % 3 > 1.2)) * h))
        draw.polygon([*points, (w, 0.78 * h)], fill=color)


def _poster_circles(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    _frame(draw, w, h, (32, 60, 110), "ORBIT", WHITE)
    colors = (YELLOW, ORANGE, RED, TEAL, WHITE)
    for k, color in enumerate(colors):
        r = (0.44 - 0.085 * k) * w
        draw.ellipse(
            (w / 2 - r, 0.42 * h - r, w / 2 + r, 0.42 * h + r),
            outline=color,
            width=round(0.045 * w),
        )


def _poster_mirror(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    _frame(draw, w, h, WHITE, "XI", BLACK)
    x = np.linspace(-0.36, 0.36, 40)
    curve = [((0.5 + a) * w, (0.12 + 0.26 * np.sqrt(0.06 + 3.2 * a * a)) * h) for a in x]
    draw.line(curve, fill=BLUE, width=10)
    for a in (-0.3, -0.15, 0.0, 0.15, 0.3):
        foot = ((0.5 + a) * w, (0.12 + 0.26 * np.sqrt(0.06 + 3.2 * a * a)) * h)
        draw.line([(0.5 * w, 0.74 * h), foot, (foot[0] + 0.9 * a * w, 0.62 * h)], fill=RED, width=4)


def _poster_chart(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    _frame(draw, w, h, (228, 236, 226), "1-2-3", GREEN)
    for k, (level, color) in enumerate(
        zip((0.2, 0.44, 0.3, 0.6, 0.5), (TEAL, BLUE, GREEN, ORANGE, RED), strict=True)
    ):
        left = (0.12 + 0.16 * k) * w
        draw.rectangle((left, (0.74 - level) * h, left + 0.11 * w, 0.74 * h), fill=color)
    draw.line((0.08 * w, 0.745 * h, 0.94 * w, 0.745 * h), fill=BLACK, width=6)


def _poster_sea(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(190, 222, 232))
    draw.rectangle((0, 0.58 * h, w, h), fill=(36, 104, 140))
    draw.polygon([(0.3 * w, 0.56 * h), (0.5 * w, 0.12 * h), (0.5 * w, 0.56 * h)], fill=WHITE)
    draw.polygon([(0.53 * w, 0.56 * h), (0.53 * w, 0.2 * h), (0.68 * w, 0.56 * h)], fill=RED)
    hull = [(0.24, 0.6), (0.76, 0.6), (0.66, 0.74), (0.34, 0.74)]
    draw.polygon([(x * w, y * h) for x, y in hull], fill=(110, 60, 36))


def _poster_eyes(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=WHITE)
    for row, (word, size) in enumerate(
        (("E", 0.2), ("FP", 0.14), ("TOZ", 0.1), ("LPED", 0.075), ("PECFD", 0.055))
    ):
        draw_word(draw, word, (w / 2, (0.16 + 0.18 * row) * h), size * h, BLACK)


def _poster_squares(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    colors = (RED, BLUE, YELLOW, WHITE, BLACK, TEAL)
    for row in range(4):
        for column in range(4):
            color = colors[(row * 7 + column * 5 + row * column) % 6]
            draw.rectangle(
                (column * w / 4, row * h / 4, (column + 1) * w / 4, (row + 1) * h / 4), fill=color
            )


def _whiteboard(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(198, 202, 206))
    draw.rectangle((0.02 * w, 0.035 * h, 0.98 * w, 0.965 * h), fill=(246, 248, 248))
    _word(draw, "MAP 250", 0.22 * w, 0.16 * h, 0.3 * w, 0.10 * h, BLUE)
    draw.line([(0.1 * w, 0.85 * h), (0.1 * w, 0.32 * h)], fill=BLACK, width=5)
    draw.line([(0.1 * w, 0.85 * h), (0.5 * w, 0.85 * h)], fill=BLACK, width=5)
    t = np.linspace(0, 1, 30)
    curve = [((0.1 + 0.38 * a) * w, (0.82 - 0.44 * a**0.5 - 0.03 * np.sin(20 * a)) * h) for a in t]
    draw.line(curve, fill=RED, width=7)
    for x, y, text in ((0.64, 0.3, "A"), (0.86, 0.3, "B"), (0.75, 0.7, "C")):
        r = 0.09 * h
        draw.ellipse((x * w - r, y * h - r, x * w + r, y * h + r), outline=GREEN, width=6)
        draw_word(draw, text, (x * w, y * h), 0.09 * h, BLACK)
    for a, b in (
        ((0.70, 0.3), (0.80, 0.3)),
        ((0.66, 0.42), (0.72, 0.6)),
        ((0.84, 0.42), (0.78, 0.6)),
    ):
        draw.line([(a[0] * w, a[1] * h), (b[0] * w, b[1] * h)], fill=BLUE, width=6)


def _noticeboard(draw: ImageDraw.ImageDraw, w: float, h: float, rng: np.random.Generator) -> None:
    draw.rectangle((0, 0, w, h), fill=(110, 76, 46))
    draw.rectangle((0.02 * w, 0.03 * h, 0.98 * w, 0.97 * h), fill=(190, 150, 100))
    papers = (WHITE, (246, 232, 150), (190, 220, 240), (240, 190, 190), (200, 230, 190))
    for k in range(12):
        x, y = (0.05 + 0.155 * (k % 6)) * w, (0.10 + 0.43 * (k // 6)) * h
        wide, high = rng.uniform(0.10, 0.14) * w, rng.uniform(0.26, 0.38) * h
        draw.rectangle((x, y, x + wide, y + high), fill=papers[rng.integers(len(papers))])
        for line in range(5):
            level = y + (0.2 + 0.14 * line) * high
            draw.line((x + 0.1 * wide, level, x + 0.85 * wide, level), fill=GRAY, width=3)
        draw.ellipse((x + wide / 2 - 6, y - 2, x + wide / 2 + 6, y + 10), fill=RED)


def _calendar(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=WHITE)
    draw.rectangle((0, 0, w, 0.36 * h), fill=TEAL)
    _word(draw, "MAY", w / 2, 0.18 * h, 0.6 * w, 0.18 * h, WHITE)
    for row in range(5):
        for column in range(7):
            x, y = (0.1 + 0.125 * column) * w, (0.44 + 0.11 * row) * h
            color = RED if column == 6 else GRAY
            draw.rectangle((x, y, x + 0.07 * w, y + 0.05 * h), fill=color)


def _clock(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=WHITE)
    for hour in range(12):
        a = np.radians(30 * hour)
        inner = 0.34 if hour % 3 == 0 else 0.39
        ends = [(0.5 * w + r * w * np.sin(a), 0.5 * h - r * h * np.cos(a)) for r in (inner, 0.45)]
        draw.line(ends, fill=BLACK, width=8)
    for degrees, reach, width in ((320, 0.24, 14), (48, 0.36, 9)):
        a = np.radians(degrees)
        tip = (0.5 * w + reach * w * np.sin(a), 0.5 * h - reach * h * np.cos(a))
        draw.line([(0.5 * w, 0.5 * h), tip], fill=BLACK, width=width)


def _screen_code(draw: ImageDraw.ImageDraw, w: float, h: float, rng: np.random.Generator) -> None:
    draw.rectangle((0, 0, w, h), fill=(24, 30, 40))
    inks = ((150, 200, 120), (210, 170, 90), (120, 170, 220), (200, 200, 200))
    for line in range(14):
        x = (0.05 + 0.05 * rng.integers(0, 4)) * w
        y = (0.06 + 0.065 * line) * h
        for _ in range(rng.integers(1, 4)):
            wide = rng.uniform(0.06, 0.2) * w
            draw.rectangle((x, y, x + wide, y + 0.03 * h), fill=inks[rng.integers(4)])
            x += wide + 0.02 * w


def _screen_plot(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(232, 238, 244))
    draw.rectangle((0, 0, w, 0.1 * h), fill=BLUE)
    t = np.linspace(0, 1, 40)
    for phase, color in ((0, RED), (1.4, GREEN), (2.8, ORANGE)):
        curve = [((0.08 + 0.84 * a) * w, (0.55 + 0.25 * np.sin(7 * a + phase)) * h) for a in t]
        draw.line(curve, fill=color, width=6)


def _screen_map(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(50, 70, 60))
    for x0, y0, x1, y1 in ((0.1, 0.1, 0.4, 0.5), (0.5, 0.1, 0.9, 0.4), (0.3, 0.6, 0.8, 0.9)):
        draw.rectangle((x0 * w, y0 * h, x1 * w, y1 * h), outline=(140, 230, 160), width=6)
    draw.ellipse((0.42 * w, 0.45 * h, 0.5 * w, 0.57 * h), fill=RED)


def _projection(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(250, 250, 252))
    draw.rectangle((0, 0, w, 0.2 * h), fill=(40, 70, 120))
    _word(draw, "FOUR STARTS", w / 2, 0.1 * h, 0.8 * w, 0.12 * h, WHITE)
    for k, color in enumerate((RED, GREEN, BLUE, ORANGE)):
        y = (0.32 + 0.16 * k) * h
        draw.ellipse((0.1 * w, y - 0.03 * h, 0.1 * w + 0.06 * h, y + 0.03 * h), fill=color)
        draw.rectangle((0.18 * w, y - 0.02 * h, (0.5 + 0.06 * k) * w, y + 0.02 * h), fill=GRAY)


def _keyboard(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(40, 42, 46))
    for row in range(5):
        for column in range(15):
            x, y = (0.025 + 0.0637 * column) * w, (0.07 + 0.18 * row) * h
            draw.rectangle((x, y, x + 0.05 * w, y + 0.13 * h), fill=(82, 86, 92))


def _books(
    draw: ImageDraw.ImageDraw, w: float, h: float, rng: np.random.Generator, count: int
) -> None:
    """A row of spines on a shelf."""
    draw.rectangle((0, 0, w, h), fill=(38, 30, 24))
    colors = (RED, GREEN, BLUE, YELLOW, ORANGE, TEAL, WHITE, (110, 60, 40), (90, 40, 80), BLACK)
    edges = np.cumsum(rng.uniform(0.6, 1.4, count))
    edges = np.concatenate([[0], edges]) / edges[-1]
    for left, right in itertools.pairwise(edges):
        top = rng.uniform(0.04, 0.28) * h
        color = colors[rng.integers(len(colors))]
        draw.rectangle((left * w + 1, top, right * w - 2, h), fill=color)
        for level in (0.2, 0.72):
            y = top + level * (h - top)
            draw.rectangle((left * w + 3, y, right * w - 4, y + 0.05 * h), fill=(220, 200, 140))


def _binders(draw: ImageDraw.ImageDraw, w: float, h: float, rng: np.random.Generator) -> None:
    draw.rectangle((0, 0, w, h), fill=(46, 44, 42))
    colors = (BLUE, RED, GREEN, BLACK, GRAY, YELLOW)
    for k in range(14):
        if rng.random() < 0.12:
            continue
        left, right = k * w / 14 + 2, (k + 1) * w / 14 - 2
        draw.rectangle((left, 0.06 * h, right, h), fill=colors[rng.integers(len(colors))])
        draw.rectangle((left + 6, 0.2 * h, right - 6, 0.5 * h), fill=WHITE)
        middle = (left + right) / 2
        draw.ellipse((middle - 6, 0.72 * h, middle + 6, 0.72 * h + 12), fill=WHITE)


def _server(draw: ImageDraw.ImageDraw, w: float, h: float, rng: np.random.Generator) -> None:
    draw.rectangle((0, 0, w, h), fill=(30, 32, 36))
    for unit in range(20):
        y = (0.02 + 0.048 * unit) * h
        shade = int(rng.integers(48, 84))
        draw.rectangle((0.07 * w, y, 0.93 * w, y + 0.042 * h), fill=(shade, shade, shade + 6))
        for k in range(8):
            if rng.random() < 0.7:
                x = (0.14 + 0.06 * k) * w
                color = (60, 220, 90) if rng.random() < 0.8 else (240, 170, 40)
                draw.rectangle((x, y + 0.014 * h, x + 0.03 * w, y + 0.026 * h), fill=color)
        draw.rectangle((0.68 * w, y + 0.01 * h, 0.88 * w, y + 0.03 * h), fill=(20, 20, 22))


def _vending(draw: ImageDraw.ImageDraw, w: float, h: float, rng: np.random.Generator) -> None:
    draw.rectangle((0, 0, w, h), fill=(188, 30, 40))
    _word(draw, "SNACKS", 0.5 * w, 0.07 * h, 0.8 * w, 0.07 * h, WHITE)
    draw.rectangle((0.06 * w, 0.14 * h, 0.72 * w, 0.80 * h), fill=(30, 36, 44))
    colors = (RED, YELLOW, BLUE, GREEN, ORANGE, TEAL, WHITE)
    for row in range(6):
        for column in range(5):
            x, y = (0.09 + 0.125 * column) * w, (0.16 + 0.105 * row) * h
            color = colors[rng.integers(len(colors))]
            draw.rectangle((x, y, x + 0.09 * w, y + 0.075 * h), fill=color)
    draw.rectangle((0.10 * w, 0.85 * h, 0.68 * w, 0.94 * h), fill=BLACK)
    draw.rectangle((0.78 * w, 0.3 * h, 0.94 * w, 0.5 * h), fill=(210, 214, 218))


def _microwave(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(196, 198, 200))
    draw.rectangle((0.05 * w, 0.12 * h, 0.7 * w, 0.88 * h), fill=(34, 36, 40))
    draw.rectangle((0.76 * w, 0.12 * h, 0.94 * w, 0.28 * h), fill=(40, 160, 90))
    for row in range(3):
        for column in range(2):
            x, y = (0.77 + 0.09 * column) * w, (0.4 + 0.17 * row) * h
            draw.rectangle((x, y, x + 0.06 * w, y + 0.1 * h), fill=GRAY)


def _oven(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(210, 212, 214))
    draw.rectangle((0.1 * w, 0.32 * h, 0.9 * w, 0.9 * h), fill=(36, 38, 42))
    draw.rectangle((0.1 * w, 0.22 * h, 0.9 * w, 0.27 * h), fill=GRAY)
    for k in range(5):
        x = (0.16 + 0.15 * k) * w
        draw.ellipse((x, 0.06 * h, x + 0.08 * w, 0.14 * h), fill=BLACK)


def _fridge(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=(226, 228, 228))
    draw.rectangle((0, 0.34 * h, w, 0.35 * h), fill=GRAY)
    for top, bottom in ((0.18, 0.31), (0.38, 0.55)):
        draw.rectangle((0.08 * w, top * h, 0.14 * w, bottom * h), fill=GRAY)
    draw.rectangle((0.5 * w, 0.42 * h, 0.78 * w, 0.52 * h), fill=YELLOW)
    draw.rectangle((0.4 * w, 0.1 * h, 0.56 * w, 0.16 * h), fill=RED)


def _lift(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    for x in range(int(w)):
        shade = int(168 + 26 * np.sin(9.0 * x / w) + 10 * np.sin(41.0 * x / w))
        draw.line((x, 0, x, h), fill=(shade, shade, shade + 4))
    draw.line((0.5 * w, 0, 0.5 * w, h), fill=(50, 52, 56), width=8)


def _tools(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Perforated board with tools hung up by size."""
    draw.rectangle((0, 0, w, h), fill=(86, 104, 120))
    for row in range(12):
        for column in range(24):
            x, y = (column + 0.5) * w / 24, (row + 0.5) * h / 12
            draw.ellipse((x - 3, y - 3, x + 3, y + 3), fill=(60, 74, 88))
    for k in range(6):
        x, long = (0.06 + 0.05 * k) * w, (0.62 - 0.06 * k) * h
        draw.rectangle((x, 0.14 * h, x + 0.012 * w, 0.14 * h + long), fill=(200, 204, 208))
        draw.rectangle((x - 0.006 * w, 0.1 * h, x + 0.018 * w, 0.26 * h), fill=RED)
    for k in range(3):
        x = (0.44 + 0.1 * k) * w
        draw.rectangle((x, 0.2 * h, x + 0.018 * w, 0.82 * h), fill=(170, 120, 70))
        draw.rectangle((x - 0.028 * w, 0.12 * h, x + 0.046 * w, 0.26 * h), fill=BLACK)
    draw.polygon(
        [(0.76 * w, 0.2 * h), (0.96 * w, 0.3 * h), (0.96 * w, 0.36 * h), (0.76 * w, 0.42 * h)],
        fill=(206, 210, 214),
    )
    draw.rectangle((0.72 * w, 0.18 * h, 0.77 * w, 0.46 * h), fill=ORANGE)
    for k in range(4):
        x, r = (0.75 + 0.06 * k) * w, (0.05 + 0.012 * k) * h
        draw.ellipse((x - r, 0.7 * h - r, x + r, 0.7 * h + r), outline=YELLOW, width=9)


def _washer(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    """Front of a washing machine."""
    draw.rectangle((0, 0, w, h), fill=(236, 236, 236))
    draw.ellipse((0.2 * w, 0.26 * h, 0.8 * w, 0.86 * h), fill=GRAY)
    draw.ellipse((0.27 * w, 0.33 * h, 0.73 * w, 0.79 * h), fill=(50, 60, 74))
    draw.rectangle((0.06 * w, 0.07 * h, 0.3 * w, 0.17 * h), fill=(200, 204, 208))
    draw.ellipse((0.78 * w, 0.06 * h, 0.9 * w, 0.18 * h), fill=BLACK)


def _label(draw: ImageDraw.ImageDraw, w: float, h: float) -> None:
    draw.rectangle((0, 0, w, h), fill=WHITE)
    _word(draw, "SPARES", w / 2, 0.3 * h, 0.8 * w, 0.3 * h, RED)
    for k in range(12):
        x = (0.1 + 0.067 * k) * w
        draw.rectangle((x, 0.58 * h, x + (0.02 + 0.015 * (k % 3)) * w, 0.9 * h), fill=BLACK)
