"""Build compass.glb: python -m scenes.compass.build.

World axes: x east, y north, z up, meters; the origin is the middle of the floor.
The same code always writes the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenes.compass.side_picture import paint_side
from scenes.modeling.geometry import Patch, polygon, pose
from scenes.modeling.pbr_materials import textured
from scenes.modeling.stage import Model, Stage

OUTPUT = Path(__file__).with_name("compass.glb")
HALF_M, HEIGHT_M = 3.0, 3.0
WALL_PANEL_M, WALL_LETTERS_M = (0.5, 2.0), 1.0  # between these heights the word stands alone
PLATE_PANEL_M, PLATE_LETTERS_M = (2.0, 4.0), 1.2  # the same, from the south edge


@dataclass(frozen=True)
class Side:
    """One side of the room: its name, which it bears in letters, and its color in sRGB bytes."""

    name: str
    color: tuple[int, int, int]
    yaw_deg: float | None = None  # of a wall: from north, counter-clockwise


SIDES = (
    Side("north", (30, 80, 170), 0),
    Side("east", (190, 40, 35), -90),
    Side("south", (30, 125, 60), 180),
    Side("west", (125, 50, 150), 90),
    Side("up", (0, 140, 150)),
    Side("down", (145, 110, 0)),
)


def main() -> None:
    """Build the scene and print its size."""
    materials = {side.name: textured(side.name, picture(side), lossless=True) for side in SIDES}
    stage = Stage("compass", materials, unlit=frozenset(materials))
    for side in SIDES:
        stage.place(
            side.name, Model(side.name, side.name, surface(side)), pose(yaw_deg=side.yaw_deg or 0)
        )
    size = stage.write(OUTPUT)
    print(f"{OUTPUT.name}: {size} bytes, {stage.triangle_count()} triangles")


def picture(side: Side) -> np.ndarray:
    """The picture on a side."""
    word, wall = side.name.upper(), side.yaw_deg is not None
    if wall:
        return paint_side(word, side.color, (2 * HALF_M, HEIGHT_M), WALL_PANEL_M, WALL_LETTERS_M)
    return paint_side(word, side.color, (2 * HALF_M, 2 * HALF_M), PLATE_PANEL_M, PLATE_LETTERS_M)


def surface(side: Side) -> Patch:
    """The rectangle of a side, its front to the inside; walls are made for the north side.

    Corners run from the picture's lower left one, counter-clockwise as seen from inside.
    """
    a, top = HALF_M, HEIGHT_M
    if side.name == "up":  # seen from below with north up, east is on the left
        corners = [(a, -a, top), (-a, -a, top), (-a, a, top), (a, a, top)]
    elif side.name == "down":
        corners = [(-a, -a, 0), (a, -a, 0), (a, a, 0), (-a, a, 0)]
    else:
        corners = [(-a, a, 0), (a, a, 0), (a, a, top), (-a, a, top)]
    return polygon(corners, [(0, 0), (1, 0), (1, 1), (0, 1)])


if __name__ == "__main__":
    main()
