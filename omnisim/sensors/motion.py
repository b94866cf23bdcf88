"""Motion of a camera during its exposure, and of its picture."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.cameras import CentralCamera
from omnisim.parameters import Number, Parameters

# Poses (4, 4) world_from_base, by seconds after the middle of the frame.
PoseFunction = Callable[[float], NDArray[np.float64]]
# Assumed distance of the nearest surface, as depth is not known before there is a picture. Nearer
# surfaces move by more from sub-frame to sub-frame.
NEAREST_M = 1.0
# Limits of a camera's motion; within them poses are exact to 1e-9 even through an hour's exposure.
MAX_MPS, MAX_RADPS = 1e4, 1e3
GRID = 13  # samples of the motion to a side of the picture


Speed = Annotated[Number, Field(ge=-MAX_MPS, le=MAX_MPS)]
TurnRate = Annotated[Number, Field(ge=-MAX_RADPS, le=MAX_RADPS)]


@dataclass(frozen=True)
class Twist(Parameters, name="twist"):
    """A constant velocity, linear and angular.

    Attributes:
        linear_mps: velocity of the base, in the base's own frame: x forward, y left, z up.
        angular_radps: turn rate about these axes; z counter-clockwise seen from above, to the left.

    Raises:
        OpticsError: a rate that is not finite, or beyond `MAX_MPS` or `MAX_RADPS`.
    """

    linear_mps: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    angular_radps: tuple[TurnRate, TurnRate, TurnRate] = (0.0, 0.0, 0.0)

    def through(self, world_from_base: NDArray[np.float64]) -> PoseFunction:
        """Pose function of this motion, at a pose (4, 4) in the middle of the frame."""
        x, y, z = self.angular_radps
        rates = np.array(
            [
                [0.0, -z, y, self.linear_mps[0]],
                [z, 0.0, -x, self.linear_mps[1]],
                [-y, x, 0.0, self.linear_mps[2]],
                [0.0, 0.0, 0.0, 0.0],
            ]
        )

        def at(time_s: float) -> NDArray[np.float64]:
            from scipy.linalg import expm  # slow to import; a shutter that takes no time never asks

            moved = expm(rates * time_s)
            moved[3] = (0.0, 0.0, 0.0, 1.0)  # only nearly so after a long way
            return world_from_base @ moved

        return at


def moved_px(camera: CentralCamera, world_from_optical: list[NDArray[np.float64]]) -> float:
    """Largest motion in the picture along poses (4, 4) of a camera, in pixels."""
    u = np.linspace(0.0, camera.width_px - 1.0, GRID)
    v = np.linspace(0.0, camera.height_px - 1.0, GRID)
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    rays = camera.ray_from_pixel(pixels)
    total = np.zeros(np.count_nonzero(rays.valid))
    for one, other in itertools.pairwise(world_from_optical):
        other_from_one = np.linalg.inv(other) @ one
        points = NEAREST_M * rays.directions[rays.valid] @ other_from_one[:3, :3].T
        seen = camera.pixel_from_ray(points + other_from_one[:3, 3])
        away = np.linalg.norm(seen.positions_px - pixels[rays.valid], axis=-1)
        total += np.where(seen.valid, away, 0.0)
    return float(np.max(total, initial=0.0))
