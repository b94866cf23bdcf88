"""Furniture of the laboratory; pieces at a wall have it at y = 0 and face -y."""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import Patch, ball, bar, box, join, lathe, pose, ring, tube
from scenes.modeling.stage import Model
from scenes.soccer.materials import painted_in

DESK_TOP = 0.74
SHELVES = (0.08, 0.46, 0.84, 1.22, 1.60)  # upper faces of a bookcase's boards


def desk() -> Model:
    """1.6 m x 0.8 m on a steel frame."""
    top = painted_in("beech", box((1.6, 0.8, 0.03), (0, -0.4, DESK_TOP - 0.015)))
    legs = [
        box((0.05, 0.05, DESK_TOP - 0.03), (x, y, DESK_TOP / 2 - 0.015), "-z")
        for x in (-0.74, 0.74)
        for y in (-0.72, -0.08)
    ]
    rails = [box((1.43, 0.03, 0.05), (0, -0.08, 0.66))]
    rails += [box((0.03, 0.59, 0.05), (x, -0.4, 0.66)) for x in (-0.74, 0.74)]
    drawers = painted_in("light_grey", box((0.42, 0.6, 0.52), (0.48, -0.42, 0.40)))
    fronts = [box((0.38, 0.012, 0.14), (0.48, -0.727, z)) for z in (0.23, 0.40, 0.57)]
    pulls = [box((0.12, 0.02, 0.015), (0.48, -0.742, z)) for z in (0.26, 0.43, 0.60)]
    parts = [
        painted_in("dark_grey", join([*legs, *rails, *pulls])),
        painted_in("white_board", join(fronts)),
    ]
    return Model("desk", "paints", join([top, drawers, *parts]))


def workbench() -> Model:
    """1.8 m x 0.7 m, heavy, with a shelf below."""
    top = painted_in("oak", box((1.8, 0.7, 0.05), (0, -0.35, 0.875)))
    legs = [
        box((0.08, 0.08, 0.85), (x, y, 0.425), "-z+z")
        for x in (-0.82, 0.82)
        for y in (-0.62, -0.08)
    ]
    shelf = painted_in("dark_wood", box((1.72, 0.6, 0.03), (0, -0.35, 0.25)))
    return Model("workbench", "paints", join([top, shelf, painted_in("slate", join(legs))]))


def bookcase() -> Model:
    """1.0 m x 0.32 m x 2.0 m with five boards."""
    sides = [box((0.025, 0.32, 2.0), (x, -0.16, 1.0), "-z") for x in (-0.4875, 0.4875)]
    boards = [box((0.95, 0.305, 0.02), (0, -0.1625, z - 0.01), "-x+x") for z in (*SHELVES, 1.99)]
    back = box((0.95, 0.01, 1.92), (0, -0.005, 1.03), "+y-x+x-z+z")
    return Model("bookcase", "paints", painted_in("beech", join([*sides, *boards, back])))


def cabinet() -> Model:
    """Steel cabinet with two doors."""
    body = painted_in("mint", box((0.9, 0.45, 1.9), (0, -0.225, 0.95), "-z"))
    doors = [box((0.43, 0.012, 1.8), (x, -0.456, 0.96)) for x in (-0.22, 0.22)]
    handles = [box((0.015, 0.03, 0.16), (x, -0.475, 1.0)) for x in (-0.04, 0.04)]
    parts = [body, painted_in("mint", join(doors)), painted_in("dark_grey", join(handles))]
    return Model("cabinet", "paints", join(parts))


def stool() -> Model:
    """Round wooden stool."""
    parts = [
        painted_in(
            "beech", lathe([(0.0, 0.58), (0.17, 0.58), (0.18, 0.60), (0.17, 0.62), (0.0, 0.62)], 20)
        )
    ]
    legs = [
        bar(
            (0.11 * np.cos(a), 0.11 * np.sin(a), 0.58),
            (0.19 * np.cos(a), 0.19 * np.sin(a), 0),
            0.014,
            7,
        )
        for a in np.radians([45, 135, 225, 315])
    ]
    hoop = ring(0.165, 0.008, 20, 5).shifted(z=0.2)
    return Model("stool", "paints", join([*parts, painted_in("black", join([*legs, hoop]))]))


def chair(cloth: str) -> Model:
    """Office chair on five casters, facing +y."""
    seat = cushion(0.46, 0.46, 0.08).shifted(z=0.48)
    back = cushion(0.42, 0.5, 0.07).moved(pose(0, -0.23, 0.80, roll_deg=80))
    legs = []
    for index in range(5):
        a = np.radians(72 * index + 18)
        x, y = 0.28 * np.cos(a), 0.28 * np.sin(a)
        legs.append(bar((0.02 * np.cos(a), 0.02 * np.sin(a), 0.11), (x, y, 0.075), 0.02, 6))
        wheel = lathe([(0, -0.02), (0.03, -0.02), (0.03, 0.02), (0, 0.02)], 10)
        legs.append(wheel.moved(pose(x, y, 0.03, np.degrees(a), roll_deg=90)))
    legs.append(bar((0, 0, 0.09), (0, 0, 0.44), 0.03, 10))
    legs.append(
        tube([(0, 0.0, 0.42), (0, -0.27, 0.43), (0, -0.30, 0.62), (0, -0.27, 0.80)], 0.02, 6)
    )
    return Model(
        f"chair_{cloth}",
        "paints",
        join([painted_in(cloth, join([seat, back])), painted_in("black", join(legs))]),
    )


def monitor() -> Model:
    """On its foot; the screen is a picture of its own at y = -0.031."""
    parts = [
        box((0.56, 0.03, 0.36), (0, -0.015, 0.36)),
        box((0.30, 0.05, 0.20), (0, 0.02, 0.36)),
        box((0.06, 0.03, 0.24), (0, 0.04, 0.13)),
        box((0.26, 0.18, 0.015), (0, 0.02, 0.0075), "-z"),
    ]
    return Model("monitor", "paints", painted_in("black", join(parts)))


def keyboard() -> Model:
    """Keyboard and mouse."""
    base = painted_in("dark_grey", box((0.44, 0.14, 0.02), (0, 0, 0.01), "-z"))
    rows = [box((0.41, 0.02, 0.008), (0, y, 0.024), "-z") for y in (-0.05, -0.025, 0, 0.025, 0.05)]
    mouse = ball(1.0, 4, 8).moved(pose(0.32, 0, 0.012, scale=(0.03, 0.05, 0.02)))
    return Model("keyboard", "paints", join([base, painted_in("black", join([*rows, mouse]))]))


def computer() -> Model:
    """A tower under a desk."""
    case = painted_in("dark_grey", box((0.18, 0.44, 0.42), (0, 0, 0.21), "-z"))
    front = painted_in("steel", box((0.15, 0.006, 0.1), (0, -0.223, 0.34)))
    return Model("computer", "paints", join([case, front]))


def board_frame(name: str, width: float, height: float, hue: str, ledge: bool = False) -> Model:
    """A slab of 2 cm on a wall for a picture at y = -0.022; its middle is the origin."""
    parts = [painted_in(hue, box((width + 0.05, 0.02, height + 0.05), (0, -0.01, 0), "+y"))]
    if ledge:
        z = -height / 2 - 0.035
        parts.append(painted_in("steel", box((width, 0.08, 0.015), (0, -0.04, z), "+y")))
        for x, pen in ((-0.3, "navy"), (-0.1, "red"), (0.15, "black")):
            parts.append(
                painted_in(pen, bar((x, -0.05, z + 0.017), (x + 0.12, -0.05, z + 0.017), 0.009, 6))
            )
    return Model(name, "paints", join(parts))


def coat_rack() -> Model:
    """A rail with five hooks at 1.7 m."""
    rail = painted_in("oak", box((1.3, 0.02, 0.1), (0, -0.01, 1.7), "+y"))
    hooks = [
        tube([(x, -0.02, 1.71), (x, -0.08, 1.69), (x, -0.09, 1.73)], 0.008, 5)
        for x in np.linspace(-0.5, 0.5, 5)
    ]
    return Model("coat_rack", "paints", join([rail, painted_in("steel", join(hooks))]))


def cushion(x: float, y: float, z: float) -> Patch:
    """A box with rounded sides about the origin."""
    count = 16
    levels = (
        (0.0, -0.5),
        (0.8, -0.5),
        (0.96, -0.4),
        (1.0, 0.0),
        (0.96, 0.4),
        (0.8, 0.5),
        (0.0, 0.5),
    )
    patch = lathe([(r, h) for r, h in levels], count, crease_deg=50)
    turn = np.arctan2(patch.positions[:, 1], patch.positions[:, 0]) + np.pi / count
    radius = np.hypot(patch.positions[:, 0], patch.positions[:, 1])
    c, s = np.cos(turn), np.sin(turn)
    square = np.maximum(np.abs(c), np.abs(s)) ** -0.7
    patch.positions[:, 0] = 0.5 * radius * square * c
    patch.positions[:, 1] = 0.5 * radius * square * s
    return patch.moved(pose(scale=(x, y, z)))
