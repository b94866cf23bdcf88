"""Surroundings of a robot's path, as physics has them: static pieces and objects."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from omnisim.errors import TrajectoryError
from omnisim.scene import Scene
from omnisim.scene.model import DynamicObject
from omnisim.scene.object_motion import FreeBody
from omnisim.simulation.physics.convex_pieces import ConvexPiece, Region, convex_pieces, hull_of
from omnisim.simulation.physics.rover import Rover
from omnisim.simulation.physics.world_model import SolidObject
from omnisim.trajectories import Trajectory

# Within which the scene collides: about the path, beside half of the robot's diagonal; and about
# objects that are free to move.
PATH_REACH_M, OBJECT_REACH_M = 1.0, 20.0
HEADROOM_M = 0.5  # above the robot
MOST_PIECES = 30_000  # some 0.4 ms a step


def solid_objects(scene: Scene) -> dict[str, SolidObject]:
    """Dynamic objects of a scene by name; those that are free to move collide as their hulls.

    Raises:
        TrajectoryError: a free one that is flat.
    """
    return {one.name: _solid(one) for one in scene.objects}


def static_pieces(
    scene: Scene, rover: Rover, planned: Trajectory, objects: Mapping[str, SolidObject]
) -> list[ConvexPiece]:
    """Pieces of a scene within reach of a planned trajectory and of the objects that are free.

    Raises:
        TrajectoryError: too many.
    """
    reach_m = PATH_REACH_M + 0.5 * float(np.hypot(*rover.size_m[:2]))
    places, top_m = planned.positions_m, float(rover.size_m[2]) + HEADROOM_M
    low, high = places.min(axis=0) - reach_m, places.max(axis=0) + (reach_m, reach_m, top_m)
    for one in objects.values():
        if one.mass_kg is not None:
            low = np.minimum(low, one.pose[:3, 3] - OBJECT_REACH_M)
            high = np.maximum(high, one.pose[:3, 3] + OBJECT_REACH_M)
    middles = places + planned.world_from_base[:, :3, 2] * 2.0 * rover.wheel_radius_m
    pieces = convex_pieces(scene, Region(low, high, middles))
    if len(pieces) > MOST_PIECES:
        raise TrajectoryError(
            f"{scene.name}: expected at most {MOST_PIECES} convex pieces about the path with "
            f"--physics, got {len(pieces)}"
        )
    return pieces


def _solid(one: DynamicObject) -> SolidObject:
    pose = one.motion.pose_at(0.0)
    if not isinstance(one.motion, FreeBody):
        return SolidObject(convex_pieces(one.shape, Region.everywhere()), pose)
    hull = hull_of(one.shape)
    if hull is None:
        raise TrajectoryError(f"object {one.name!r}: expected a solid with mass_kg, got a flat one")
    return SolidObject([ConvexPiece(one.name, hull)], pose, one.motion.mass_kg)
