"""Points of deforming surfaces at another time, by their position in the triangle hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.core.world import time_of
from omnisim.ground_truth.hits import Hits
from omnisim.rendering.contract import DeformingDraw, HitSource, ScenePoses

_MIN_AREA = 1e-300  # squared area below which a triangle is degenerate


def deformed_hits(
    source: HitSource, hits: Hits, current: ScenePoses, other: ScenePoses
) -> Hits | None:
    """Hits with points deformed as at another time, with objects and camera at the current poses.

    Rigid motion is applied separately. Ranges keep their current values.

    Args:
        source: source of the hits.
        hits: hits at the current poses.
        current, other: poses and times of the two images.

    Returns:
        Deformed hits; None: nothing deforms.
    """
    times_s = time_of(current.world_from_objects), time_of(other.world_from_objects)
    if not source.deforming or times_s[0] == times_s[1]:
        return None
    points = hits.points_and_ranges_m.copy()
    flat, draw_ids = points.reshape(-1, 4), hits.draw_ids.ravel()
    for draw, one in source.deforming.items():
        seen = np.flatnonzero(draw_ids == draw + 1)
        if len(seen):
            triangles = hits.triangles.ravel()[seen]
            viewpoint_from_mesh = _viewpoint_from_mesh(one, current)
            flat[seen, :3] = _deformed(
                flat[seen, :3].astype(np.float64), one, triangles, viewpoint_from_mesh, times_s
            )
    return hits._replace(points_and_ranges_m=points)


def _viewpoint_from_mesh(one: DeformingDraw, poses: ScenePoses) -> NDArray[np.float64]:
    matrix = one.object_from_mesh.copy()
    if one.object_index is not None:
        matrix = poses.world_from_objects[one.object_index] @ matrix
    matrix[:3, 3] -= poses.world_from_rig[:3, 3]
    return matrix


def _deformed(
    points_m: NDArray[np.float64],
    one: DeformingDraw,
    triangles: NDArray[np.uint32],
    viewpoint_from_mesh: NDArray[np.float64],
    times_s: tuple[float, float],
) -> NDArray[np.float64]:
    """Points (n, 3) on triangles (n,) of a mesh, moved from its shape at one time to another."""
    deformation = one.mesh.deformation
    assert deformation is not None
    hit = one.mesh.triangles[triangles].astype(np.intp)
    used, corners = np.unique(hit, return_inverse=True)
    before, after = (
        (
            deformation.positions_at(time_s, used) @ viewpoint_from_mesh[:3, :3].T
            + viewpoint_from_mesh[:3, 3]
        )[corners.reshape(-1, 3)]
        for time_s in times_s
    )
    first, second = before[:, 1] - before[:, 0], before[:, 2] - before[:, 0]
    across = np.cross(first, second)
    squared = np.maximum(np.einsum("nc,nc->n", across, across), _MIN_AREA)
    inside = points_m - before[:, 0]
    of_second = np.einsum("nc,nc->n", np.cross(inside, second), across) / squared
    of_third = np.einsum("nc,nc->n", np.cross(first, inside), across) / squared
    return (
        after[:, 0]
        + of_second[:, None] * (after[:, 1] - after[:, 0])
        + of_third[:, None] * (after[:, 2] - after[:, 0])
    )
