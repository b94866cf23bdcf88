"""Mesh of a mirror: tessellation as in the paper's Fig. 3, unfolding to the cube, and its error."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from omnisim.cameras.mirrors.hyperbolic_mirror import HyperbolicMirror
from omnisim.core import cube
from omnisim.core.arrays import Floats, Ints
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL, RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.errors import OpticsError
from omnisim.core.short_repr import short_repr


@dataclass(frozen=True)
class MirrorMesh:
    """Triangles with vertices on the mirror, in the mirror frame.

    Polygons are counted as in the paper: each triangle at the apex is one polygon, and so is each
    cell of two triangles in the other rings.
    """

    vertices_m: Floats  # (n, 3)
    normals: Floats  # (n, 3) unit vectors on the reflecting side
    triangles: Ints  # (m, 3) counter-clockwise seen from the pinhole
    polygons: int
    sectors: int  # polygons around the axis
    rings: int  # polygons from the apex to the rim

    def __repr__(self) -> str:
        shape = f"{self.sectors} sectors × {self.rings} rings"
        return short_repr(self, f"{self.polygons:,} polygons", shape)

    @property
    def edge_middles_m(self) -> Floats:
        """Midpoints (n, 3) of all edges; some are beyond the rim, seen from the viewpoint."""
        corners = self.vertices_m[self.triangles]
        return (0.5 * (corners + np.roll(corners, 1, axis=1))).reshape(-1, 3)

    @property
    def rim_middles_m(self) -> Floats:
        """Midpoints (sectors, 3) of the rim edges."""
        rim = self.vertices_m[-self.sectors :]
        return 0.5 * (rim + np.roll(rim, 1, axis=0))


@dataclass(frozen=True)
class UnfoldedMirrorMesh:
    """Mirror mesh clipped along the cube edges, with one copy of each vertex per face."""

    vertices_m: Floats  # (n, 3) mirror frame
    normals: Floats  # (n, 3) unit vectors
    # (n, 2) in [0, 1] on the unfolded cube (`omnisim.core.cube`), origin at the image's top left
    texture_coordinates: Floats
    triangles: Ints  # (m, 3) counter-clockwise seen from the pinhole


# Tessellation of a mirror into polygons, as in the paper's Fig. 3.


PAPER_POLYGON_COUNTS = (16, 64, 256, 1024, 4096)
MIN_POLYGONS = 8
MAX_POLYGONS = 1 << 20
# A cell is as tall as wide for about four sectors per ring; up to this factor off is accepted.
MAX_STRETCH = 4.0
# Ring j of R stands at (j/R)^0.7 of the rim's radius in the image. Equal spacing (exponent 1)
# wastes rings near the center, where cells are narrow anyway. Swept from 0.5 to 1.3 over five mesh
# sizes for the paper's mirror: 0.7 has the smallest mean error and 8 to 14 % less maximum.
RING_EXPONENT = 0.7


def sectors_and_rings(polygons: int) -> tuple[int, int]:
    """Split a polygon count into sectors around the axis and rings, as close to 4 : 1 as possible.

    The number of sectors is a multiple of four, so all four quadrants are equal. For 2ⁿ polygons
    with even n, the split is the paper's 2^(n/2+1) × 2^(n/2−1).

    Raises:
        OpticsError: the count has no such split; the message names the nearest counts that have
            one.
    """
    if not MIN_POLYGONS <= polygons <= MAX_POLYGONS:
        limits = f"{MIN_POLYGONS} to {MAX_POLYGONS}"
        raise OpticsError(f"mirror: expected {limits} polygons, got {polygons}")
    split = _best_split(polygons)
    if split is None:
        below = next(n for n in range(polygons - 1, 0, -1) if _best_split(n))
        above = next(n for n in range(polygons + 1, 2 * polygons) if _best_split(n))
        raise OpticsError(
            "mirror: expected polygons that make rings of equal sectors in four equal quadrants, "
            f"the nearest {below} and {above}, got {polygons}"
        )
    return split


def tessellate(mirror: HyperbolicMirror, polygons: int) -> MirrorMesh:
    """Tessellate a mirror: every vertex is on the surface, the last ring on the rim.

    Raises:
        OpticsError: see `sectors_and_rings`.
    """
    sectors, rings = sectors_and_rings(polygons)
    theta = _ring_angles_rad(mirror, rings)
    azimuth = np.arange(sectors) * (2.0 * math.pi / sectors)
    apex = np.array([[0.0, 0.0, mirror.vertex_height_m]])
    circles = mirror.surface_points(theta[:, None], azimuth[None, :]).positions_m
    vertices = np.concatenate((apex, circles.reshape(-1, 3)))
    # vertex 0 on the axis, and `rings` circles of `sectors` vertices
    here = np.arange(sectors, dtype=np.int64)
    following = (here + 1) % sectors
    fan = np.stack((np.zeros_like(here), 1 + here, 1 + following), axis=-1)
    inner = 1 + sectors * np.arange(rings - 1, dtype=np.int64)[:, None]
    outer = inner + sectors
    lower = np.stack((inner + here, outer + here, outer + following), axis=-1)
    upper = np.stack((inner + here, outer + following, inner + following), axis=-1)
    cells = np.stack((lower, upper), axis=2)  # the two triangles of a cell stay together
    triangles = np.concatenate((fan, cells.reshape(-1, 3)))
    normals = mirror.normals(vertices)
    return MirrorMesh(vertices, normals, triangles, polygons, sectors, rings)


def sector_triangles_m(mirror: HyperbolicMirror, sectors: int, rings: int) -> Floats:
    """Corners (2 rings − 1, 3, 3) of the triangles in the mesh's first sector, mirror frame.

    All sectors are equal up to a rotation about the axis.
    """
    theta = np.concatenate(([0.0], _ring_angles_rad(mirror, rings)))
    azimuth = np.array([0.0, 2.0 * math.pi / sectors])
    points = mirror.surface_points(theta[:, None], azimuth).positions_m
    inner, outer = points[:-1], points[1:]
    lower = np.stack((inner[:, 0], outer[:, 0], outer[:, 1]), axis=1)
    upper = np.stack((inner[:, 0], outer[:, 1], inner[:, 1]), axis=1)
    return np.concatenate((lower, upper[1:]))  # the cell at the vertex has no upper triangle


def _ring_angles_rad(mirror: HyperbolicMirror, rings: int) -> Floats:
    """Angles of incidence (rings,) of the rings; the last one is the rim's."""
    share = (np.arange(1, rings + 1) / rings) ** RING_EXPONENT
    theta = mirror.theta_from_tangent(share * mirror.tangent_from_theta(mirror.theta_max_rad))
    theta[-1] = mirror.theta_max_rad  # without rounding errors
    return theta


def _best_split(polygons: int) -> tuple[int, int] | None:
    splits = [
        (sectors, polygons // sectors)
        for rings in range(1, math.isqrt(4 * polygons) + 1)
        if polygons % rings == 0
        and (sectors := polygons // rings) % 4 == 0
        and sectors >= 8
        and 1.0 / MAX_STRETCH <= sectors / (4.0 * rings) <= MAX_STRETCH
    ]
    return min(splits, key=lambda split: abs(math.log(split[0] / (4.0 * split[1]))), default=None)


# Clipping of a mirror's mesh along the cube edges, for texture coordinates (Fig. 6).
#
# Within one cube face, projection from the effective viewpoint gives a polygon its texture
# coordinates. A polygon crossed by a cube edge belongs to two faces. It is clipped at the edge, and
# the new vertices are placed on the mirror in the same direction. Both neighbors of a clipped edge
# share the new vertex, so the mesh has no cracks.


RIG_FROM_MIRROR: Floats = RIG_FROM_OPTICAL_LOOKING_UP @ MIRROR_FROM_OPTICAL.T
# A vertex this close to a cube edge, relative to its distance, lies on it: the meridians at 45° do,
# up to rounding.
_ON_EDGE = 1e-12


def unfold(mirror: HyperbolicMirror, mesh: MirrorMesh) -> UnfoldedMirrorMesh:
    """Clip a mirror's mesh along the cube edges and compute its texture coordinates."""
    clipper = _Clipper(mirror, mesh.vertices_m)
    parts = [clipper.clip_to_face(face, mesh.triangles) for face in range(len(cube.FACE_NAMES))]
    positions = np.array(clipper.positions)
    vertices, coordinates, triangles, base = [], [], [], 0
    for face, corners in enumerate(parts):
        used, local = np.unique(corners, return_inverse=True)
        vertices.append(positions[used])
        tangents = cube.face_tangents(positions[used] @ RIG_FROM_MIRROR.T, face)
        inside = 0.5 + 0.5 * np.clip(tangents, -1.0, 1.0) / cube.CELL_TANGENT  # clip: rounding only
        coordinates.append(
            (inside + cube.LAYOUT_CELLS[face]) / (cube.LAYOUT_COLUMNS, cube.LAYOUT_ROWS)
        )
        triangles.append(local.reshape(-1, 3) + base)
        base += len(used)
    stacked, corners = np.concatenate(vertices), np.concatenate(triangles).astype(np.int64)
    normals = mirror.normals(stacked)
    return UnfoldedMirrorMesh(stacked, normals, np.concatenate(coordinates), corners)


class _Clipper:
    """Clips triangles to the cells of the cube faces, and shares new vertices."""

    def __init__(self, mirror: HyperbolicMirror, positions: Floats):
        self._mirror = mirror
        self.positions = list(positions)  # (3,) of each vertex in m, mirror frame, new ones last
        self._crossings: dict[tuple[int, int, tuple[float, ...]], int] = {}
        # signed distances (6 faces, n, 4 planes) in m from the planes; 0 on an edge
        planes = np.array([_edge_planes(face) for face in range(len(cube.FACE_NAMES))])
        distances = np.einsum("fpj,nj->fnp", planes, positions)
        near = np.abs(distances) <= _ON_EDGE * np.linalg.norm(positions, axis=1)[:, None]
        self._fixed = np.where(near, 0.0, distances)

    def clip_to_face(self, face: int, triangles: Ints) -> Ints:
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

    def _clip(self, polygon: list[int], plane: Floats) -> list[int]:
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

    def _side(self, vertex: int, plane: Floats) -> float:
        position = self.positions[vertex]
        distance = float(plane @ position)
        return 0.0 if abs(distance) <= _ON_EDGE * float(np.linalg.norm(position)) else distance

    def _crossing(self, one: int, other: int, plane: Floats) -> int:
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


def _edge_planes(face: int) -> Floats:
    """Normals (4, 3) in the mirror frame of the planes that bound a face, pointing inwards."""
    right, down, forward = cube.FACE_FROM_RIG[face]
    return np.array([forward - right, forward + right, forward - down, forward + down]) @ (
        RIG_FROM_MIRROR
    )


# Image distortion caused by a mirror's mesh, computed without rendering.
#
# A pixel that sees a point P of a flat triangle shows the direction from the effective viewpoint
# to P; the curved mirror shows that direction at another pixel. P, the pinhole and the effective
# viewpoint lie in a plane through the axis. The error is therefore radial: f |tan β(θ) − ρ/(c −
# z)| for P at distance ρ from the axis and height z, with the focal length f, the pinhole at
# height c, and β(θ) as in `hyperbolic.py`. The error is 0 at the mesh's vertices, does not change
# sign, and is largest near the middle of a cell.


# Sampling steps between two corners of a triangle: for the largest error, where the neighborhood of
# the largest sample is sampled again, and for means.
_STEPS, _FINE_STEPS = 16, 64
_MAX_RINGS = math.isqrt(MAX_POLYGONS // 4)


class MeshError(NamedTuple):
    """Distance in pixels between a direction's images in the mesh and in the mirror."""

    mean_px: float
    percentile_95_px: float
    max_px: float


class Annulus(NamedTuple):
    """Part of the mirror's image between two circles; radii as tangents of the angle β."""

    inner: float
    outer: float


WHOLE_MIRROR = Annulus(0.0, math.inf)


def mesh_error(mirror: HyperbolicMirror, polygons: int, rim_radius_px: float) -> MeshError:
    """Error of a mirror's mesh over its image area; the rim has a radius of `rim_radius_px`.

    Raises:
        OpticsError: see `sectors_and_rings`.
    """
    focal_length_px = rim_radius_px / _rim_tangent(mirror)
    corners = _sector(mirror, *sectors_and_rings(polygons))
    lattice, shares = _lattice(_FINE_STEPS)
    errors_px = focal_length_px * _sample(mirror, corners, lattice)[0]
    # areas in the image, in squared tangents at the pinhole
    seen = corners[..., :2] / (1.0 - corners[..., 2:])
    (x1, y1), (x2, y2) = (seen[:, 1] - seen[:, 0]).T, (seen[:, 2] - seen[:, 0]).T
    weights = (0.5 * np.abs(x1 * y2 - x2 * y1))[:, None] * shares
    order = np.argsort(errors_px, axis=None)
    share = np.cumsum(weights.ravel()[order]) / weights.sum()
    percentile_95_px = errors_px.ravel()[order][np.searchsorted(share, 0.95)]
    mean_px = np.average(errors_px, weights=weights)
    return MeshError(float(mean_px), float(percentile_95_px), float(errors_px.max()))


def largest_error(
    mirror: HyperbolicMirror, sectors: int, rings: int, annulus: Annulus = WHOLE_MIRROR
) -> float:
    """Largest error of a mesh within a part of the image, in tangents at the pinhole.

    The mesh's straight edges lie inside the round rim; that gap counts as an error, too. `sectors`
    and `rings` are its polygons around the axis, and from the apex to the rim.
    """
    corners = _sector(mirror, sectors, rings)
    lattice, _ = _lattice(_STEPS)
    errors, radii = _sample(mirror, corners, lattice)
    is_shown = (radii.max(axis=1) >= annulus.inner) & (radii.min(axis=1) <= annulus.outer)
    peaks = np.where(is_shown, errors.max(axis=1), 0.0)
    high = np.flatnonzero(peaks > 0.9 * peaks.max())  # candidates for the largest error
    around = lattice[errors[high].argmax(axis=1)][:, None]
    near = np.maximum(around + 3.0 / _STEPS * (lattice - 1.0 / 3.0), 0.0)  # a step to each side
    near /= near.sum(axis=-1, keepdims=True)
    largest = _sample(mirror, corners[high], near)[0].max(initial=0.0)
    rim = _rim_tangent(mirror)
    lost = min(rim, annulus.outer) - rim * math.cos(math.pi / sectors)
    return max(float(largest), lost if rim > annulus.inner else 0.0)


def needed_polygons(
    mirror: HyperbolicMirror, max_error: float, annulus: Annulus = WHOLE_MIRROR
) -> int | None:
    """Smallest polygon count within an error bound, with four sectors per ring; None: too many.

    The tolerance is in tangents at the pinhole, pixels over the focal length, in an annulus.
    """

    def suffices(rings: int) -> bool:
        return largest_error(mirror, 4 * rings, rings, annulus) <= max_error

    return fewest_polygons(suffices, _MAX_RINGS)


def fewest_polygons(suffices: Callable[[int], bool], largest_rings: int) -> int | None:
    """Smallest polygon count, four sectors per ring, whose rings suffice; None: over the limit."""
    doubled = [2**n for n in range(1, largest_rings.bit_length())]
    enough = next(filter(suffices, doubled), None)
    if enough is None:
        return None
    candidates = range(enough // 2 + 1, enough)
    rings = candidates.start + bisect_left(candidates, True, key=suffices)
    return 4 * rings * rings


@lru_cache
def _lattice(steps: int) -> tuple[Floats, Floats]:
    """Barycentric points (n, 3) of a triangle, edges included, and their weights (n,) in a mean."""
    one, other = np.indices((steps + 1, steps + 1)).reshape(2, -1)
    counts = np.stack((one, other, steps - one - other), axis=-1)
    counts = counts[counts[:, 2] >= 0]
    meeting = np.array([6.0, 3.0, 1.0])[np.count_nonzero(counts == 0, axis=1)]
    return counts / steps, meeting / meeting.sum()  # by the lattice triangles that meet there


def _sector(mirror: HyperbolicMirror, sectors: int, rings: int) -> Floats:
    """Corners (triangles, 3, 3) of one sector, in units of c: the pinhole is at z = 1."""
    return sector_triangles_m(mirror, sectors, rings) / mirror.c_m


def _sample(mirror: HyperbolicMirror, corners: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Errors and radii in the image (triangles, samples), in tangents at the pinhole.

    The samples' barycentric coordinates are (samples, 3) or (triangles, samples, 3).
    """
    # evenly spaced in the image: perspective interpolation, as in a rasterizer
    weights = points / (1.0 - corners[:, None, :, 2])
    points = (weights @ corners) / weights.sum(axis=-1, keepdims=True)
    across = np.hypot(points[..., 0], points[..., 1])
    radii = across / (1.0 - points[..., 2])
    annulus = mirror.tangent_from_theta(np.arctan2(across, points[..., 2]))
    return np.abs(annulus - radii), radii


def _rim_tangent(mirror: HyperbolicMirror) -> float:
    return float(mirror.tangent_from_theta(mirror.theta_max_rad))
