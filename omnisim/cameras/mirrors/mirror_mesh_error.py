"""Image distortion caused by a mirror's mesh, computed without rendering.

A pixel that sees a point P of a flat triangle shows the direction from the effective viewpoint to
P; the curved mirror shows that direction at another pixel. P, the pinhole and the effective
viewpoint lie in a plane through the axis. The error is therefore radial: f |tan β(θ) − ρ/(c − z)|
for P at distance ρ from the axis and height z, with the focal length f, the pinhole at height c,
and β(θ) as in `hyperbolic.py`. The error is 0 at the mesh's vertices, does not change sign, and is
largest near the middle of a cell.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.mirrors.hyperbolic_mirror import HyperbolicMirror
from omnisim.cameras.mirrors.tessellation import MAX_POLYGONS, sector_triangles_m, sectors_and_rings

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
    lattice = _lattice(_FINE_STEPS)
    errors_px = focal_length_px * _sample(mirror, corners, lattice.coordinates).errors
    weights = _areas(corners)[:, None] * lattice.weights
    order = np.argsort(errors_px, axis=None)
    share = np.cumsum(weights.ravel()[order]) / weights.sum()
    percentile_95_px = errors_px.ravel()[order][np.searchsorted(share, 0.95)]
    mean_px = np.average(errors_px, weights=weights)
    return MeshError(float(mean_px), float(percentile_95_px), float(errors_px.max()))


def largest_error(
    mirror: HyperbolicMirror, sectors: int, rings: int, annulus: Annulus = WHOLE_MIRROR
) -> float:
    """Largest error of a mesh within a part of the image, in tangents at the pinhole.

    The mesh's straight edges lie inside the round rim; that gap counts as an error, too.

    Args:
        mirror: mirror shape.
        sectors, rings: polygons of the mesh around the axis, and from the apex to the rim.
        annulus: visible part of the mirror.
    """
    corners = _sector(mirror, sectors, rings)
    lattice = _lattice(_STEPS).coordinates
    samples = _sample(mirror, corners, lattice)
    is_shown = (samples.radii.max(axis=1) >= annulus.inner) & (
        samples.radii.min(axis=1) <= annulus.outer
    )
    peaks = np.where(is_shown, samples.errors.max(axis=1), 0.0)
    high = np.flatnonzero(peaks > 0.9 * peaks.max())  # candidates for the largest error
    around = lattice[samples.errors[high].argmax(axis=1)][:, None]
    near = np.maximum(around + 3.0 / _STEPS * (lattice - 1.0 / 3.0), 0.0)  # a step to each side
    near /= near.sum(axis=-1, keepdims=True)
    largest = _sample(mirror, corners[high], near).errors.max(initial=0.0)
    rim = _rim_tangent(mirror)
    lost = (
        min(rim, annulus.outer) - rim * math.cos(math.pi / sectors) if rim > annulus.inner else 0.0
    )
    return max(float(largest), lost)


def needed_polygons(
    mirror: HyperbolicMirror, max_error: float, annulus: Annulus = WHOLE_MIRROR
) -> int | None:
    """Smallest polygon count within an error bound, with four sectors per ring.

    Args:
        mirror: mirror shape.
        max_error: tolerance in tangents at the pinhole: pixels over the focal length.
        annulus: visible part of the mirror.

    Returns:
        Number of polygons, or None if `MAX_POLYGONS` are not enough.
    """

    def suffices(rings: int) -> bool:
        return largest_error(mirror, 4 * rings, rings, annulus) <= max_error

    return fewest_polygons(suffices, _MAX_RINGS)


def fewest_polygons(suffices: Callable[[int], bool], largest_rings: int) -> int | None:
    """Smallest polygon count, four sectors per ring, whose rings suffice; None if there is none.

    Args:
        suffices: True for a sufficient number of rings.
        largest_rings: limit of the number of rings.
    """
    doubled = [2**n for n in range(1, largest_rings.bit_length())]
    enough = next(filter(suffices, doubled), None)
    if enough is None:
        return None
    candidates = range(enough // 2 + 1, enough)
    rings = candidates.start + bisect_left(candidates, True, key=suffices)
    return 4 * rings * rings


class _Samples(NamedTuple):
    """Samples of triangles, in tangents at the pinhole.

    Attributes:
        errors: (triangles, samples).
        radii: (triangles, samples) distances from the axis in the image.
    """

    errors: NDArray[np.float64]
    radii: NDArray[np.float64]


class _Lattice(NamedTuple):
    """Sample points across a triangle, edges included.

    Attributes:
        coordinates: (samples, 3), barycentric.
        weights: (samples,) weights of a mean: the number of lattice triangles that meet at a
            sample.
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


def _sector(mirror: HyperbolicMirror, sectors: int, rings: int) -> NDArray[np.float64]:
    """Corners (triangles, 3, 3) of one sector, in units of c: the pinhole is at z = 1."""
    return sector_triangles_m(mirror, sectors, rings) / mirror.c_m


def _sample(
    mirror: HyperbolicMirror, corners: NDArray[np.float64], coordinates: NDArray[np.float64]
) -> _Samples:
    """Sample triangles at barycentric coordinates (samples, 3) or (triangles, samples, 3)."""
    # evenly spaced in the image: perspective interpolation, as in a rasterizer
    weights = coordinates / (1.0 - corners[:, None, :, 2])
    points = (weights @ corners) / weights.sum(axis=-1, keepdims=True)
    across = np.hypot(points[..., 0], points[..., 1])
    radii = across / (1.0 - points[..., 2])
    annulus = mirror.tangent_from_theta(np.arctan2(across, points[..., 2]))
    return _Samples(np.abs(annulus - radii), radii)


def _areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas (triangles,) of triangles in the image, in squared tangents at the pinhole."""
    seen = corners[..., :2] / (1.0 - corners[..., 2:])
    (x1, y1), (x2, y2) = (seen[:, 1] - seen[:, 0]).T, (seen[:, 2] - seen[:, 0]).T
    return 0.5 * np.abs(x1 * y2 - x2 * y1)


def _rim_tangent(mirror: HyperbolicMirror) -> float:
    return float(mirror.tangent_from_theta(mirror.theta_max_rad))
