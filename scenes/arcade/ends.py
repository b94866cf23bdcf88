"""Both ends: a glazed entrance from the street, and a mirror that doubles the arcade."""

from __future__ import annotations

from scenes.arcade.display import Display
from scenes.arcade.plan import EAVES, HALF, LENGTH
from scenes.modeling.geometry import Patch, bar, join, polygon, pose
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model

_GATE, _GATE_TOP, _TOP = (
    1.0,
    2.3,
    EAVES - 1.2,
)  # half width and height of the doors; the screen's top
_FRAME = 0.08
_MIRROR_HALF, _MIRROR_TOP = 1.9, 3.3


def build_ends(show: Display) -> None:
    """Entrance, street and mirror."""
    _entrance(show)
    _street(show)
    _mirror_wall(show)


def _across(y0: float, y1: float, z0: float, z1: float) -> Patch:
    """Rectangle in the plane x = 0 that faces +x."""
    return polygon([(0, y0, z0), (0, y1, z0), (0, y1, z1), (0, y0, z1)])


def _entrance(show: Display) -> None:
    """Screen of glass with a double door, one leaf open."""
    at = pose(0.06)
    show.put("entrance_frame", show.made(_screen), at)
    post = _GATE + _FRAME
    panes = {
        "side_left": _across(post, HALF - _FRAME, 0.5, _TOP - _FRAME),
        "side_right": _across(-HALF + _FRAME, -post, 0.5, _TOP - _FRAME),
        "transom": _across(-_GATE, _GATE, _GATE_TOP + _FRAME, _TOP - _FRAME),
    }
    for name, pane in panes.items():
        show.lay(f"entrance_glass_{name}", "pane", pane, at)
    for side, open_deg in ((1, 0.0), (-1, 80.0)):
        leaf = at @ pose(0, side * _GATE, 0, -side * open_deg)
        show.put("entrance_leaf", show.made(_leaf, side), leaf)
        y0, y1 = sorted((-side * 0.09, -side * (_GATE - 0.1)))
        pane = Model(f"gate_glass_{side}", "pane", _across(y0, y1, 0.22, _GATE_TOP - 0.1))
        show.put("entrance_leaf_glass", pane, leaf)
        show.put("entrance_handle", show.made(_handle, side), leaf)


def _screen(a: Atlas) -> Model:
    """Posts and rails of the entrance, and stone risers."""
    parts = []
    for y in (-HALF + _FRAME / 2, -_GATE - _FRAME / 2, _GATE + _FRAME / 2, HALF - _FRAME / 2):
        parts.append(a.block("joinery", (0.1, _FRAME, _TOP), (0, y, _TOP / 2), "-z"))
    parts.append(a.block("joinery", (0.1, 2 * HALF, _FRAME), (0, 0, _TOP - _FRAME / 2)))
    parts.append(a.block("joinery", (0.1, 2 * _GATE, _FRAME), (0, 0, _GATE_TOP + _FRAME / 2)))
    for side in (-1, 1):
        middle, wide = side * (_GATE + HALF) / 2, HALF - _GATE - 2 * _FRAME
        parts.append(a.block("joinery", (0.14, wide, 0.5), (0, middle, 0.25), "-z"))
    return Model("entrance_frame", "props", join(parts))


def _leaf(a: Atlas, side: int) -> Model:
    wide, deep = _GATE - 0.005, 0.05
    middle = -side * wide / 2
    parts = [
        a.block("joinery", (deep, wide - 0.18, 0.2), (0, middle, 0.12), "-y+y"),
        a.block("joinery", (deep, wide - 0.18, 0.09), (0, middle, _GATE_TOP - 0.05), "-y+y"),
    ]
    for y in (-side * 0.045, -side * (wide - 0.045)):
        parts.append(
            a.block("joinery", (deep, 0.09, _GATE_TOP - 0.025), (0, y, _GATE_TOP / 2 + 0.008))
        )
    return Model(f"gate_{side}", "props", join(parts))


def _handle(a: Atlas, side: int) -> Model:
    y = -side * (_GATE - 0.06)
    parts = [bar((x, y, 0.8), (x, y, 1.5), 0.016, 8) for x in (-0.07, 0.07)]
    parts += [bar((-0.07, y, z), (0.07, y, z), 0.010, 6) for z in (0.88, 1.42)]
    return Model(f"gate_handle_{side}", "brass", join(parts))


def _street(show: Display) -> None:
    """Pavement, roadway, and the houses across."""
    for name, material, x0, x1, z in (
        ("pavement_near", "pavement", -3.0, 0.0, -0.01),
        ("roadway", "asphalt", -9.0, -3.0, -0.13),
        ("pavement_far", "pavement", -12.0, -9.0, -0.01),
    ):
        corners = [(x0, -16, z), (x1, -16, z), (x1, 16, z), (x0, 16, z)]
        show.lay(f"street_{name}", material, polygon(corners))
    for y in (-10.7, 0.0, 10.7):
        show.put("house", show.made(_house), pose(-12.0, y, -0.01))


def _house(a: Atlas) -> Model:
    """Facade that faces +x, 10.7 m wide."""
    face = a.picture("facade", 10.7, 8.0).moved(pose(yaw_deg=90))
    return Model("house", "props", face)


def _mirror_wall(show: Display) -> None:
    """The end wall and its mirror, from near the floor to above a person's head."""
    wall = polygon([(0, HALF, 0), (0, -HALF, 0), (0, -HALF, _TOP), (0, HALF, _TOP)])
    show.lay("wall_end", "ashlar", wall, pose(LENGTH))
    y, low, high = _MIRROR_HALF, 0.15, _MIRROR_TOP
    glass = polygon([(0, y, low), (0, -y, low), (0, -y, high), (0, y, high)])
    show.lay("mirror_end", "mirror", glass, pose(LENGTH - 0.03))
    show.put("mirror_frame", show.made(_end_frame), pose(LENGTH))


def _end_frame(a: Atlas) -> Model:
    """Frame of the mirror at the end, which faces -x."""
    wide, high = 2 * _MIRROR_HALF, _MIRROR_TOP - 0.15
    parts = []
    for y in (-_MIRROR_HALF - 0.06, _MIRROR_HALF + 0.06):
        parts.append(
            a.block("mustard", (0.08, 0.12, high + 0.24), (-0.04, y, high / 2 + 0.15), "+x")
        )
    for z in (0.09, _MIRROR_TOP + 0.06):
        parts.append(a.block("mustard", (0.08, wide, 0.12), (-0.04, 0, z), "-y+y+x"))
    return Model("end_frame", "props", join(parts))
