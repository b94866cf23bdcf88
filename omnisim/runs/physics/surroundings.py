"""Surroundings of robots' paths in physics: static pieces and objects."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import TrajectoryError
from omnisim.runs.physics.convex_pieces import ConvexPiece, Region, convex_pieces, hull_of
from omnisim.runs.physics.driver import Driver
from omnisim.runs.physics.world_model import SolidObject
from omnisim.scene import Scene
from omnisim.scene.model import DynamicObject
from omnisim.scene.motion.object_motion import FreeBody

# Reach within which the scene collides: around the path, in addition to half of the robot's
# diagonal; and around free objects.
PATH_REACH_M, OBJECT_REACH_M = 1.0, 20.0
HEADROOM_M = 0.5  # reach above the robot
MAX_PIECES = 30_000  # about 0.4 ms per step


def solid_objects(scene: Scene) -> dict[str, SolidObject]:
    """Dynamic objects of a scene by name; free objects collide as their hulls.

    Raises:
        TrajectoryError: a free object is flat.
    """
    return {one.name: _solid(one) for one in scene.objects}


def static_pieces(
    scene: Scene, drivers: Collection[Driver], objects: Mapping[str, SolidObject]
) -> list[ConvexPiece]:
    """Pieces of a scene within reach of robots' trajectories and of free objects.

    Raises:
        TrajectoryError: too many pieces.
    """
    bounds = [_bounds(one) for one in drivers]
    low = np.min([lowest for lowest, _ in bounds], axis=0)
    high = np.max([highest for _, highest in bounds], axis=0)
    for one in objects.values():
        if one.mass_kg is not None:
            low = np.minimum(low, one.pose[:3, 3] - OBJECT_REACH_M)
            high = np.maximum(high, one.pose[:3, 3] + OBJECT_REACH_M)
    middles = [
        one.planned.positions_m
        + one.planned.world_from_base[:, :3, 2] * 2.0 * one.rover.wheel_radius_m
        for one in drivers
    ]
    pieces = convex_pieces(scene, Region(low, high, np.concatenate(middles)))
    if len(pieces) > MAX_PIECES:
        raise TrajectoryError(
            f"{scene.name}: expected at most {MAX_PIECES} convex pieces about the path with "
            f"--physics, got {len(pieces)}"
        )
    return pieces


def _bounds(driver: Driver) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners (3,) of the box within a robot's reach, lowest first."""
    size_m, places = driver.rover.size_m, driver.planned.positions_m
    reach_m = PATH_REACH_M + 0.5 * float(np.hypot(*size_m[:2]))
    top_m = float(size_m[2]) + HEADROOM_M
    return places.min(axis=0) - reach_m, places.max(axis=0) + (reach_m, reach_m, top_m)


def _solid(one: DynamicObject) -> SolidObject:
    pose = one.motion.pose_at(0.0)
    if not isinstance(one.motion, FreeBody):
        return SolidObject(convex_pieces(one.shape, Region.everywhere()), pose)
    hull = hull_of(one.shape)
    if hull is None:
        raise TrajectoryError(f"object {one.name!r}: expected a solid with mass_kg, got a flat one")
    return SolidObject([ConvexPiece(one.name, hull)], pose, one.motion.mass_kg)
