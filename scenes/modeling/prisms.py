"""Closed solids with flat sides and bevelled edges, for objects of sheet metal."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from scenes.modeling.geometry import Patch, Vector, join, polygon


def prism(outline: Sequence[Vector], levels: Sequence[tuple[float, float]]) -> Patch:
    """Upright solid over a convex outline.

    Args:
        outline: corners (x, y), counter-clockwise from above.
        levels: (height, inset of the outline there) upwards; insets slope or bevel the sides.
    """
    rings = [
        np.column_stack([inset_outline(outline, inset), np.full(len(outline), height)])
        for height, inset in levels
    ]
    sides = [polygon(rings[0][::-1]), polygon(rings[-1])]
    for low, high in itertools.pairwise(rings):
        for a, b in itertools.pairwise([*range(len(outline)), 0]):
            sides.append(polygon([low[a], low[b], high[b], high[a]]))
    return join(sides)


def block(size: Vector, center: Vector = (0, 0, 0), bevel: float = 0.003) -> Patch:
    """Axis-aligned box whose edges are cut at 45 degrees."""
    x, y, z = np.asarray(size, float) / 2
    outline = [
        (x - bevel, -y),
        (x, bevel - y),
        (x, y - bevel),
        (x - bevel, y),
        (bevel - x, y),
        (-x, y - bevel),
        (-x, bevel - y),
        (bevel - x, -y),
    ]
    levels = [(-z, bevel), (bevel - z, 0.0), (z - bevel, 0.0), (z, bevel)]
    return prism(outline, levels).shifted(*center)


def rounded_front(
    back_x: float, front_x: float, half_width: float, radius: float, steps: int = 5
) -> np.ndarray:
    """Outline of a plate whose two corners at `front_x` are round."""
    angle = np.linspace(0, np.pi / 2, steps)
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1) * radius
    corner = arc + (front_x - radius, half_width - radius)
    mirrored = corner[::-1] * (1, -1)
    return np.concatenate([[(back_x, -half_width)], mirrored, corner, [(back_x, half_width)]])


def inset_outline(outline: Sequence[Vector], inset: float) -> np.ndarray:
    """Convex outline with every side moved inwards by `inset`; negative: outwards."""
    points = np.asarray(outline, float)
    sides = np.roll(points, -1, axis=0) - points
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    inwards = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    before = np.roll(inwards, 1, axis=0)
    # A corner moves so that it stays on both of its sides.
    reach = inset / (1.0 + np.einsum("ij,ij->i", inwards, before))
    return points + reach[:, None] * (inwards + before)
