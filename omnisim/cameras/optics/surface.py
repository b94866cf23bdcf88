"""Surfaces of an optical system, obstacles before them, and sequential ray tracing through both."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Annotated, Literal, NamedTuple

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import CameraParameters, ParameterValue
from omnisim.cameras.optics.shapes import Shape
from omnisim.core.arrays import Bools, Bytes, Floats
from omnisim.core.errors import OpticsError, did_you_mean
from omnisim.core.files.parameters import (
    NOT_IN_FILES,
    Coordinate,
    Length,
    Number,
    Parameters,
    described,
)
from omnisim.core.poses import check_pose

Place = tuple[Coordinate, Coordinate, Coordinate]
_SHARE_OFF = 1e-9  # offset of a ray from the surface that it leaves, relative to the ray's scale


class SurfaceHits(NamedTuple):
    """First hits of rays on a surface."""

    lengths_m: Floats  # (n,), NaN without a hit
    beyond_rim: Bools  # (n,): the ray hits the shape, but beyond the surface's rim


@dataclass(frozen=True, eq=False)
class Surface:
    """A mirror, or the boundary between two media.

    Attributes:
        shape: shape, in the surface's own frame.
        system_from_surface: (4, 4) pose of that frame.

    Raises:
        OmnisimError: the pose is invalid, the hole leaves nothing of the surface, or a rim is
            missing that the shape needs.
    """

    shape: Shape
    system_from_surface: Floats = field(default_factory=lambda: np.eye(4), metadata=NOT_IN_FILES)
    rim_radius_m: Length = math.inf
    """Radius of its rim in meters; default: the extent of its shape."""
    rim_center_m: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    """(x, y) of the rim's center relative to the axis, in meters."""
    hole_radius_m: Annotated[Number, Field(ge=0.0, le=1e3)] = 0.0
    """Radius of a hole about its axis in meters."""
    medium: Medium | None = None
    """Medium behind it, seen from the camera; default: none, a mirror."""
    name: str = "surface"
    """Name in messages; default: the name of its shape."""

    def __post_init__(self) -> None:
        check_pose(self.system_from_surface)
        if self.shape.needs_rim and math.isinf(self.rim_radius_m):
            raise OpticsError(f"{self.name}: rim_radius_m: missing")
        if not 0.0 <= self.hole_radius_m < self.rim_radius_m:  # also rejects NaN
            raise OpticsError(
                f"{self.name}: hole_radius_m: expected 0 or more, and less than rim_radius_m = "
                f"{self.rim_radius_m:g}, got {self.hole_radius_m:g}"
            )

    @property
    def is_mirror(self) -> bool:
        """True if it reflects, False if it refracts."""
        return self.medium is None

    @property
    def visible_radius_m(self) -> float:
        """Radius about the axis that contains the whole surface; may be infinite."""
        reach_m = self.rim_radius_m + math.hypot(*self.rim_center_m)
        return min(reach_m, self.shape.domain_m)

    def may_return(self, origins_m: Floats, directions: Floats) -> Bools:
        """Mask (n,) of rays from surface points (n, 3) that may hit it again, system frame."""
        if self._is_convex:  # only rays that leave it backwards
            normals = self.normals(origins_m)
            to_camera = np.einsum("nj,j->n", normals, self.system_from_surface[:3, 2]) < 0.0
            to_side_of_normal = np.einsum("nj,nj->n", normals, directions) > 0.0
            return to_camera != to_side_of_normal
        if self._is_rising:
            along = self.directions_from_system(directions)
            outward = np.sum(self.points_from_system(origins_m)[:, :2] * along[:, :2], axis=1)
            return (along[:, 2] > 0.0) | (outward < 0.0)
        return np.ones(len(origins_m), dtype=np.bool_)

    @cached_property
    def _is_convex(self) -> bool:
        return self.shape.is_convex(self.visible_radius_m)

    @cached_property
    def _is_rising(self) -> bool:
        return self.shape.is_rising(self.visible_radius_m)

    def parameters(self) -> CameraParameters:
        """Keys and values in an optics file; a mirror has no medium."""
        shape, pose = self.shape.parameters(), pose_parameters(self.system_from_surface)
        parameters: CameraParameters = {"name": self.name, **shape, **pose}
        if math.isfinite(self.rim_radius_m):
            parameters["rim_radius_m"] = self.rim_radius_m
            parameters["rim_center_m"] = list(self.rim_center_m)
        if self.hole_radius_m > 0.0:
            parameters["hole_radius_m"] = self.hole_radius_m
        if self.medium is not None:
            parameters["medium"] = medium_parameter(self.medium)
        return parameters

    def points_from_system(self, points_m: Floats) -> Floats:
        """Points (n, 3) in the surface's frame, from the system frame."""
        moved = points_m - self.system_from_surface[:3, 3]
        return np.einsum("nj,ji->ni", moved, self.system_from_surface[:3, :3])

    def directions_from_system(self, directions: Floats) -> Floats:
        """Directions (n, 3) in the surface's frame, from the system frame."""
        return np.einsum("nj,ji->ni", directions, self.system_from_surface[:3, :3])

    def directions_to_system(self, directions: Floats) -> Floats:
        """Directions (n, 3) in the system frame, from the surface's frame."""
        return np.einsum("nj,ij->ni", directions, self.system_from_surface[:3, :3])

    def hits(self, origins_m: Floats, directions: Floats, leaving: bool = False) -> SurfaceHits:
        """First hits of rays (n, 3), system frame, inside the rim; `leaving`: they start here."""
        origins = self.points_from_system(origins_m)
        along = self.directions_from_system(directions)
        lengths = self.shape.intersections(origins, along, self.visible_radius_m)
        scale = np.linalg.norm(origins, axis=1) if leaving else np.zeros(len(origins))
        ahead = lengths > (_SHARE_OFF * scale)[:, None]
        lengths = np.where(ahead, lengths, np.nan)
        inside = np.zeros(lengths.shape, dtype=np.bool_)
        x, y = self.rim_center_m
        hole_m = max(self.hole_radius_m, self.shape.tip_radius_m)
        for column in range(lengths.shape[1]):
            points = origins + lengths[:, column, None] * along
            inside[:, column] = np.hypot(points[:, 0] - x, points[:, 1] - y) <= self.rim_radius_m
            if hole_m > 0.0:
                inside[:, column] &= np.hypot(points[:, 0], points[:, 1]) >= hole_m
        first = inside.argmax(axis=1)
        rows = np.arange(len(lengths))
        first_m = np.where(inside[rows, first], lengths[rows, first], np.nan)
        return SurfaceHits(first_m, np.isnan(first_m) & ahead.any(axis=1))

    def normals(self, points_m: Floats) -> Floats:
        """Unit normals (n, 3) at points on the surface, system frame."""
        gradients = self.shape.level(self.points_from_system(points_m)).gradients
        lengths = np.linalg.norm(gradients, axis=1, keepdims=True)
        unit = np.divide(gradients, lengths, out=np.zeros_like(gradients), where=lengths > 0.0)
        return self.directions_to_system(unit)


def pose_parameters(pose: Floats) -> CameraParameters:
    """Key and value of a pose (4, 4) in an optics file; only its position if it is not rotated."""
    if np.array_equal(pose[:3, :3], np.eye(3)):
        return {"position_m": pose[:3, 3].tolist()}
    return {"pose": pose.tolist()}


@dataclass(frozen=True)
class Rod(Parameters, name="obstacle"):
    """Opaque cylinder in the path of rays: a stem, a needle, or the camera's own body."""

    begin_m: Place
    """Center of one end, meters in the system's frame."""
    end_m: Place
    """Center of the other end."""
    radius_m: Length
    """Radius in meters."""
    name: str = "obstacle"
    """Name in messages."""

    def _check(self) -> None:
        if self.begin_m == self.end_m:
            raise self._error("end_m", "a point other than begin_m")

    def parameters(self) -> CameraParameters:
        """Keys and values in an optics file."""
        return {"name": self.name, **self.to_table(full=True)}

    def hits(self, origins_m: Floats, directions: Floats) -> Floats:
        """Lengths (n,) at which rays (n, 3) enter it; 0 if they start inside, NaN: never."""
        axis = np.subtract(self.end_m, self.begin_m)
        height_m = float(np.linalg.norm(axis))
        axis = axis / height_m
        offsets = origins_m - self.begin_m
        along, up = directions @ axis, offsets @ axis
        across = directions - along[:, None] * axis
        beside = offsets - up[:, None] * axis
        square = np.einsum("nj,nj->n", across, across)
        half = np.einsum("nj,nj->n", across, beside)
        rest = np.einsum("nj,nj->n", beside, beside) - self.radius_m**2
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(half * half - square * rest)
            sides = np.stack(((-half - root) / square, (-half + root) / square))
            endless = (square == 0.0) & (rest <= 0.0)
            sides = np.where(endless, np.array([[-np.inf], [np.inf]]), sides)
            ends = np.sort(np.stack((-up / along, (height_m - up) / along)), axis=0)
            level = (along == 0.0) & (up >= 0.0) & (up <= height_m)
            ends = np.where(level, np.array([[-np.inf], [np.inf]]), ends)
            enter = np.maximum(np.maximum(sides[0], ends[0]), 0.0)
            return np.where(enter <= np.minimum(sides[1], ends[1]), enter, np.nan)


# Sequential ray tracing from a camera through the surfaces of its optical system.


class Fate(IntEnum):
    """Result of tracing a ray from the camera."""

    SEEN = 0  # leaves the system
    OUTSIDE = 1  # the pixel is outside the camera's own domain
    MISSED = 2  # misses a surface
    RIM = 3  # passes outside a surface's rim, or through its hole
    TOTAL_REFLECTION = 4  # is totally reflected at a boundary
    SHADOWED = 5  # is blocked by a mirror, its rim or an obstacle


class TracedRays(NamedTuple):
    """Rays of pixels where they leave the system, in its frame."""

    origins_m: Floats  # (..., 3): on the last surface
    directions: Floats  # (..., 3), unit
    valid: Bools  # (...,)
    fates: Bytes  # (...,) values of `Fate`


class TracedPaths(NamedTuple):
    """Paths of rays through a system."""

    points_m: Floats  # (surfaces + 1, n, 3): the camera, and the hit on each surface
    directions: Floats  # (n, 3), unit: beyond the last surface
    fates: Bytes  # (n,) values of `Fate`


def trace(
    surfaces: Sequence[Surface],
    indices: Sequence[float],
    obstacles: Sequence[Rod],
    origins_m: Floats,
    directions: Floats,
    fates: Bytes,
    can_block: bool = True,
) -> TracedPaths:
    """Trace rays (n, 3), system frame, from a camera through surfaces, in the rays' order.

    Refractive indices (surfaces + 1) are between the surfaces. Rays with another fate (n,) than
    SEEN are not traced, and get NaN points. If they can, mirrors and obstacles block rays.
    """
    points = np.full((len(surfaces) + 1, len(origins_m), 3), np.nan)
    points[0] = origins_m
    along, fates = directions.copy(), fates.copy()
    for number, surface in enumerate(surfaces):
        rows = np.flatnonzero(fates == Fate.SEEN)
        begin, toward = points[number, rows], along[rows]
        lengths, beyond_rim = surface.hits(begin, toward)
        hit = np.isfinite(lengths)
        fates[rows[~hit]] = np.where(beyond_rim[~hit], Fate.RIM, Fate.MISSED)
        rows, toward = rows[hit], toward[hit]
        at = begin[hit] + lengths[hit, None] * toward
        if can_block:
            blocked = _blocked(surfaces, obstacles, number, begin[hit], toward, lengths[hit])
            fates[rows[blocked]] = Fate.SHADOWED
        points[number + 1, rows] = at
        ratio = indices[number] / indices[number + 1]
        along[rows] = deflected(surface.normals(at), toward, surface.is_mirror, ratio)
        fates[rows[np.isnan(along[rows, 0])]] = Fate.TOTAL_REFLECTION
    if not can_block:
        return TracedPaths(points, along, fates)
    rows = np.flatnonzero(fates == Fate.SEEN)
    endless = np.full(len(rows), np.inf)
    number = len(surfaces)
    blocked = _blocked(surfaces, obstacles, number, points[number, rows], along[rows], endless)
    fates[rows[blocked]] = Fate.SHADOWED
    return TracedPaths(points, along, fates)


def deflected(normals: Floats, directions: Floats, is_mirror: bool, ratio: float = 1.0) -> Floats:
    """Directions (n, 3) beyond a surface, by those before it and its unit normals (n, 3).

    A boundary refracts by `ratio`, the refractive index before it over that beyond it; NaN where it
    reflects totally.
    """
    along = np.einsum("nj,nj->n", directions, normals)[:, None]
    outgoing: Floats
    if is_mirror:
        outgoing = directions - 2.0 * along * normals
    else:
        normals = np.where(along > 0.0, normals, -normals)
        cosine = np.abs(along)
        squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
        root = np.sqrt(np.where(squared >= 0.0, squared, np.nan))
        outgoing = ratio * directions + (root - ratio * cosine) * normals
    outgoing /= np.linalg.norm(outgoing, axis=1, keepdims=True)
    return outgoing


def _blocked(
    surfaces: Sequence[Surface],
    obstacles: Sequence[Rod],
    number: int,
    origins_m: Floats,
    directions: Floats,
    lengths_m: Floats,
) -> Bools:
    """Mask (n,) of path segments to surface `number` that are blocked."""
    blocked = np.zeros(len(origins_m), dtype=np.bool_)
    ends_m = np.where(np.isfinite(lengths_m), (1.0 - 1e-9) * lengths_m, np.inf)
    for obstacle in obstacles:
        blocked |= obstacle.hits(origins_m, directions) < ends_m
    for other, surface in enumerate(surfaces):
        if not surface.is_mirror or other == number:
            continue
        leaving = other == number - 1
        rows = np.arange(len(origins_m))
        if leaving:
            rows = np.flatnonzero(surface.may_return(origins_m, directions))
        hits = surface.hits(origins_m[rows], directions[rows], leaving)
        blocked[rows] |= hits.lengths_m < ends_m[rows]
    return blocked


# Refractive indices of media.


MAX_INDEX = 5.0
Primary = Literal["R", "G", "B"]
Index = Annotated[float, Field(strict=True, ge=1.0, le=MAX_INDEX)]
Medium = Annotated[
    Literal["vacuum", "air", "water", "acrylic", "glass"] | Index | tuple[Index, Index, Index],
    described(
        "vacuum, air, water, acrylic, glass, a refractive index from 1 to 5, or those of R, G and B"
    ),
]

# Vacuum wavelengths: helium's d line, for which catalogs state indices, and the dominant
# wavelengths of sRGB's primaries.
D_LINE_UM = 0.58756
WAVELENGTHS_UM: Mapping[Primary, float] = {"R": 0.6114, "G": 0.5491, "B": 0.4642}


def _sellmeier(*terms: tuple[float, float]) -> Callable[[float], float]:
    """Index by wavelength in µm: n² = 1 + Σ bλ²/(λ² − c), with terms (b, c)."""

    def index(wavelength_um: float) -> float:
        squared = wavelength_um**2
        return math.sqrt(1.0 + sum(b * squared / (squared - c) for b, c in terms))

    return index


def _air(wavelength_um: float) -> float:
    """Index of standard air at 15 °C. Source: Ciddor, Applied Optics 35 (1996)."""
    wavenumber = wavelength_um**-2
    return 1.0 + 0.05792105 / (238.0185 - wavenumber) + 0.00167917 / (57.362 - wavenumber)


def _acrylic(wavelength_um: float) -> float:
    """Index of PMMA. Source: Beadie, Brindza, Flynn et al., Applied Optics 54 (2015)."""
    x = wavelength_um**2
    inverse = 2.3678e-2 / x - 4.2137e-3 / x**2 + 7.3417e-4 / x**3 - 4.5042e-5 / x**4
    return math.sqrt(2.1778 + 6.1209e-3 * x - 1.5004e-3 * x**2 + inverse)


MEDIA: Mapping[str, Callable[[float], float]] = {
    "vacuum": lambda wavelength_um: 1.0,
    "air": _air,
    # fresh, 20 °C: Daimon & Masumura, Applied Optics 46 (2007)
    "water": _sellmeier(
        (0.5684027565, 5.101829712e-3),
        (0.1726177391, 1.821153936e-2),
        (0.02086189578, 2.620722293e-2),
        (0.1130748688, 10.69792721),
    ),
    "acrylic": _acrylic,
    # SCHOTT N-BK7, data sheet
    "glass": _sellmeier(
        (1.03961212, 0.00600069867), (0.231792344, 0.0200179144), (1.01046945, 103.560653)
    ),
}


def refractive_index(medium: Medium, color: Primary | None = None) -> float:
    """Refractive index of a medium: a name in `MEDIA`, an index, or indices for R, G and B.

    The color is "R", "G" or "B"; None: the index at the d line, or that for G of three.

    Raises:
        OpticsError: a medium or color is unknown, or an index is impossible.
    """
    if color is not None and color not in WAVELENGTHS_UM:
        raise OpticsError(f"color: expected R, G or B, got {color!r}")
    if isinstance(medium, tuple):
        if len(medium) != len(WAVELENGTHS_UM):
            raise OpticsError(f"medium: expected indices of R, G and B, got {len(medium)}")
        medium = medium[list(WAVELENGTHS_UM).index(color or "G")]
    if not isinstance(medium, str):
        if not 1.0 <= medium <= MAX_INDEX:
            raise OpticsError(f"medium: expected an index of 1 to {MAX_INDEX:g}, got {medium}")
        return medium
    if medium not in MEDIA:
        raise OpticsError(f"medium {medium!r}: {did_you_mean(medium, MEDIA)}")
    return MEDIA[medium](D_LINE_UM if color is None else WAVELENGTHS_UM[color])


def medium_parameter(medium: Medium) -> ParameterValue:
    """Medium as written in optics files."""
    return list(medium) if isinstance(medium, tuple) else medium
