"""A wheel of the Pioneer 2 AT about its axle: z is the axle, its outer side faces +z."""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import Patch, box, join, lathe, pose
from scenes.modeling.palette import Palette
from scenes.modeling.robot_parts import cylinder

WIDTH = 0.085
LUGS = 16  # a row; one of them is straight below the axle
SEGMENTS = 24


def wheel(palette: Palette, diameter: float) -> Patch:
    """Tire with two rows of lugs, a light rim and a hub."""
    radius, half = diameter / 2, WIDTH / 2
    tread, lip = radius - 0.006, 0.58 * radius
    tire = [
        (0.0, -half + 0.004),
        (lip, -half + 0.004),
        (0.80 * radius, -half),
        (0.92 * radius, -half + 0.006),
        (tread, -half + 0.017),
        (tread, half - 0.017),
        (0.92 * radius, half - 0.006),
        (0.80 * radius, half),
        (lip, half - 0.003),
    ]
    rim = [
        tire[-1],
        (lip - 0.008, half - 0.014),
        (0.024, half - 0.018),
        (0.022, half - 0.006),
        (0.019, half - 0.003),
        (0.0, half - 0.003),
    ]
    holes = [
        cylinder(0.0085, 0.002, 6).moved(pose(yaw_deg=72 * index) @ pose(0.039, 0, half - 0.0167))
        for index in range(5)
    ]
    lugs = []
    for index in range(2 * LUGS):
        row = 1 if index % 2 else -1
        # An even number's lug is centered on a multiple of the pitch, so on the way straight down.
        lug = box((0.009, 0.018, 0.034), (radius - 0.0045, 0, row * 0.019))
        lugs.append(lug.moved(pose(yaw_deg=index * 180 / LUGS)))
    return join(
        [
            palette.paint("rubber", lathe(tire, SEGMENTS), *lugs),
            palette.paint("rim", lathe(rim, SEGMENTS)),
            palette.paint("rubber", *holes),
        ]
    )


def outwards(side: int) -> np.ndarray:
    """Rotation for the left side (+1) or the right one (-1): z to the outside."""
    return pose(roll_deg=-90 * side)
