"""Clipping of a mirror's mesh along the cube edges, for texture coordinates (Fig. 6).

Within one cube face, projection from the effective viewpoint gives a polygon its texture
coordinates. A polygon crossed by a cube edge belongs to two faces. It is clipped at the edge, and
the new vertices are placed on the mirror in the same direction. Both neighbors of a clipped edge
share the new vertex, so the mesh has no cracks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.mirrors.hyperbolic_mirror import HyperbolicMirror
from omnisim.cameras.mirrors.mirror_mesh import MirrorMesh, UnfoldedMirrorMesh
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL, RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.cube import (
    CELL_TANGENT,
    FACE_FROM_RIG,
    FACE_NAMES,
    LAYOUT_CELLS,
    LAYOUT_COLUMNS,
    LAYOUT_ROWS,
    face_tangents,
)

RIG_FROM_MIRROR: NDArray[np.float64] = RIG_FROM_OPTICAL_LOOKING_UP @ MIRROR_FROM_OPTICAL.T
# A vertex this close to a cube edge, relative to its distance, lies on it: the meridians at 45° do,
# up to rounding.
_ON_EDGE = 1e-12


def unfold(mirror: HyperbolicMirror, mesh: MirrorMesh) -> UnfoldedMirrorMesh:
    """Clip a mesh along the cube edges and compute its texture coordinates.

    Args:
        mirror: mirror shape.
        mesh: tessellation of that mirror.
    """
    clipper = _Clipper(mirror, mesh.vertices_m)
    parts = [clipper.clip_to_face(face, mesh.triangles) for face in range(len(FACE_NAMES))]
    positions = np.array(clipper.positions)
    vertices, coordinates, triangles, base = [], [], [], 0
    for face, corners in enumerate(parts):
        used, local = np.unique(corners, return_inverse=True)
        vertices.append(positions[used])
        coordinates.append(_texture_coordinates(positions[used], face))
        triangles.append(local.reshape(-1, 3) + base)
        base += len(used)
    stacked = np.concatenate(vertices)
    return UnfoldedMirrorMesh(
        vertices_m=stacked,
        normals=mirror.normals(stacked),
        texture_coordinates=np.concatenate(coordinates),
        triangles=np.concatenate(triangles).astype(np.int64),
    )


def _texture_coordinates(positions: NDArray[np.float64], face: int) -> NDArray[np.float64]:
    """Coordinates (n, 2) on the unfolded cube, origin at the top left."""
    tangents = face_tangents(positions @ RIG_FROM_MIRROR.T, face)
    inside = 0.5 + 0.5 * np.clip(tangents, -1.0, 1.0) / CELL_TANGENT  # clip: rounding only
    return (inside + LAYOUT_CELLS[face]) / (LAYOUT_COLUMNS, LAYOUT_ROWS)


class _Clipper:
    """Clips triangles to the cells of the cube faces, and shares new vertices.

    Attributes:
        positions: position (3,) of each vertex in m, mirror frame, new vertices last.
    """

    def __init__(self, mirror: HyperbolicMirror, positions: NDArray[np.float64]):
        self._mirror = mirror
        self.positions = list(positions)
        self._crossings: dict[tuple[int, int, tuple[float, ...]], int] = {}
        self._fixed = _edge_distances(positions)

    def clip_to_face(self, face: int, triangles: NDArray[np.int64]) -> NDArray[np.int64]:
        """Parts of triangles (n, 3) inside the cell of one face, as triangles (m, 3)."""
        limits = _edge_planes(face)
        distances = self._fixed[face][triangles]  # (n, 3 corners, 4 planes)
        outside = np.any(np.all(distances <= 0.0, axis=1), axis=1)
        whole = np.all(distances >= 0.0, axis=(1, 2)) & ~outside
        result = triangles[whole].tolist()
        for corners in triangles[~whole & ~outside].tolist():
            polygon = corners
            for plane in limits:
                polygon = self._clip(polygon, plane)
            result += [[polygon[0], polygon[i], polygon[i + 1]] for i in range(1, len(polygon) - 1)]
        return np.array(result, dtype=np.int64).reshape(-1, 3)

    def _clip(self, polygon: list[int], plane: NDArray[np.float64]) -> list[int]:
        """Part of a polygon in front of a plane through the effective viewpoint.

        Source: Sutherland & Hodgman 1974.
        """
        kept: list[int] = []
        sides = [self._side(vertex, plane) for vertex in polygon]
        for i, vertex in enumerate(polygon):
            last, side_last, side = polygon[i - 1], sides[i - 1], sides[i]
            if side * side_last < 0.0:
                kept.append(self._crossing(last, vertex, plane))
            if side >= 0.0:
                kept.append(vertex)
        return kept

    def _side(self, vertex: int, plane: NDArray[np.float64]) -> float:
        position = self.positions[vertex]
        distance = float(plane @ position)
        return 0.0 if abs(distance) <= _ON_EDGE * float(np.linalg.norm(position)) else distance

    def _crossing(self, one: int, other: int, plane: NDArray[np.float64]) -> int:
        """Index of the vertex where an edge crosses a plane; adds the vertex if it is new."""
        low, high = min(one, other), max(one, other)
        # the two faces at a cube edge see its plane from opposite sides
        sign = 1.0 if tuple(plane) > tuple(-plane) else -1.0
        key = (low, high, tuple((sign * plane).tolist()))
        if key not in self._crossings:
            a, b = self.positions[low], self.positions[high]
            t = (plane @ a) / (plane @ a - plane @ b)
            crossing = a + t * (b - a)
            theta = np.arctan2(np.hypot(crossing[0], crossing[1]), crossing[2])
            azimuth = np.arctan2(crossing[1], crossing[0])
            self._crossings[key] = len(self.positions)
            self.positions.append(self._mirror.surface_points(theta, azimuth).positions_m)
        return self._crossings[key]


def _edge_planes(face: int) -> NDArray[np.float64]:
    """Normals (4, 3) in the mirror frame of the planes that bound a face, pointing inwards."""
    right, down, forward = FACE_FROM_RIG[face]
    return np.array([forward - right, forward + right, forward - down, forward + down]) @ (
        RIG_FROM_MIRROR
    )


def _edge_distances(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed distances (6 faces, n, 4 planes) in m of points from the planes; 0 on an edge."""
    planes = np.array([_edge_planes(face) for face in range(len(FACE_NAMES))])
    distances = np.einsum("fpj,nj->fnp", planes, positions)
    near = np.abs(distances) <= _ON_EDGE * np.linalg.norm(positions, axis=1)[:, None]
    return np.where(near, 0.0, distances)
