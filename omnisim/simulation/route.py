"""Where a vehicle drives in a scene: a path of the scene, or one from a file."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import TrajectoryError
from omnisim.robot import (
    Kinematics,
    Trajectory,
    check_continuous,
    check_drivable,
    drive_in_steps,
    drive_with_period,
    read_recording,
    time_poses,
)
from omnisim.robot.waypoint_files import read_waypoints
from omnisim.scene import Scene
from omnisim.simulation.vehicle import Vehicle

DEFAULT_STEP_M, DEFAULT_STEP_DEG = 0.41, 12.0  # the paper's lap in about a hundred steps
LARGEST_STEP_M = 1.0  # of poses from a file: farther is a jump


@dataclass(frozen=True)
class Route:
    """What path to drive, and how finely.

    Attributes:
        path: name of one of the scene's paths, or a file with poses or waypoints.
        step_m, step_deg: longest step along waypoints and on the spot.
        rate_hz: steps a second along waypoints instead, or of a file without times.
        ignore_limits: drive what the robot could not.
        ground_m: height of the ground that waypoints are on.
    """

    path: str
    step_m: float = DEFAULT_STEP_M
    step_deg: float = DEFAULT_STEP_DEG
    rate_hz: float | None = None
    ignore_limits: bool = False
    ground_m: float = 0.0


def plan_route(scene: Scene, vehicle: Vehicle, route: Route) -> Trajectory:
    """The poses of the vehicle's base along a route.

    Raises:
        TrajectoryError: no such path; a file that is damaged, jumps, or asks for more than the
            vehicle can do; or a path that leaves the map.
    """
    path = Path(route.path)
    if path.suffix and path.exists():
        trajectory = _from_file(path, vehicle, route)
    else:
        trajectory = _from_scene(scene, vehicle, route)
    _check_on_the_map(scene, trajectory, route.path)
    return trajectory


def _from_scene(scene: Scene, vehicle: Vehicle, route: Route) -> Trajectory:
    paths = {path.name: path for path in scene.paths}
    if route.path not in paths:
        near = difflib.get_close_matches(route.path, paths, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"it has {', '.join(paths) or 'none'}"
        raise TrajectoryError(
            f"path {route.path!r}: no such file, and no such path in {scene.name}; {hint}"
        )
    found = paths[route.path]
    yaw_deg = found.start_yaw_deg
    start_yaw_rad = None if yaw_deg is None else math.radians(yaw_deg)
    where = f"path {route.path!r} of {scene.name}"
    return _along(np.array(found.waypoints_m), start_yaw_rad, vehicle, route, where)


def _from_file(path: Path, vehicle: Vehicle, route: Route) -> Trajectory:
    waypoints_m = read_waypoints(path) if path.suffix.lower() == ".csv" else None
    if waypoints_m is not None:
        return _along(waypoints_m, None, vehicle, route, str(path))
    recording = read_recording(path)
    if recording.times_s is None and route.rate_hz is None:
        trajectory = time_poses(recording.world_from_base, _kinematics(vehicle, str(path)))
    else:
        trajectory = recording.trajectory(None if recording.times_s is not None else route.rate_hz)
    check_continuous(
        trajectory, LARGEST_STEP_M, recording.source, lines=list(recording.line_numbers)
    )
    if vehicle.kinematics is not None and not route.ignore_limits:
        check_drivable(trajectory, vehicle.kinematics, str(path))
    return trajectory


def _along(
    waypoints_m: NDArray[np.float64],
    start_yaw_rad: float | None,
    vehicle: Vehicle,
    route: Route,
    where: str,
) -> Trajectory:
    kinematics = _kinematics(vehicle, where)
    try:
        if route.rate_hz is not None:
            if not (math.isfinite(route.rate_hz) and route.rate_hz > 0.0):
                raise TrajectoryError(f"rate {route.rate_hz:g} Hz: want a number above 0")
            flat = drive_with_period(waypoints_m, kinematics, 1.0 / route.rate_hz, start_yaw_rad)
        else:
            step_rad = math.radians(route.step_deg)
            flat = drive_in_steps(waypoints_m, kinematics, route.step_m, step_rad, start_yaw_rad)
        poses = flat.world_from_base.copy()
        poses[:, 2, 3] = route.ground_m
        return Trajectory(flat.times_s, poses)
    except TrajectoryError as reason:
        raise TrajectoryError(f"{where}: {reason}") from None


def _kinematics(vehicle: Vehicle, where: str) -> Kinematics:
    if vehicle.kinematics is None:
        raise TrajectoryError(
            f"{where}: has no times, and robot {vehicle.name!r} has no [kinematics] to drive "
            "it by: add them to one of the two"
        )
    return vehicle.kinematics


def _check_on_the_map(scene: Scene, trajectory: Trajectory, name: str) -> None:
    low, high = scene.bounds_m()[:, :2]
    places = trajectory.positions_m[:, :2]
    outside = np.any((places < low) | (places > high), axis=1)
    if outside.any():
        step = int(np.argmax(outside))
        x, y = places[step]
        raise TrajectoryError(
            f"{name}: leaves the map at step {step}, ({x:.2f}, {y:.2f}) m: {scene.name} spans "
            f"({low[0]:.2f}, {low[1]:.2f}) to ({high[0]:.2f}, {high[1]:.2f}) m"
        )
