"""Distortion of the picture by a mirror's mesh, computed without rendering.

Each flat triangle shows the direction of its own point instead of the mirror's. Its points, the
pinhole and the effective viewpoint share a plane through the axis: the error is along the radius,
f |tan β(θ) − ρ/(c − z)| for a point at a distance ρ from the axis and a height z. It is 0 at the
vertices, of one sign, and largest near the middle of a cell.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.mirrors.hyperbolic import HyperbolicMirror
from omnisim.mirrors.tessellation import MAX_POLYGONS, sector_triangles_m, sectors_and_rings

# Steps of the samples between two corners of a triangle. 16: the largest sample is within 0.5 % of
# the largest error; 64: so is the mean, of meshes of any size, and the rest within 0.05 %.
_STEPS, _FINE_STEPS = 16, 64
_DOUBLED_RINGS = [2**n for n in range(1, 20) if 4 * 4**n <= MAX_POLYGONS]


class MeshError(NamedTuple):
    """Distance between where the mesh shows a direction and where the mirror would, in pixels."""

    mean_px: float
    percentile_95_px: float
    max_px: float


class Annulus(NamedTuple):
    """Part of the mirror's picture between two circles, in tangents at the pinhole."""

    inner: float
    outer: float


WHOLE_MIRROR = Annulus(0.0, math.inf)


def mesh_error(mirror: HyperbolicMirror, polygons: int, rim_radius_px: float) -> MeshError:
    """Error of a mesh, over its area, in a picture whose rim has a radius of `rim_radius_px`.

    Raises:
        OpticsError: see `sectors_and_rings`.
    """
    focal_length_px = rim_radius_px / _rim_tangent(mirror)
    samples = _sample(mirror, *sectors_and_rings(polygons), _FINE_STEPS)
    errors_px = focal_length_px * samples.errors
    weights = samples.areas[:, None] * _lattice(_FINE_STEPS).weights
    order = np.argsort(errors_px, axis=None)
    share = np.cumsum(weights.ravel()[order]) / weights.sum()
    percentile_95_px = errors_px.ravel()[order][np.searchsorted(share, 0.95)]
    mean_px = np.average(errors_px, weights=weights)
    return MeshError(float(mean_px), float(percentile_95_px), float(errors_px.max()))


def largest_error(
    mirror: HyperbolicMirror, sectors: int, rings: int, shown: Annulus = WHOLE_MIRROR
) -> float:
    """Largest error of a mesh in a part of the picture, in tangents at the pinhole.

    Its straight edges lie inside of the round rim: that distance is an error, too.
    """
    samples = _sample(mirror, sectors, rings, _STEPS)
    in_part = (samples.radii.max(axis=1) >= shown.inner) & (
        samples.radii.min(axis=1) <= shown.outer
    )
    rim = _rim_tangent(mirror)
    lost = min(rim, shown.outer) - rim * math.cos(math.pi / sectors) if rim > shown.inner else 0.0
    return max(float(samples.errors[in_part].max(initial=0.0)), lost)


def needed_polygons(
    mirror: HyperbolicMirror, max_error: float, shown: Annulus = WHOLE_MIRROR
) -> int | None:
    """Fewest polygons, four sectors a ring, that keep the largest error in bounds.

    Args:
        mirror: the mirror.
        max_error: in tangents at the pinhole: pixels over the focal length.
        shown: part of the mirror in the picture.

    Returns:
        None: no mesh of `MAX_POLYGONS` does.
    """

    def suffices(rings: int) -> bool:
        return largest_error(mirror, 4 * rings, rings, shown) <= max_error

    enough = next(filter(suffices, _DOUBLED_RINGS), None)
    if enough is None:
        return None
    candidates = range(enough // 2 + 1, enough)
    rings = candidates.start + bisect_left(candidates, True, key=suffices)
    return 4 * rings * rings


class _Samples(NamedTuple):
    """Samples of one sector's triangles, in tangents at the pinhole.

    Attributes:
        errors: (triangles, samples).
        radii: (triangles, samples) distances from the axis in the picture.
        areas: (triangles,) in the picture.
    """

    errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    areas: NDArray[np.float64]


class _Lattice(NamedTuple):
    """Samples all over a triangle, its edges too.

    Attributes:
        coordinates: (samples, 3), barycentric.
        weights: (samples,) in a mean: as many triangles of the lattice as meet there.
    """

    coordinates: NDArray[np.float64]
    weights: NDArray[np.float64]


@lru_cache
def _lattice(steps: int) -> _Lattice:
    one, other = np.indices((steps + 1, steps + 1)).reshape(2, -1)
    counts = np.stack((one, other, steps - one - other), axis=-1)
    counts = counts[counts[:, 2] >= 0]
    meeting = np.array([6.0, 3.0, 1.0])[np.count_nonzero(counts == 0, axis=1)]
    return _Lattice(counts / steps, meeting / meeting.sum())


def _sample(mirror: HyperbolicMirror, sectors: int, rings: int, steps: int) -> _Samples:
    corners = sector_triangles_m(mirror, sectors, rings) / mirror.c_m
    depths = 1.0 - corners[..., 2]  # from the pinhole
    seen = corners[..., :2] / depths[..., None]
    # evenly in the picture: perspective interpolation, as rasterizers do it
    weights = _lattice(steps).coordinates / depths[:, None, :]
    points = (weights @ corners) / weights.sum(axis=-1, keepdims=True)
    across = np.hypot(points[..., 0], points[..., 1])
    radii = across / (1.0 - points[..., 2])
    shown = mirror.tangent_from_theta(np.arctan2(across, points[..., 2]))
    (x1, y1), (x2, y2) = (seen[:, 1] - seen[:, 0]).T, (seen[:, 2] - seen[:, 0]).T
    return _Samples(np.abs(shown - radii), radii, 0.5 * np.abs(x1 * y2 - x2 * y1))


def _rim_tangent(mirror: HyperbolicMirror) -> float:
    return float(mirror.tangent_from_theta(mirror.theta_max_rad))
