"""Furniture of the court: fountain, benches, pots, bicycle, sundial, lanterns."""

from __future__ import annotations

import numpy as np

from scenes.courtyard.materials import in_material
from scenes.modeling.geometry import (
    Patch,
    ball,
    bar,
    box,
    disc,
    join,
    lathe,
    polygon,
    pose,
    ring,
    tube,
)
from scenes.modeling.stage import Model


def fountain() -> Model:
    """Eight-sided basin with a column bowl."""
    turn = pose(yaw_deg=22.5)
    basin = lathe(
        [
            (1.22, 0.0),
            (1.22, 0.10),
            (1.12, 0.12),
            (1.12, 0.46),
            (1.20, 0.48),
            (1.20, 0.56),
            (0.98, 0.56),
            (0.98, 0.10),
        ],
        8,
        crease_deg=20,
    )
    stem = lathe(
        [
            (0.34, 0.10),
            (0.34, 0.34),
            (0.20, 0.40),
            (0.13, 0.56),
            (0.12, 0.80),
            (0.18, 0.92),
            (0.16, 0.96),
            (0.30, 1.02),
            (0.52, 1.12),
            (0.58, 1.20),
            (0.58, 1.24),
            (0.53, 1.24),
            (0.46, 1.16),
            (0.10, 1.13),
            (0.07, 1.30),
            (0.11, 1.36),
            (0.05, 1.44),
            (0.0, 1.48),
        ],
        20,
        crease_deg=50,
    )
    parts = [
        in_material("limestone", _flat_sided(basin).moved(turn)),
        in_material("mosaic", disc(1.04, 0.12, 8).moved(turn)),
        in_material("marble", stem),
    ]
    for index in range(8):  # mosaic panel on each side of the basin
        reach = 1.12 * np.cos(np.pi / 8) + 0.006
        panel = polygon(
            [
                (-0.32, -reach, 0.18),
                (0.32, -reach, 0.18),
                (0.32, -reach, 0.40),
                (-0.32, -reach, 0.40),
            ]
        )
        parts.append(in_material("mosaic", panel).moved(pose(yaw_deg=45 * index)))
    return Model("fountain", "props", join(parts))


def fountain_water() -> Model:
    """Water in the basin and in the bowl, with four thin jets between them."""
    jets = []
    for index in range(4):
        t = np.linspace(0, 1, 9)
        arc = np.stack([0.50 + 0.28 * t, 0 * t, 1.21 + 0.10 * t - 0.85 * t**2], axis=1)
        jets.append(tube(arc, 0.012, 4).moved(pose(yaw_deg=45 + 90 * index)))
    levels = [disc(0.99, 0.47, 8).moved(pose(yaw_deg=22.5)), disc(0.52, 1.205, 20)]
    return Model("fountain_water", "water", join([*levels, *jets]))


def bench() -> Model:
    """Slatted bench facing -y, with a back and iron legs."""
    parts = []
    for y in (-0.18, -0.06, 0.06):
        parts.append(in_material("oak", box((1.5, 0.10, 0.035), (0, y, 0.445))))
    for z, y in ((0.62, 0.155), (0.78, 0.185)):
        slat = box((1.5, 0.03, 0.11)).moved(pose(0, y, z, roll_deg=-10))
        parts.append(in_material("oak", slat))
    for x in (-0.62, 0.62):
        parts += [
            in_material("iron", part)
            for part in (
                box((0.05, 0.05, 0.43), (x, -0.18, 0.215), without="-z"),
                bar((x, 0.07, 0.0), (x, 0.205, 0.86), 0.025, 4),
                box((0.05, 0.30, 0.04), (x, -0.05, 0.41)),
                bar((x, -0.20, 0.63), (x, 0.16, 0.65), 0.02, 4),
                bar((x, -0.18, 0.43), (x, -0.19, 0.63), 0.018, 4),
            )
        ]
    return Model("bench", "props", join(parts))


def flower_pot(name: str = "flower_pot") -> Model:
    """Clay pot with a rolled rim, filled with soil."""
    wall = lathe(
        [(0.22, 0.0), (0.31, 0.40), (0.345, 0.41), (0.345, 0.49), (0.30, 0.49), (0.29, 0.42)],
        12,
        crease_deg=50,
    )
    return Model(
        name,
        "props",
        join([in_material("terracotta", wall), in_material("soil", disc(0.295, 0.44, 12))]),
    )


def planter_box() -> Model:
    """Square stone planter."""
    parts = [
        in_material("limestone", part)
        for part in (
            box((0.80, 0.80, 0.42), (0, 0, 0.27), without="+z-z"),
            box((0.88, 0.88, 0.06), (0, 0, 0.03), without="-z"),
            box((0.90, 0.08, 0.08), (0, -0.41, 0.52)),
            box((0.90, 0.08, 0.08), (0, 0.41, 0.52)),
            box((0.08, 0.74, 0.08), (-0.41, 0, 0.52), without="-y+y"),
            box((0.08, 0.74, 0.08), (0.41, 0, 0.52), without="-y+y"),
        )
    ]
    parts.append(
        in_material(
            "soil",
            polygon([(-0.4, -0.4, 0.5), (0.4, -0.4, 0.5), (0.4, 0.4, 0.5), (-0.4, 0.4, 0.5)]),
        )
    )
    return Model("planter_box", "props", join(parts))


def amphora() -> Model:
    """Two-handled jar."""
    body = lathe(
        [
            (0.0, 0.0),
            (0.10, 0.0),
            (0.11, 0.03),
            (0.20, 0.22),
            (0.24, 0.40),
            (0.22, 0.54),
            (0.13, 0.66),
            (0.085, 0.72),
            (0.08, 0.82),
            (0.12, 0.86),
            (0.12, 0.89),
            (0.07, 0.88),
            (0.06, 0.70),
        ],
        11,
        crease_deg=50,
    )
    handles = [
        tube([(0.08, 0, 0.80), (0.17, 0, 0.82), (0.21, 0, 0.74), (0.19, 0, 0.60)], 0.018, 5).moved(
            pose(yaw_deg=yaw)
        )
        for yaw in (0, 180)
    ]
    return Model("amphora", "props", in_material("terracotta", join([body, *handles])))


def crate() -> Model:
    """Wooden fruit crate, open slats on a dark box."""
    parts = [in_material("dark_oak", box((0.54, 0.38, 0.30), (0, 0, 0.16), without="-z"))]
    for z in (0.06, 0.16, 0.26):
        for y in (-0.2, 0.2):
            parts.append(in_material("oak", box((0.60, 0.02, 0.08), (0, y, z))))
        for x in (-0.285, 0.285):
            parts.append(in_material("oak", box((0.02, 0.38, 0.08), (x, 0, z))))
    return Model("crate", "props", join(parts))


def sundial() -> Model:
    """Armillary sundial on a stone baluster."""
    foot = [in_material("limestone", box((0.62, 0.62, 0.10), (0, 0, 0.05), without="-z"))]
    foot.append(
        in_material(
            "marble",
            lathe(
                [
                    (0.24, 0.10),
                    (0.24, 0.16),
                    (0.15, 0.22),
                    (0.20, 0.42),
                    (0.12, 0.62),
                    (0.11, 0.74),
                    (0.22, 0.80),
                    (0.24, 0.86),
                    (0.24, 0.92),
                    (0.0, 0.92),
                ],
                12,
                crease_deg=50,
            ),
        )
    )
    center = pose(0, 0, 1.32)
    sphere = [
        ring(0.38, 0.016, 22, 4).moved(center @ pose(**turn))
        for turn in ({"roll_deg": 90}, {"roll_deg": 90, "yaw_deg": 90}, {"roll_deg": 42}, {})
    ]
    axis = np.array([0, np.cos(np.radians(42)), np.sin(np.radians(42))])
    middle = np.array([0, 0, 1.32])
    sphere.append(bar(middle - 0.52 * axis, middle + 0.52 * axis, 0.012))
    sphere.append(ball(0.07, 6, 10).shifted(z=1.32))
    sphere.append(bar((0, 0, 0.9), (0, 0, 0.96), 0.05, 8))
    return Model("sundial", "props", join([*foot, in_material("bronze", join(sphere))]))


def bicycle() -> tuple[Model, Model]:
    """A bicycle standing along x, front towards +x: enamelled frame, and all its other parts."""
    rear, front, crank = (-0.52, 0, 0.34), (0.52, 0, 0.34), (-0.06, 0, 0.30)
    seat, head = (-0.21, 0, 0.78), (0.36, 0, 0.80)
    frame = [
        bar(a, b, 0.017, 8) for a, b in ((crank, seat), (crank, (0.385, 0, 0.70)), (seat, head))
    ]
    for y in (-0.05, 0.05):
        for a, b in ((crank, rear), (seat, rear), ((0.40, 0, 0.66), front)):
            frame.append(bar((a[0], y * 0.5, a[2]), (b[0], y, b[2]), 0.011))
    frame.append(bar((0.40, 0, 0.64), (0.345, 0, 0.86), 0.021, 8))
    for x, start, end in ((-0.52, 20, 190), (0.52, 30, 150)):
        frame.append(_mudguard(x, 0.34, 0.365, start, end))
    parts = [in_material("iron", _wheel().shifted(x, 0, 0.34)) for x in (-0.52, 0.52)]
    bars = [
        (-0.02, -0.27, 0.98),
        (0.20, -0.26, 0.99),
        (0.34, -0.10, 0.96),
        (0.34, 0.10, 0.96),
        (0.20, 0.26, 0.99),
        (-0.02, 0.27, 0.98),
    ]
    parts += [
        in_material("iron", part)
        for part in (
            tube(bars, 0.012),
            bar((0.345, 0, 0.86), (0.335, 0, 0.97), 0.014),
            bar(seat, (-0.235, 0, 0.88), 0.013),
            ring(0.09, 0.008, 18, 4).moved(pose(*crank, roll_deg=90)),
            bar((-0.06, -0.09, 0.30), (-0.06, 0.09, 0.30), 0.016),
            bar((-0.06, 0.07, 0.30), (0.05, 0.07, 0.17), 0.01),
            bar((-0.06, -0.07, 0.30), (-0.17, -0.07, 0.43), 0.01),
            bar((-0.20, 0.06, 0.30), (-0.26, 0.20, 0.0), 0.010),
        )
    ]
    for x, y, z in ((0.05, 0.12, 0.17), (-0.17, -0.12, 0.43)):
        parts.append(in_material("iron", box((0.09, 0.09, 0.02), (x, y, z))))
    saddle = ball(1.0, 5, 8).moved(pose(-0.25, 0, 0.90, scale=(0.15, 0.085, 0.04)))
    grips = [bar((-0.03, y, 0.98), (0.08, y, 0.985), 0.018) for y in (-0.27, 0.27)]
    parts += [in_material("leather", part) for part in (saddle, *grips)]
    basket = lathe(
        [(0.10, 0.74), (0.15, 0.96), (0.16, 0.97), (0.14, 0.96), (0.09, 0.76), (0.0, 0.76)], 10, 30
    ).shifted(x=0.53)
    parts.append(in_material("oak", basket))
    parts.append(in_material("iron", bar((0.36, 0, 0.84), (0.45, 0, 0.84), 0.01)))
    return (
        Model("bicycle_frame", "bicycle_enamel", join(frame)),
        Model("bicycle_parts", "props", join(parts)),
    )


def lantern() -> Model:
    """Four-sided iron lantern hanging from z = 0."""
    parts = [
        bar((0, 0, 0), (0, 0, -0.30), 0.008, 3),
        lathe([(0.0, -0.61), (0.10, -0.58), (0.0, -0.57)], 4, 20),
        lathe([(0.0, -0.37), (0.14, -0.38), (0.03, -0.29), (0.0, -0.28)], 4, 20),
    ]
    for index in range(4):
        a = np.radians(90 * index)
        low = (0.09 * np.cos(a), 0.09 * np.sin(a), -0.58)
        parts.append(bar(low, (0.125 * np.cos(a), 0.125 * np.sin(a), -0.37), 0.008, 3))
    glow = _flat_sided(lathe([(0.075, -0.57), (0.11, -0.38)], 4, 20))
    metal = in_material("iron", _flat_sided(join(parts)))
    return Model("lantern", "props", join([metal, in_material("lemon", glow)]))


def _wheel() -> Patch:
    """Tire, rim, hub and spokes about the y axis."""
    upright = pose(roll_deg=90)
    parts = [ring(0.325, 0.018, 26, 5).moved(upright), ring(0.300, 0.010, 26, 3).moved(upright)]
    parts.append(bar((0, -0.05, 0), (0, 0.05, 0), 0.022, 8))
    for index in range(16):
        a, b = np.radians(22.5 * index), np.radians(22.5 * index + 25 * (-1) ** index)
        y = 0.03 * (-1) ** index
        parts.append(
            bar(
                (0.02 * np.cos(b), y, 0.02 * np.sin(b)),
                (0.30 * np.cos(a), 0, 0.30 * np.sin(a)),
                0.003,
                3,
            )
        )
    return join(parts)


def _mudguard(x: float, z: float, radius: float, start_deg: float, end_deg: float) -> Patch:
    angle = np.radians(np.linspace(start_deg, end_deg, 12))
    arc = [(x + radius * np.cos(a), 0, z + radius * np.sin(a)) for a in angle]
    return tube(arc, 0.014, 5)


def _flat_sided(patch: Patch) -> Patch:
    """The same faces with flat shading, for prisms made on the lathe."""
    corners = patch.positions[patch.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Patch(
        corners.reshape(-1, 3),
        np.repeat(normals, 3, axis=0),
        patch.uvs[patch.faces].reshape(-1, 2),
        np.arange(len(patch.faces) * 3).reshape(-1, 3),
    )
