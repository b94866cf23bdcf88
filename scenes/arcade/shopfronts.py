"""Fronts of the shops: joinery, panes, doors, neon signs; and the walls without a shop."""

from __future__ import annotations

import itertools

from scenes.arcade.display import Display
from scenes.arcade.neon import neon_word
from scenes.arcade.plan import FASCIA, FRONTS, HALF_FRONT, HEAD, RISER, Front
from scenes.modeling.geometry import Patch, bar, join, polygon
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model

DOOR, DOOR_TOP = 1.0, 2.2  # opening of a door
_FRAME = 0.07
_SIGN_HEIGHT = 0.30


def build_fronts(show: Display) -> None:
    """All bays of both sides."""
    for front in FRONTS:
        if front.name == "lift":
            _lift(show, front)
        elif not front.wall:
            _blind_wall(show, front)
        else:
            _shopfront(show, front)
        if front.sign:
            _sign(show, front)


def _upright(x0: float, x1: float, z0: float, z1: float, y: float = 0.0) -> Patch:
    """Rectangle that faces the passage."""
    return polygon([(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)])


def door_middle(front: Front) -> float:
    """Position of the door along the front, m to the right of its middle."""
    return front.door * (HALF_FRONT - _FRAME - DOOR / 2)


def _shopfront(show: Display, front: Front) -> None:
    door = door_middle(front)
    inner = door - front.door * (DOOR / 2 + _FRAME / 2)  # post between door and window
    outer = -front.door * (HALF_FRONT - _FRAME / 2)
    left, right = sorted((inner, outer))
    posts = [left, (left + right) / 2, right]
    show.put("front", show.made(_joinery, front.door), front.place())
    for low, high in itertools.pairwise(posts):
        x0, x1 = low + _FRAME / 2, high - _FRAME / 2
        pane = _upright(x0, x1, RISER + _FRAME, HEAD - _FRAME)
        show.put(f"window_{front.name}", _own(show, front, "window", pane, x0), front.place())
    transom = _upright(door - DOOR / 2, door + DOOR / 2, DOOR_TOP + _FRAME, HEAD - _FRAME)
    show.put(f"window_{front.name}", _own(show, front, "transom", transom, 0.0), front.place())
    hinge = door + front.door * DOOR / 2
    turn = front.place(hinge, 0.0, 0.0, front.door * -front.open_deg)
    show.put("door_leaf", show.made(_leaf, front.door), turn)
    wide = front.door * (DOOR - 2 * _FRAME)
    x0, x1 = sorted((-front.door * _FRAME, -front.door * _FRAME - wide))
    pane = _upright(x0, x1, 0.22, DOOR_TOP - _FRAME)
    show.put("door_glass", _own(show, front, "door_glass", pane, 0.0), turn)
    show.put("door_handle", show.made(_handle, front.door), turn)


def _own(show: Display, front: Front, kind: str, patch: Patch, x: float) -> Model:
    """Model of a pane, shared by the fronts that are alike."""

    def make(a: Atlas, material: str, door: int, kind: str, x_mm: int) -> Model:
        return Model(f"{kind}_{material}_{door}_{x_mm}", material, patch)

    key = (front.glass, front.door, kind, round(1000 * x))
    known = show.stage.models.get(f"{key[2]}_{key[0]}_{key[1]}_{key[3]}")
    return known or make(show.atlas, *key)


def _joinery(a: Atlas, door_side: int) -> Model:
    """Frame, riser and fascia of a shop front with its door at one side."""
    door = door_side * (HALF_FRONT - _FRAME - DOOR / 2)
    inner = door - door_side * (DOOR / 2 + _FRAME / 2)
    outer = -door_side * (HALF_FRONT - _FRAME / 2)
    left, right = sorted((inner, outer))
    edge = door_side * (HALF_FRONT - _FRAME / 2)
    middle, width = (left + right) / 2, right - left + _FRAME
    paint, deep = "joinery", 0.09
    parts = [
        a.block(paint, (width, 0.12, RISER), (middle, 0, RISER / 2), "-z"),
        a.block("walnut", (width, 0.16, 0.03), (middle, 0, RISER + 0.015)),
        a.block(paint, (2 * HALF_FRONT, deep, _FRAME), (0, 0, HEAD - _FRAME / 2)),
        a.block(paint, (DOOR, deep, _FRAME), (door, 0, DOOR_TOP + _FRAME / 2)),
        a.block("lacquer", (2 * HALF_FRONT, 0.10, FASCIA - HEAD), (0, 0, (HEAD + FASCIA) / 2)),
        a.block("oak", (DOOR, 0.14, 0.012), (door, 0, 0.006), "-z"),
    ]
    for x in (left, middle, right):
        parts.append(
            a.block(paint, (_FRAME, deep, HEAD - RISER), (x, 0, (HEAD + RISER) / 2), "-z+z")
        )
    parts.append(a.block(paint, (_FRAME, deep, HEAD), (edge, 0, HEAD / 2), "-z+z"))
    for k in range(3):
        x = middle + (k - 1) * width / 3
        parts.append(a.block("moss", (width / 3 - 0.14, 0.015, 0.28), (x, -0.066, 0.22), "+y"))
    return Model(f"joinery_{'right' if door_side > 0 else 'left'}", "props", join(parts))


def _leaf(a: Atlas, side: int) -> Model:
    """Frame of a door's leaf, its hinge at x = 0."""
    wide, deep, mid = DOOR - 0.01, 0.045, -side * (DOOR - 0.01) / 2
    parts = [
        a.block("joinery", (wide - 2 * _FRAME, deep, 0.2), (mid, 0, 0.12), "-x+x"),
        a.block(
            "joinery",
            (wide - 2 * _FRAME, deep, _FRAME),
            (mid, 0, DOOR_TOP - _FRAME / 2 - 0.004),
            "-x+x",
        ),
    ]
    for x in (-side * _FRAME / 2, -side * (wide - _FRAME / 2)):
        parts.append(
            a.block("joinery", (_FRAME, deep, DOOR_TOP - 0.024), (x, 0, DOOR_TOP / 2 + 0.008))
        )
    return Model(f"leaf_{'right' if side > 0 else 'left'}", "props", join(parts))


def _handle(a: Atlas, side: int) -> Model:
    """Long handles on both sides."""
    x = -side * (DOOR - 0.05)
    parts = [bar((x, y, 0.85), (x, y, 1.35), 0.014, 6) for y in (-0.06, 0.06)]
    parts += [bar((x, -0.06, z), (x, 0.06, z), 0.009, 5) for z in (0.92, 1.28)]
    return Model(f"handle_{'right' if side > 0 else 'left'}", "brass", join(parts))


def _sign(show: Display, front: Front) -> None:
    """Neon on the fascia."""
    z = (HEAD + FASCIA) / 2
    patch = neon_word(front.sign, _SIGN_HEIGHT)
    y = -0.05 if front.wall else -0.01
    show.lay(f"sign_{front.name}", front.neon, patch, front.place(0.0, y - 0.035, z))


def _blind_wall(show: Display, front: Front) -> None:
    """Stone wall with a full-length mirror, posters and a bench."""
    wall = _upright(-HALF_FRONT - 0.3, HALF_FRONT + 0.3, 0.0, FASCIA + 0.01)
    show.lay("wall_looking_glass", "ashlar", wall, front.place())
    show.lay("mirror_tall", "mirror", _upright(-0.75, 0.75, 0.12, 2.42, -0.03), front.place())
    show.put("mirror_frame", show.made(_mirror_frame, 1.5, 2.3), front.place(0.0, 0.0, 0.12))
    for x, name in ((-1.5, "poster_sphere"), (1.5, "poster_waves")):
        show.put("poster", show.made(_poster, name, 0.8, 1.1), front.place(x, -0.002, 1.15))


def _mirror_frame(a: Atlas, wide: float, high: float) -> Model:
    """Frame around a mirror, its lower edge at z = 0."""
    parts = []
    for x in (-wide / 2 - 0.04, wide / 2 + 0.04):
        parts.append(a.block("mustard", (0.08, 0.06, high + 0.16), (x, -0.03, high / 2), "+y"))
    for z in (-0.04, high + 0.04):
        parts.append(a.block("mustard", (wide, 0.06, 0.08), (0, -0.03, z), "-x+x+y"))
    return Model(f"mirror_frame_{round(10 * wide)}", "props", join(parts))


def _poster(a: Atlas, name: str, wide: float, high: float) -> Model:
    return Model(name, "props", a.board(name, "lacquer", wide, high, 0.025))


def _lift(show: Display, front: Front) -> None:
    """Two leaves of brushed steel in a stone wall."""
    half, top = 0.6, 2.2
    panels = [
        _upright(-HALF_FRONT - 0.3, -half, 0.0, FASCIA + 0.01),
        _upright(half, HALF_FRONT + 0.3, 0.0, FASCIA + 0.01),
        _upright(-half, half, top, FASCIA + 0.01),
    ]
    show.lay("wall_lift", "ashlar", join(panels), front.place())
    for number, (x0, x1) in enumerate(((-half, -0.004), (0.004, half)), start=1):
        leaf = _upright(x0, x1, 0.0, top, 0.10)
        show.lay(f"lift_door_{number}", "brushed_steel", leaf, front.place())
    show.put("lift_frame", show.made(_lift_frame, half, top), front.place())


def _lift_frame(a: Atlas, half: float, top: float) -> Model:
    """Reveals, architrave, call plate."""
    parts = [a.block("lacquer", (2 * half, 0.02, top), (0, 0.12, top / 2), "-z+z-x+x+y")]
    for side in (-1, 1):
        reveal = polygon(
            [(side * half, y, z) for y, z in ((0, 0), (0.12, 0), (0.12, top), (0, top))]
        )
        flipped = reveal if side < 0 else polygon(reveal.positions[::-1])
        parts.append(a.in_material("grey", flipped))
        parts.append(
            a.block(
                "grey",
                (0.09, 0.04, top + 0.09),
                (side * (half + 0.045), -0.02, (top + 0.09) / 2),
                "+y-z",
            )
        )
    sill = [(-half, 0, 0), (half, 0, 0), (half, 0.12, 0), (-half, 0.12, 0)]
    parts.append(a.in_material("iron", polygon(sill)))
    under = [(-half, 0, top), (-half, 0.12, top), (half, 0.12, top), (half, 0, top)]
    parts.append(a.in_material("grey", polygon(under)))
    parts.append(a.block("grey", (2 * half, 0.04, 0.09), (0, -0.02, top + 0.045), "+y-x+x"))
    parts.append(a.picture("lift_plate", 0.24, 0.12, -0.042).shifted(0, 0, top + 0.2))
    parts.append(a.block("lacquer", (0.26, 0.04, 0.14), (0, -0.02, top + 0.26), "+y-y"))
    parts.append(a.block("lacquer", (0.10, 0.02, 0.22), (half + 0.3, -0.01, 1.1), "+y"))
    return Model("lift_frame", "props", join(parts))
