"""Ranges of a scanner's beams, by ray casting."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from omnisim.core.world import ObjectPart
from omnisim.ground_truth.lidar_beams import EchoLimits
from omnisim.rendering.rays.caster import Rays
from omnisim.rendering.rays.echoes import no_returns, replace_specular
from omnisim.rendering.rays.embree import NO_TRIANGLE
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene


class Beams:
    """Casts the beams of a scanner into a scene.

    Surfaces reflect on both sides. A beam passes through the holes of masked materials and through
    blended surfaces that hide less than half of what is behind them.

    Args:
        scene: scene to cast at, in its current state; earlier states are not kept.
        angles_rad: (n,) in the scanner's frame, counter-clockwise from its x axis.
        max_range_m: surfaces farther away are ignored; may be infinite.
        hidden: parts of dynamic objects that beams pass through.
        limits: limits of echoes behind glass and mirrors; None: beams end at them.
    """

    def __init__(
        self,
        scene: Callable[[], RayScene],
        angles_rad: NDArray[np.float64],
        max_range_m: float,
        hidden: frozenset[ObjectPart],
        limits: EchoLimits | None = None,
    ):
        self._scene, self._max_range_m, self._hidden = scene, max_range_m, hidden
        self._limits = limits
        flat = np.zeros_like(angles_rad)
        self._directions = np.stack((np.cos(angles_rad), np.sin(angles_rad), flat), axis=1)

    def refresh(self) -> None:
        """Do nothing: each cast uses the current scene."""

    def cast(
        self,
        world_from_scanner: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> NDArray[np.float64]:
        """Ranges (n,) in meters from a pose (4, 4), with objects at their poses; +inf: no hit."""
        scene, count = self._scene(), len(self._directions)
        rays = Rays(
            np.tile(world_from_scanner[:3, 3], (count, 1)),
            np.einsum("nj,ij->ni", self._directions, world_from_scanner[:3, :3]),
            np.zeros(count),
            np.full(count, self._max_range_m),
        )
        objects = ObjectState(world_from_objects, self._hidden)
        hits = scene.first_hits(rays, objects, both_sides=True)
        returns = no_returns(1, count)
        hit = np.flatnonzero(hits.triangles != NO_TRIANGLE)
        exact = scene.caster.exact(rays.take(hit), hits.take(hit), world_from_objects)
        returns.ranges_m[0, hit] = exact.ranges_m
        returns.surfaces_plus_one[0, hit] = scene.shading.surfaces(exact) + 1
        if self._limits is not None and scene.shading.is_specular.any():
            replace_specular(returns, scene, rays, objects, self._limits)
        return returns.ranges_m[0]
