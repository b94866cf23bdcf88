"""How the camera moves while its picture is taken, and how far the picture moves with it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera
from omnisim.errors import OmnisimError

# From seconds after the middle of the frame to the pose (4, 4) world_from_base.
Motion = Callable[[float], NDArray[np.float64]]
# Nothing is nearer than this when it is told how far a picture moves: an assumption, as depth is
# not known before there is a picture. What is nearer moves by more from sub-frame to sub-frame.
NEAREST_M = 1.0
# Beyond these no camera moves; within them poses are exact to 1e-9 even through an hour's exposure.
FASTEST_MPS, FASTEST_RADPS = 1e4, 1e3
GRID = 13  # places to a side of the picture at which its motion is looked at


@dataclass(frozen=True)
class Twist:
    """A constant motion.

    Attributes:
        linear_mps: velocity of the base, in the base's own frame: x forward, y left, z up.
        angular_radps: turn rate about these axes; z counter-clockwise seen from above, to the left.

    Raises:
        OmnisimError: a rate that is not finite, or beyond `FASTEST_MPS` or `FASTEST_RADPS`.
    """

    linear_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name, most in (("linear_mps", FASTEST_MPS), ("angular_radps", FASTEST_RADPS)):
            value = getattr(self, name)
            if len(value) != 3 or not np.all(np.abs(value) <= most):  # false for NaN, too
                raise OmnisimError(
                    f"{name} = {value!r}: want three numbers from −{most:g} to {most:g}"
                )

    def through(self, world_from_base: NDArray[np.float64]) -> Motion:
        """The motion that is at a pose (4, 4) in the middle of the frame."""
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
            moved[3] = (0.0, 0.0, 0.0, 1.0)  # of long ways only nearly so
            return world_from_base @ moved

        return at


def moved_px(camera: CentralCamera, world_from_optical: list[NDArray[np.float64]]) -> float:
    """How far the picture of something moves at most, along poses (4, 4) of a camera."""
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
