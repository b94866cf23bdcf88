"""The field: carpet and lines in one plane without overlaps, goals, beacons.

All lines are measured to their outer edges, so each lies inside what it bounds.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from scenes.modeling.geometry import Patch, box, disc, join, lathe, polygon, tile
from scenes.modeling.stage import Model, Stage

HALF_X, HALF_Y = 2.7, 1.8
LINE = 0.025
CARPET_X, CARPET_Y, CARPET_Z = 3.0, 2.0, 0.006  # half sizes, and how thick it is
BOX_X, BOX_Y = HALF_X - 0.65, 0.65  # goal box: its line towards the center, its half width
CIRCLE = 0.18
MIDDLE = 0.20  # half side of the square that is cut round the center circle
ARC_STEPS = 24  # of half a circle's half: off the true circle by 0.1 mm
BEACON_SIDES = 48
BOARD = 0.015

Corner = tuple[float, float]


def lay_carpet(stage: Stage) -> None:
    """Carpet and lines as pieces that share their edges."""
    pieces = defaultdict(list)
    for name, corners in [*_rectangles(), *_center()]:
        pieces[name].append(polygon([(x, y, 0.0) for x, y in corners]))
    pieces["carpet"].append(_edges())
    for name, parts in sorted(pieces.items()):
        if name == "carpet":
            stage.place(name, Model(name, "carpet", tile(join(parts), 1.0)))
        else:
            stage.place(name, Model(name, "line_white", join(parts)))


def build_landmarks(stage: Stage, landmarks: list[dict]) -> None:
    """Goals and beacons where and as large as the scene's TOML says.

    A beacon is one node for each band, a goal one node; names begin with the landmark's.
    """
    for landmark in landmarks:
        name, (x, y, z) = landmark["name"], landmark["position_m"]
        bands, (size_x, size_y) = landmark["bands"], landmark["footprint_m"]
        if len(bands) == 1:
            patch = _goal(size_x, size_y, bands[0]["top_m"], opens_to=-np.sign(x))
            material = f"landmark_{bands[0]['color']}"
            stage.place(name, Model(name, material, patch.shifted(x, y, z)))
            continue
        foot = 0.0
        for band in bands:
            node, top = f"{name}_{band['color']}", band["top_m"]
            parts = [lathe([(size_x / 2, foot), (size_x / 2, top)], BEACON_SIDES)]
            if band is bands[-1]:
                parts.append(disc(size_x / 2, top, BEACON_SIDES))
            material = f"landmark_{band['color']}"
            stage.place(node, Model(node, material, join(parts).shifted(x, y, z)))
            foot = top


def _goal(depth: float, width: float, height: float, opens_to: float) -> Patch:
    """Two side boards and a back board about the middle of the base; no top, no front."""
    inner = width - 2 * BOARD
    back_x = -opens_to * (depth - BOARD) / 2
    parts = [box((BOARD, inner, height), (back_x, 0, height / 2), without="-z-y+y")]
    for side in (-1, 1):
        y = side * (width - BOARD) / 2
        parts.append(box((depth, BOARD, height), (0, y, height / 2), without="-z"))
    return join(parts)


def _rectangles() -> Iterator[tuple[str, list[Corner]]]:
    """The plane but for its middle, cut along one grid: no corner lies on another's edge."""
    x_cuts = (CARPET_X, HALF_X, HALF_X - LINE, BOX_X + LINE, BOX_X, MIDDLE, LINE / 2)
    y_cuts = (CARPET_Y, HALF_Y, HALF_Y - LINE, BOX_Y, BOX_Y - LINE, MIDDLE)
    xs, ys = (sorted({s * c for c in cuts for s in (-1, 1)}) for cuts in (x_cuts, y_cuts))
    for x0, x1 in itertools.pairwise(xs):
        for y0, y1 in itertools.pairwise(ys):
            x, y = (x0 + x1) / 2, (y0 + y1) / 2
            if max(abs(x), abs(y)) > MIDDLE:
                yield _name(x, y), [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def _name(x: float, y: float) -> str:
    """Material at a point outside the middle."""
    end, side = "blue" if x > 0 else "yellow", "left" if y > 0 else "right"
    if abs(x) > HALF_X or abs(y) > HALF_Y:
        return "carpet"
    if abs(y) > HALF_Y - LINE:
        return f"line_touch_{side}"
    if abs(x) > HALF_X - LINE:
        return f"line_goal_{end}"
    if abs(x) < LINE / 2:
        return "line_halfway"
    if abs(x) > BOX_X and abs(y) < BOX_Y and (abs(x) < BOX_X + LINE or abs(y) > BOX_Y - LINE):
        return f"line_box_{end}"
    return "carpet"


def _center() -> Iterator[tuple[str, list[Corner]]]:
    """Circle, halfway line and carpet in the square that `_rectangles` leaves."""
    x = LINE / 2
    outer, inner = (_arc(radius, x) for radius in (CIRCLE, CIRCLE - LINE))
    levels = [-MIDDLE, outer[0][1], inner[0][1], inner[-1][1], outer[-1][1], MIDDLE]
    for y0, y1 in itertools.pairwise(levels):
        yield "line_halfway", [(-x, y0), (x, y0), (x, y1), (-x, y1)]
    low, high = (MIDDLE, -MIDDLE), (MIDDLE, MIDDLE)
    half: list[tuple[str, list[Corner]]] = [("carpet", inner)]
    for k in range(2 * ARC_STEPS):
        band = [inner[k], outer[k], outer[k + 1], inner[k + 1]]
        half.append(("line_centre_circle", band))
        half.append(("carpet", [outer[k], low if k < ARC_STEPS else high, outer[k + 1]]))
    half.append(("carpet", [outer[ARC_STEPS], low, high]))
    half.append(("carpet", [(x, -MIDDLE), low, outer[0]]))
    half.append(("carpet", [(x, MIDDLE), outer[-1], high]))
    for name, corners in half:
        yield name, corners
        yield name, [(-a, -b) for a, b in corners]  # half a turn keeps the front in front


def _arc(radius: float, x: float) -> list[Corner]:
    """The right part of a circle, from below upwards, beginning and ending on the line at x."""
    reach = np.arccos(x / radius)
    angles = np.linspace(-reach, reach, 2 * ARC_STEPS + 1)
    return [(float(radius * np.cos(a)), float(radius * np.sin(a))) for a in angles]


def _edges() -> Patch:
    """The carpet's cut edges, down to the floor, and its backing.

    Nobody sees the backing but a sample that falls between two pieces by a rounding error.
    """
    x, y, z = CARPET_X, CARPET_Y, CARPET_Z
    backing = box((2 * x, 2 * y, 0), (0, 0, 0.001 - z), without="-x+x-y+y-z")
    return join([box((2 * x, 2 * y, z), (0, 0, -z / 2), without="+z-z"), backing])
