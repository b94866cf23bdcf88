"""Walls, floors, ceilings, skirtings and the outside faces, from the plan.

A wall is drawn by the panels of the two rooms that it divides; frames close the holes between
them.  Panels, floors and ceilings reach a little into one another, so that no seam can open.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from scenes.mapping.materials import SIZES
from scenes.mapping.plan import (
    EAST,
    HALF,
    HEIGHT,
    NORTH,
    OPENINGS,
    OUTER,
    ROOMS,
    SOUTH,
    STAIR_HOLE,
    WEST,
    Opening,
    Room,
)
from scenes.modeling.geometry import Patch, join, polygon, tile
from scenes.modeling.picture_atlas import Atlas
from scenes.modeling.stage import Model, Stage

LAP = 0.004  # how far panels reach past the surface that hides their edge, where light is another
SKIRTING = (0.012, 0.08)
CASING = 0.06  # width of the frame around an opening, beyond it
SHAFT_TOP = 4.9


@dataclass(frozen=True)
class Side:
    """One wall of a room, seen from inside: the line `axis` = `line`, from `low` to `high`.

    Attributes:
        inward: sign of the way into the room along `axis`.
    """

    name: str
    axis: str
    line: float
    low: float
    high: float
    inward: int

    @property
    def face(self) -> float:
        """Position of its surface along `axis`."""
        return self.line + self.inward * HALF

    def point(self, along: float, across: float, z: float) -> tuple[float, float, float]:
        """World coordinates of a point along the wall and across it."""
        return (across, along, z) if self.axis == "x" else (along, across, z)

    def quad(self, u0: float, u1: float, z0: float, z1: float, across: float) -> Patch:
        """Upright rectangle that faces the room."""
        # To someone facing it, x runs rightwards along a north wall, y along a west wall.
        rightwards = (self.axis == "y") == (self.inward < 0)
        a, b = (u0, u1) if rightwards else (u1, u0)
        corners = [(a, z0), (b, z0), (b, z1), (a, z1)]
        return polygon([self.point(u, across, z) for u, z in corners])

    def openings(self) -> tuple[Opening, ...]:
        """Openings in this wall, in order."""
        found = [
            hole
            for hole in OPENINGS
            if hole.axis == self.axis
            and hole.line == self.line
            and self.low < hole.center < self.high
        ]
        return tuple(sorted(found, key=lambda hole: hole.center))


def sides(room: Room) -> tuple[Side, ...]:
    """The four walls of a room."""
    return (
        Side("south", "y", room.y0, room.x0, room.x1, 1),
        Side("east", "x", room.x1, room.y0, room.y1, -1),
        Side("north", "y", room.y1, room.x0, room.x1, -1),
        Side("west", "x", room.x0, room.y0, room.y1, 1),
    )


def build_shell(stage: Stage, atlas: Atlas) -> None:
    """Everything that divides the inside from itself and from the outside."""
    for room in ROOMS:
        _lay(stage, room)
        for side in sides(room):
            material = room.accents.get(side.name, room.wall)
            cuts = room.cuts if side.axis != room.along else ()
            _raise_wall(stage, f"wall_{room.name}_{side.name}", side, material, cuts)
        _place(stage, f"skirting_{room.name}", "props", _skirting(room, atlas))
    _build_facades(stage)
    _build_stair_shaft(stage)


def _raise_wall(
    stage: Stage, name: str, side: Side, material: str, cuts: tuple[float, ...]
) -> None:
    holes = side.openings()
    low, high = side.low + HALF - LAP, side.high - HALF + LAP
    edges = {edge for hole in holes for edge in _span(hole)}
    levels = {level for hole in holes for level in (hole.sill, hole.head) if level > 0}
    z_lines = sorted({-LAP, HEIGHT + LAP} | levels)
    u_lines = sorted({low, high, *cuts} | edges)
    for number, (start, end) in enumerate(itertools.pairwise([low, *cuts, high]), start=1):
        inside = [u for u in u_lines if start <= u <= end]
        parts = [
            side.quad(u0, u1, z0, z1, side.face)
            for (u0, u1), (z0, z1) in itertools.product(
                itertools.pairwise(inside), itertools.pairwise(z_lines)
            )
            if not any(_covers(hole, (u0 + u1) / 2, (z0 + z1) / 2) for hole in holes)
        ]
        parts.append(_cap(side, start == low, start, end, end == high))
        node = f"{name}_{number:02}" if cuts else name
        _place(stage, node, material, tile(join(parts), SIZES[material]))


def _cap(side: Side, first: bool, start: float, end: float, last: bool) -> Patch:
    """Top of the room's half of the wall, mitered at the room's corners."""
    inner = (side.low + HALF if first else start, side.high - HALF if last else end)
    outer = (side.low if first else start, side.high if last else end)
    z = HEIGHT + LAP
    corners = [
        side.point(inner[0], side.face, z),
        side.point(inner[1], side.face, z),
        side.point(outer[1], side.line, z),
        side.point(outer[0], side.line, z),
    ]
    upwards = (side.axis == "y") == (side.inward < 0)
    return polygon(corners if upwards else corners[::-1])


def _lay(stage: Stage, room: Room) -> None:
    """Floor and ceiling, up to the middle lines of the walls."""
    low, high = (room.x0, room.x1) if room.along == "x" else (room.y0, room.y1)
    for number, (start, end) in enumerate(itertools.pairwise([low, *room.cuts, high]), start=1):
        x0, y0, x1, y1 = (
            (start, room.y0, end, room.y1) if room.along == "x" else (room.x0, start, room.x1, end)
        )
        ending = f"_{number:02}" if room.cuts else ""
        floor = polygon([(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)])
        _place(stage, f"floor_{room.name}{ending}", room.floor, tile(floor, SIZES[room.floor]))
        ceiling = join(_ceiling(x0, y0, x1, y1, room.name == "stair_hall"))
        size = SIZES[room.ceiling]
        _place(stage, f"ceiling_{room.name}{ending}", room.ceiling, tile(ceiling, size))


def _ceiling(x0: float, y0: float, x1: float, y1: float, with_hole: bool) -> Iterator[Patch]:
    hole = STAIR_HOLE if with_hole else (x0, y0, x0, y0)
    for a0, a1 in itertools.pairwise(sorted({x0, hole[0], hole[2], x1})):
        for b0, b1 in itertools.pairwise(sorted({y0, hole[1], hole[3], y1})):
            if with_hole and (a0, b0) == hole[:2]:
                continue
            corners = [(a0, b0), (a0, b1), (a1, b1), (a1, b0)]
            yield polygon([(x, y, HEIGHT) for x, y in corners])


def _skirting(room: Room, atlas: Atlas) -> Patch:
    deep, high = SKIRTING
    parts = []
    for side in sides(room):
        doors = [hole for hole in side.openings() if hole.sill == 0]
        stops = [side.low + HALF]
        for hole in doors:
            first, last = _span(hole)
            stops += [first - CASING, last + CASING]
        stops.append(side.high - HALF)
        for start, end in zip(stops[::2], stops[1::2], strict=True):
            if end - start < 0.02:
                continue
            across = side.face + side.inward * deep / 2
            middle = side.point((start + end) / 2, across, high / 2)
            size = side.point(end - start, deep, high)
            parts.append(atlas.block(room.skirting, size, middle, without="-z"))
    return join(parts)


def _build_facades(stage: Stage) -> None:
    """The outside faces, with parapets, and the tops of the outside walls."""
    faces = (
        Side("south", "y", SOUTH, WEST, EAST, -1),
        Side("east", "x", EAST, SOUTH, NORTH, 1),
        Side("north", "y", NORTH, WEST, EAST, 1),
        Side("west", "x", WEST, SOUTH, NORTH, -1),
    )
    for side in faces:
        holes = side.openings()
        low, high = side.low - OUTER, side.high + OUTER
        across = side.line + side.inward * OUTER
        u_lines = sorted({low, high} | {edge for hole in holes for edge in _span(hole)})
        levels = {level for hole in holes for level in (hole.sill, hole.head)}
        z_lines = sorted({-0.4, HEIGHT + LAP} | levels)
        parts = [
            side.quad(u0, u1, z0, z1, across)
            for (u0, u1), (z0, z1) in itertools.product(
                itertools.pairwise(u_lines), itertools.pairwise(z_lines)
            )
            if not any(_covers(hole, (u0 + u1) / 2, (z0 + z1) / 2) for hole in holes)
        ]
        z = HEIGHT + LAP
        top = [
            side.point(side.low, side.line, z),
            side.point(side.high, side.line, z),
            side.point(high, across, z),
            side.point(low, across, z),
        ]
        upwards = (side.axis == "y") == (side.inward > 0)
        parts.append(polygon(top if upwards else top[::-1]))
        _place(stage, f"facade_{side.name}", "brick", tile(join(parts), SIZES["brick"]))


def _build_stair_shaft(stage: Stage) -> None:
    """Shaft above the stairs: four walls and a ceiling."""
    x0, y0, x1, y1 = STAIR_HOLE
    walls = (
        Side("south", "y", y0, x0, x1, 1),
        Side("east", "x", x1, y0, y1, -1),
        Side("north", "y", y1, x0, x1, -1),
        Side("west", "x", x0, y0, y1, 1),
    )
    parts = [s.quad(s.low, s.high, HEIGHT - 0.001, SHAFT_TOP, s.line) for s in walls]
    _place(stage, "wall_stair_shaft", "paint_yellow", tile(join(parts), 3.0))
    top = polygon(
        [(x0, y0, SHAFT_TOP), (x0, y1, SHAFT_TOP), (x1, y1, SHAFT_TOP), (x1, y0, SHAFT_TOP)]
    )
    _place(stage, "ceiling_stair_shaft", "ceiling_plaster", tile(top, 3.0))


def _span(hole: Opening) -> tuple[float, float]:
    return (round(hole.center - hole.width / 2, 6), round(hole.center + hole.width / 2, 6))


def _covers(hole: Opening, along: float, z: float) -> bool:
    return abs(along - hole.center) < hole.width / 2 and hole.sill < z < hole.head


def _place(stage: Stage, name: str, material: str, patch: Patch) -> None:
    stage.place(name, Model(name, material, patch))
