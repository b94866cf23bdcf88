"""Furniture and goods.  What stands at a wall has its back in the plane y = 0 and faces -y."""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import ball, bar, join, lathe, polygon, pose
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model

_GOODS = ("red", "mustard", "teal", "navy", "white", "orange", "lilac", "moss", "pink", "ivory")


def shelf(a: Atlas, goods: str, seed: int) -> Model:
    """Shelf of 1.4 m by 2.1 m with goods: "books", "discs", "boxes" or "none"."""
    rng = np.random.default_rng(seed)
    wide, deep, high = 1.4, 0.34, 2.1
    parts = [a.block("walnut", (wide, 0.02, high), (0, -0.01, high / 2), "-z+y")]
    for x in (-wide / 2 + 0.02, wide / 2 - 0.02):
        parts.append(a.block("walnut", (0.04, deep, high), (x, -deep / 2 - 0.02, high / 2), "-z"))
    levels = (0.08, 0.49, 0.90, 1.31, 1.72)
    for z in (*levels, high - 0.03):
        parts.append(a.block("walnut", (wide - 0.08, deep, 0.03), (0, -deep / 2 - 0.02, z), "-x+x"))
    for z in levels:
        floor = z + 0.016
        if goods == "books":
            for x in (-0.33, 0.33):
                high_row = float(rng.uniform(0.24, 0.32))
                row = a.picture("spines", 0.62, high_row, -0.26).shifted(x, 0, floor)
                top = a.block("ivory", (0.62, 0.2, 0.01), (x, -0.16, floor + high_row - 0.02), "-z")
                parts += [row, top]
        elif goods == "discs":
            parts.append(a.picture("covers", 1.28, 0.34, -0.12).shifted(0, 0, floor))
        elif goods == "boxes":
            left = -0.62
            while left < 0.42:
                size = rng.uniform((0.12, 0.14, 0.10), (0.26, 0.26, 0.32))
                paint = _GOODS[int(rng.integers(len(_GOODS)))]
                middle = (left + size[0] / 2, -0.20, floor + size[2] / 2)
                parts.append(a.block(paint, tuple(size.tolist()), middle, "-z"))
                left += float(size[0]) + float(rng.uniform(0.02, 0.08))
    return Model(f"shelf_{goods}_{seed}", "props", join(parts))


def counter(a: Atlas, paint: str) -> Model:
    """Counter of 1.8 m, free standing, its front at y = -0.3."""
    parts = [
        a.block(paint, (1.8, 0.6, 0.92), (0, 0, 0.46), "-z+z"),
        a.block("walnut", (1.9, 0.7, 0.05), (0, 0, 0.945)),
        a.block("lacquer", (0.36, 0.28, 0.22), (0.5, 0.05, 1.08), "-z"),
    ]
    for k in range(3):
        parts.append(a.block("ivory", (0.5, 0.012, 0.7), (0.58 * (k - 1), -0.306, 0.46), "+y"))
    return Model(f"counter_{paint}", "props", join(parts))


def plinth(a: Atlas, paint: str, wide_mm: int, high_mm: int) -> Model:
    """Square block to show something on."""
    wide, high = wide_mm / 1000, high_mm / 1000
    parts = [
        a.block(paint, (wide, wide, high - 0.04), (0, 0, (high - 0.04) / 2), "-z+z"),
        a.block("lacquer", (wide + 0.03, wide + 0.03, 0.04), (0, 0, high - 0.02)),
    ]
    return Model(f"plinth_{paint}_{wide_mm}_{high_mm}", "props", join(parts))


def stage(a: Atlas, paint: str) -> Model:
    """Low platform behind a window, 2.9 m wide."""
    parts = [
        a.block(paint, (2.9, 0.7, 0.42), (0, 0, 0.21), "-z+z"),
        a.block("oak", (2.94, 0.74, 0.03), (0, 0, 0.435)),
    ]
    return Model(f"stage_{paint}", "props", join(parts))


def glass_shelf_stand(a: Atlas) -> Model:
    """Two uprights that hold boards."""
    parts = [a.block("iron", (0.03, 0.03, 1.3), (x, 0, 0.65), "-z") for x in (-1.2, 0.0, 1.2)]
    parts += [a.block("white", (2.5, 0.26, 0.02), (0, 0, z)) for z in (0.45, 0.9, 1.3)]
    return Model("stand", "props", join(parts))


def round_table(a: Atlas) -> Model:
    """Bistro table."""
    parts = [
        a.in_material(
            "white", lathe([(0.0, 0.70), (0.31, 0.70), (0.31, 0.73), (0.0, 0.73)], 20, 40)
        ),
        a.in_material("iron", bar((0, 0, 0.02), (0, 0, 0.70), 0.025, 8)),
        a.in_material("iron", lathe([(0.2, 0.0), (0.2, 0.02), (0.03, 0.06)], 14, 40)),
    ]
    return Model("round_table", "props", join(parts))


def chair(a: Atlas, paint: str) -> Model:
    """Bistro chair that faces -y."""
    legs = [((x, y, 0.0), (0.9 * x, 0.9 * y, 0.44)) for x in (-0.19, 0.19) for y in (-0.19, 0.19)]
    parts = [a.in_material("iron", bar(p, q, 0.012, 5)) for p, q in legs]
    parts.append(a.block(paint, (0.40, 0.40, 0.035), (0, 0, 0.455)))
    for x in (-0.17, 0.17):
        parts.append(a.in_material("iron", bar((x, 0.18, 0.45), (x, 0.22, 0.88), 0.012, 5)))
    for z in (0.66, 0.84):
        parts.append(a.block(paint, (0.36, 0.02, 0.08), (0, 0.205, z)))
    return Model(f"chair_{paint}", "props", join(parts))


def bench(a: Atlas) -> Model:
    """Wooden bench of 1.6 m, back at the wall."""
    parts = [a.block("oak", (1.6, 0.09, 0.03), (0, -0.10 - 0.11 * k, 0.45)) for k in range(4)]
    for x in (-0.65, 0.65):
        parts.append(a.block("iron", (0.05, 0.40, 0.04), (x, -0.26, 0.42)))
        parts += [a.block("iron", (0.05, 0.05, 0.42), (x, y, 0.21), "-z") for y in (-0.09, -0.43)]
    return Model("bench", "props", join(parts))


def mannequin(a: Atlas, cloth: str) -> Model:
    """Tailor's dummy, 1.5 m high."""
    torso = [(0.10, 0.78), (0.17, 0.84), (0.13, 1.02), (0.18, 1.22), (0.17, 1.32), (0.06, 1.40)]
    torso += [(0.05, 1.46), (0.0, 1.48)]
    parts = [
        a.in_material(cloth, lathe(torso, 16, 50)),
        a.in_material("walnut", bar((0, 0, 0.03), (0, 0, 0.80), 0.02, 6)),
        a.in_material("walnut", lathe([(0.17, 0.0), (0.17, 0.02), (0.0, 0.05)], 14, 40)),
        a.block("mustard", (0.40, 0.02, 0.012), (0, -0.13, 1.02)),
    ]
    return Model(f"mannequin_{cloth}", "props", join(parts))


def hat(a: Atlas, cloth: str) -> Model:
    """Hat on a stand."""
    brim = [(0.0, 0.30), (0.17, 0.30), (0.19, 0.315), (0.11, 0.32), (0.10, 0.42), (0.07, 0.44)]
    parts = [
        a.in_material(cloth, lathe([*brim, (0.0, 0.43)], 12, 40)),
        a.in_material("lacquer", lathe([(0.112, 0.322), (0.108, 0.35)], 12, 40)),
        a.in_material("walnut", bar((0, 0, 0.01), (0, 0, 0.31), 0.012, 5)),
        a.in_material("walnut", lathe([(0.08, 0.0), (0.08, 0.012), (0.0, 0.02)], 8, 40)),
    ]
    return Model(f"hat_{cloth}", "props", join(parts))


def toy_ball(a: Atlas, paint: str) -> Model:
    """Ball of 0.22 m on the ground."""
    return Model(
        f"toy_ball_{paint}", "props", a.in_material(paint, ball(0.11, 8, 14)).shifted(z=0.11)
    )


def toy_tower(a: Atlas) -> Model:
    """Building blocks in a stack."""
    parts = []
    for k, paint in enumerate(("red", "mustard", "teal", "orange", "lilac")):
        piece = a.block(paint, (0.20 - 0.02 * k, 0.20 - 0.02 * k, 0.12), (0, 0, 0.06), "-z")
        parts.append(piece.moved(pose(0, 0, 0.12 * k, 17 * k)))
    return Model("toy_tower", "props", join(parts))


def toy_robot(a: Atlas) -> Model:
    """Tin robot, 0.42 m high, that faces -y."""
    parts = [
        a.block("teal", (0.18, 0.12, 0.18), (0, 0, 0.21)),
        a.block("teal", (0.12, 0.10, 0.10), (0, 0, 0.36)),
        a.block("mustard", (0.10, 0.01, 0.08), (0, -0.064, 0.22), "+y"),
        a.in_material("red", bar((0, 0, 0.41), (0, 0, 0.47), 0.006, 5)),
    ]
    for x in (-0.05, 0.05):
        parts.append(a.block("navy", (0.06, 0.09, 0.12), (x, 0, 0.06), "-z"))
        parts.append(a.block("white", (0.025, 0.01, 0.025), (0.6 * x, -0.054, 0.37), "+y"))
        parts.append(a.block("navy", (0.04, 0.05, 0.16), (2.3 * x, -0.01, 0.21)))
    return Model("toy_robot", "props", join(parts))


def foliage(a: Atlas, height_mm: int, seed: int) -> Model:
    """Leaves of a pot plant, seen from both sides."""
    rng, high = np.random.default_rng(seed), height_mm / 1000
    parts = []
    for _ in range(30):
        yaw, rise = rng.uniform(0, 360), rng.uniform(0.15, 1.0)
        long, wide = high * rng.uniform(0.28, 0.5), high * rng.uniform(0.05, 0.09)
        tip, middle = (long, 0, 0.32 * long), (0.5 * long, 0, 0.27 * long)
        edges = [(0.45 * long, side * wide, 0.33 * long) for side in (1, -1)]
        halves = [polygon([(0, 0, 0), middle, edges[0]]), polygon([middle, tip, edges[0]])]
        halves += [polygon([(0, 0, 0), edges[1], middle]), polygon([middle, edges[1], tip])]
        parts.append(join(halves).moved(pose(0, 0, 0.3 + 0.55 * high * rise, yaw)))
    return Model(f"foliage_{height_mm}_{seed}", "foliage", join(parts))


def plant_pot(a: Atlas, height_mm: int) -> Model:
    """Pot and stem of a plant."""
    high = height_mm / 1000
    profile = [(0.0, 0.0), (0.15, 0.0), (0.20, 0.30), (0.22, 0.32), (0.19, 0.32), (0.18, 0.29)]
    parts = [
        a.in_material("terracotta", lathe([*profile, (0, 0.29)], 16, 40)),
        a.in_material("leather", bar((0, 0, 0.28), (0, 0, 0.3 + 0.6 * high), 0.015, 5)),
    ]
    return Model(f"plant_pot_{height_mm}", "props", join(parts))


def bouquet(a: Atlas, seed: int) -> Model:
    """Bucket with flowers."""
    rng = np.random.default_rng(seed)
    parts = [
        a.in_material("grey", lathe([(0.11, 0.0), (0.14, 0.3), (0.13, 0.3), (0.1, 0.02)], 14, 40))
    ]
    for k in range(9):
        turn, reach = 2.4 * k, 0.05 + 0.016 * k
        x, y = reach * np.cos(turn), reach * np.sin(turn)
        z = float(rng.uniform(0.45, 0.6))
        parts.append(a.in_material("moss", bar((0.4 * x, 0.4 * y, 0.1), (x, y, z), 0.005, 3)))
        paint = ("pink", "red", "mustard", "white", "lilac")[int(rng.integers(5))]
        parts.append(a.in_material(paint, ball(0.034, 3, 5).shifted(x, y, z)))
    return Model(f"bouquet_{seed}", "props", join(parts))


def cup(a: Atlas) -> Model:
    """Cup and saucer."""
    parts = [
        a.in_material("white", lathe([(0.0, 0.0), (0.07, 0.008), (0.075, 0.014)], 10, 60)),
        a.in_material(
            "white", lathe([(0.02, 0.01), (0.04, 0.06), (0.036, 0.06), (0.0, 0.02)], 8, 60)
        ),
    ]
    return Model("cup", "props", join(parts))


def wall_picture(a: Atlas, name: str, wide_mm: int, high_mm: int) -> Model:
    """Framed picture, its lower edge at z = 0."""
    wide, high = wide_mm / 1000, high_mm / 1000
    return Model(f"picture_{name}_{wide_mm}", "props", a.board(name, "lacquer", wide, high, 0.025))


def a_board(a: Atlas) -> Model:
    """Menu on the floor before the café."""
    board = a.board("menu", "leather", 0.55, 0.85, 0.03)
    front = board.moved(pose(0, -0.14, 0.02, 0, 1.0, 0.0, -9.0))
    back = board.moved(pose(0, 0.14, 0.02, 180, 1.0, 0.0, -9.0))
    return Model("a_board", "props", join([front, back]))


def lamp_panel(a: Atlas, lamp: str) -> Model:
    """Luminous panel of 2.0 m by 0.45 m below a ceiling at z = 0."""
    corners = [(-1.0, 0.22, -0.03), (1.0, 0.22, -0.03), (1.0, -0.22, -0.03), (-1.0, -0.22, -0.03)]
    return Model(f"panel_{lamp}", lamp, polygon(corners))


def lamp_housing(a: Atlas) -> Model:
    """Frame around a luminous panel."""
    parts = []
    for x in (-1.02, 1.02):
        parts.append(a.block("white", (0.04, 0.52, 0.05), (x, 0, -0.025), "+z"))
    for y in (-0.24, 0.24):
        parts.append(a.block("white", (2.0, 0.04, 0.05), (0, y, -0.025), "+z-x+x"))
    return Model("lamp_housing", "props", join(parts))


def globe(a: Atlas) -> Model:
    """Luminous globe of 0.32 m about the origin."""
    return Model("globe", "globe", ball(0.16, 8, 16))


def globe_chain(a: Atlas) -> Model:
    """Rod and cap from which a globe hangs, up to z = 1.25."""
    parts = [
        a.in_material("iron", bar((0, 0, 0.15), (0, 0, 1.25), 0.010, 5)),
        a.in_material("iron", lathe([(0.09, 0.125), (0.06, 0.17), (0.0, 0.19)], 12, 40)),
    ]
    return Model("globe_rod", "props", join(parts))
