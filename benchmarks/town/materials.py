"""Materials of the town: small procedural textures that repeat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.model import Material, Texture

SIDE_PX = 128
_SEED = 7
_PLAIN = {
    "white paint": (0.82, 0.82, 0.80), "green paint": (0.05, 0.20, 0.10),
    "red paint": (0.35, 0.05, 0.04), "blue paint": (0.06, 0.12, 0.33), "metal": (0.20, 0.21, 0.22),
    "lamp": (0.9, 0.85, 0.6),
}  # fmt: skip


def town_materials() -> dict[str, tuple[Material, float]]:
    """Materials by name, each with the width of its texture in meters."""
    random = np.random.default_rng(_SEED)
    materials = {name: (Material(name, (*color, 1.0)), 1.0) for name, color in _PLAIN.items()}
    images = {
        "brick": (_courses(random, (150, 74, 56), (176, 168, 156), 16, 32), 1.0),
        "cream plaster": (_rough(random, (226, 212, 178), 6.0), 2.0),
        "white plaster": (_rough(random, (232, 232, 226), 5.0), 2.0),
        "yellow plaster": (_rough(random, (230, 190, 104), 6.0), 2.0),
        "red tiles": (_courses(random, (164, 78, 52), (92, 42, 30), 32, 16), 1.2),
        "slate": (_courses(random, (92, 98, 108), (52, 56, 62), 32, 32), 1.2),
        "glass": (_sky(), 1.3),
        "stone": (_rough(random, (178, 174, 166), 8.0), 1.0),
        "asphalt": (_rough(random, (84, 84, 88), 10.0), 2.0),
        "paving": (_courses(random, (172, 168, 160), (120, 116, 110), 32, 32, 0), 1.6),
        "grass": (_rough(random, (86, 128, 58), 18.0), 2.0),
        "leaves": (_rough(random, (58, 100, 46), 26.0), 1.0),
        "bark": (_rough(random, (98, 78, 60), 14.0), 0.6),
    }
    for name, (pixels, width_m) in images.items():
        materials[name] = (Material(name, texture=Texture(pixels)), width_m)
    return materials


def _rgba(rgb: NDArray[np.float64]) -> NDArray[np.uint8]:
    pixels = np.full((SIDE_PX, SIDE_PX, 4), 255, dtype=np.uint8)
    pixels[..., :3] = np.clip(np.rint(rgb), 0, 255)
    return pixels


def _rough(
    random: np.random.Generator, color: tuple[int, int, int], sigma: float
) -> NDArray[np.uint8]:
    """Texture of a color with fine and coarse grain."""
    grain = random.normal(0.0, sigma, (SIDE_PX, SIDE_PX))
    coarse = random.normal(0.0, sigma, (SIDE_PX // 8, SIDE_PX // 8)).repeat(8, 0).repeat(8, 1)
    return _rgba(np.array(color) + (grain + 0.6 * coarse)[..., None])


def _courses(
    random: np.random.Generator,
    color: tuple[int, int, int],
    joint: tuple[int, int, int],
    high_px: int,
    wide_px: int,
    shift_px: int | None = None,
) -> NDArray[np.uint8]:
    """Texture of stones in courses, each shifted by half a stone, with joints of two pixels."""
    rows, columns = np.mgrid[:SIDE_PX, :SIDE_PX]
    course = rows // high_px
    shifted = columns + course * (wide_px // 2 if shift_px is None else shift_px)
    stone = (shifted // wide_px) % (SIDE_PX // wide_px)
    tints = random.normal(0.0, 12.0, (SIDE_PX // high_px, SIDE_PX // wide_px))
    rgb = np.array(color) + tints[course, stone][..., None]
    is_joint = (rows % high_px < 2) | (shifted % wide_px < 2)
    return _rgba(np.where(is_joint[..., None], np.array(joint), rgb))


def _sky() -> NDArray[np.uint8]:
    """Texture of the sky reflected in a pane: bright at the top, dark at the bottom."""
    down = np.linspace(0.0, 1.0, SIDE_PX)[:, None, None]
    rgb = (1.0 - down) * np.array([150.0, 178.0, 200.0]) + down * np.array([52.0, 62.0, 72.0])
    return _rgba(np.broadcast_to(rgb, (SIDE_PX, SIDE_PX, 3)))
