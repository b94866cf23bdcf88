"""The hall round the field: floor, walls with windows, ceiling, and what is fixed to them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from scenes.modeling.geometry import (
    Patch,
    bar,
    box,
    join,
    lathe,
    polygon,
    pose,
    sheet,
    tile,
    tube,
)
from scenes.modeling.stage import Model, Stage
from scenes.soccer.field import CARPET_X, CARPET_Y, CARPET_Z
from scenes.soccer.materials import painted_in
from scenes.soccer.pictures import picture

HALF_X, HALF_Y = 6.0, 4.5
FLOOR, TOP = -CARPET_Z, 3.6
REVEAL = 0.24  # from a wall's face to its window
WINDOWS = (-4.2, -1.4, 1.4, 4.2)
WINDOW_X, SILL, LINTEL = 1.0, 1.0, 2.7  # half width; heights
OUTSIDE_RADIUS = 16.0


@dataclass(frozen=True)
class Side:
    """One wall: parts are modeled for the north, where the wall is y = 0 and faces -y."""

    name: str
    yaw_deg: float
    half: float
    distance: float

    def place(
        self, x: float = 0.0, y: float = 0.0, z: float = FLOOR, yaw_deg: float = 0.0
    ) -> np.ndarray:
        """Pose of a part at a place given in the side's own axes."""
        return pose(yaw_deg=self.yaw_deg) @ pose(x, self.distance + y, z, yaw_deg)


NORTH = Side("north", 0, HALF_X, HALF_Y)
EAST = Side("east", -90, HALF_Y, HALF_X)
SOUTH = Side("south", 180, HALF_X, HALF_Y)
WEST = Side("west", 90, HALF_Y, HALF_X)
SIDES = (NORTH, EAST, SOUTH, WEST)


def build_hall(stage: Stage) -> None:
    """Everything that stays when the laboratory moves out."""
    stage.place("floor", Model("floor", "floor", _floor()))
    for side in SIDES:
        openings = WINDOWS if side is NORTH else ()
        wall = tile(_wall(side.half, openings), 2.0)
        stage.place(
            f"wall_{side.name}", Model(f"wall_{side.name}", f"wall_{side.name}", wall), side.place()
        )
        board = painted_in(
            "mid_grey", box((2 * side.half, 0.015, 0.08), (0, -0.0075, 0.04), "+y-z")
        )
        stage.place(
            f"skirting_{side.name}", Model(f"skirting_{side.name}", "paints", board), side.place()
        )
    corners = [(-HALF_X, HALF_Y), (HALF_X, HALF_Y), (HALF_X, -HALF_Y), (-HALF_X, -HALF_Y)]
    ceiling = tile(polygon([(x, y, TOP) for x, y in corners]), 0.6)
    stage.place("ceiling", Model("ceiling", "ceiling", ceiling))
    _hang_from_ceiling(stage)
    _glaze(stage)
    _heat(stage)
    _door(stage)


def _floor() -> Patch:
    """Linoleum with a hole that the carpet covers by a centimeter."""
    x_cuts = (-HALF_X, 0.01 - CARPET_X, CARPET_X - 0.01, HALF_X)
    y_cuts = (-HALF_Y, 0.01 - CARPET_Y, CARPET_Y - 0.01, HALF_Y)
    parts = _grid(x_cuts, y_cuts, hole=lambda x, y: abs(x) < CARPET_X - 0.01 and abs(y) < 1.9)
    return tile(join([part.moved(pose(z=FLOOR)) for part in parts]), 2.0)


def _wall(half: float, openings: tuple[float, ...]) -> Patch:
    """A wall's inner face with its openings' reveals."""
    x_cuts = [-half, *itertools.chain(*((x - WINDOW_X, x + WINDOW_X) for x in openings)), half]
    z_cuts = [0.0, SILL, LINTEL, TOP - FLOOR] if openings else [0.0, TOP - FLOOR]

    def is_open(x: float, z: float) -> bool:
        return SILL < z < LINTEL and any(abs(x - middle) < WINDOW_X for middle in openings)

    upright = pose(roll_deg=90)  # the grid's y becomes z, its front faces -y
    parts = [part.moved(upright) for part in _grid(x_cuts, z_cuts, is_open)]
    for middle in openings:
        a, b, y = middle - WINDOW_X, middle + WINDOW_X, REVEAL
        for p, q in (
            ((a, SILL), (b, SILL)),
            ((b, SILL), (b, LINTEL)),
            ((b, LINTEL), (a, LINTEL)),
            ((a, LINTEL), (a, SILL)),
        ):
            corners = [(p[0], 0, p[1]), (q[0], 0, q[1]), (q[0], y, q[1]), (p[0], y, p[1])]
            parts.append(polygon(corners))
    return join(parts)


def _grid(x_cuts, y_cuts, hole) -> list[Patch]:
    """Rectangles facing +z between cuts, but for those whose middle is in the hole."""
    return [
        polygon([(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)])
        for x0, x1 in itertools.pairwise(x_cuts)
        for y0, y1 in itertools.pairwise(y_cuts)
        if not hole((x0 + x1) / 2, (y0 + y1) / 2)
    ]


def _hang_from_ceiling(stage: Stage) -> None:
    """Beams, lamps, a duct, a tray of cables, a projector."""
    beam = Model(
        "beam", "concrete", tile(box((0.24, 2 * HALF_Y, 0.34), (0, 0, TOP - 0.17), "+z-y+y"), 1.5)
    )
    for index, x in enumerate((-4.5, -1.5, 1.5, 4.5), start=1):
        stage.place(f"beam_{index:02}", beam, pose(x))
    lamp = Model("lamp", "paints", _lamp_housing())
    glow = Model("lamp_tubes", "lamp_glow", _lamp_tubes())
    spots = itertools.product((-3.0, 0.0, 3.0), (-2.4, 0.0, 2.4))
    for index, (x, y) in enumerate(spots, start=1):
        stage.place(f"lamp_{index:02}", lamp, pose(x, y, 3.0))
        stage.place(f"lamp_{index:02}_tubes", glow, pose(x, y, 3.0))
    duct = [bar((-HALF_X, -3.7, 2.98), (HALF_X, -3.7, 2.98), 0.2, 16)]
    for x in np.arange(-5.0, 5.1, 2.0):
        duct.append(bar((x - 0.03, -3.7, 2.98), (x + 0.03, -3.7, 2.98), 0.215, 16))
        duct.append(bar((x, -3.7, 3.15), (x, -3.7, TOP), 0.012, 5))
    stage.place("air_duct", Model("air_duct", "paints", painted_in("steel", join(duct))))
    tray = [box((2 * HALF_X, 0.02, 0.06), (0, y, 3.1), "-x+x") for y in (3.5, 3.78)]
    tray += [box((0.04, 0.26, 0.012), (x, 3.64, 3.085)) for x in np.arange(-5.8, 5.9, 0.4)]
    wires = [
        tube(
            [
                (x, 3.64 + 0.05 * np.sin(1.3 * x + k) + 0.03 * k, 3.10)
                for x in np.linspace(-6, 6, 25)
            ],
            0.012,
            5,
        )
        for k in (-2, 0, 2)
    ]
    parts = [painted_in("steel", join(tray)), painted_in("black", join(wires))]
    stage.place("cable_tray", Model("cable_tray", "paints", join(parts)))
    projector = [
        painted_in("cream", box((0.36, 0.30, 0.12), (0, 0, -0.7))),
        painted_in("dark_grey", bar((0, 0, -0.64), (0, 0, 0), 0.02, 8)),
        painted_in("black", bar((-0.19, 0.05, -0.7), (-0.17, 0.05, -0.7), 0.035, 12)),
    ]
    stage.place("projector", Model("projector", "paints", join(projector)), pose(-3.0, -1.2, TOP))


def _lamp_housing() -> Patch:
    """Two-tube fitting of 1.5 m along x on wires, its underside at z = 0."""
    parts = [box((1.54, 0.22, 0.03), (0, 0, 0.065))]
    parts += [box((0.02, 0.22, 0.05), (x, 0, 0.025)) for x in (-0.76, 0.76)]
    parts += [bar((x, 0, 0.08), (x, 0, TOP - 3.0), 0.004, 3) for x in (-0.6, 0.6)]
    return painted_in("white_board", join(parts))


def _lamp_tubes() -> Patch:
    return join([bar((-0.75, y, 0.03), (0.75, y, 0.03), 0.013, 8) for y in (-0.06, 0.06)])


def _glaze(stage: Stage) -> None:
    """Frames, panes, window boards, and what is seen through the panes."""
    frame, board = Model("window_frame", "paints", _window_frame()), _window_board()
    pane = Model("window_pane", "window_glass", _window_pane())
    sill = Model("window_sill", "paints", board)
    for index, x in enumerate(WINDOWS, start=1):
        at = NORTH.place(x)
        stage.place(f"window_{index:02}", frame, at)
        stage.place(f"window_{index:02}_glass", pane, at)
        stage.place(f"window_{index:02}_sill", sill, at)
    angle = np.linspace(np.pi, 0, 33)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * OUTSIDE_RADIUS
    rim[:, 1] += HALF_Y + REVEAL
    along = np.linspace(0, 2, 33)  # the picture twice
    low, high = np.full(33, 0.01), np.full(33, 0.99)  # its foot must not bleed in at its top
    rows = np.stack([rim + [0, 0, -0.9], rim + [0, 0, 12.1]], axis=1)
    uvs = np.stack([np.stack([along, v], axis=1) for v in (low, high)], axis=1)
    stage.place("outside_view", Model("outside_view", "outside", sheet(rows, uvs)))
    ground = tile(polygon((rim + [0, 0, -0.9])[::-1]), 4.0)
    stage.place("outside_lawn", Model("outside_lawn", "lawn", ground))


def _window_frame() -> Patch:
    middle_z, tall, y = (SILL + LINTEL) / 2, LINTEL - SILL, REVEAL - 0.03
    parts = [
        box((0.06, 0.06, tall), (x, y, middle_z)) for x in (-WINDOW_X + 0.03, 0, WINDOW_X - 0.03)
    ]
    rails = (SILL + 0.03, SILL + 1.2, LINTEL - 0.03)
    parts += [box((WINDOW_X - 0.09, 0.06, 0.06), (x, y, z)) for z in rails for x in (-0.485, 0.485)]
    handles = [box((0.02, 0.05, 0.12), (x, y - 0.05, SILL + 0.62)) for x in (-0.05, 0.95)]
    return join([painted_in("white_board", join(parts)), painted_in("steel", join(handles))])


def _window_pane() -> Patch:
    x, y = WINDOW_X, REVEAL - 0.03
    return polygon([(-x, y, SILL), (x, y, SILL), (x, y, LINTEL), (-x, y, LINTEL)])


def _window_board() -> Patch:
    return painted_in(
        "light_grey", box((2 * WINDOW_X + 0.1, 0.12, 0.03), (0, -0.06, SILL - 0.016), "+y")
    )


def _heat(stage: Stage) -> None:
    """A radiator under each window, with its pipes."""
    fins = [box((0.045, 0.10, 0.56), (x, -0.11, 0.42)) for x in np.arange(-0.81, 0.82, 0.06)]
    rails = [box((1.70, 0.06, 0.04), (0, -0.11, z)) for z in (0.18, 0.66)]
    pipes = [tube([(0.87, -0.11, 0.66), (0.93, -0.11, 0.66), (0.93, -0.11, 0)], 0.012, 6)]
    pipes += [bar((x, -0.11, 0.3), (x, 0, 0.3), 0.012, 5) for x in (-0.6, 0.6)]
    valve = lathe([(0.0, 0.0), (0.025, 0.0), (0.025, 0.07), (0.0, 0.07)], 10).shifted(
        0.93, -0.11, 0.66
    )
    parts = [painted_in("cream", join([*fins, *rails, *pipes])), painted_in("dark_grey", valve)]
    radiator = Model("radiator", "paints", join(parts))
    for index, x in enumerate(WINDOWS, start=1):
        stage.place(f"radiator_{index:02}", radiator, NORTH.place(x))


def _door(stage: Stage) -> None:
    """Door, switch, exit sign, extinguisher and clock on the west wall."""
    wide, tall = 0.95, 2.1
    leaf = [painted_in("slate", box((wide, 0.05, tall), (0, -0.025, tall / 2), "+y-z"))]
    leaf.append(painted_in("petrol", box((0.22, 0.004, 0.8), (0.22, -0.052, 1.45), "+y")))
    leaf.append(painted_in("steel", box((0.8, 0.004, 0.2), (0, -0.052, 0.16), "+y")))
    leaf.append(
        painted_in(
            "steel", tube([(-0.4, -0.05, 1.05), (-0.4, -0.1, 1.05), (-0.27, -0.1, 1.05)], 0.011, 6)
        )
    )
    frame = [
        box((0.1, 0.07, tall + 0.1), (x, -0.035, (tall + 0.1) / 2), "+y-z")
        for x in (-wide / 2 - 0.05, wide / 2 + 0.05)
    ]
    frame.append(box((wide, 0.07, 0.1), (0, -0.035, tall + 0.05), "+y-x+x"))
    leaf.append(painted_in("dark_grey", join(frame)))
    stage.place("door", Model("door", "paints", join(leaf)), WEST.place(-2.6))
    switch = painted_in("paper", box((0.08, 0.012, 0.08), (0, -0.006, 1.15), "+y"))
    stage.place("light_switch", Model("light_switch", "paints", switch), WEST.place(-1.85))
    sign = painted_in("bottle", box((0.4, 0.04, 0.18), (0, -0.02, 2.42), "+y"))
    arrow = painted_in("paper", box((0.2, 0.004, 0.05), (0, -0.042, 2.42), "+y"))
    stage.place("exit_sign", Model("exit_sign", "paints", join([sign, arrow])), WEST.place(-2.6))
    bottle = [
        (0.0, 0.0),
        (0.07, 0.0),
        (0.075, 0.02),
        (0.075, 0.36),
        (0.05, 0.43),
        (0.02, 0.45),
        (0.02, 0.5),
        (0.0, 0.5),
    ]
    parts = [
        painted_in("red", lathe(bottle, 14).shifted(0, -0.1, 0.9)),
        painted_in(
            "black", tube([(0.02, -0.1, 1.4), (0.1, -0.12, 1.38), (0.1, -0.12, 1.1)], 0.012, 6)
        ),
        painted_in("black", box((0.12, 0.03, 0.025), (0.02, -0.1, 1.41))),
    ]
    stage.place(
        "fire_extinguisher", Model("fire_extinguisher", "paints", join(parts)), WEST.place(-1.6)
    )
    rim = painted_in("dark_grey", box((0.36, 0.04, 0.36), (0, -0.02, 0), "+y"))
    stage.place("clock", Model("clock", "paints", rim), WEST.place(-0.4, 0, 2.55))
    face = Model("clock_face", "pictures", picture("clock", 0.32, 0.32).shifted(y=-0.042))
    stage.place("clock_face", face, WEST.place(-0.4, 0, 2.55))
