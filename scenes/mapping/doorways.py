"""Fillings of the plan's openings: frames, door leaves, windows, panes, the broken wall.

Modeled with x along the wall, y through it, z up; in outside walls +y is outside.
"""

from __future__ import annotations

import numpy as np

from scenes.mapping.plan import EAST, HALF, NORTH, OPENINGS, OUTER, Opening
from scenes.mapping.shell import CASING
from scenes.modeling.geometry import Patch, bar, box, join, polygon, pose
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model, Stage

LINING = 0.03  # thickness of the boards in the opening
PROUD = 0.012  # how far they stand out of the wall
LEAF = 0.04
GLAZED = ("orange", "red", "grey", "walnut")  # leaves with a pane in them


def fill_openings(stage: Stage, atlas: Atlas, rng: np.random.Generator) -> None:
    """Put into each opening what it is named after."""
    models: dict[tuple, Model] = {}

    def shared(key: tuple, make) -> Model:
        if key not in models:
            patch, material = make()
            name = "_".join(str(part).replace(".", "") for part in key)
            models[key] = Model(name, material, patch)
        return models[key]

    for hole in OPENINGS:
        at, flipped = _pose(hole)
        walls = (-HALF, OUTER if hole.outside else HALF)
        size = (hole.width, hole.sill, hole.head)
        if hole.kind == "breach":
            stage.place(hole.name, Model(hole.name, "props", _breach(atlas, hole, rng)), at)
            continue
        paint = _frame_paint(hole)
        frame = shared(
            ("frame", paint, *size, hole.outside, hole.kind == "window"),
            lambda size=size, walls=walls, paint=paint: (
                _frame(atlas, size, walls, paint),
                "props",
            ),
        )
        stage.place(f"{hole.name}_frame", frame, at)
        if hole.kind in ("window", "glazing", "front"):
            depth = 0.08 if hole.outside else 0.0
            sash = shared(
                ("sash", hole.kind, *size),
                lambda size=size, depth=depth, kind=hole.kind: (
                    _sash(atlas, size, depth, kind),
                    "props",
                ),
            )
            stage.place(hole.name, sash, at)
            material = "frosted_glass" if hole.name == "window_washroom" else "glass"
            pane = shared(
                ("pane", material, *size),
                lambda size=size, depth=depth, material=material: (_pane(size, depth), material),
            )
            stage.place(f"{hole.name}_glass", pane, at)
        elif hole.open_deg is not None:
            leaf = shared(
                ("leaf", hole.leaf), lambda leaf=hole.leaf: (leaf_patch(atlas, leaf), "props")
            )
            turned = at @ _leaf_pose(hole, flipped, walls)
            stage.place(hole.name, leaf, turned)
            if hole.leaf in GLAZED:
                glass = shared(("leaf_glass",), lambda: (_leaf_pane(), "glass"))
                stage.place(f"{hole.name}_glass", glass, turned)


def leaf_patch(atlas: Atlas, paint: str) -> Patch:
    """A door leaf along +x from its hinge, y = -0.04 ... 0."""
    wide, low, high = 1.04 - 2 * LINING - 0.008, 0.008, 2.18 - LINING - 0.004
    x0, y = 0.004, -LEAF / 2

    def part(left: float, right: float, bottom: float, top: float) -> Patch:
        size = (right - left, LEAF, top - bottom)
        return atlas.block(paint, size, (x0 + (left + right) / 2, y, (bottom + top) / 2))

    if paint in GLAZED:
        left, right, bottom, top = _light(wide)
        parts = [
            part(0, left, low, high),
            part(right, wide, low, high),
            part(left, right, low, bottom),
            part(left, right, top, high),
        ]
    else:
        parts = [part(0, wide, low, high)]
        for front, sign in ((0.0, 1), (-LEAF, -1)):  # kick plates
            size, middle = (wide - 0.06, 0.004, 0.20), (x0 + wide / 2, front + sign * 0.002, 0.13)
            parts.append(atlas.block("steel", size, middle))
    for side in (1, -1):
        reach = y + side * (LEAF / 2 + 0.05)
        x = x0 + wide - 0.065
        handle = [
            bar((x, y, 1.05), (x, reach, 1.05), 0.011, 6),
            bar((x + 0.012, reach, 1.05), (x - 0.12, reach, 1.05), 0.011, 6),
        ]
        parts.append(atlas.in_material("steel", join(handle)))
        plate = (0.05, 0.006, 0.18)
        parts.append(atlas.block("steel", plate, (x, y + side * (LEAF / 2 + 0.003), 1.0)))
    return join(parts)


def _light(wide: float) -> tuple[float, float, float, float]:
    """The pane in a leaf: left, right, bottom, top."""
    return 0.56 * wide, 0.80 * wide, 1.15, 1.95


def _leaf_pane() -> Patch:
    left, right, bottom, top = _light(1.04 - 2 * LINING - 0.008)
    return _both_sides(left + 0.004, right + 0.004, bottom, top, -LEAF / 2)


def _pose(hole: Opening) -> tuple[np.ndarray, bool]:
    """Transform world from opening, and true where its axis along the wall runs backwards."""
    yaw = 0 if hole.axis == "y" else 90
    if hole.outside:
        to_larger = hole.line in (EAST, NORTH)
        flipped = to_larger if hole.axis == "x" else not to_larger
    else:
        flipped = False
    x, y = (hole.line, hole.center) if hole.axis == "x" else (hole.center, hole.line)
    return pose(x, y, 0, yaw + (180 if flipped else 0)), flipped


def _leaf_pose(hole: Opening, flipped: bool, walls: tuple[float, float]) -> np.ndarray:
    hinge = -hole.hinge if flipped else hole.hinge
    swing = hole.swing if hole.axis == "y" else -hole.swing
    if flipped:
        swing = -swing
    clear = hole.width / 2 - LINING
    if swing > 0:
        turn, y, ahead = pose(), walls[1], hinge
    else:  # the same seen from the other side
        turn, y, ahead = pose(yaw_deg=180), -walls[0], -hinge
    if ahead < 0:
        return turn @ pose(-clear, y, 0, hole.open_deg)
    return turn @ pose(clear, y, 0, 180 - hole.open_deg) @ pose(y=LEAF)


def _frame_paint(hole: Opening) -> str:
    if hole.kind in ("window", "front"):
        return "white"
    if hole.kind in ("passage", "glazing"):
        return "dark_grey"
    return "ivory" if hole.leaf in ("beech", "walnut") else "grey"


def _frame(
    atlas: Atlas, size: tuple[float, float, float], walls: tuple[float, float], paint: str
) -> Patch:
    """Boards that line the opening and casings on the faces of the wall."""
    wide, sill, head = size
    y0, y1 = walls[0] - PROUD, walls[1] + PROUD
    deep, y = y1 - y0, (y0 + y1) / 2
    tall, z = head - sill, (head + sill) / 2
    parts = [
        atlas.block(paint, (LINING, deep, tall), (s * (wide - LINING) / 2, y, z)) for s in (-1, 1)
    ]
    parts.append(
        atlas.block(paint, (wide - 2 * LINING, deep, LINING), (0, y, head - LINING / 2), "-x+x")
    )
    overlap = 0.015
    band = CASING + overlap
    for face, sign in ((walls[0], -1), (walls[1], 1)):
        middle = face + sign * 0.008
        foot = sill - CASING if sill > 0 else sill
        for s in (-1, 1):
            x = s * (wide / 2 + (CASING - overlap) / 2)
            high = head + CASING - foot
            parts.append(atlas.block(paint, (band, 0.026, high), (x, middle, foot + high / 2)))
        across = wide - 2 * overlap
        levels = [head + (CASING - overlap) / 2] + [sill - (CASING - overlap) / 2] * (sill > 0)
        for level in levels:
            parts.append(atlas.block(paint, (across, 0.026, band), (0, middle, level), "-x+x"))
    if sill > 0:
        parts.append(
            atlas.block(paint, (wide - 2 * LINING, deep, LINING), (0, y, sill + LINING / 2))
        )
        if walls[1] > HALF:  # a board in the window, a ledge outside
            ledge = (wide + 0.16, 0.14, 0.03)
            parts.append(atlas.block("ivory", ledge, (0, walls[0] - 0.04, sill + 0.045)))
            parts.append(atlas.block("steel", ledge, (0, walls[1] + 0.05, sill - 0.015)))
    else:
        under, middle = (deep, y) if walls[1] > HALF else (0.10, 0.0)
        size = (wide - 2 * LINING, under, 0.006)
        parts.append(atlas.block("steel", size, (0, middle, 0.003), "-z"))
    return join(parts)


def _sash(atlas: Atlas, size: tuple[float, float, float], depth: float, kind: str) -> Patch:
    """The bars that hold the glass."""
    wide, sill, head = size
    paint = "white" if kind == "window" else "dark_grey"
    left, bottom = -wide / 2 + LINING, sill + (LINING if sill else 0.012)
    right, top = -left, head - LINING
    thick, deep = 0.05, 0.06
    count = max(round(wide / (0.75 if kind == "window" else 1.0)), 1)
    parts = []
    for x in np.linspace(left + thick / 2, right - thick / 2, count + 1):
        high = top - bottom
        parts.append(atlas.block(paint, (thick, deep, high), (x, depth, bottom + high / 2)))
    for z in (bottom + thick / 2, top - thick / 2):
        size_x = right - left - 2 * thick
        parts.append(atlas.block(paint, (size_x, deep - 0.006, thick), (0, depth, z), "-x+x"))
    if kind == "front":
        for x in (-0.12, 0.12):
            for y in (depth - 0.075, depth + 0.075):
                parts.append(atlas.in_material("steel", bar((x, y, 0.8), (x, y, 1.5), 0.016)))
                for z in (0.9, 1.4):
                    parts.append(atlas.in_material("steel", bar((x, depth, z), (x, y, z), 0.01)))
        parts.append(
            atlas.block(paint, (right - left - 2 * thick, 0.03, 0.22), (0, depth, 0.17), "-x+x")
        )
    return join(parts)


def _pane(size: tuple[float, float, float], depth: float) -> Patch:
    wide, sill, head = size
    half = wide / 2 - LINING
    return _both_sides(-half, half, sill + LINING, head - LINING, depth)


def _both_sides(x0: float, x1: float, z0: float, z1: float, y: float) -> Patch:
    """A pane that is seen from either side, each time once."""
    front = [(x0, y - 0.003, z0), (x1, y - 0.003, z0), (x1, y - 0.003, z1), (x0, y - 0.003, z1)]
    back = [(x, y + 0.003, z) for x, _, z in reversed(front)]
    return join([polygon(front), polygon(back)])


def _breach(atlas: Atlas, hole: Opening, rng: np.random.Generator) -> Patch:
    """Torn edges of masonry around a hole in the wall, a little thicker than the wall."""
    parts, course, hidden = [], 0.15, 0.03

    def depth() -> float:
        return 2 * HALF + rng.uniform(0.012, 0.036)

    for side in (-1, 1):
        for level in np.arange(0, hole.head, course):
            out = rng.uniform(0.04, 0.20)
            size = (out + hidden, depth(), course)
            x = side * (hole.width / 2 + hidden - size[0] / 2)
            parts.append(box(size, (x, 0, level + course / 2), courses=True))
    bricks = 11
    wide = (hole.width + 2 * hidden) / bricks
    for k in range(bricks):
        drop = rng.uniform(0.02, 0.10)
        size = (wide, depth(), drop + hidden)
        x = (k - (bricks - 1) / 2) * wide
        parts.append(box(size, (x, 0, hole.head + hidden - size[2] / 2), courses=True))
    return join([atlas.in_material("bricks", part) for part in parts])
