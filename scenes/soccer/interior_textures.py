"""Pictures of the hall's surfaces: carpet, linoleum, ceiling panels, the view outside, a leaf.

Float images (rows, columns, 3 or 4) of sRGB values in 0..1.
"""

from __future__ import annotations

import numpy as np
from PIL import ImageDraw

from scenes.modeling.noise import blend, fractal_noise, smooth_step
from scenes.modeling.painting import painted, rgb


def carpet(size: int, rng: np.random.Generator) -> np.ndarray:
    """One meter of green needle felt."""
    fibers = fractal_noise(size, size, (size // 2, size // 3), 1, rng)
    wear = fractal_noise(size, size, 4, 3, rng)
    return np.array([0.16, 0.46, 0.22]) * (0.91 + 0.13 * fibers + 0.04 * wear)[..., None]


def linoleum(size: int, rng: np.random.Generator) -> np.ndarray:
    """One sheet of two meters, marbled gray, with a seam along one edge."""
    marble = fractal_noise(size, size, (6, 10), 5, rng)
    flecks = fractal_noise(size, size, size // 8, 1, rng)
    image = blend(np.array([0.59, 0.59, 0.58]), np.array([0.66, 0.65, 0.62]), marble)
    image *= (0.96 + 0.08 * flecks)[..., None]
    image[:3] *= 0.75
    return image


def ceiling_panels(size: int, rng: np.random.Generator) -> np.ndarray:
    """One acoustic panel of 0.6 m with its rail."""
    holes = smooth_step(0.80, 0.90, fractal_noise(size, size, size // 3, 1, rng))
    image = np.array([0.93, 0.93, 0.91]) * (1 - 0.13 * holes)[..., None]
    image[:6], image[:, :6] = 0.80, 0.80
    return image


def outside(width: int, height: int, rng: np.random.Generator) -> np.ndarray:
    """A pale day: clouds, a row of trees, brick buildings, a lawn at the foot."""
    up = np.linspace(1, 0, height)[:, None] * np.ones((1, width))
    # At the top it is the background of scene.toml, which is what there is above.
    sky = blend(np.array([0.90, 0.92, 0.93]), np.array([0.70, 0.79, 0.88]), up / 0.9)
    clouds = smooth_step(0.45, 0.8, fractal_noise(height, width, (4, 8), 5, rng))
    clouds *= 1 - smooth_step(0.7, 0.95, up)
    sky = blend(sky, np.array([0.97, 0.97, 0.96]), 0.8 * clouds)

    def buildings(draw: ImageDraw.ImageDraw, s: float) -> None:
        tall, scale = s * height / width, s / width
        for left, right, top, wall in (
            (40, 190, 0.38, (0.62, 0.42, 0.34)),
            (230, 300, 0.55, (0.72, 0.66, 0.56)),
            (400, 620, 0.30, (0.60, 0.60, 0.58)),
            (700, 790, 0.50, (0.66, 0.46, 0.38)),
            (850, 990, 0.42, (0.74, 0.70, 0.64)),
        ):
            draw.rectangle((left * scale, top * tall, right * scale, 0.9 * tall), fill=rgb(wall))
            for x in range(left + 9, right - 12, 17):
                for y in range(int(top * height) + 9, int(0.75 * height), 19):
                    shape = (x * scale, y * scale, (x + 9) * scale, (y + 11) * scale)
                    draw.rectangle(shape, fill=rgb((0.33, 0.38, 0.43)))

    picture, covered = painted(width, height, buildings)
    image = sky * (1 - covered) + picture * covered
    crowns = fractal_noise(1, width, (1, 40), 3, rng)[0]
    leaves = fractal_noise(height, width, (24, 96), 3, rng)
    green = blend(np.array([0.22, 0.33, 0.16]), np.array([0.45, 0.55, 0.27]), leaves)
    image = blend(image, green, smooth_step(0.0, 0.02, 0.18 + 0.32 * crowns[None] - up))
    return blend(image, np.array([0.47, 0.54, 0.28]), smooth_step(0.10, 0.08, up))


def leaf(size: int) -> np.ndarray:
    """RGBA: one pointed leaf along the image's y axis; green under the transparent part, too."""
    across, along = np.meshgrid(np.linspace(-1, 1, size), np.linspace(1, 0, size))
    half = 0.95 * np.sin(np.pi * np.clip(along, 0, 1) ** 0.8)
    vein = np.abs(across) < 0.06
    image = np.empty((size, size, 4))
    image[..., :3] = np.where(vein[..., None], (0.50, 0.60, 0.32), (0.25, 0.42, 0.20))
    image[..., 3] = np.abs(across) < half
    return image
