"""Furniture of offices and halls.

What stands against a wall has its back in the plane y = 0 and faces -y.  Heights are above the
floor, or above what an object stands on.
"""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import (
    Patch,
    ball,
    bar,
    disc,
    join,
    lathe,
    polygon,
    pose,
    ring,
    sheet,
    tube,
)
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model


def desk(a: Atlas, top: str = "beech") -> Model:
    """Desk, 1.6 m x 0.75 m, with drawers on its right."""
    parts = [
        a.block(top, (1.6, 0.75, 0.03), (0, -0.375, 0.735)),
        a.block("dark_grey", (0.03, 0.68, 0.72), (-0.76, -0.375, 0.36), "-z+z"),
        a.block("dark_grey", (1.49, 0.02, 0.36), (0, -0.08, 0.54), "-x+x+z"),
        a.block("grey", (0.42, 0.62, 0.66), (0.55, -0.37, 0.39), "+z"),
        a.block("dark_grey", (0.36, 0.54, 0.06), (0.55, -0.37, 0.03), "-z+z"),
    ]
    for z in (0.18, 0.40, 0.61):
        parts.append(a.block("white", (0.38, 0.016, 0.19), (0.55, -0.688, z), "+y"))
        parts.append(a.block("dark_grey", (0.12, 0.02, 0.015), (0.55, -0.705, z + 0.05), "+y"))
    return Model(f"desk_{top}", "props", join(parts))


def office_chair(a: Atlas, fabric: str) -> Model:
    """Swivel chair on five casters, facing -y."""
    metal = [bar((0, 0, 0.10), (0, 0, 0.44), 0.028, 8)]
    for k in range(5):
        t = np.radians(72 * k + 18)
        tip = (0.28 * np.cos(t), 0.28 * np.sin(t), 0.075)
        metal.append(bar((0, 0, 0.11), tip, 0.020, 4))
        metal.append(ball(0.032, 4, 6).shifted(tip[0], tip[1], 0.032))
    metal.append(tube([(0, 0.16, 0.44), (0, 0.27, 0.50), (0, 0.265, 0.72)], 0.022, 5))
    for x in (-0.27, 0.27):
        metal.append(bar((x, 0.02, 0.46), (x, 0.02, 0.66), 0.016, 5))
        metal.append(bar((x * 0.6, 0.02, 0.455), (x, 0.02, 0.47), 0.014, 5))
    parts = [a.in_material("black", part) for part in metal]
    for x in (-0.27, 0.27):
        parts.append(a.block("black", (0.06, 0.26, 0.03), (x, 0.0, 0.675)))
    parts.append(a.in_material(fabric, _cushion(0.48, 0.46, 0.09).shifted(0, 0, 0.44)))
    back = _cushion(0.44, 0.50, 0.08).moved(pose(0, 0.25, 0.80, roll_deg=82))
    parts.append(a.in_material(fabric, back))
    return Model(f"office_chair_{fabric}", "props", join(parts))


def side_chair(a: Atlas, fabric: str) -> Model:
    """Chair on four tube legs, facing -y."""
    legs = []
    for x in (-0.21, 0.21):
        legs.append(tube([(x, -0.21, 0), (x, -0.20, 0.44), (x, 0.20, 0.44)], 0.012, 5))
        legs.append(tube([(x, 0.24, 0), (x, 0.19, 0.44), (x, 0.25, 0.84)], 0.012, 5))
    parts = [a.in_material("steel", leg) for leg in legs]
    parts.append(a.block(fabric, (0.44, 0.43, 0.035), (0, 0, 0.465)))
    back = a.block(fabric, (0.44, 0.03, 0.26)).moved(pose(0, 0.232, 0.72, roll_deg=-9))
    return Model(f"side_chair_{fabric}", "props", join([*parts, back]))


def monitor(a: Atlas, screen: str) -> Model:
    """Flat screen on a foot, facing -y."""
    parts = [
        a.block("black", (0.54, 0.03, 0.33), (0, 0.02, 0.31)),
        a.picture(screen, 0.51, 0.30, 0.002).shifted(z=0.16),
        a.block("black", (0.06, 0.03, 0.22), (0, 0.05, 0.11), "-z"),
        a.block("black", (0.24, 0.18, 0.015), (0, 0.04, 0.0075), "-z"),
    ]
    return Model(f"monitor_{screen}", "props", join(parts))


def keyboard(a: Atlas) -> Model:
    """Keyboard and mouse, near edge towards -y."""
    keys = a.picture("keyboard", 0.43, 0.15).moved(pose(0, -0.075, 0.0225, roll_deg=-90))
    parts = [
        a.block("black", (0.44, 0.16, 0.02), (0, 0, 0.01), "-z"),
        keys,
        a.in_material(
            "black", ball(1.0, 5, 8).moved(pose(0.32, 0, 0.012, scale=(0.03, 0.05, 0.02)))
        ),
    ]
    return Model("keyboard", "props", join(parts))


def mug(a: Atlas, paint: str) -> Model:
    """Mug with a handle."""
    body = lathe([(0.0, 0.0), (0.038, 0.0), (0.042, 0.09), (0.036, 0.09), (0.034, 0.02)], 10, 50)
    handle = ring(0.026, 0.006, 8, 4).moved(pose(0.05, 0, 0.045, roll_deg=90))
    coffee = a.in_material("soil", disc(0.036, 0.07, 10))
    return Model(
        f"mug_{paint}", "props", join([a.in_material(paint, join([body, handle])), coffee])
    )


def papers(a: Atlas) -> Model:
    """A pile of paper, not quite straight."""
    parts = [
        a.block("white", (0.21, 0.297, 0.02), (0, 0, 0.01), "-z"),
        a.block("ivory", (0.21, 0.297, 0.015)).moved(pose(0.02, 0.01, 0.0275, 14)),
    ]
    return Model("papers", "props", join(parts))


def desk_lamp(a: Atlas) -> Model:
    """Lamp on a jointed arm."""
    parts = [
        lathe([(0.09, 0.0), (0.09, 0.02), (0.0, 0.025)], 10, 50),
        tube([(0, 0, 0.02), (0.0, 0.10, 0.28), (0.0, -0.12, 0.44)], 0.010, 5),
        lathe([(0.075, 0.36), (0.03, 0.46), (0.0, 0.465)], 10, 60).shifted(0, -0.14, 0),
        lathe([(0.0, 0.372), (0.072, 0.364)], 10, 180).shifted(0, -0.14, 0),
    ]
    return Model("desk_lamp", "props", a.in_material("red", join(parts)))


def bookcase(a: Atlas, rows: tuple[str, ...], wood: str) -> Model:
    """Case with a row of books on each shelf."""
    wide, deep, step = 0.96, 0.30, 0.36
    high = step * len(rows) + 0.10
    parts = [
        a.block(wood, (0.025, deep, high), (s * (wide - 0.025) / 2, -deep / 2, high / 2), "-z")
        for s in (-1, 1)
    ]
    parts.append(a.block(wood, (wide - 0.05, 0.012, high), (0, -0.006, high / 2), "-z-x+x"))
    parts.append(a.block(wood, (wide - 0.05, deep - 0.02, 0.07), (0, -deep / 2, 0.035), "-z-x+x"))
    for level in range(len(rows) + 1):
        z = 0.085 + step * level
        parts.append(a.block(wood, (wide - 0.05, deep - 0.02, 0.025), (0, -deep / 2, z), "-x+x"))
    for level, books in enumerate(rows):
        if books == "none":
            continue
        z, tall = 0.0975 + step * level, 0.28
        parts.append(a.picture(books, wide - 0.06, tall, -deep + 0.06).shifted(z=z))
        top = a.block("ivory", (wide - 0.06, deep - 0.09, 0.01), (0, -deep / 2 + 0.025, z + tall))
        parts.append(top)
    return Model(f"bookcase_{'_'.join(rows)}_{wood}", "props", join(parts))


def cupboard(a: Atlas, paint: str, wide: float = 1.0, high: float = 1.9) -> Model:
    """Cupboard with two doors."""
    deep = 0.42
    parts = [
        a.block(paint, (wide, deep, high - 0.06), (0, -deep / 2, 0.06 + (high - 0.06) / 2)),
        a.block("black", (wide - 0.04, deep - 0.06, 0.06), (0, -deep / 2 + 0.02, 0.03), "+z"),
    ]
    for s in (-1, 1):
        door = (wide / 2 - 0.012, 0.018, high - 0.09)
        parts.append(
            a.block(paint, door, (s * wide / 4, -deep - 0.009, 0.06 + high / 2 - 0.03), "+y")
        )
        grip = (0.014, 0.025, 0.18)
        parts.append(a.block("steel", grip, (s * 0.05, -deep - 0.030, high * 0.54)))
    return Model(f"cupboard_{paint}_{round(100 * high)}", "props", join(parts))


def filing_cabinet(a: Atlas, paint: str) -> Model:
    """Four steel drawers."""
    parts = [a.block(paint, (0.46, 0.60, 1.32), (0, -0.30, 0.66), "-z")]
    for level in range(4):
        z = 0.19 + 0.315 * level
        parts.append(a.block(paint, (0.43, 0.018, 0.295), (0, -0.609, z), "+y"))
        parts.append(a.block("black", (0.14, 0.025, 0.02), (0, -0.63, z + 0.06), "+y"))
        parts.append(a.block("white", (0.09, 0.006, 0.04), (0, -0.621, z + 0.11), "+y"))
    return Model(f"filing_cabinet_{paint}", "props", join(parts))


def picture(a: Atlas, name: str, wide: float, high: float, edge: str = "black") -> Model:
    """A board on a wall, its lower edge at z = 0."""
    return Model(
        f"picture_{name}_{edge}_{round(100 * wide)}", "props", a.board(name, edge, wide, high)
    )


def wall_clock(a: Atlas) -> Model:
    """Round clock on a wall, its middle at z = 0."""
    angle = np.linspace(0, 2 * np.pi, 21)[:-1]
    left, bottom, width, height = a.places["clock"]
    face = disc(0.15, 0, 20).moved(pose(0, -0.035, 0, roll_deg=90))
    unit = 0.5 + np.stack([np.cos(angle), np.sin(angle)], axis=1) * 0.46
    uvs = np.array([left, bottom]) + unit * [width, height]
    face = Patch(face.positions, face.normals, uvs, face.faces)
    rim = lathe([(0.165, 0.0), (0.165, 0.045), (0.15, 0.045), (0.15, 0.03)], 20, 40)
    rim = a.in_material("black", rim.moved(pose(roll_deg=90)))
    return Model("wall_clock", "props", join([rim, face]))


def waste_bin(a: Atlas, paint: str) -> Model:
    """Round bin, open at the top."""
    wall = lathe([(0.12, 0.0), (0.15, 0.32), (0.14, 0.32), (0.115, 0.02), (0.0, 0.02)], 12, 40)
    return Model(f"bin_{paint}", "props", a.in_material(paint, wall))


def plant(
    a: Atlas, rng: np.random.Generator, name: str, leaf: str, count: int, reach: float
) -> Model:
    """Arching leaves in a pot; each leaf has two faces."""
    pot = lathe(
        [(0.13, 0.0), (0.18, 0.34), (0.20, 0.34), (0.20, 0.38), (0.17, 0.38), (0.16, 0.3)], 12, 40
    )
    parts = [
        a.in_material("terracotta" if leaf == "leaf" else "white", pot),
        a.in_material("soil", disc(0.165, 0.33, 12)),
    ]
    for k in range(count):
        yaw, lift = 137.5 * k + rng.uniform(-10, 10), rng.uniform(0.5, 1.0)
        t = np.linspace(0, 1, 6)
        out = 0.03 + reach * (0.45 + 0.55 * (1 - lift)) * t**1.3
        up = 0.32 + reach * (0.6 + 1.0 * lift) * (t - 0.38 * t**2.6)
        half = 0.055 * reach / 0.6 * np.sin(np.pi * (0.08 + 0.92 * t)) + 0.004
        edges = np.stack(
            [np.stack([out, s * half, up + 0.25 * half * abs(s)], axis=1) for s in (-1, 0, 1)],
            axis=1,
        )
        uvs = np.stack(np.meshgrid([-0.1, 0, 0.1], t), axis=-1)
        faces = [sheet(edges, uvs), sheet(edges[:, ::-1] - [0, 0, 0.003], uvs)]
        parts += [a.in_material(leaf, face.moved(pose(yaw_deg=yaw))) for face in faces]
    return Model(name, "props", join(parts))


def fire_extinguisher(a: Atlas) -> Model:
    """Red bottle on a wall bracket, foot at z = 0, back at y = 0."""
    body = lathe(
        [(0.0, 0.0), (0.07, 0.0), (0.075, 0.02), (0.075, 0.42), (0.03, 0.50), (0.0, 0.51)], 14, 50
    )
    parts = [
        a.in_material("red", body.shifted(0, -0.09, 0)),
        a.in_material(
            "black", tube([(0.02, -0.09, 0.53), (0.10, -0.10, 0.50), (0.11, -0.10, 0.15)], 0.013, 5)
        ),
        a.block("black", (0.03, 0.14, 0.03), (0, -0.10, 0.545)),
        a.in_material("steel", bar((0, -0.09, 0.49), (0, -0.09, 0.55), 0.022, 8)),
        a.block("steel", (0.06, 0.03, 0.04), (0, -0.015, 0.30), "+y"),
        a.picture("sign_fire", 0.2, 0.2, -0.006).shifted(z=0.78),
    ]
    return Model("fire_extinguisher", "props", join(parts))


def radiator(a: Atlas) -> Model:
    """Ribbed radiator under a window, foot at z = 0."""
    parts = [a.block("white", (1.2, 0.05, 0.46), (0, -0.075, 0.38))]
    for x in np.linspace(-0.55, 0.55, 12):
        parts.append(a.block("white", (0.045, 0.02, 0.44), (x, -0.108, 0.38), "+y"))
    for x in (-0.5, 0.5):
        parts.append(a.in_material("steel", bar((x, -0.075, 0.0), (x, -0.075, 0.16), 0.012, 5)))
    return Model("radiator", "props", join(parts))


def coat_stand(a: Atlas) -> Model:
    """Stand with a coat and a hat."""
    parts = [
        bar((0, 0, 0.03), (0, 0, 1.75), 0.02, 6),
        lathe([(0.22, 0.0), (0.22, 0.02), (0.02, 0.05)], 12, 50),
    ]
    for k in range(4):
        t = np.radians(90 * k + 45)
        c, s = np.cos(t), np.sin(t)
        parts.append(
            tube([(0, 0, 1.6), (0.12 * c, 0.12 * s, 1.64), (0.16 * c, 0.16 * s, 1.72)], 0.012, 4)
        )
    coat = lathe(
        [(0.0, 0.75), (0.17, 0.75), (0.15, 1.1), (0.13, 1.45), (0.05, 1.62), (0.0, 1.63)], 9, 60
    )
    hat = lathe(
        [(0.0, 1.70), (0.15, 1.70), (0.16, 1.72), (0.09, 1.73), (0.085, 1.82), (0.0, 1.84)], 12, 40
    )
    cloth = a.in_material("fabric_blue", coat.moved(pose(0.13, 0.05, 0, scale=(0.75, 1.0, 1.0))))
    felt = a.in_material("leather", hat.shifted(-0.02))
    return Model(
        "coat_stand", "props", join([*(a.in_material("black", p) for p in parts), cloth, felt])
    )


def sofa(a: Atlas, fabric: str, seats: int) -> Model:
    """Sofa or, with one seat, armchair; back at y = 0."""
    wide = 0.62 * seats + 0.36
    parts = [
        a.block(fabric, (wide - 0.04, 0.80, 0.22), (0, -0.43, 0.20)),
        a.block(fabric, (wide - 0.30, 0.20, 0.50), (0, -0.13, 0.56), "-z"),
    ]
    for s in (-1, 1):
        parts.append(a.block(fabric, (0.15, 0.82, 0.36), (s * (wide - 0.15) / 2, -0.43, 0.46)))
        for y in (-0.08, -0.76):
            parts.append(
                a.block("oak", (0.06, 0.06, 0.09), (s * (wide / 2 - 0.06), y, 0.045), "-z")
            )
    for k in range(seats):
        x = (k - (seats - 1) / 2) * 0.62
        parts.append(a.in_material(fabric, _cushion(0.60, 0.62, 0.16).shifted(x, -0.53, 0.31)))
    return Model(f"sofa_{seats}_{fabric}", "props", join(parts))


def low_table(a: Atlas) -> Model:
    """Coffee table with a shelf."""
    parts = [
        a.block("walnut", (1.0, 0.55, 0.035), (0, 0, 0.42)),
        a.block("walnut", (0.86, 0.42, 0.02), (0, 0, 0.16)),
    ]
    for x in (-0.45, 0.45):
        for y in (-0.23, 0.23):
            parts.append(a.block("black", (0.04, 0.04, 0.41), (x, y, 0.205), "-z"))
    return Model("low_table", "props", join(parts))


def round_table(a: Atlas, top: str) -> Model:
    """Table on one foot, 0.9 m across."""
    parts = [
        a.in_material(top, lathe([(0.0, 0.715), (0.45, 0.715), (0.45, 0.745)], 24, 40)),
        a.in_material(top, disc(0.45, 0.745, 24)),
        a.in_material("steel", bar((0, 0, 0.03), (0, 0, 0.715), 0.035, 8)),
        a.in_material("steel", lathe([(0.26, 0.0), (0.26, 0.02), (0.03, 0.05)], 16, 40)),
    ]
    return Model(f"round_table_{top}", "props", join(parts))


def meeting_table(a: Atlas) -> Model:
    """Long table, 1.1 m x 2.8 m along y."""
    parts = [
        a.block("oak", (1.1, 2.8, 0.04), (0, 0, 0.73)),
        a.block("black", (0.5, 0.08, 0.68), (0, -0.95, 0.37), "+z"),
        a.block("black", (0.5, 0.08, 0.68), (0, 0.95, 0.37), "+z"),
        a.block("black", (0.7, 0.4, 0.03), (0, -0.95, 0.015), "-z"),
        a.block("black", (0.7, 0.4, 0.03), (0, 0.95, 0.015), "-z"),
    ]
    return Model("meeting_table", "props", join(parts))


def bench(a: Atlas, paint: str) -> Model:
    """Waiting bench: four shells on a beam."""
    parts = [a.block("dark_grey", (2.0, 0.06, 0.05), (0, -0.30, 0.36))]
    for x in (-0.8, 0.8):
        parts.append(a.block("dark_grey", (0.05, 0.05, 0.34), (x, -0.30, 0.17), "-z"))
        parts.append(a.block("dark_grey", (0.05, 0.44, 0.03), (x, -0.30, 0.015), "-z"))
    for k in range(4):
        x = (k - 1.5) * 0.51
        parts.append(a.block(paint, (0.47, 0.44, 0.03), (x, -0.30, 0.40)))
        parts.append(a.block(paint, (0.47, 0.03, 0.40)).moved(pose(x, -0.075, 0.60, roll_deg=-8)))
    return Model(f"bench_{paint}", "props", join(parts))


def reception_desk(a: Atlas) -> Model:
    """Counter with a raised front, visitors at -y."""
    parts = [
        a.block("oak", (2.2, 0.06, 1.06), (0, -0.75, 0.53), "-z"),
        a.block("oak", (0.06, 0.72, 1.06), (-1.07, -0.36, 0.53), "-z"),
        a.block("oak", (0.06, 0.72, 1.06), (1.07, -0.36, 0.53), "-z"),
        a.block("white", (2.3, 0.34, 0.04), (0, -0.71, 1.08)),
        a.block("beech", (2.08, 0.66, 0.03), (0, -0.39, 0.735)),
        a.block("teal", (2.2, 0.012, 0.10), (0, -0.786, 0.20)),
    ]
    return Model("reception_desk", "props", join(parts))


def door_mat(a: Atlas) -> Model:
    """Mat inside the front door."""
    return Model("door_mat", "props", a.block("black", (1.8, 1.0, 0.012), (0, 0, 0.006), "-z"))


def hanging_sign(a: Atlas, name: str, wide: float, high: float) -> Model:
    """Sign under the ceiling, z = 0, the same on both faces."""
    front = a.board(name, "white", wide, high, 0.02).shifted(0, 0.01, -high - 0.12)
    back = a.picture(name, wide, high, 0).shifted(0, -0.0101, -high - 0.12).moved(pose(yaw_deg=180))
    rods = [bar((x, 0, -0.13), (x, 0, 0), 0.006, 4) for x in (-0.4 * wide, 0.4 * wide)]
    return Model(
        f"hanging_{name}", "props", join([front, back, a.in_material("steel", join(rods))])
    )


def projector(a: Atlas) -> Model:
    """Projector under the ceiling, z = 0, lens towards -y."""
    parts = [
        a.in_material("white", bar((0, 0, -0.22), (0, 0, 0), 0.02, 6)),
        a.block("white", (0.34, 0.28, 0.12), (0, 0, -0.28)),
        a.in_material("black", bar((0.08, -0.18, -0.28), (0.08, -0.13, -0.28), 0.035, 10)),
    ]
    return Model("projector", "props", join(parts))


def _cushion(wide: float, deep: float, thick: float) -> Patch:
    """Box with softened rims, about its middle, from z = 0."""
    ring_uv = []
    outline = [
        (-1, -1),
        (0, -1.06),
        (1, -1),
        (1.06, 0),
        (1, 1),
        (0, 1.06),
        (-1, 1),
        (-1.06, 0),
        (-1, -1),
    ]
    levels = ((0.0, 0.90), (0.25, 1.0), (0.75, 1.0), (1.0, 0.88), (1.04, 0.0))
    points = np.array(
        [
            [(x * wide / 2.12 * s, y * deep / 2.12 * s, z * thick) for x, y in outline]
            for z, s in levels
        ]
    )
    for level in range(len(levels)):
        ring_uv.append([(k * wide / 3, level * thick * 0.6) for k in range(len(outline))])
    side = sheet(points.transpose(1, 0, 2), np.array(ring_uv).transpose(1, 0, 2))
    under = points[0, :-1][::-1]
    return join([side, polygon(under)])
