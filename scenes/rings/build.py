"""Build rings.glb: python -m scenes.rings.build.

World axes: x east, y north, z up, meters. The same code always writes the same bytes.
Incidence theta is measured at the sphere's center, from straight down.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenes.modeling.geometry import Patch, pose
from scenes.modeling.pbr_materials import plain
from scenes.modeling.stage import Model, Stage

OUTPUT = Path(__file__).with_name("rings.glb")
RADIUS_M = 2.0
CENTER_M = (0.0, 0.0, 2.0)  # scene.toml starts here
SEGMENTS = 360
LINES_DEG = np.arange(5, 180, 5)  # incidence of the lines' middles
LINE_WIDTH_DEG = 0.6
HORIZON_DEG = 90
COLORS = {  # linear
    "white": (1.0, 1.0, 1.0),
    "black": (0.0, 0.0, 0.0),
    "red": (0.8, 0.05, 0.05),
}


def main() -> None:
    """Build the scene and print its size."""
    materials = {name: plain(name, color) for name, color in COLORS.items()}
    stage = Stage("rings", materials, unlit=frozenset(materials))
    strips = np.arange(2 * len(LINES_DEG) + 1)  # gap, line, gap, ..., gap
    horizon = 2 * int(np.flatnonzero(LINES_DEG == HORIZON_DEG)[0]) + 1
    lines = strips[(strips % 2 == 1) & (strips != horizon)]
    place = pose(*CENTER_M)
    stage.place("sphere", Model("sphere", "white", sphere_strips(strips[::2])), place)
    stage.place("lines", Model("lines", "black", sphere_strips(lines)), place)
    stage.place("horizon", Model("horizon", "red", sphere_strips([horizon])), place)
    size = stage.write(OUTPUT, compact=True)
    print(f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles")


def sphere_strips(strips: list[int] | np.ndarray) -> Patch:
    """Strips of the sphere between neighboring rims, counted from the bottom, seen from inside.

    All vertices of the sphere are in every patch, in the same places: what lines and gaps share is
    then the same to the last bit in the file (which stores it once) and on the GPU, and no crack
    can open between them.
    """
    rims_deg = np.sort([LINES_DEG - LINE_WIDTH_DEG / 2, LINES_DEG + LINE_WIDTH_DEG / 2], axis=None)
    theta = np.radians(rims_deg)[:, None]
    azimuth = np.arange(SEGMENTS) * 2 * np.pi / SEGMENTS
    outward = np.stack(
        np.broadcast_arrays(
            np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), -np.cos(theta)
        ),
        axis=-1,
    )
    outward = np.concatenate([[(0, 0, -1)], outward.reshape(-1, 3), [(0, 0, 1)]])
    return Patch(
        RADIUS_M * outward,
        -outward,
        np.zeros((len(outward), 2)),
        np.concatenate([_strip_faces(strip, len(rims_deg)) for strip in strips]),
    )


def _strip_faces(strip: int, rims: int) -> np.ndarray:
    """Triangles (n, 3) between rim `strip` and the one above it; the first and last are caps."""
    here = np.arange(SEGMENTS)
    after = np.roll(here, -1)
    lower, upper = 1 + (strip - 1) * SEGMENTS, 1 + strip * SEGMENTS
    if strip == 0:
        return np.stack([0 * here, upper + here, upper + after], axis=1)
    if strip == rims:
        top = 1 + rims * SEGMENTS
        return np.stack([lower + after, lower + here, top + 0 * here], axis=1)
    a, b, c, d = lower + here, lower + after, upper + after, upper + here
    return np.concatenate([np.stack([b, a, d], axis=1), np.stack([b, d, c], axis=1)])


if __name__ == "__main__":
    main()
