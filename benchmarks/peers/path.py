"""Path of the race, equal for all renderers: through open space in any scene."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.peer import SENSOR
from omnisim.cameras import pixel_grid
from omnisim.rendering.stage import Stage

HEIGHT_M = 1.0  # of the camera above a path's ground
SHARE, FARTHEST_M = 0.7, 8.0  # of the free way ahead
YAW_STEP_DEG = 17.0  # from one pose to the next: no peer shall gain from aligned axes
# The way is free up to the nearest surface within these angles of its direction, to both sides
# and up and down; farther down is the ground.
BESIDE_DEG, ABOVE_DEG, LOOK_PX = 15.0, 5.0, 240


def race_poses(stage: Stage, count: int) -> NDArray[np.float64]:
    """Level poses (count, 4, 4) world_from_rig along the scene's first path.

    In a scene without paths: from the start along the longest free way.
    """
    scene = stage.scene
    if scene.paths:
        corners = np.array(scene.paths[0].waypoints_m)
        return np.array(
            [
                SENSOR.base_pose((*position_m, HEIGHT_M), yaw_deg=yaw_deg + YAW_STEP_DEG * step)
                for step, (position_m, yaw_deg) in enumerate(_along(corners, count))
            ]
        )
    start = np.array(scene.start.position_m)
    yaw_deg, reach_m = _free_way(stage)
    ahead = np.array([np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg)), 0.0])
    shares = np.linspace(0.0, 1.0, count)
    return np.array(
        [
            SENSOR.base_pose(start + share * reach_m * ahead, yaw_deg=yaw_deg + YAW_STEP_DEG * step)
            for step, share in enumerate(shares)
        ]
    )


def _along(corners: NDArray[np.float64], count: int) -> list[tuple[NDArray[np.float64], float]]:
    """Evenly spaced positions (2,) along corners (n, 2), and headings in degrees."""
    legs = np.diff(corners, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    ends = np.cumsum(lengths)
    positions = []
    for distance in (np.arange(count) + 0.5) * ends[-1] / count:
        leg = int(np.searchsorted(ends, distance))
        share = 1.0 - (ends[leg] - distance) / lengths[leg]
        heading = float(np.degrees(np.arctan2(legs[leg, 1], legs[leg, 0])))
        positions.append((corners[leg] + share * legs[leg], heading))
    return positions


def _free_way(stage: Stage) -> tuple[float, float]:
    """Heading in degrees, and length in m, of the longest free way from the scene's start."""
    sensor = SENSOR.resized(LOOK_PX)
    camera = sensor.model
    pose = sensor.base_pose(stage.scene.start.position_m)
    with stage.open(sensor) as renderer:
        ranges_m = renderer.render(pose, also=("range",)).channels["range"]
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    directions = rays.directions @ camera.rig_from_optical.T
    around = rays.valid & (np.abs(directions[..., 2]) < np.sin(np.radians(ABOVE_DEG)))
    azimuths = np.arctan2(directions[around][:, 1], directions[around][:, 0])
    headings = np.radians(np.arange(0.0, 360.0, 10.0))
    apart = np.abs((azimuths[:, None] - headings + np.pi) % (2.0 * np.pi) - np.pi)
    near = apart < np.radians(BESIDE_DEG)
    free_m = np.where(near, ranges_m[around][:, None], np.inf).min(axis=0)
    best = int(np.argmax(free_m))
    return float(np.degrees(headings[best])), min(SHARE * float(free_m[best]), FARTHEST_M)
