"""Plan of the arcade: measures, and what is behind each front.

World axes: x along the passage, from the street to the mirror; y to the left of that; z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenes.modeling.geometry import pose
from scenes.modeling.pbr_materials import Color

BAY, BAYS = 5.0, 6
LENGTH = BAY * BAYS
HALF = 2.5  # half the width between the fronts
BORDER = 2.1  # half the width of the light terrazzo
PILASTER, PILASTER_DEPTH = 0.5, 0.16
HALF_FRONT = (BAY - PILASTER) / 2
RISER, HEAD, FASCIA, EAVES = 0.45, 2.75, 3.35, 4.8  # heights of a front's parts
GLAZED, RIDGE = 1.55, 5.9  # half width and height of the glass roof
SHOP_DEPTH, SHOP_HEIGHT = 3.2, 3.0


@dataclass(frozen=True)
class Front:
    """One bay of a side.

    Attributes:
        name: of the shop, also of its objects.
        side: 1: to the left of the passage; -1: to the right.
        bay: number from the street.
        sign: word in neon.
        neon: material of the sign.
        wall: material of the shop's walls; "": a wall without a shop.
        lamp: material of the shop's lamps.
        door: sense in which the door is beside the window's middle.
        open_deg: angle by which the door is open.
        glass: material of the window.
    """

    name: str
    side: int
    bay: int
    sign: str
    neon: str
    wall: str = ""
    lamp: str = "lamp_warm"
    door: int = 1
    open_deg: float = 0.0
    glass: str = "pane"

    def place(
        self, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw_deg: float = 0.0
    ) -> np.ndarray:
        """World pose: x to the right of somebody who faces the front, y into the shop."""
        turn = 0.0 if self.side > 0 else 180.0
        return pose(BAY * (self.bay + 0.5), self.side * HALF, 0.0, turn) @ pose(x, y, z, yaw_deg)


FRONTS = (
    Front("cafe", 1, 0, "CAFE", "neon_amber", "wall_cream", door=-1, open_deg=70.0),
    Front("books", 1, 1, "BOOKS", "neon_red", "wall_green"),
    Front("glass", 1, 2, "GLASS", "neon_blue", "wall_white", "lamp_cool", door=-1),
    Front("toys", 1, 3, "TOYS", "neon_pink", "wall_yellow", door=1),
    Front("hats", 1, 4, "HATS", "neon_amber", "wall_rose", door=-1),
    Front("flora", 1, 5, "FLORA", "neon_green", "wall_white", "lamp_cool"),
    Front("optics", -1, 0, "OPTICS", "neon_blue", "wall_white", "lamp_cool", door=-1),
    Front("tailor", -1, 1, "TAILOR", "neon_green", "wall_rose", door=1),
    Front("clinic", -1, 2, "DENTIST", "neon_pink", "wall_white", "lamp_cool", glass="frosted"),
    Front("looking", -1, 3, "", ""),
    Front("discs", -1, 4, "DISCS", "neon_red", "wall_blue", door=-1),
    Front("lift", -1, 5, "LIFT", "neon_blue"),
)
# Walls of the shops, linear RGB.
WALLS: dict[str, Color] = {
    "wall_cream": (0.72, 0.61, 0.42),
    "wall_green": (0.16, 0.32, 0.24),
    "wall_white": (0.78, 0.78, 0.75),
    "wall_yellow": (0.80, 0.62, 0.20),
    "wall_rose": (0.66, 0.36, 0.33),
    "wall_blue": (0.14, 0.24, 0.42),
}


def front_named(name: str) -> Front:
    """The front of a shop."""
    return next(front for front in FRONTS if front.name == name)
