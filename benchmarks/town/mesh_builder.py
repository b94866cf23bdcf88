"""Quads by material, with texture coordinates in meters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Submesh(NamedTuple):
    """Triangles of one material."""

    positions: NDArray[np.float32]  # (n, 3), meters
    texture_coordinates: NDArray[np.float32]  # (n, 2), meters
    triangles: NDArray[np.uint32]  # (m, 3)


class MeshBuilder:
    """Builder of quads by material; corners are counter-clockwise, seen from outside."""

    def __init__(self) -> None:
        self._corners: dict[str, list[NDArray[np.float64]]] = {}

    def quad(self, material: str, *corners: ArrayLike) -> None:
        """Add a quad with four corners in a plane; three corners make a triangle."""
        points = np.array(corners, dtype=np.float64)
        if len(points) == 3:
            points = np.concatenate((points, points[2:]))
        self._corners.setdefault(material, []).append(points)

    def box(self, material: str, low: ArrayLike, high: ArrayLike, open_sides: str = "") -> None:
        """Add an axis-aligned box without the sides in `open_sides`, such as "-x" or "+x"."""
        ends = np.array((low, high), dtype=np.float64)
        for axis in range(3):
            for end, sign in enumerate("-+"):
                if f"{sign}{'xyz'[axis]}" in open_sides:
                    continue
                one, other = ((axis + 1) % 3, (axis + 2) % 3)[:: 1 if end else -1]
                corners = np.tile(ends[end], (4, 1))
                corners[:, one] = ends[[0, 1, 1, 0], one]
                corners[:, other] = ends[[0, 0, 1, 1], other]
                self.quad(material, *corners)

    def post(
        self, material: str, foot: ArrayLike, height_m: float, radii_m: tuple[float, float],
        sides: int = 6,
    ) -> None:  # fmt: skip
        """Add an upright prism or truncated cone, without its ends."""
        angles = np.arange(sides + 1) * 2.0 * np.pi / sides
        ring = np.stack((np.cos(angles), np.sin(angles), np.zeros(sides + 1)), axis=-1)
        base = np.asarray(foot, dtype=np.float64)
        low = base + radii_m[0] * ring
        high = base + radii_m[1] * ring + np.array([0.0, 0.0, height_m])
        for at in range(sides):
            self.quad(material, low[at], low[at + 1], high[at + 1], high[at])

    def submeshes(self) -> dict[str, Submesh]:
        """Submeshes by material."""
        return {material: _part(np.array(quads)) for material, quads in self._corners.items()}


def _part(quads: NDArray[np.float64]) -> Submesh:
    """Triangles of quads (n, 4, 3), textured flat in meters."""
    right = quads[:, 1] - quads[:, 0]
    width = np.linalg.norm(right, axis=1, keepdims=True)
    right = right / np.maximum(width, 1e-9)
    normal = np.cross(right, quads[:, 2] - quads[:, 0])
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    up = np.cross(normal, right)
    along = quads - quads[:, :1]
    u = np.einsum("nkj,nj->nk", along, right)
    v = -np.einsum("nkj,nj->nk", along, up)
    first = 4 * np.arange(len(quads))[:, None, None]
    triangles = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    flat = quads.reshape(-1, 3)
    a, b, c = (flat[triangles[:, corner]] for corner in range(3))
    has_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9
    return Submesh(
        flat.astype(np.float32),
        np.stack((u, v), axis=-1).reshape(-1, 2).astype(np.float32),
        triangles[has_area].astype(np.uint32),
    )
