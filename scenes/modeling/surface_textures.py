"""Pictures of building surfaces: paving, plaster, stone, brick, tiles, wood, grass.

Every function returns a float image (rows, columns, 3) of sRGB values in 0..1.
"""

from __future__ import annotations

import numpy as np

from scenes.modeling.noise import blend, fractal_noise, grid_cells, smooth_step

Color = tuple[float, float, float]


def paving(size: int, tiles: int, rng: np.random.Generator) -> np.ndarray:
    """Square stone slabs in a gentle two-tone check; straight joints show mirror distortion."""
    light, dark = np.array([0.80, 0.75, 0.66]), np.array([0.66, 0.60, 0.52])
    row, column, across_y, across_x = grid_cells(size, size, tiles, tiles)
    tone = 1 + 0.09 * (rng.random((tiles, tiles)) - 0.5)
    warmth = 0.03 * (rng.random((tiles, tiles)) - 0.5)
    checked = ((row + column) % 2)[..., None]
    image = np.where(checked == 0, light, dark) * tone[row, column][..., None]
    image += warmth[row, column][..., None] * np.array([1.0, 0.0, -1.0])
    image *= _grain(size, size, 0.10, rng)[..., None]
    return _with_joints(image, across_y, across_x, 0.035, (0.47, 0.42, 0.36))


def terracotta_floor(size: int, tiles: int, rng: np.random.Generator) -> np.ndarray:
    """Hand-made clay tiles of the arcade walk, laid square."""
    row, column, across_y, across_x = grid_cells(size, size, tiles, tiles)
    tone = 1 + 0.28 * (rng.random((tiles, tiles)) - 0.5)
    image = np.array([0.70, 0.40, 0.28]) * tone[row, column][..., None]
    image *= _grain(size, size, 0.16, rng)[..., None]
    return _with_joints(image, across_y, across_x, 0.05, (0.62, 0.55, 0.47))


def cobbles(size: int, stones: int, rng: np.random.Generator) -> np.ndarray:
    """Rounded river cobbles: nearest-stone cells on a jittered grid."""
    grid = np.stack(np.meshgrid(np.arange(stones), np.arange(stones)), -1).reshape(-1, 2) + 0.5
    centers = grid + 0.26 * (rng.random(grid.shape) - 0.5)
    centers[:, 0] += 0.5 * (np.floor(grid[:, 1]) % 2)  # brick-like bond
    pixels = (np.arange(size) + 0.5) * stones / size
    nearest = np.full((size, size), np.inf)
    second = np.full((size, size), np.inf)
    owner = np.zeros((size, size), int)
    for index, (x, y) in enumerate(centers):
        dx = np.abs(pixels - x % stones)
        dy = np.abs(pixels - y)
        dx, dy = np.minimum(dx, stones - dx), np.minimum(dy, stones - dy)
        distance = np.hypot(dx[None, :], dy[:, None])
        closer = distance < nearest
        second = np.where(closer, nearest, np.minimum(second, distance))
        owner = np.where(closer, index, owner)
        nearest = np.minimum(nearest, distance)
    palette = np.array(
        [
            [0.55, 0.54, 0.52],
            [0.47, 0.45, 0.43],
            [0.61, 0.56, 0.49],
            [0.52, 0.47, 0.43],
            [0.42, 0.43, 0.45],
        ]
    )
    image = palette[rng.integers(0, len(palette), len(centers))][owner]
    dome = smooth_step(0.0, 0.42, second - nearest)
    image = image * (0.72 + 0.38 * dome)[..., None] * _grain(size, size, 0.14, rng)[..., None]
    return blend(np.array([0.33, 0.29, 0.24]), image, smooth_step(0.03, 0.12, second - nearest))


def ashlar(size: int, courses: int, rng: np.random.Generator) -> np.ndarray:
    """Dressed limestone blocks, each second course shifted by half a block."""
    row, column, across_y, across_x = _bond(size, courses, courses // 2)
    tone = 1 + 0.14 * (rng.random((courses, courses)) - 0.5)
    image = np.array([0.79, 0.74, 0.64]) * tone[row, column][..., None]
    image *= _grain(size, size, 0.16, rng)[..., None]
    return _with_joints(image, across_y, across_x, 0.035, (0.60, 0.55, 0.47), aspect=2.0)


def brick(size: int, courses: int, rng: np.random.Generator) -> np.ndarray:
    """Running-bond brickwork of warm reds."""
    row, column, across_y, across_x = _bond(size, courses, courses // 3)
    tone = 1 + 0.34 * (rng.random((courses, courses)) - 0.5)
    image = np.array([0.66, 0.37, 0.27]) * tone[row, column][..., None]
    image *= _grain(size, size, 0.2, rng)[..., None]
    return _with_joints(image, across_y, across_x, 0.09, (0.66, 0.54, 0.46), aspect=3.0)


def roof_tiles(size: int, columns: int, rows: int, rng: np.random.Generator) -> np.ndarray:
    """Barrel tiles: one column of tiles per texture column, overlaps drawn as dark edges."""
    row, column, across_y, _across_x = grid_cells(size, size, rows, columns)
    tone = 1 + 0.36 * (rng.random((rows, columns)) - 0.5)
    moss = fractal_noise(size, size, 3, 4, rng)
    image = np.array([0.76, 0.43, 0.29]) * tone[row, column][..., None]
    image = blend(image, np.array([0.62, 0.52, 0.38]), 0.55 * smooth_step(0.55, 0.95, moss))
    image *= _grain(size, size, 0.2, rng)[..., None]
    overlap = smooth_step(0.0, 0.16, across_y)
    return image * (0.55 + 0.45 * overlap)[..., None]


def plaster_wall(size: int, hue: Color, dado: Color, rng: np.random.Generator) -> np.ndarray:
    """Three meters of lime-washed wall: painted dado, dividing lines, damp and dust at the foot."""
    height = 3.0 * (1 - (np.arange(size) + 0.5) / size)[:, None] * np.ones((1, size))
    image = np.ones((size, size, 3)) * np.array(hue)
    image = blend(image, np.array(dado), (height < 0.86).astype(float))
    for level, half in ((0.90, 0.022), (0.99, 0.010)):
        line = (np.abs(height - level) < half).astype(float)
        image = blend(image, np.array(dado) * 0.62, line)
    clouds = fractal_noise(size, size, 3, 5, rng)
    image *= (0.90 + 0.16 * clouds)[..., None]
    image *= _grain(size, size, 0.05, rng)[..., None]
    streaks = fractal_noise(size, size, (2, 14), 4, rng)
    damp = smooth_step(0.55, 0.95, streaks) * smooth_step(1.0, 0.0, height) * 0.35
    image = blend(image, np.array([0.42, 0.37, 0.31]), damp)
    shade = 1 - 0.16 * smooth_step(2.3, 3.0, height)  # under the ceiling it is always dimmer
    return image * shade[..., None]


def planks(size: int, boards: int, color: Color, rng: np.random.Generator) -> np.ndarray:
    """Boards running along the image's x axis."""
    row, _, across_y, _ = grid_cells(size, size, boards, 1)
    tone = 1 + 0.22 * (rng.random(boards) - 0.5)
    streaks = fractal_noise(size, size, (24, 2), 4, rng)
    image = np.array(color) * tone[row][..., None] * (0.78 + 0.40 * streaks)[..., None]
    gap = smooth_step(0.0, 0.06, np.minimum(across_y, 1 - across_y))
    return image * (0.45 + 0.55 * gap)[..., None]


def grass(size: int, rng: np.random.Generator) -> np.ndarray:
    """Dry Mediterranean meadow."""
    patches = fractal_noise(size, size, 9, 4, rng)
    blades = fractal_noise(size, size, (40, 60), 2, rng)
    image = blend(np.array([0.44, 0.48, 0.23]), np.array([0.60, 0.56, 0.31]), patches)
    return image * (0.78 + 0.40 * blades)[..., None]


def mottled(size: int, color: Color, strength: float, rng: np.random.Generator) -> np.ndarray:
    """Any plain material with cloudy variation and fine grain."""
    clouds = fractal_noise(size, size, 4, 5, rng)
    image = np.array(color) * (1 - strength / 2 + strength * clouds)[..., None]
    return image * _grain(size, size, strength / 2, rng)[..., None]


def mosaic(size: int, pieces: int, rng: np.random.Generator) -> np.ndarray:
    """Small glazed tiles in sea colors."""
    palette = np.array(
        [[0.12, 0.42, 0.52], [0.18, 0.55, 0.60], [0.85, 0.82, 0.70], [0.10, 0.30, 0.45]]
    )
    row, column, across_y, across_x = grid_cells(size, size, pieces, pieces)
    image = palette[rng.choice(len(palette), (pieces, pieces), p=[0.35, 0.3, 0.15, 0.2])]
    image = image[row, column] * _grain(size, size, 0.1, rng)[..., None]
    return _with_joints(image, across_y, across_x, 0.09, (0.78, 0.76, 0.70))


def _grain(height: int, width: int, strength: float, rng: np.random.Generator) -> np.ndarray:
    fine = fractal_noise(height, width, (height // 16, width // 16), 3, rng)
    return 1 - strength / 2 + strength * fine


def _bond(size: int, courses: int, blocks: int) -> tuple[np.ndarray, ...]:
    """Like `grid_cells`, with each second row shifted by half a block."""
    y = ((np.arange(size) + 0.5) * courses / size)[:, None] * np.ones((1, size))
    x = ((np.arange(size) + 0.5) * blocks / size)[None, :] + 0.5 * (y.astype(int) % 2)
    return y.astype(int), x.astype(int) % blocks, y % 1, x % 1


def _with_joints(
    image: np.ndarray,
    across_y: np.ndarray,
    across_x: np.ndarray,
    width: float,
    color: Color,
    aspect: float = 1.0,
) -> np.ndarray:
    """Draw joints between cells, and darken the cell edges as worn slabs do."""
    edge_y = np.minimum(across_y, 1 - across_y)
    edge_x = np.minimum(across_x, 1 - across_x) * aspect
    edge = np.minimum(edge_y, edge_x)
    worn = image * (0.90 + 0.10 * smooth_step(width, 4 * width, edge))[..., None]
    return blend(worn, np.array(color), 1 - smooth_step(0.5 * width, 1.1 * width, edge))
