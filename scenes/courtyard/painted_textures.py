"""Pictures with a meaning: compass rose, banners, arch fronts, clock, foliage, railing, props.

Float images (rows, columns, 3 or 4) of sRGB values in 0..1, unless said otherwise.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

from scenes.modeling import surface_textures as surface
from scenes.modeling.lettering import draw_word
from scenes.modeling.noise import fractal_noise
from scenes.modeling.painting import Color, painted, rgb

# Where each material sits in the 4 x 4 prop atlas, from the top left, row by row.
PROP_CELLS = (
    "limestone", "marble", "terracotta", "soil",
    "oak", "dark_oak", "green_paint", "blue_paint",
    "iron", "bronze", "mosaic", "leather",
    "red_paint", "clock", "lemon", "dim_room",
)  # fmt: skip


def compass_rose(size: int, tiles: int, rng: np.random.Generator) -> np.ndarray:
    """The inlaid rose: image up is north, image right is east, letters upright."""
    base = surface.paving(size, tiles, rng)

    def paint(draw: ImageDraw.ImageDraw, s: float) -> None:
        middle = s / 2

        def circle(radius: float, color: Color) -> None:
            r = radius * s
            draw.ellipse((middle - r, middle - r, middle + r, middle + r), fill=rgb(color))

        circle(0.492, (0.36, 0.30, 0.26))
        circle(0.484, (0.84, 0.79, 0.69))
        circle(0.440, (0.36, 0.30, 0.26))
        circle(0.434, (0.88, 0.84, 0.75))
        _degree_scale(draw, s)
        circle(0.318, (0.55, 0.20, 0.16))
        circle(0.306, (0.82, 0.76, 0.64))
        _star(draw, s, 8, 22.5, 0.262, 0.10, (0.66, 0.56, 0.40), (0.80, 0.72, 0.56))
        _star(draw, s, 4, 45.0, 0.300, 0.10, (0.14, 0.33, 0.40), (0.44, 0.62, 0.64))
        _star(draw, s, 4, 0.0, 0.318, 0.085, (0.50, 0.13, 0.11), (0.84, 0.45, 0.30))
        circle(0.040, (0.36, 0.30, 0.26))
        circle(0.032, (0.88, 0.70, 0.34))
        for letter, x, y in (("N", 0, -1), ("E", 1, 0), ("S", 0, 1), ("W", -1, 0)):
            color = (0.60, 0.10, 0.08) if letter == "N" else (0.13, 0.18, 0.26)
            center = (middle + 0.376 * s * x, middle + 0.376 * s * y)
            draw_word(draw, letter, center, 0.098 * s, rgb(color))

    inlay, covered = painted(size, size, paint)
    clouds = 0.91 + 0.14 * fractal_noise(size, size, 6, 5, rng)
    return base * (1 - covered) + inlay * clouds[..., None] * covered


def banner(
    width: int, height: int, word: str, cloth: Color, ink: Color, rng: np.random.Generator
) -> np.ndarray:
    """A hanging cloth with the initial large and the whole word below it."""

    def paint(draw: ImageDraw.ImageDraw, s: float) -> None:
        tall = s * height / width
        draw.rectangle((0, 0, s, tall), fill=rgb(cloth))
        for inset, line in ((0.035, 0.022), (0.075, 0.008)):
            draw.rectangle(
                (inset * s, inset * s, s - inset * s, tall - inset * s),
                outline=rgb(ink),
                width=round(line * s),
            )
        draw_word(draw, word[0], (0.5 * s, 0.40 * tall), 0.50 * tall, rgb(ink), weight=0.19)
        size = 0.155 * tall if len(word) < 5 else 0.135 * tall
        draw_word(draw, word, (0.5 * s, 0.80 * tall), size, rgb(ink), weight=0.19)

    image, _ = painted(width, height, paint)
    weave = 0.90 + 0.16 * fractal_noise(height, width, (4, 10), 5, rng)
    return image * weave[..., None]


def arch_front(
    width: int, height: int, hue: Color, accent: Color, rng: np.random.Generator
) -> np.ndarray:
    """Front of one arcade bay, 2.2 m wide, from the springing line up to the eave.

    The round opening (radius 0.85 m) is framed by voussoirs alternating stone and accent.
    """

    def paint(draw: ImageDraw.ImageDraw, s: float) -> None:
        meter = s / 2.2
        foot = s * height / width
        draw.rectangle((0, 0, s, foot), fill=rgb(hue))
        center = s / 2

        def pie(radius: float, start: float, end: float, color: Color) -> None:
            r = radius * meter
            draw.pieslice((center - r, foot - r, center + r, foot + r), start, end, fill=rgb(color))

        pie(1.10, 180, 360, tuple(0.55 * c for c in accent))
        count = 13
        for index in range(count):
            stone = (0.86, 0.81, 0.71) if index % 2 == 0 else accent
            start = 180 + 180 * index / count
            pie(1.075, start, start + 180 / count - 0.8, stone)
        _frieze(draw, meter, s, accent)
        for x in (0.0, s):
            for radius, color in ((0.135, accent), (0.105, (0.90, 0.86, 0.77)), (0.045, accent)):
                r, y = radius * meter, foot - 0.83 * meter
                draw.ellipse((x - r, y - r, x + r, y + r), fill=rgb(color))

    image, _ = painted(width, height, paint)
    clouds = 0.90 + 0.16 * fractal_noise(height, width, 4, 5, rng)
    return image * clouds[..., None]


def foliage(size: int, rng: np.random.Generator) -> np.ndarray:
    """RGBA atlas: leafy spray (left), conifer spray (right), dense leaf and bark strips (foot).

    The color under transparent pixels is leaf green, so that filtering draws no halo.
    """
    canvas = Image.new("RGBA", (size * 2, size * 2), (74, 98, 44, 0))
    draw = ImageDraw.Draw(canvas)
    greens = [(64, 92, 38), (82, 110, 48), (100, 128, 58), (52, 78, 34), (116, 138, 66)]
    dark = [(38, 64, 40), (48, 76, 46), (58, 88, 52), (32, 56, 36)]
    half, strip = size, int(size * 1.5)
    for _ in range(150):
        radius, angle = 0.40 * half * np.sqrt(rng.random()), rng.random() * 2 * np.pi
        x, y = half / 2 + radius * np.cos(angle), strip / 2 + 1.4 * radius * np.sin(angle)
        _leaf(
            draw,
            x,
            y,
            angle + 1.2 * (rng.random() - 0.5),
            0.14 * half,
            0.055 * half,
            greens[rng.integers(len(greens))],
            (4, 4, half - 4, strip - 4),
        )
    for _ in range(360):
        along = rng.random()
        reach = 0.40 * half * (1 - along) ** 0.7 + 0.03 * half
        x = half * 1.5 + reach * (2 * rng.random() - 1)
        y = strip * (0.95 - 0.82 * along)
        lean = -np.pi / 2 + 0.9 * (x - half * 1.5) / half
        _leaf(
            draw,
            x,
            y,
            lean,
            0.12 * half,
            0.022 * half,
            dark[rng.integers(len(dark))],
            (half + 4, 4, 2 * half - 4, strip - 4),
        )
    _opaque_strips(draw, size, strip, greens, dark, rng)
    small = canvas.resize((size, size), Image.Resampling.BOX)
    pixels = np.asarray(small, float) / 255
    pixels[..., :3] = np.round(pixels[..., :3] * 31) / 31  # fewer shades make a smaller PNG
    pixels[..., 3] = np.round(pixels[..., 3] * 7) / 7
    pixels[pixels[..., 3] < 0.2] = (72 / 255, 96 / 255, 44 / 255, 0)
    return pixels


def balloon_stripes(width: int) -> np.ndarray:
    """Vertical gores of a hot-air balloon with a pale belt."""
    gore = (np.arange(width) * 12 // width) % 3
    colors = np.array([[0.78, 0.18, 0.14], [0.95, 0.88, 0.70], [0.93, 0.62, 0.18]])
    image = np.repeat(colors[gore][None], width // 2, axis=0)
    image[int(0.40 * width / 2) : int(0.48 * width / 2)] = (0.18, 0.30, 0.46)
    return image


def railing(size: int) -> np.ndarray:
    """RGBA wrought-iron panel: bars, rails and a row of rings; repeats along x."""
    canvas = Image.new("RGBA", (size * 4, size * 4), (32, 34, 36, 0))
    draw = ImageDraw.Draw(canvas)
    s, iron = size * 4, (32, 34, 36, 255)
    bars = 7
    for index in range(bars):
        x = (index + 0.5) * s / bars
        draw.rectangle((x - 0.017 * s, 0.03 * s, x + 0.017 * s, s), fill=iron)
        box = (x - 0.062 * s, 0.09 * s, x + 0.062 * s, 0.22 * s)
        draw.ellipse(box, outline=iron, width=round(0.022 * s))
    for top, bottom in ((0.0, 0.045), (0.075, 0.10), (0.21, 0.235), (0.90, 0.93)):
        draw.rectangle((0, top * s, s, bottom * s), fill=iron)
    return np.asarray(canvas.resize((size, size), Image.Resampling.BOX), float) / 255


def prop_atlas(size: int, rng: np.random.Generator) -> np.ndarray:
    """All the small-object materials in one picture, so that each object is one mesh."""
    cell = size // 4
    makers: dict[str, Callable[[], np.ndarray]] = {
        "limestone": lambda: surface.mottled(cell, (0.80, 0.75, 0.65), 0.20, rng),
        "marble": lambda: surface.mottled(cell, (0.83, 0.80, 0.73), 0.22, rng),
        "terracotta": lambda: surface.mottled(cell, (0.74, 0.42, 0.28), 0.26, rng),
        "soil": lambda: surface.mottled(cell, (0.28, 0.21, 0.15), 0.60, rng),
        "oak": lambda: surface.planks(cell, 4, (0.62, 0.43, 0.26), rng),
        "dark_oak": lambda: surface.planks(cell, 4, (0.37, 0.24, 0.15), rng),
        "green_paint": lambda: surface.planks(cell, 6, (0.25, 0.43, 0.36), rng),
        "blue_paint": lambda: surface.planks(cell, 6, (0.27, 0.43, 0.58), rng),
        "iron": lambda: surface.mottled(cell, (0.17, 0.17, 0.18), 0.30, rng),
        "bronze": lambda: surface.mottled(cell, (0.52, 0.40, 0.20), 0.45, rng),
        "mosaic": lambda: surface.mosaic(cell, 12, rng),
        "leather": lambda: surface.mottled(cell, (0.42, 0.24, 0.14), 0.30, rng),
        "red_paint": lambda: surface.mottled(cell, (0.70, 0.13, 0.11), 0.12, rng),
        "clock": lambda: clock_face(cell),
        "lemon": lambda: surface.mottled(cell, (0.95, 0.80, 0.18), 0.14, rng),
        "dim_room": lambda: surface.mottled(cell, (0.13, 0.15, 0.18), 0.40, rng),
    }
    rows = [
        np.concatenate([makers[name]() for name in PROP_CELLS[start : start + 4]], axis=1)
        for start in range(0, 16, 4)
    ]
    return np.concatenate(rows, axis=0)


def clock_face(size: int) -> np.ndarray:
    """Tower clock at ten past ten."""

    def paint(draw: ImageDraw.ImageDraw, s: float) -> None:
        draw.rectangle((0, 0, s, s), fill=rgb((0.93, 0.90, 0.82)))
        for hour in range(12):
            angle = np.radians(30 * hour)
            long = 0.11 if hour % 3 == 0 else 0.06
            _ray(draw, s, angle, 0.43 - long, 0.43, 0.022, (0.14, 0.16, 0.22))
        _ray(draw, s, np.radians(305), -0.05, 0.24, 0.040, (0.14, 0.16, 0.22))
        _ray(draw, s, np.radians(60), -0.05, 0.36, 0.028, (0.14, 0.16, 0.22))

    return painted(size, size, paint)[0]


def _star(
    draw: ImageDraw.ImageDraw,
    s: float,
    points: int,
    first_deg: float,
    reach: float,
    waist: float,
    dark: Color,
    light: Color,
) -> None:
    """Star of kite-shaped points, each split into a dark and a light half."""
    for index in range(points):
        angle = np.radians(first_deg + 360 * index / points)
        tip = _polar(s, reach, angle)
        for side, color in ((1, dark), (-1, light)):
            shoulder = _polar(s, waist, angle + side * np.pi / 4)
            draw.polygon([(s / 2, s / 2), tip, shoulder], fill=rgb(color))


def _degree_scale(draw: ImageDraw.ImageDraw, s: float) -> None:
    for degree in range(0, 360, 5):
        inner = 0.448 if degree % 15 == 0 else 0.464
        _ray(draw, s, np.radians(degree), inner, 0.480, 0.005, (0.36, 0.30, 0.26))


def _ray(
    draw: ImageDraw.ImageDraw,
    s: float,
    angle: float,
    start: float,
    end: float,
    width: float,
    color: Color,
) -> None:
    draw.line(
        [_polar(s, start, angle), _polar(s, end, angle)],
        fill=rgb(color),
        width=max(1, round(width * s)),
    )


def _polar(s: float, radius: float, angle: float) -> tuple[float, float]:
    """Pixel at a radius and a compass angle (0 up the image, growing clockwise)."""
    return (s / 2 + s * radius * np.sin(angle), s / 2 - s * radius * np.cos(angle))


def _frieze(draw: ImageDraw.ImageDraw, meter: float, s: float, accent: Color) -> None:
    """Painted band with triangles under the eave; repeats from bay to bay."""
    draw.rectangle((0, 0, s, 0.20 * meter), fill=rgb((0.90, 0.86, 0.77)))
    draw.rectangle((0, 0.185 * meter, s, 0.21 * meter), fill=rgb(accent))
    draw.rectangle((0, 0.02 * meter, s, 0.045 * meter), fill=rgb(accent))
    teeth = 16
    for index in range(teeth):
        left, step = index * s / teeth, s / teeth
        draw.polygon(
            [(left, 0.165 * meter), (left + step, 0.165 * meter), (left + step / 2, 0.07 * meter)],
            fill=rgb(accent),
        )


def _leaf(
    draw: ImageDraw.ImageDraw,
    x: float,
    y: float,
    angle: float,
    length: float,
    width: float,
    color: tuple[int, int, int],
    limits: tuple[int, int, int, int],
) -> None:
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    base = np.array([x, y])
    outline = [
        base - along * length / 2,
        base - across * width / 2 - along * length * 0.1,
        base + along * length / 2,
        base + across * width / 2 - along * length * 0.1,
    ]
    left, top, right, bottom = limits
    if not all(left <= px <= right and top <= py <= bottom for px, py in outline):
        return  # a clipped leaf would leave a straight edge
    draw.polygon([tuple(point) for point in outline], fill=(*color, 255))


def _opaque_strips(
    draw: ImageDraw.ImageDraw,
    size: int,
    strip: int,
    greens: list,
    dark: list,
    rng: np.random.Generator,
) -> None:
    """Foot of the foliage atlas: dense leaves, dense conifer, bark, each without holes."""
    thirds = np.linspace(0, 2 * size, 4).astype(int)
    grounds = [(48, 70, 32), (30, 52, 34), (98, 78, 58)]
    tints = [greens, dark, [(86, 68, 50), (112, 90, 68), (76, 60, 44)]]
    for index, (ground, colors) in enumerate(zip(grounds, tints, strict=True)):
        left, right = thirds[index], thirds[index + 1]
        draw.rectangle((left, strip, right, 2 * size), fill=(*ground, 255))
        for _ in range(260):
            x, y = rng.uniform(left, right), rng.uniform(strip, 2 * size)
            angle = np.pi / 2 if index == 2 else rng.random() * 2 * np.pi
            _leaf(
                draw,
                x,
                y,
                angle,
                0.10 * size,
                0.035 * size,
                colors[rng.integers(len(colors))],
                (left, strip, right, 2 * size),
            )
