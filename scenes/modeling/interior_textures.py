"""Pictures of indoor surfaces: carpet, parquet, linoleum, tiles, panels, concrete.

Every function returns a float image (rows, columns, 3) of sRGB values in 0..1 that repeats
seamlessly.
"""

from __future__ import annotations

import numpy as np

from scenes.modeling.noise import blend, fractal_noise, grid_cells, smooth_step

Color = tuple[float, float, float]


def carpet(size: int, squares: int, color: Color, rng: np.random.Generator) -> np.ndarray:
    """Carpet squares whose pile runs across from one to the next."""
    row, column, across_y, across_x = grid_cells(size, size, squares, squares)
    along = fractal_noise(size, size, (6, size // 8), 2, rng)
    across = fractal_noise(size, size, (size // 8, 6), 2, rng)
    pile = np.where((row + column) % 2 == 0, along, across)
    tone = 0.90 + 0.08 * ((row + column) % 2) + 0.16 * (pile - 0.5)
    edge = smooth_step(0.0, 0.02, _edge_distance(across_y, across_x))
    return np.array(color) * (tone * (0.86 + 0.14 * edge))[..., None]


def checker(size: int, tiles: int, light: Color, dark: Color, rng: np.random.Generator):
    """Floor tiles in two colors with thin joints."""
    row, column, across_y, across_x = grid_cells(size, size, tiles, tiles)
    image = np.where(((row + column) % 2 == 0)[..., None], np.array(light), np.array(dark))
    tone = 1 + 0.06 * (rng.random((tiles, tiles)) - 0.5)
    image = image * tone[row, column][..., None] * _clouds(size, 0.06, rng)
    joint = 1 - smooth_step(0.008, 0.02, _edge_distance(across_y, across_x))
    return blend(image, np.array([0.45, 0.44, 0.42]), 0.7 * joint)


def tiled_wall(
    size: int, tiles: int, color: Color, joint: Color, spread: float, rng: np.random.Generator
) -> np.ndarray:
    """Square glazed tiles, each a little different in tone."""
    row, column, across_y, across_x = grid_cells(size, size, tiles, tiles)
    tone = 1 + spread * (rng.random((tiles, tiles)) - 0.5)
    image = np.array(color) * tone[row, column][..., None] * _clouds(size, 0.03, rng)
    lines = 1 - smooth_step(0.02, 0.055, _edge_distance(across_y, across_x))
    return blend(image, np.array(joint), lines)


def parquet(
    size: int, blocks: int, staves: int, color: Color, rng: np.random.Generator
) -> np.ndarray:
    """Basket parquet: blocks of staves, turned from one block to the next."""
    row, column, across_y, across_x = grid_cells(size, size, blocks, blocks)
    turned = (row + column) % 2 == 1
    across, along = np.where(turned, across_x, across_y), np.where(turned, across_y, across_x)
    stave = np.minimum((across * staves).astype(int), staves - 1)
    tone = 1 + 0.30 * (rng.random((blocks, blocks, staves)) - 0.5)
    lying = fractal_noise(size, size, (size // 8, 6), 3, rng)
    standing = fractal_noise(size, size, (6, size // 8), 3, rng)
    grain = 0.86 + 0.26 * np.where(turned, standing, lying)
    image = np.array(color) * (tone[row, column, stave] * grain)[..., None]
    within = across * staves % 1
    gap = smooth_step(0.0, 0.06, np.minimum(within, 1 - within))
    end = smooth_step(0.0, 0.012, np.minimum(along, 1 - along))
    return image * (0.55 + 0.45 * np.minimum(gap, end))[..., None]


def floorboards(size: int, boards: int, color: Color, rng: np.random.Generator) -> np.ndarray:
    """Long boards along the image's x axis with staggered ends."""
    row, _, across_y, _ = grid_cells(size, size, boards, 1)
    x = (np.arange(size) + 0.5)[None, :] / size + rng.random(boards)[row[:, :1]]
    half = np.floor(2 * x).astype(int) % 2
    tone = 1 + 0.26 * (rng.random((boards, 2)) - 0.5)
    streaks = fractal_noise(size, size, (size // 8, 3), 3, rng)
    image = np.array(color) * (tone[row, half] * (0.84 + 0.30 * streaks))[..., None]
    end = np.abs(2 * x % 1 - 0.5) > 0.494
    gap = smooth_step(0.0, 0.05, np.minimum(across_y, 1 - across_y))
    return image * np.where(end, 0.6, 0.55 + 0.45 * gap)[..., None]


def linoleum(size: int, color: Color, rng: np.random.Generator) -> np.ndarray:
    """Marbled sheet flooring."""
    flow = fractal_noise(size, size, (7, 13), 4, rng)
    veins = smooth_step(0.42, 0.5, flow) - smooth_step(0.5, 0.58, flow)
    image = np.array(color) * (0.94 + 0.10 * flow)[..., None]
    return blend(image, np.array([0.93, 0.92, 0.88]), 0.13 * veins)


def terrazzo(size: int, chips: int, ground: Color, rng: np.random.Generator) -> np.ndarray:
    """Stone chips in a ground color."""
    image = np.ones((size, size, 3)) * np.array(ground)
    y, x = np.mgrid[:size, :size]
    palette = np.array(
        [[0.88, 0.86, 0.80], [0.42, 0.40, 0.40], [0.66, 0.42, 0.32], [0.72, 0.70, 0.66]]
    )
    for _ in range(chips):
        cy, cx = rng.random(2) * size
        long, wide = (0.010 + 0.016 * rng.random(2)) * size
        turn = rng.random() * np.pi
        dx = (x - cx + size / 2) % size - size / 2
        dy = (y - cy + size / 2) % size - size / 2
        along = (dx * np.cos(turn) + dy * np.sin(turn)) / long
        across = (dy * np.cos(turn) - dx * np.sin(turn)) / wide
        image[np.abs(along) + np.abs(across) < 1] = palette[rng.integers(len(palette))]
    return image * _clouds(size, 0.06, rng)


def concrete(size: int, color: Color, rng: np.random.Generator, slabs: int = 1) -> np.ndarray:
    """Stained concrete with a few pores, and joints between the slabs where there are several."""
    stains = fractal_noise(size, size, 3, 5, rng)
    image = np.array(color) * (0.82 + 0.32 * stains)[..., None] * _clouds(size, 0.08, rng)
    pores = fractal_noise(size, size, size // 3, 1, rng)
    image *= np.where(pores > 0.95, 0.86, 1.0)[..., None]
    if slabs > 1:
        _, _, across_y, across_x = grid_cells(size, size, slabs, slabs)
        joint = 1 - smooth_step(0.004, 0.012, _edge_distance(across_y, across_x))
        image = blend(image, np.array(color) * 0.45, joint)
    return image


def painted_wall(
    size: int,
    wall: Color,
    foot: Color,
    foot_height: float,
    rng: np.random.Generator,
    line: Color | None = None,
) -> np.ndarray:
    """Three meters of smooth wall: another color up to `foot_height`, a line above it."""
    height = 3.0 * (1 - (np.arange(size) + 0.5) / size)[:, None] * np.ones((1, size))
    image = blend(np.array(wall), np.array(foot), (height < foot_height).astype(float))
    if line is not None:
        image = blend(image, np.array(line), (np.abs(height - foot_height) < 0.03).astype(float))
    return image * _clouds(size, 0.07, rng)


def wallpaper(size: int, stripes: int, light: Color, dark: Color, rng: np.random.Generator):
    """Broad upright stripes, every second one with a row of lozenges."""
    x = (np.arange(size) + 0.5) * stripes / size
    column, across = x.astype(int)[None, :], (x % 1)[None, :]
    y = ((np.arange(size) + 0.5) * stripes / size % 1)[:, None]
    lozenge = (np.abs(across - 0.5) + np.abs(y - 0.5) < 0.22) & (column % 2 == 1)
    image = np.where((column % 2 == 0)[..., None], np.array(light), np.array(dark))
    image = blend(image * np.ones((size, 1, 1)), np.array(light), lozenge.astype(float))
    return image * _clouds(size, 0.04, rng)


def wood_panelling(size: int, panels: int, color: Color, rng: np.random.Generator) -> np.ndarray:
    """Three meters of wall in upright panels with shadow gaps and a rail."""
    _, column, _, across = grid_cells(size, size, 1, panels)
    height = 3.0 * (1 - (np.arange(size) + 0.5) / size)[:, None] * np.ones((1, size))
    figure = fractal_noise(size, size, (3, size // 10), 4, rng)
    tone = 1 + 0.16 * (rng.random(panels) - 0.5)
    image = np.array(color) * (tone[column] * (0.80 + 0.34 * figure))[..., None]
    gap = 1 - smooth_step(0.010, 0.022, np.minimum(across, 1 - across))
    gap = np.maximum(gap, (np.abs(height - 1.02) < 0.012).astype(float))
    return blend(image, np.array(color) * 0.35, gap)


def blockwork(size: int, courses: int, color: Color, rng: np.random.Generator) -> np.ndarray:
    """Painted concrete blocks in running bond, twice as long as they are high."""
    y = ((np.arange(size) + 0.5) * courses / size)[:, None] * np.ones((1, size))
    x = ((np.arange(size) + 0.5) * courses / 2 / size)[None, :] + 0.5 * (y.astype(int) % 2)
    tone = 1 + 0.08 * (rng.random((courses, courses)) - 0.5)
    image = np.array(color) * tone[y.astype(int), x.astype(int) % courses][..., None]
    edge = np.minimum(np.minimum(y % 1, 1 - y % 1), 2 * np.minimum(x % 1, 1 - x % 1))
    image = image * _clouds(size, 0.08, rng)
    return image * (0.72 + 0.28 * smooth_step(0.02, 0.07, edge))[..., None]


def broken_plaster(
    under: np.ndarray, plaster: Color, share: float, rng: np.random.Generator
) -> np.ndarray:
    """Plaster that has come off in places and shows the masonry `under` it."""
    size = len(under)
    field = fractal_noise(size, size, 3, 5, rng)
    level = np.quantile(field, share)
    image = np.array(plaster) * _clouds(size, 0.20, rng)
    cracks = fractal_noise(size, size, 4, 3, rng)
    image *= np.where(np.abs(cracks - 0.5) < 0.006, 0.6, 1.0)[..., None]
    rim = smooth_step(level - 0.015, level, field) - smooth_step(level, level + 0.02, field)
    return blend(under * 0.9, image, smooth_step(level - 0.004, level + 0.004, field)) * (
        1 - 0.35 * rim[..., None]
    )


def ceiling_panels(size: int, panels: int, rng: np.random.Generator, missing: int = 0):
    """Mineral fiber panels in a white grid; some may be missing and show the dark above."""
    row, column, across_y, across_x = grid_cells(size, size, panels, panels)
    specks = fractal_noise(size, size, size // 4, 1, rng)
    tone = 1 + 0.03 * (rng.random((panels, panels)) - 0.5)
    image = np.array([0.93, 0.93, 0.91]) * tone[row, column][..., None]
    image *= np.where(specks > 0.86, 0.88, 1.0)[..., None]
    gone = np.zeros(panels * panels, bool)
    gone[rng.choice(panels * panels, missing, replace=False)] = True
    image = np.where(gone.reshape(panels, panels)[row, column][..., None], 0.10, image)
    grid = 1 - smooth_step(0.018, 0.03, _edge_distance(across_y, across_x))
    return blend(image, np.array([0.74, 0.74, 0.74]), grid)


def metal_panels(size: int, columns: int, color: Color, rng: np.random.Generator) -> np.ndarray:
    """Coated sheet-metal panels with seams."""
    _, column, across_y, across_x = grid_cells(size, size, 2, columns)
    tone = 1 + 0.08 * (rng.random(columns) - 0.5)
    brushed = fractal_noise(size, size, (2, size // 8), 3, rng)
    image = np.array(color) * (tone[column] * (0.95 + 0.08 * brushed))[..., None]
    edge = np.minimum(np.minimum(across_x, 1 - across_x), 2 * np.minimum(across_y, 1 - across_y))
    return image * (0.55 + 0.45 * smooth_step(0.008, 0.025, edge))[..., None]


def _edge_distance(across_y: np.ndarray, across_x: np.ndarray) -> np.ndarray:
    return np.minimum(np.minimum(across_y, 1 - across_y), np.minimum(across_x, 1 - across_x))


def _clouds(size: int, strength: float, rng: np.random.Generator) -> np.ndarray:
    """Brightness that varies softly about one, ready to multiply a picture with."""
    return (1 - strength / 2 + strength * fractal_noise(size, size, 4, 5, rng))[..., None]
