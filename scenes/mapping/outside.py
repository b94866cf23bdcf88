"""View through the windows: lawn, road, trees, neighbors, far hills."""

from __future__ import annotations

import itertools

import numpy as np

from scenes.mapping.plan import EAST, NORTH, OUTER, SOUTH, WEST
from scenes.modeling.geometry import Patch, ball, bar, box, join, polygon, pose, tile
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model, Stage

GROUND = -0.15
REACH = 60.0


def surround(stage: Stage, atlas: Atlas, rng: np.random.Generator) -> None:
    """The country around the building, in pieces small enough to be left out when not seen."""
    _lawns(stage)
    tree, hedge = _tree(atlas, rng), _hedge(atlas)
    places = (
        (-9, -6), (-12, 1), (-8.5, 6), (-13, 10), (-6, 17), (2, 19), (8, 17.5), (14, 20),
        (16, 8), (15, 1.5), (18, -4), (-2, -19), (9, -18), (4.6, -24),
    )  # fmt: skip
    for number, (x, y) in enumerate(places, start=1):
        at = pose(x, y, GROUND, 70 * number, 0.85 + 0.06 * (number % 5))
        stage.place(f"tree_{number:02}", tree, at)
    for number, (x, y, yaw) in enumerate(
        ((-7.5, -2, 90), (-7.5, 3, 90), (0, 16, 0), (5, 16, 0), (13.5, 4, 90), (13.5, 9, 90)),
        start=1,
    ):
        stage.place(f"hedge_{number:02}", hedge, pose(x, y, GROUND, yaw))
    house = _house(atlas)
    for number, (x, y, yaw) in enumerate(
        ((-26, 4, 90), (24, 3, -90), (3, 34, 0), (-14, -30, 170), (20, -27, 200)), start=1
    ):
        stage.place(f"house_{number:02}", house, pose(x, y, GROUND, yaw))
    stage.place("far_hills", Model("far_hills", "far_hills", _hills()))


def _lawns(stage: Stage) -> None:
    """Ground around the building, and the road in front of it, in rings: baked light is coarser
    with the distance."""
    x0, x1, y0, y1 = WEST - OUTER, EAST + OUTER, SOUTH - OUTER, NORTH + OUTER
    road = (-14.0, -11.0)
    pieces = {
        "lawn_north": ("grass", -REACH, REACH, y1 - 0.2, REACH),
        "lawn_west": ("grass", -REACH, x0 + 0.2, y0, y1 - 0.2),
        "lawn_east": ("grass", x1 - 0.2, REACH, y0, y1 - 0.2),
        "forecourt": ("asphalt", -REACH, REACH, road[1], y0),
        "road": ("asphalt", -REACH, REACH, road[0], road[1]),
        "lawn_south": ("grass", -REACH, REACH, -REACH, road[0]),
    }
    rings = {"": 6.0, "_middle": 20.0, "_far": 2 * REACH}
    cuts = [ring for ring in rings.values() if ring < REACH]
    x_lines = sorted({x0 + 0.2, x1 - 0.2, *(x0 - cut for cut in cuts), *(x1 + cut for cut in cuts)})
    y_lines = sorted({*(y0 - cut for cut in cuts), *(y1 + cut for cut in cuts)})
    for name, (material, west, east, south, north) in pieces.items():
        found: dict[str, list[Patch]] = {}
        xs = [west, *(x for x in x_lines if west < x < east), east]
        ys = [south, *(y for y in y_lines if south < y < north), north]
        for (a, b), (c, d) in itertools.product(itertools.pairwise(xs), itertools.pairwise(ys)):
            x, y = (a + b) / 2, (c + d) / 2
            away = max(x0 - x, x - x1, y0 - y, y - y1)
            ring = next(ending for ending, reach in rings.items() if away < reach)
            corners = [(a, c, GROUND), (b, c, GROUND), (b, d, GROUND), (a, d, GROUND)]
            found.setdefault(ring, []).append(polygon(corners))
        for ring, parts in found.items():
            node = name + ring
            stage.place(node, Model(node, material, tile(join(parts), 5.0)))


def _tree(atlas: Atlas, rng: np.random.Generator) -> Model:
    parts = [atlas.in_material("bark", bar((0, 0, -0.1), (0, 0, 2.2), 0.16, 7))]
    for _ in range(7):
        x, y = rng.normal(0, 0.7, 2)
        z, size = rng.uniform(2.3, 4.2), rng.uniform(0.7, 1.2)
        crown = ball(1.0, 6, 9)
        bumpy = crown.positions * (1 + 0.12 * np.sin(9 * crown.positions[:, [1, 2, 0]]))
        crown = Patch(bumpy, crown.normals, crown.uvs, crown.faces)
        leaf = "leaf" if rng.random() < 0.6 else "dark_leaf"
        parts.append(atlas.in_material(leaf, crown.moved(pose(x, y, z, scale=size))))
    return Model("tree", "props", join(parts))


def _hedge(atlas: Atlas) -> Model:
    parts = []
    for k in range(6):
        bush = ball(1.0, 5, 8).moved(pose(-2.0 + 0.8 * k, 0, 0.45, 31 * k, (0.62, 0.5, 0.55)))
        parts.append(atlas.in_material("dark_leaf", bush))
    return Model("hedge", "props", join(parts))


def _house(atlas: Atlas) -> Model:
    """Two storeys, windows on all sides, front at -y."""
    parts = [atlas.block("ivory", (14, 8, 6), (0, 0, 3), "-z+z")]
    for x in np.linspace(-5.6, 5.6, 6):
        for z in (1.8, 4.4):
            for s in (-1, 1):
                size, middle = (1.2, 0.05, 1.4), (x, s * 4.02, z)
                parts.append(atlas.block("white", (1.5, 0.04, 1.7), (x, s * 4.01, z)))
                parts.append(atlas.block("dark_window", size, middle))
    ridge, foot, eave = 8.4, 5.9, 4.5
    for s in (-1, 1):
        slope = [(-7.4, s * eave, foot), (7.4, s * eave, foot), (7.4, 0, ridge), (-7.4, 0, ridge)]
        above = polygon(slope if s < 0 else slope[::-1])
        below = polygon(slope[::-1] if s < 0 else slope).shifted(z=-0.12)
        parts += [atlas.in_material("terracotta", above), atlas.in_material("oak", below)]
        gable = [(s * 7, -4, 6), (s * 7, 4, 6), (s * 7, 0, 8.1)]
        parts.append(atlas.in_material("ivory", polygon(gable if s > 0 else gable[::-1])))
    return Model("house", "props", join(parts))


def _hills() -> Patch:
    """A ring of hills, seen from inside."""
    angle = np.linspace(0, 2 * np.pi, 49)
    tops = 5 + 2.2 * np.sin(3 * angle) + 1.3 * np.sin(7 * angle + 1)
    parts = []
    for a, b, za, zb in zip(angle[:-1], angle[1:], tops[:-1], tops[1:], strict=True):
        feet = [(58 * np.cos(t), 58 * np.sin(t)) for t in (a, b)]
        corners = [
            (*feet[1], GROUND - 0.5), (*feet[0], GROUND - 0.5), (*feet[0], za), (*feet[1], zb),
        ]  # fmt: skip
        parts.append(polygon(corners))
    return join(parts)


def doorstep() -> Model:
    """Slab before the front door."""
    patch = box((3.0, 1.6, 0.10), (0, 0, GROUND + 0.05), "-z")
    return Model("doorstep", "asphalt", tile(patch, 5.0))
