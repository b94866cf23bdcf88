"""Beams of a spinning lidar, the slices of its revolution, and what its beams hit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class LidarBeams(NamedTuple):
    """Directions of a lidar's beams.

    Attributes:
        elevations_rad: (rings,), rising.
        azimuths_rad: (firings,), falling evenly from π by a whole turn.
        max_range_m: surfaces farther away need not be found.
    """

    elevations_rad: NDArray[np.float64]
    azimuths_rad: NDArray[np.float64]
    max_range_m: float

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit directions (rings, firings, 3) in the lidar's frame."""
        elevations, azimuths = self.elevations_rad[:, None], self.azimuths_rad[None]
        level = np.cos(elevations)
        x, y = level * np.cos(azimuths), level * np.sin(azimuths)
        return np.stack(np.broadcast_arrays(x, y, np.sin(elevations)), axis=-1)


class LidarPoses(NamedTuple):
    """Poses of a lidar and of all that moves, at one time.

    Attributes:
        world_from_lidar: (4, 4).
        world_from_objects: (4, 4) each, in the order of the stage's objects.
    """

    world_from_lidar: NDArray[np.float64]
    world_from_objects: Sequence[NDArray[np.float64]] = ()

    @property
    def origin_m(self) -> NDArray[np.float64]:
        """Origin of the beams (3,), world."""
        return self.world_from_lidar[:3, 3]


@dataclass(frozen=True, eq=False)
class Slice:
    """Part of a revolution; in it all points of the world move straight and evenly.

    Attributes:
        first, last: firings; `last` is the first one of the next slice.
        start, middle, end: poses.
    """

    first: int
    last: int
    start: LidarPoses
    middle: LidarPoses
    end: LidarPoses

    @property
    def path_m(self) -> NDArray[np.float64]:
        """Motion (3,) of the lidar's origin from start to end, world."""
        return self.end.origin_m - self.start.origin_m


class Revolution(NamedTuple):
    """Motion of a lidar's revolution.

    Attributes:
        slices: of as many firings each; the last may have fewer.
        shares: (firings,) of its slice that has passed at each firing.
        rotations: (firings, 3, 3) world_from_lidar at each firing.
    """

    slices: tuple[Slice, ...]
    shares: NDArray[np.float64]
    rotations: NDArray[np.float64]


class BeamHits(NamedTuple):
    """Hits of all beams of a revolution."""

    ranges_m: NDArray[np.floating]  # (rings, firings); +inf: nothing is hit
    draw_ids: NDArray[np.uint32]  # (rings, firings), 1 + draw item; 0: nothing is hit
