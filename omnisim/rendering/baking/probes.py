"""Probes: light in free space, for dynamic objects."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.baking.atlas.atlas import camera_places_m
from omnisim.rendering.baking.atlas.bake_tiles import Arrays
from omnisim.rendering.baking.emitters import lamps_on
from omnisim.rendering.baking.gathering import Gatherer
from omnisim.rendering.baking.sampling import Floats, generator, sphere_directions, spread_points
from omnisim.rendering.baking.transport import INSIDE, SKY, PatchHits, Transport
from omnisim.scene.light.environment import factors_of_moments, spherical_harmonics
from omnisim.scene.model import Scene

PROBE_BUDGET = 16384
TILE = 1024
_MIN_SPACING_M, _MIN_SIZE_M = 0.25, 1e-3
# Extents around cameras: the first with a small enough spacing is taken, else the last.
_MAX_SPACING_M = 0.6
_AROUND_M = ((np.inf, np.inf), (32.0, 16.0), (16.0, 8.0), (8.0, 4.0))  # level, upwards
_RAYS = 256
_MAX_INSIDE = 0.25  # share of rays that hit backs
_PROBES = 2  # stage of random numbers


class ProbeGrid(NamedTuple):
    """Grid of probes in the world.

    Attributes:
        origin_m, spacing_m: (3,) first probe, and spacing of neighbors.
        shape: number of probes along x, y and z.
    """

    origin_m: NDArray[np.float64]
    spacing_m: NDArray[np.float64]
    shape: tuple[int, int, int]

    @property
    def size(self) -> int:
        """Number of probes."""
        return int(np.prod(self.shape))

    def positions_m(self, first: int, last: int) -> NDArray[np.float64]:
        """Positions (n, 3) of the probes from index `first` up to `last`, z fastest."""
        indices = np.stack(np.unravel_index(np.arange(first, last), self.shape), axis=1)
        return self.origin_m + indices * self.spacing_m


def probe_grid(scene: Scene) -> ProbeGrid:
    """Grid of probes within the bounds of the static surfaces, about `PROBE_BUDGET` or fewer.

    In a larger scene the grid surrounds the positions of cameras and vehicles.
    """
    low, high = scene.bounds_m()
    places = camera_places_m(scene)
    for level_m, upwards_m in _AROUND_M:
        around = np.array((level_m, level_m, upwards_m))
        first = np.maximum(low, places.min(axis=0) - around)
        last = np.minimum(high, places.max(axis=0) + around)
        spacing_m, shape = _spacing(last - first)
        if spacing_m <= _MAX_SPACING_M:
            break
    steps = np.maximum(last - first, _MIN_SIZE_M) / shape
    nx, ny, nz = (int(number) for number in shape)
    return ProbeGrid(first + 0.5 * steps, steps, (nx, ny, nz))


def _spacing(size_m: NDArray[np.float64]) -> tuple[float, NDArray[np.intp]]:
    """Spacing of a grid within the budget, and its number of probes per axis."""
    spacing_m = _MIN_SPACING_M
    while True:
        shape = np.maximum(np.ceil(size_m / spacing_m).astype(np.intp), 1)
        if shape.prod(dtype=np.float64) <= PROBE_BUDGET:  # would overflow as int64
            return spacing_m, shape
        spacing_m *= 1.05


class ProbeBaker:
    """Bakes probes with rays in all directions.

    Args:
        scene: scene with its lamps.
        transport: ray casting in the scene.
        gatherer: gatherer of sky light.
        seen: (p, 3) light leaving the patches.
        seed: seed of the random numbers.
    """

    def __init__(
        self,
        scene: Scene,
        transport: Transport,
        gatherer: Gatherer,
        seen: Floats,
        seed: int,
    ):
        self.grid = probe_grid(scene)
        self.tiles = -(-self.grid.size // TILE)
        self._lighting, self._transport, self._gatherer = scene.lighting, transport, gatherer
        self._seen, self._seed = seen, seed

    def bake(self, tile: int) -> Arrays:
        """Spherical harmonics (n, 9, 3) and validity (n,) of a tile's probes."""
        first, last = tile * TILE, min((tile + 1) * TILE, self.grid.size)
        positions = self.grid.positions_m(first, last) - self._transport.center_m
        origins = positions.astype(np.float32)
        shift = generator(self._seed, _PROBES, tile).random(2, dtype=np.float32)
        directions = sphere_directions((spread_points(_RAYS) + shift) % 1.0)
        moments = np.zeros((len(origins), 9, 3))
        inside = np.zeros(len(origins), dtype=np.intp)
        for direction, shares in zip(directions, spherical_harmonics(directions), strict=True):
            aims = np.broadcast_to(direction, origins.shape)
            hits = self._transport.cast(origins, np.ascontiguousarray(aims))
            inside += (hits.patches == INSIDE) | self._transport.is_back(hits)
            light = self._light(hits)
            moments += shares[:, None] * light[:, None]
        moments *= 4.0 * np.pi / _RAYS
        self._add_lamps(moments, origins)
        return {
            "sh": factors_of_moments(moments).astype(np.float32),
            "valid": inside <= _MAX_INSIDE * _RAYS,
        }

    def _light(self, hits: PatchHits) -> Floats:
        light = self._seen[np.maximum(hits.patches, 0)]
        light[hits.patches < 0] = 0.0
        free = np.flatnonzero(hits.patches == SKY)
        light[free] = self._gatherer.sky(hits.directions[free])
        return light * hits.shares

    def _add_lamps(self, moments: NDArray[np.float64], origins: Floats) -> None:
        """Add the light of lamps, each from a single direction."""
        for lamp in lamps_on(self._lighting, self._transport, origins):
            toward = np.broadcast_to(lamp.directions, origins.shape)
            light = np.pi * lamp.levels[:, None] * lamp.color
            moments += spherical_harmonics(toward)[:, :, None] * light[:, None]
