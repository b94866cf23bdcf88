"""Small solid-modeling kit: patches of triangles with normals and texture coordinates.

World axes while modeling: x east, y north, z up, meters.  Texture v points up the image.
Until `fit_to_rectangle` or `tile` is applied, texture coordinates are meters along the surface.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

Vector = Sequence[float] | np.ndarray


@dataclass(frozen=True)
class Patch:
    """Triangles sharing one material."""

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    faces: np.ndarray

    def moved(self, matrix: np.ndarray) -> Patch:
        """The patch under a rotation, translation and positive scale."""
        positions = self.positions @ matrix[:3, :3].T + matrix[:3, 3]
        normals = self.normals @ np.linalg.inv(matrix[:3, :3])
        return replace(self, positions=positions, normals=_unit(normals))

    def shifted(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Patch:
        """The patch translated."""
        return replace(self, positions=self.positions + np.array([x, y, z]))


def join(patches: Iterable[Patch]) -> Patch:
    """One patch out of several."""
    patches = list(patches)
    starts = np.cumsum([0] + [len(p.positions) for p in patches[:-1]])
    return Patch(
        np.concatenate([p.positions for p in patches]),
        np.concatenate([p.normals for p in patches]),
        np.concatenate([p.uvs for p in patches]),
        np.concatenate([p.faces + start for p, start in zip(patches, starts, strict=True)]),
    )


def pose(
    x: float = 0.0,
    y: float = 0.0,
    z: float = 0.0,
    yaw_deg: float = 0.0,
    scale: float | Vector = 1.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
) -> np.ndarray:
    """4x4 matrix: scale, roll about x, pitch about y, yaw about z, then translate."""
    yaw, pitch, roll = np.radians([yaw_deg, pitch_deg, roll_deg])
    about_z = _rotation(0, 1, yaw)
    about_y = _rotation(2, 0, pitch)
    about_x = _rotation(1, 2, roll)
    matrix = np.eye(4)
    matrix[:3, :3] = about_z @ about_y @ about_x @ np.diag(np.broadcast_to(scale, 3))
    matrix[:3, 3] = x, y, z
    return matrix


def polygon(corners: Sequence[Vector], uvs: Sequence[Vector] | None = None) -> Patch:
    """Flat convex polygon, corners counter-clockwise as seen from its front."""
    points = np.asarray(corners, float)
    count = len(points)
    edges = np.roll(points, -1, axis=0) - points
    normal = _unit(np.cross(edges[:-1], edges[1:]).sum(axis=0))
    if uvs is None:
        right, up = _wall_axes(normal)
        uvs = np.stack([points @ right, points @ up], axis=1)
    fan = [[0, i, i + 1] for i in range(1, count - 1)]
    return Patch(points, np.tile(normal, (count, 1)), np.asarray(uvs, float), np.array(fan))


def box(
    size: Vector, center: Vector = (0, 0, 0), without: str = "", courses: bool = False
) -> Patch:
    """Axis-aligned box; `without` drops hidden sides, e.g. "-z+y".

    Each side's texture runs along its longer edge, so that wood grain follows the board;
    with `courses` it stays level instead, as masonry must.
    """
    half, mid = np.asarray(size, float) / 2, np.asarray(center, float)
    dropped = {without[i : i + 2] for i in range(0, len(without), 2)}
    sides = []
    for axis, letter in enumerate("xyz"):
        for sign, mark in ((1, "+"), (-1, "-")):
            if mark + letter in dropped:
                continue
            normal = np.zeros(3)
            normal[axis] = sign
            right, up = _wall_axes(normal)
            reach_right, reach_up = abs(right) @ half, abs(up) @ half
            face_mid = mid + normal * half
            signs = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            corners = [face_mid + right * reach_right * a + up * reach_up * b for a, b in signs]
            uvs = np.array([[(a + 1) * reach_right, (b + 1) * reach_up] for a, b in signs])
            sides.append(
                polygon(corners, uvs if courses or reach_right >= reach_up else uvs[:, ::-1])
            )
    return join(sides)


def sheet(points: np.ndarray, uvs: np.ndarray, wraps: bool = False) -> Patch:
    """Smooth surface over a grid of points (rows, columns, 3), front = row x column direction.

    `wraps` says that the last column repeats the first, so normals must agree across the seam.
    """
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
    c, d = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    flat = points.reshape(-1, 3)
    crosses = np.cross(flat[faces[:, 1]] - flat[faces[:, 0]], flat[faces[:, 2]] - flat[faces[:, 0]])
    faces = faces[np.linalg.norm(crosses, axis=1) > 1e-10]  # poles collapse to slivers
    # Whole quads, not triangles: the choice of diagonal must not tilt the normals.
    quads = np.cross(flat[c] - flat[a], flat[d] - flat[b])
    normals = np.zeros_like(flat)
    for corner in (a, b, c, d):
        np.add.at(normals, corner, quads)
    normals = normals.reshape(rows, columns, 3)
    if wraps:
        normals[:, 0] = normals[:, -1] = normals[:, 0] + normals[:, -1]
    used, faces = np.unique(faces, return_inverse=True)
    normals = _unit(normals.reshape(-1, 3)[used])
    return Patch(flat[used], normals, uvs.reshape(-1, 2)[used], faces.reshape(-1, 3))


def lathe(profile: Sequence[tuple[float, float]], segments: int, crease_deg: float = 40.0) -> Patch:
    """Solid of revolution about z; profile (radius, z) runs upwards along the outside.

    Where the profile turns by more than `crease_deg` the edge stays sharp.
    """
    line = np.asarray(profile, float)
    steps = np.diff(line, axis=0)
    heading = np.degrees(np.arctan2(steps[:, 1], steps[:, 0]))
    turn = np.abs((np.diff(heading) + 180) % 360 - 180)
    breaks = [0, *(np.flatnonzero(turn > crease_deg) + 1), len(line) - 1]
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(steps, axis=1))])
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    girth = 2 * np.pi * line[:, 0].max()
    bands = []
    for first, last in itertools.pairwise(breaks):
        part, height = line[first : last + 1], along[first : last + 1]
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        points = np.empty((len(part), segments + 1, 3))
        points[..., :2] = part[:, None, :1] * ring
        points[..., 2] = part[:, None, 1]
        uvs = np.stack(np.meshgrid(angle / (2 * np.pi) * girth, height), axis=-1)
        bands.append(_flipped(sheet(points, uvs, wraps=True)))
    return join(bands)


def tube(path: Sequence[Vector], radius: float, sides: int = 6, closed: bool = False) -> Patch:
    """Round bar along a polyline; `closed` joins its end to its start (rings)."""
    line = np.asarray(path, float)
    if closed:
        line = np.concatenate([line, line[:1]])
    before = np.roll(line[:-1], 1, axis=0) if closed else line[:-1]
    tangents = np.gradient(line, axis=0)
    if closed:
        tangents[0] = tangents[-1] = line[1] - before[0]
    tangents = _unit(tangents)
    first = _unit(np.cross(tangents, _aside(tangents)))
    second = np.cross(tangents, first)
    angle = np.linspace(0, 2 * np.pi, sides + 1)[:, None]
    points = np.stack(
        [
            p + radius * (np.cos(angle) * a + np.sin(angle) * b)
            for p, a, b in zip(line, first, second, strict=True)
        ]
    )
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    uvs = np.stack(np.meshgrid(angle[:, 0] * radius, along), axis=-1)[..., ::-1]
    wall = _flipped(sheet(points, uvs, wraps=True))
    if closed:
        return wall
    return join([wall, polygon(points[0, :-1][::-1]), polygon(points[-1, :-1])])


def _aside(tangents: np.ndarray) -> np.ndarray:
    """A direction as far from all tangents (n, 3) as one can be: the cross-section of a bar that is
    counted from it does not twist along the bar.

    Of a straight bar there are many: the same one on every processor is made from the axis of the
    world that it leans to least. Of a bent one there are two, and its sign is decided.
    """
    _, strengths, rows = np.linalg.svd(tangents, full_matrices=True)
    if len(strengths) < 3 or strengths[1] < 1e-6 * strengths[0]:
        along = rows[0]
        axis = np.eye(3)[np.argmin(np.round(np.abs(along), 6))]
        return _unit(axis - along * (axis @ along))
    spread = rows[2]
    return spread * np.sign(spread[np.argmax(np.round(np.abs(spread), 6))])


def bar(start: Vector, end: Vector, radius: float, sides: int = 6) -> Patch:
    """Straight round bar between two points."""
    return tube([start, end], radius, sides)


def ring(radius: float, thickness: float, segments: int = 24, sides: int = 6) -> Patch:
    """Torus about z."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * radius
    return tube(circle, thickness, sides, closed=True)


def ball(radius: float, rings: int = 8, segments: int = 12) -> Patch:
    """Sphere about the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    return lathe(
        list(zip(radius * np.cos(angle), radius * np.sin(angle), strict=True)), segments, 180
    )


def disc(radius: float, z: float, segments: int) -> Patch:
    """Flat round plate facing up."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    return polygon([(radius * np.cos(a), radius * np.sin(a), z) for a in angle])


def bent(patch: Patch, radius: float) -> Patch:
    """A part on the plane x = 0 wrapped around z, so that the plane becomes a cylinder's side."""
    x, y, z = patch.positions.T
    angle = y / radius
    turn = np.zeros((len(angle), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0], turn[:, 0, 1] = np.sin(angle), -np.sin(angle)
    turn[:, 2, 2] = 1.0
    reach = np.stack([radius + x, 0 * y, z], axis=1)
    positions = np.einsum("nij,nj->ni", turn, reach)
    return replace(patch, positions=positions, normals=np.einsum("nij,nj->ni", turn, patch.normals))


def tile(patch: Patch, size: float | tuple[float, float]) -> Patch:
    """Texture repeating every `size` meters."""
    return replace(patch, uvs=patch.uvs / np.asarray(size, float))


def fit_to_rectangle(patch: Patch, left: float, bottom: float, side: float) -> Patch:
    """Texture taken from one square cell of an atlas, where a cell shows one meter of material.

    Parts larger than a meter are squeezed in; smaller ones start at a place in the cell that
    depends on where the part is, so that neighboring boards do not look the same.
    """
    low, high = patch.uvs.min(axis=0), patch.uvs.max(axis=0)
    scale = 1.0 / np.maximum(high - low, 1.0)
    size = (high - low) * scale
    scatter = np.modf(np.abs(patch.positions[0] @ [[3.71, 7.13], [5.27, 2.39], [9.41, 4.57]]))[0]
    uvs = (patch.uvs - low) * scale + scatter * (1.0 - size)
    inset = 0.03 * side  # keeps neighboring cells from bleeding in at coarse mip levels
    return replace(patch, uvs=np.array([left, bottom]) + inset + uvs * (side - 2 * inset))


def _wall_axes(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Right and up along a flat surface for an observer facing it."""
    if abs(normal[2]) > 0.9:
        right = np.array([1.0, 0.0, 0.0])
    else:
        right = _unit(np.cross([0.0, 0.0, 1.0], normal))
    return right, np.cross(normal, right)


def _flipped(patch: Patch) -> Patch:
    return replace(patch, faces=patch.faces[:, ::-1], normals=-patch.normals)


def _rotation(first: int, second: int, angle: float) -> np.ndarray:
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[first, second], matrix[second, first] = -np.sin(angle), np.sin(angle)
    return matrix


def _unit(vectors: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length < 1e-12, 1.0, length)
