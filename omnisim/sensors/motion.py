"""Motion of a camera and of dynamic objects during an exposure, and of the picture."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from omnisim.cameras import CentralCamera
from omnisim.gpu.pipeline import ScenePoses
from omnisim.parameters import Number, Parameters
from omnisim.world import Pose

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

    def through(self, world_from_base: Pose) -> Callable[[float], Pose]:
        """Poses (4, 4) of this motion by seconds, at a pose (4, 4) at 0 s."""
        x, y, z = self.angular_radps
        rates = np.array(
            [
                [0.0, -z, y, self.linear_mps[0]],
                [z, 0.0, -x, self.linear_mps[1]],
                [-y, x, 0.0, self.linear_mps[2]],
                [0.0, 0.0, 0.0, 0.0],
            ]
        )

        def at(time_s: float) -> Pose:
            from scipy.linalg import expm  # slow to import; a shutter that takes no time never asks

            moved = expm(rates * time_s)
            moved[3] = (0.0, 0.0, 0.0, 1.0)  # only nearly so after a long way
            pose: Pose = world_from_base @ moved
            return pose

        return at


def moved_px(
    camera: CentralCamera,
    poses: Sequence[ScenePoses],
    object_corners_m: Sequence[NDArray[np.float64]] = (),
) -> float:
    """Largest motion in the picture along poses of the camera and the dynamic objects, in pixels.

    Args:
        camera: whose picture it is.
        poses: one after the other.
        object_corners_m: (8, 3) of the box around each dynamic object, in its own frame.
    """
    u = np.linspace(0.0, camera.width_px - 1.0, GRID)
    v = np.linspace(0.0, camera.height_px - 1.0, GRID)
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    rays = camera.ray_from_pixel(pixels)
    pixels, points_m = pixels[rays.valid], NEAREST_M * rays.directions[rays.valid]
    world_from_optical = [one.world_from_rig.copy() for one in poses]
    for pose in world_from_optical:
        pose[:3, :3] = pose[:3, :3] @ camera.rig_from_optical
    static_px = np.zeros(len(points_m))
    for before, after in itertools.pairwise(world_from_optical):
        seen = camera.pixel_from_ray(_moved(points_m, np.linalg.inv(after) @ before))
        static_px += np.where(seen.valid, np.linalg.norm(seen.positions_px - pixels, axis=-1), 0.0)
    largest_px = [static_px.max(initial=0.0)]
    for index, corners_m in enumerate(object_corners_m):
        seen_at = [
            camera.pixel_from_ray(
                _moved(corners_m, np.linalg.inv(pose) @ one.world_from_objects[index])
            )
            for pose, one in zip(world_from_optical, poses, strict=True)
        ]
        dynamic_px = np.zeros(len(corners_m))
        for first, second in itertools.pairwise(seen_at):
            step_px = np.linalg.norm(second.positions_px - first.positions_px, axis=-1)
            dynamic_px += np.where(first.valid & second.valid, step_px, 0.0)
        largest_px.append(dynamic_px.max(initial=0.0))
    return float(max(largest_px))


def _moved(
    points_m: NDArray[np.float64], target_from_source: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points (n, 3) in another frame."""
    moved: NDArray[np.float64] = points_m @ target_from_source[:3, :3].T + target_from_source[:3, 3]
    return moved
