"""Rubble of the collapsed room."""

from __future__ import annotations

import numpy as np

from scenes.modeling.geometry import Patch, box, join, pose, sheet, tube
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model


def heap(a: Atlas, rng: np.random.Generator, name: str, radius: float, high: float) -> Model:
    """Mound of dust with bricks and lumps of plaster on it."""
    rings, spokes = 6, 15
    t = np.linspace(0, 1, rings)
    angle = np.linspace(0, 2 * np.pi, spokes)
    wobble = 1 + 0.22 * (rng.random(spokes) - 0.5)
    wobble[-1] = wobble[0]
    bumps = 1 + 0.5 * (rng.random((rings, spokes)) - 0.5)
    bumps[:, -1] = bumps[:, 0]
    bumps[0] = 1.0  # one top
    out = radius * t[:, None] * wobble
    z = high * (np.cos(np.pi * np.minimum(t, 1))[:, None] * 0.5 + 0.5) * bumps
    z[-1] = -0.02
    points = np.stack([out * np.cos(angle), out * np.sin(angle), z], axis=-1)
    mound = sheet(points, points[..., :2], wraps=True)
    parts = [a.in_material("concrete", mound)]
    for _ in range(round(46 * radius)):
        reach = radius * np.sqrt(rng.random()) * 1.05
        turn = rng.uniform(0, 2 * np.pi)
        level = high * (np.cos(np.pi * min(reach / radius, 1)) * 0.5 + 0.5)
        at = pose(
            reach * np.cos(turn),
            reach * np.sin(turn),
            max(level, 0.03),
            rng.uniform(0, 360),
            pitch_deg=rng.uniform(-40, 40),
            roll_deg=rng.uniform(-40, 40),
        )
        if rng.random() < 0.6:
            piece = a.in_material("bricks", box((0.24, 0.115, 0.07), courses=True))
        else:
            size = rng.uniform(0.06, 0.22, 3) * [1.2, 1.0, 0.5]
            piece = a.in_material("plasterboard", box(size))
        parts.append(piece.moved(at))
    return Model(name, "props", join(parts))


def plank(a: Atlas, length: float, wood: str) -> Model:
    """Board lying along x, its under side at z = 0."""
    patch = a.block(wood, (length, 0.16, 0.03), (0, 0, 0.015))
    return Model(f"plank_{wood}_{round(100 * length)}", "props", patch)


def slab(a: Atlas) -> Model:
    """A piece of ceiling: plasterboard on a lath."""
    parts = [
        a.block("plasterboard", (1.1, 0.8, 0.025), (0, 0, 0.0125)),
        a.block("oak", (0.05, 0.9, 0.04), (-0.3, 0.03, 0.045)),
        a.block("oak", (0.05, 0.9, 0.04), (0.3, -0.02, 0.045)),
    ]
    return Model("slab", "props", join(parts))


def ceiling_tile(a: Atlas) -> Model:
    """A panel of the ceiling, 0.6 m square."""
    return Model("ceiling_tile", "props", a.block("white", (0.58, 0.58, 0.02), (0, 0, 0.01)))


def cables(a: Atlas, rng: np.random.Generator) -> Model:
    """Cables that hang from a hole in the ceiling, z = 0."""
    parts: list[Patch] = []
    for _ in range(5):
        x, y = rng.uniform(-0.2, 0.2, 2)
        long = rng.uniform(0.4, 1.1)
        sway = rng.uniform(-0.25, 0.25, 2)
        t = np.linspace(0, 1, 6)
        path = np.stack([x + sway[0] * t**2, y + sway[1] * t**2, -long * t], axis=1)
        paint = ("black", "red", "yellow", "grey")[rng.integers(4)]
        parts.append(a.in_material(paint, tube(path, 0.009, 4)))
    return Model("cables", "props", join(parts))


def loose_bricks(a: Atlas, rng: np.random.Generator) -> Model:
    """Bricks scattered over a meter, few enough to drive around."""
    parts = []
    for k in range(9):
        x, y = (k % 3 - 1) * 0.36 + rng.uniform(-0.1, 0.1), (k // 3 - 1) * 0.36
        at = pose(x, y + rng.uniform(-0.05, 0.05), 0.035, rng.uniform(0, 360))
        parts.append(a.in_material("bricks", box((0.24, 0.115, 0.07), courses=True)).moved(at))
    return Model("loose_bricks", "props", join(parts))
