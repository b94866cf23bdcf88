"""House: walls with windows and a door, a roof with gutters, and a chimney.

It is centered on the origin, on z = 0, with its front toward −y.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.town.mesh_builder import MeshBuilder, Submesh

STOREY_M, DEPTH_M = 2.7, 8.0
WINDOW_M, SILL_M, REVEAL_M = (1.1, 1.3), 0.9, 0.14
DOOR_M = (1.0, 2.1)
FRAME_M, OVERHANG_M = 0.07, 0.45
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class HouseKind:
    """Parameters of a kind of house.

    Attributes:
        wall, roof, door: names of the materials.
        width_m: width of the front.
        columns: number of window columns in the front; the door replaces one window.
        door_column: index of the door's column.
        roof_rise_m: height of the ridge above the eaves.
    """

    wall: str
    roof: str
    door: str
    width_m: float
    columns: int
    door_column: int
    roof_rise_m: float


KINDS = (
    HouseKind("brick", "red tiles", "green paint", 8.4, 3, 1, 2.6),
    HouseKind("cream plaster", "slate", "red paint", 7.6, 3, 0, 2.2),
    HouseKind("white plaster", "red tiles", "blue paint", 9.0, 3, 2, 2.9),
    HouseKind("brick", "slate", "blue paint", 7.2, 2, 0, 3.2),
    HouseKind("yellow plaster", "red tiles", "green paint", 8.8, 3, 1, 2.0),
    HouseKind("cream plaster", "red tiles", "red paint", 7.0, 2, 1, 2.8),
)


@dataclass(frozen=True)
class _Wall:
    """Frame of a wall: from its lower left corner, right and up as seen from outside."""

    builder: MeshBuilder
    corner: NDArray[np.float64]
    right: NDArray[np.float64]

    def at(self, x: float, z: float, inward: float = 0.0) -> NDArray[np.float64]:
        return self.corner + x * self.right + z * UP - inward * np.cross(self.right, UP)

    def rectangle(
        self, material: str, x0: float, x1: float, z0: float, z1: float, inward: float = 0.0
    ) -> None:
        self.builder.quad(
            material, self.at(x0, z0, inward), self.at(x1, z0, inward), self.at(x1, z1, inward),
            self.at(x0, z1, inward),
        )  # fmt: skip

    def reveals(self, material: str, hole: tuple[float, float, float, float]) -> None:
        """Add the four reveals of a hole, to its depth."""
        x0, x1, z0, z1 = hole
        rim = [(x0, z0), (x0, z1), (x1, z1), (x1, z0)]
        for one, other in zip(rim, rim[1:] + rim[:1], strict=True):
            self.builder.quad(
                material, self.at(*one), self.at(*one, REVEAL_M), self.at(*other, REVEAL_M),
                self.at(*other),
            )  # fmt: skip


def house(kind: HouseKind) -> dict[str, Submesh]:
    """Submeshes of a house, by material."""
    builder = MeshBuilder()
    half, deep, high = 0.5 * kind.width_m, 0.5 * DEPTH_M, 2.0 * STOREY_M
    corners = np.array([(-half, -deep, 0), (half, -deep, 0), (half, deep, 0), (-half, deep, 0)])
    columns = (kind.columns, 1, kind.columns, 1)
    for side, corner in enumerate(corners):
        to_next = corners[(side + 1) % 4] - corner
        width_m = float(np.linalg.norm(to_next))
        wall = _Wall(builder, corner, to_next / width_m)
        door_column = kind.door_column if side == 0 else None
        _pierced(wall, kind, width_m, high, columns[side], door_column)
    _roof(builder, kind, half, deep, high)
    return builder.submeshes()


def _pierced(
    wall: _Wall, kind: HouseKind, width_m: float, high_m: float, columns: int, door: int | None
) -> None:
    """Add a wall of two storeys with its windows and, in column `door`, a door."""
    holes: list[tuple[float, float, float, float]] = []
    for column in range(columns):
        middle = width_m * (column + 0.5) / columns
        for storey in range(2):
            if storey == 0 and column == door:
                hole = (middle - 0.5 * DOOR_M[0], middle + 0.5 * DOOR_M[0], 0.0, DOOR_M[1])
                _door(wall, kind, hole)
            else:
                low = storey * STOREY_M + SILL_M
                half = 0.5 * WINDOW_M[0]
                hole = (middle - half, middle + half, low, low + WINDOW_M[1])
                _window(wall, hole)
            wall.reveals(kind.wall, hole)
            holes.append(hole)
    # strips of the wall around its holes
    lines = sorted({0.0, high_m, *(z for hole in holes for z in hole[2:])})
    for z0, z1 in itertools.pairwise(lines):
        cut = sorted(hole[:2] for hole in holes if hole[2] < z1 and hole[3] > z0)
        starts, ends = [0.0, *(x for _, x in cut)], [*(x for x, _ in cut), width_m]
        for x0, x1 in zip(starts, ends, strict=True):
            wall.rectangle(kind.wall, x0, x1, z0, z1)


def _window(wall: _Wall, hole: tuple[float, float, float, float]) -> None:
    """Add a pane with its frame and bars, and a projecting sill."""
    x0, x1, z0, z1 = hole
    pane, frame = REVEAL_M, REVEAL_M - 0.03
    wall.rectangle("glass", x0, x1, z0, z1, pane)
    wall.rectangle("white paint", x0, x0 + FRAME_M, z0, z1, frame)
    wall.rectangle("white paint", x1 - FRAME_M, x1, z0, z1, frame)
    wall.rectangle("white paint", x0 + FRAME_M, x1 - FRAME_M, z1 - FRAME_M, z1, frame)
    wall.rectangle("white paint", x0 + FRAME_M, x1 - FRAME_M, z0, z0 + FRAME_M, frame)
    middle, bar = 0.5 * (x0 + x1), 0.5 * FRAME_M
    wall.rectangle("white paint", middle - bar, middle + bar, z0, z1, frame)
    wall.rectangle("white paint", x0, x1, z0 + 0.85, z0 + 0.85 + bar, frame)
    out, low = -0.09, z0 - 0.08
    left, right = x0 - 0.08, x1 + 0.08
    wall.rectangle("stone", left, right, low, z0, out)
    wall.builder.quad(
        "stone", wall.at(left, z0, out), wall.at(right, z0, out), wall.at(right, z0, REVEAL_M),
        wall.at(left, z0, REVEAL_M),
    )  # fmt: skip
    wall.builder.quad(
        "stone", wall.at(left, low), wall.at(right, low), wall.at(right, low, out),
        wall.at(left, low, out),
    )  # fmt: skip


def _door(wall: _Wall, kind: HouseKind, hole: tuple[float, float, float, float]) -> None:
    """Add a door leaf with panels, a light above them, and a canopy."""
    x0, x1, z0, z1 = hole
    leaf = REVEAL_M - 0.02
    wall.rectangle(kind.door, x0, x1, z0, z1, leaf)
    for x in (x0 + 0.14, x0 + 0.56):
        wall.rectangle("stone", x, x + 0.3, z0 + 0.2, z0 + 0.9, leaf - 0.02)
        wall.rectangle("glass", x, x + 0.3, z0 + 1.1, z0 + 1.9, leaf - 0.02)
    wall.rectangle("metal", x1 - 0.12, x1 - 0.05, z0 + 1.0, z0 + 1.04, leaf - 0.05)
    out, low, high = -0.8, z1 + 0.12, z1 + 0.22
    left, right = x0 - 0.3, x1 + 0.3
    wall.rectangle("white paint", left, right, low, high, out)
    for over in ((low, 0.0, out), (high, out, 0.0)):  # below and above
        z, near, far = over
        wall.builder.quad(
            "white paint", wall.at(left, z, near), wall.at(right, z, near),
            wall.at(right, z, far), wall.at(left, z, far),
        )  # fmt: skip
    for x, near, far in ((left, 0.0, out), (right, out, 0.0)):
        wall.builder.quad(
            "white paint", wall.at(x, low, near), wall.at(x, low, far), wall.at(x, high, far),
            wall.at(x, high, near),
        )  # fmt: skip


def _roof(builder: MeshBuilder, kind: HouseKind, half: float, deep: float, high: float) -> None:
    """Add two slopes with the ridge along x, boards, gutters, gables and a chimney."""
    rise, reach = kind.roof_rise_m, deep + OVERHANG_M
    low, ridge = high - rise * OVERHANG_M / deep, high + rise
    left, right = -half - OVERHANG_M, half + OVERHANG_M
    for sign in (-1.0, 1.0):
        a, b = (left, right) if sign < 0.0 else (right, left)
        eave, top = sign * reach, 0.0
        builder.quad(kind.roof, (a, eave, low), (b, eave, low), (b, top, ridge), (a, top, ridge))
        under = -0.12
        builder.quad(
            "white paint", (a, top, ridge + under), (b, top, ridge + under), (b, eave, low + under),
            (a, eave, low + under),
        )  # fmt: skip
        builder.quad(
            "white paint", (a, eave, low + under), (b, eave, low + under), (b, eave, low),
            (a, eave, low),
        )  # fmt: skip
        for x, flip in ((left, sign > 0.0), (right, sign < 0.0)):
            board = [
                (x, eave, low + under), (x, eave, low), (x, top, ridge), (x, top, ridge + under),
            ]  # fmt: skip
            builder.quad("white paint", *(board if flip else board[::-1]))
        gutter = (min(eave, eave + 0.12 * sign), low - 0.1), (max(eave, eave + 0.12 * sign), low)
        builder.box("metal", (left, *gutter[0]), (right, *gutter[1]), "+z")
    for x, order in ((-half, 1), (half, -1)):
        gable = [(x, deep, high), (x, -deep, high), (x, 0.0, ridge - 0.1)]
        builder.quad(kind.wall, *gable[::order])
    x = 0.5 * half
    builder.box("brick", (x - 0.35, 0.6, high + 0.6), (x + 0.35, 1.3, ridge + 0.8), "-z")
    builder.post("red tiles", (x, 0.95, ridge + 0.8), 0.4, (0.16, 0.13))
