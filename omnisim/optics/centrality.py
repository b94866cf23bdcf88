"""Distance of a system's rays from one viewpoint, and the errors of a central model of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import Pixels
from omnisim.errors import OpticsError
from omnisim.optics.shapes.shape import Floats
from omnisim.optics.tracing import TracedRays

_SAMPLES = 10_000  # rays of a picture, more or less


class RaySource(Protocol):
    """The parts of an optical system that are measured."""

    @property
    def width_px(self) -> int: ...  # noqa: D102

    @property
    def height_px(self) -> int: ...  # noqa: D102

    def rays(self, pixels_px: ArrayLike) -> TracedRays:
        """Rays of pixels (..., 2)."""
        ...

    def pixel_from_ray(self, directions: ArrayLike) -> Pixels:
        """Pixels of directions (..., 3)."""
        ...


class CentralError(NamedTuple):
    """Error of a central model for points at one distance."""

    distance_m: float
    median_px: float
    percentile_99_px: float
    max_px: float
    left_out: float  # share of the rays whose point the central model shows nowhere


@dataclass(frozen=True)
class Centrality:
    """Rays of a system against one viewpoint.

    Attributes:
        viewpoint_m: (3,) point nearest to all rays, in the sensor's optical frame.
        misses_m: (n,) distances of rays from it, evenly over the picture.
        errors: of the central model that has the rays' directions and that viewpoint.
    """

    viewpoint_m: Floats
    misses_m: Floats
    errors: tuple[CentralError, ...]


def common_point(origins_m: Floats, directions: Floats) -> Floats:
    """Point (3,) with the least squared distances from rays (n, 3).

    Rays that are all parallel have no such point, but the one nearest to their origins' mean.
    """
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    middle = origins_m.mean(axis=0)
    pull = np.einsum("nij,nj->i", across, origins_m - middle)
    found: Floats = middle + np.linalg.lstsq(across.sum(axis=0), pull, rcond=1e-12)[0]
    return found


def measure_centrality(system: RaySource, distances_m: Sequence[float]) -> Centrality:
    """Measure how far a system is from one viewpoint.

    Args:
        system: to measure.
        distances_m: of points from the viewpoint.

    Raises:
        OpticsError: no pixel sees anything, or a distance that is not positive.
    """
    for distance_m in distances_m:
        if not 0.0 < distance_m <= 1e9:
            raise OpticsError(f"at_distance: expected more than 0 and finite, got {distance_m:g}")
    pixels = _pixels(system)
    rays = system.rays(pixels)
    pixels, origins_m, directions = (x[rays.valid] for x in (pixels, *rays[:2]))
    if len(pixels) == 0:
        raise OpticsError("optics: expected a pixel that sees something, got none")
    viewpoint_m = common_point(origins_m, directions)
    toward = viewpoint_m - origins_m
    along = np.einsum("nj,nj->n", toward, directions)
    misses_m = np.linalg.norm(toward - along[:, None] * directions, axis=1)
    errors = tuple(
        _error(system, pixels, toward, along, directions, distance_m) for distance_m in distances_m
    )
    return Centrality(viewpoint_m, misses_m, errors)


def _error(
    system: RaySource,
    pixels: Floats,
    toward: Floats,
    along: Floats,
    directions: Floats,
    distance_m: float,
) -> CentralError:
    """Error of the central model: where it shows the point of a ray at a distance, against where
    the ray is."""  # fmt: skip
    squared = np.einsum("nj,nj->n", toward, toward)
    reach = along * along - squared + distance_m**2  # of the sphere about the viewpoint
    lengths = along + np.sqrt(np.maximum(reach, 0.0))
    seen = system.pixel_from_ray(lengths[:, None] * directions - toward)
    valid: NDArray[np.bool_] = seen.valid & (reach >= 0.0) & (lengths > 0.0)
    errors_px = np.linalg.norm(seen.positions_px - pixels, axis=1)[valid]
    if len(errors_px) == 0:
        return CentralError(distance_m, np.nan, np.nan, np.nan, 1.0)
    median, high = np.percentile(errors_px, (50.0, 99.0))
    most = float(errors_px.max())
    return CentralError(distance_m, float(median), float(high), most, float(1.0 - valid.mean()))


def _pixels(system: RaySource) -> Floats:
    """Positions (n, 2) evenly over the picture, to the middles of its outermost pixels."""
    step = max(1.0, np.sqrt(system.width_px * system.height_px / _SAMPLES))
    sides = [
        np.linspace(0.0, size - 1.0, int(np.ceil(size / step)))
        for size in (system.width_px, system.height_px)
    ]
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
