"""Scene flow: motion of the points seen by an image's pixels, each with its surface.

Points are those of the hits, in the viewpoint frame: world axes, with the origin in the
effective viewpoint. Object 0 is the static scene, 1 the first dynamic object, and so on.
Source: Vedula et al., "Three-dimensional scene flow", 1999.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.ground_truth.hits import Hits
from omnisim.rendering.contract import ScenePoses

# Points per step: intermediate arrays stay in the cache, and BLAS stays on one thread. It runs
# larger products on threads that keep spinning and occupy cores afterwards.
POINTS_PER_BATCH = 1 << 14


def moved_from_current(current: ScenePoses, other: ScenePoses) -> NDArray[np.float64]:
    """Motions (objects, 4, 4) of the objects from one time to another, in the viewpoint frame."""
    viewpoint_m = current.world_from_rig[:3, 3]
    transforms = np.tile(np.eye(4), (1 + len(current.world_from_objects), 1, 1))
    for index, (before, then) in enumerate(
        zip(current.world_from_objects, other.world_from_objects, strict=True), start=1
    ):
        moved = then @ np.linalg.inv(before)
        transforms[index, :3, :3] = moved[:3, :3]
        # a point at the current viewpoint, minus that viewpoint
        transforms[index, :3, 3] = moved[:3, :3] @ viewpoint_m + (moved[:3, 3] - viewpoint_m)
    return transforms


def other_from_current(current: ScenePoses, other: ScenePoses) -> NDArray[np.float64]:
    """Transforms (objects, 3, 4) of each object's points to the viewpoint frame of another time."""
    transforms = moved_from_current(current, other)
    transforms[:, :3, 3] += current.world_from_rig[:3, 3] - other.world_from_rig[:3, 3]
    return transforms


def transform_points(
    points: NDArray[np.float64],
    objects: NDArray[np.intp] | None,
    transforms: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Transform each point by its object's matrix.

    Args:
        points: (n, 4), last component 1, or 0 for a direction.
        objects: (n,) object of each point; None: all on the static scene.
        transforms: (objects, 3, 4) matrices.

    Returns:
        Transformed points (n, 3).
    """
    moved: NDArray[np.float64] = points @ transforms[0].T
    if objects is not None:
        for index in np.unique(objects):
            on_it = np.flatnonzero(objects == index)
            moved[on_it] = points[on_it] @ transforms[index].T
    return moved


def scene_flow(
    hits: Hits, objects_of_draws: NDArray[np.intp], transforms: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Scene flow (height, width, 3) in meters; NaN: no hit.

    Args:
        hits: hits at the current pose.
        objects_of_draws: (n + 1,), see `HitSource.objects_of_draws`.
        transforms: (objects, 3, 4) from a point to its motion, see `in_world` and `in_optical`.
    """
    points = hits.points_and_ranges_m.reshape(-1, 4)
    # float32 like the points; without a hit the range is infinite and makes the motion NaN
    matrices = np.zeros((len(transforms), 4, 3), dtype=np.float32)
    matrices[:, :3] = np.swapaxes(transforms[:, :, :3], 1, 2)
    offsets = transforms[:, :, 3].astype(np.float32)
    flow = np.empty((len(points), 3), dtype=np.float32)
    draw_ids = hits.draw_ids.ravel()
    with np.errstate(invalid="ignore"):
        for first in range(0, len(points), POINTS_PER_BATCH):
            batch = slice(first, first + POINTS_PER_BATCH)
            flow[batch] = points[batch] @ matrices[0] + offsets[0]
            if len(transforms) == 1:
                continue
            objects = objects_of_draws.take(draw_ids[batch])
            for index in np.unique(objects[objects > 0]).tolist():
                on_it = np.flatnonzero(objects == index)
                flow[first + on_it] = points[batch][on_it] @ matrices[index] + offsets[index]
    return flow.reshape(hits.points_m.shape)


def in_world(current: ScenePoses, other: ScenePoses) -> NDArray[np.float64]:
    """Transforms (objects, 3, 4) from points to their motions along the world's axes.

    The static scene's transforms are exactly 0.
    """
    return moved_from_current(current, other)[:, :3] - np.eye(4)[:3]


def in_optical(
    current: ScenePoses, other: ScenePoses, rig_from_optical: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Transforms (objects, 3, 4) from points to their motions relative to the camera.

    A motion is the point in the other time's optical frame minus the point in the current one.
    """
    transforms = other_from_current(current, other)[:, :3]
    transforms = (other.world_from_rig[:3, :3] @ rig_from_optical).T @ transforms
    transforms[:, :, :3] -= (current.world_from_rig[:3, :3] @ rig_from_optical).T
    return transforms
