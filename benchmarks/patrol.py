"""Robot, poses and viewport of the benchmarks."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import PerspectiveCamera
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.route import Route, plan_route
from omnisim.scene import Scene

ROBOT = "p2at"
VIEWPORT_PX, VIEWPORT_FIELD_RAD = (640, 480), math.radians(90.0)
# Camera that follows the robot, from behind and above.
CHASE_M, CHASE_DOWN_DEG = (-1.2, 0.0, 1.1), 20.0


def patrol(scene: Scene, vehicle: Vehicle, count: int) -> NDArray[np.float64]:
    """Poses (count, 4, 4) of the vehicle's base, evenly spaced along the scene's first path.

    In a scene without paths, the vehicle turns on the spot with its camera at the scene's start.

    Raises:
        TrajectoryError: the vehicle cannot drive the path.
    """
    if not scene.paths:
        camera, start = vehicle.camera().sensor, scene.start
        yaws_deg = start.yaw_deg + np.arange(count) * 360.0 / count
        return np.array(
            [camera.base_pose(start.position_m, yaw_deg=yaw_deg) for yaw_deg in yaws_deg]
        )
    driven = plan_route(scene, vehicle, Route(scene.paths[0].name)).trajectory.world_from_base
    return driven[np.arange(count) * len(driven) // count]


def viewport() -> OmniCamera:
    """Camera of a simulator's window, with one sample per pixel, and without reflections.

    A reflection probe of the robot is drawn at each of its poses, for the first variant there only.
    """
    lens = PerspectiveCamera.with_field_of_view(*VIEWPORT_PX, VIEWPORT_FIELD_RAD)
    return OmniCamera(
        lens,
        polygons=None,
        base_from_rig=pose(CHASE_M, pitch_deg=CHASE_DOWN_DEG),
        supersampling=1,
        texels_per_pixel=1.0,
        reflection_probes=0,
    )
