"""Surroundings of a house: its ground up to the middle of the road, a tree, a lamp.

A plot is centered on its house. The road runs along x on the −y side; its middle is the plot's
edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.town.mesh_builder import MeshBuilder, Submesh

PLOT_WIDTH_M = 13.0
ROAD_MIDDLE_M, KERB_M, GARDEN_M, BACK_M = -14.0, -10.5, -8.5, 9.0  # y, from the house's middle
KERB_HIGH_M = 0.12
HEDGE_M = (0.5, 0.8)  # thick, high


def ground() -> dict[str, Submesh]:
    """Half of the road with its line, curb, pavement, garden with a path, and hedge."""
    builder = MeshBuilder()
    half = 0.5 * PLOT_WIDTH_M

    def lying(material: str, x0: float, x1: float, y0: float, y1: float, z: float) -> None:
        builder.quad(material, (x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z))

    lying("asphalt", -half, half, ROAD_MIDDLE_M, KERB_M, -KERB_HIGH_M)
    for x in (-0.5 * half, 0.5 * half):
        lying(
            "white paint", x - 1.0, x + 1.0, ROAD_MIDDLE_M, ROAD_MIDDLE_M + 0.07,
            -KERB_HIGH_M + 0.01,
        )  # fmt: skip
    builder.quad(
        "stone", (-half, KERB_M, -KERB_HIGH_M), (half, KERB_M, -KERB_HIGH_M), (half, KERB_M, 0.0),
        (-half, KERB_M, 0.0),
    )  # fmt: skip
    lying("paving", -half, half, KERB_M, GARDEN_M, 0.0)
    lying("grass", -half, half, GARDEN_M, BACK_M, 0.0)
    lying("paving", -0.6, 0.6, GARDEN_M, -4.0, 0.015)
    thick, high = HEDGE_M
    for x0, x1 in ((-half, -0.8), (0.8, half)):
        builder.box("leaves", (x0, GARDEN_M, 0.0), (x1, GARDEN_M + thick, high), "-z")
    builder.box("leaves", (half - thick, GARDEN_M, 0.0), (half, BACK_M, high), "-z")
    return builder.submeshes()


def tree() -> dict[str, Submesh]:
    """Tree: a trunk and five clumps of leaves, each with 20 sides."""
    builder = MeshBuilder()
    builder.post("bark", (0.0, 0.0, 0.0), 2.4, (0.2, 0.12))
    clumps = (
        (0.0, 0.0, 3.6, 1.5), (0.8, 0.3, 2.9, 1.0), (-0.7, 0.5, 3.0, 1.1), (0.1, -0.8, 2.8, 1.0),
        (0.2, 0.2, 4.8, 0.9),
    )  # fmt: skip
    for index, (x, y, z, radius) in enumerate(clumps):
        for corners in _icosahedron(0.7 * index):
            builder.quad("leaves", *(corners * (radius, radius, 0.85 * radius) + (x, y, z)))
    return builder.submeshes()


def lamp() -> dict[str, Submesh]:
    """Street lamp: a post with an arm over the road, toward −y."""
    builder = MeshBuilder()
    builder.post("metal", (0.0, 0.0, 0.0), 5.0, (0.08, 0.05))
    builder.box("metal", (-0.03, -1.2, 4.9), (0.03, 0.0, 4.96), "+y")
    builder.box("metal", (-0.12, -1.6, 4.86), (0.12, -1.0, 4.98))
    builder.box("lamp", (-0.09, -1.5, 4.82), (0.09, -1.1, 4.86), "+z")
    return builder.submeshes()


def _icosahedron(yaw_rad: float) -> NDArray[np.float64]:
    """Triangles (20, 3, 3) of an icosahedron with circumradius 1, rotated about z."""
    g = 0.5 * (1.0 + np.sqrt(5.0))
    corners = np.array(
        [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g),
         (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    )  # fmt: skip
    sides = np.array(
        [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
         (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9),
         (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    )  # fmt: skip
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    about_z = np.array([(cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)])
    triangles: NDArray[np.float64] = (corners / np.hypot(1.0, g) @ about_z.T)[sides]
    return triangles
