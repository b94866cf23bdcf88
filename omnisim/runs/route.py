"""Routes of a vehicle through a scene: a path of the scene, or one from a file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import TrajectoryError, did_you_mean
from omnisim.core.files.sources import note_file, recorded_sources, source_digest
from omnisim.core.poses import MAX_M
from omnisim.core.short_repr import short_repr
from omnisim.core.trajectories import Trajectory, check_continuous, parse_trajectory
from omnisim.core.trajectories.body_motion import BodyMotion
from omnisim.core.trajectories.formats.parsed_trajectory import Axes, ParsedTrajectory
from omnisim.core.trajectories.formats.text_table import check_printed_times
from omnisim.core.trajectories.spline_motion import SplineMotion
from omnisim.core.trajectories.trajectory import step_lengths_m
from omnisim.robots import Kinematics, check_drivable, time_poses
from omnisim.robots.body_boxes import BodyBoxes
from omnisim.robots.motion_profile import Plan, plan_in_steps, plan_with_period
from omnisim.robots.vehicle import Vehicle
from omnisim.robots.waypoints import read_waypoints
from omnisim.runs.floor_following import follow_floor, slow_on_slopes
from omnisim.runs.planned_floor import on_floor
from omnisim.runs.pose_sweep import Sweep
from omnisim.scene import Scene

DEFAULT_STEP_M, DEFAULT_STEP_DEG = 0.41, 12.0  # the paper's lap in about a hundred steps
MAX_STEP_DEG = 90.0
MAX_STEP_M = 1.0  # between poses without times: a longer step is a jump
MAX_SPEED_MPS = 100.0  # for a robot without limits of its own: a faster step is a jump
# Margin above and below the map: recorded heights have errors, and a flat map has no height.
ROOM_M = 1.0
NOTED_M = 0.005  # heights closer to 0 cause no note


@dataclass(frozen=True)
class Route:
    """Path to drive, and the size of its steps.

    Attributes:
        path: name of one of the scene's paths, or a file with poses or waypoints.
        step_m, step_deg: maximum step along waypoints and on the spot.
        rate_hz: steps per second along waypoints, in place of `step_m` and `step_deg`; or poses per
            second of a file without times.
        ignore_limits: allow jumps and motion beyond the robot's limits.
        ground_m: height of the waypoints, or None: on the scene's floor.
        axes: axes of a file's poses, or None: by the convention of the file's format.
    """

    path: str
    step_m: float = DEFAULT_STEP_M
    step_deg: float = DEFAULT_STEP_DEG
    rate_hz: float | None = None
    ignore_limits: bool = False
    ground_m: float | None = None
    axes: Axes | None = None


def route_digest(route: Route) -> str:
    """Digest (16 hexadecimal digits) of a route: its options, and the content of its file.

    The scene's own digest covers its paths.
    """
    path, options = Path(route.path), dict(vars(route))
    options["path"] = path.name
    with recorded_sources() as sources:
        if path.is_file():
            note_file(path)
    return source_digest(options, sources.digest(path.parent))[:16]


@dataclass(frozen=True, eq=False)
class PlannedRoute:
    """Route with its trajectory.

    Attributes:
        trajectory: poses of the vehicle's base.
        sweep: closely spaced poses along the trajectory, for contacts.
        follows_floor: true on the scene's floor; false at a fixed height, or at heights of a file.
        motion: continuous motion of the vehicle's base: the plan's, or smooth through the poses of
            a file, from rest to rest if the file has no times.
    """

    trajectory: Trajectory
    sweep: Sweep
    follows_floor: bool
    motion: BodyMotion

    def __repr__(self) -> str:
        return short_repr(self, repr(self.trajectory))


def plan_route(
    scene: Scene,
    vehicle: Vehicle,
    route: Route,
    print_note: Callable[[str], None] | None = None,
) -> PlannedRoute:
    """Plan the trajectory of the vehicle's base along a route.

    Waypoints, and poses of a file without heights, are on the scene's floor (`follow_floor`), or at
    `ground_m`; poses with heights stay unchanged.

    A route without a suffix names a path of the scene, if there is one, before a file.

    Args:
        scene: scene to drive in.
        vehicle: vehicle that drives.
        route: path, and size of its steps.
        print_note: callback for notes on the assumed axes, if they differ from the world's, and on
            the floor's heights, if they differ from 0.

    Raises:
        TrajectoryError: an invalid step, rate or ground height; an unknown path; a file that is
            damaged, jumps, or exceeds the vehicle's limits; or a path that leaves the map or the
            floor.
    """
    _check_numbers(route)
    path = Path(route.path)
    is_of_scene = any(path.name == route.path for path in scene.paths)
    if path.exists() if path.suffix else path.is_file() and not is_of_scene:
        plan = _from_file(path, vehicle, route, print_note)
    else:
        _refuse_axes(route)
        plan = _from_scene(scene, vehicle, route)
    has_heights = isinstance(plan, _RecordedPath) and plan.has_heights
    trajectory = plan.trajectory
    follows_floor = not has_heights and route.ground_m is None
    if not has_heights and route.ground_m is not None:
        trajectory = _at_height(trajectory, route.ground_m)
    _check_on_the_map(scene, trajectory, route.path, with_heights=not follows_floor)
    try:
        check_printed_times(trajectory.times_s)
    except TrajectoryError as reason:
        raise TrajectoryError(f"{route.path}: {reason}") from None
    box = BodyBoxes.of(vehicle)
    sweep = Sweep.along(trajectory, 0.0 if box is None else box.reach_m)
    if not follows_floor:
        motion = _motion(plan, trajectory)
        return PlannedRoute(trajectory, sweep, follows_floor=False, motion=motion)
    sweep = follow_floor(scene, sweep, box, route.path)
    if isinstance(plan, Plan):
        sweep, motion = on_floor(plan, sweep)
    else:
        sweep = sweep if plan.has_times else slow_on_slopes(sweep)
        motion = _motion(plan, sweep.trajectory)
    trajectory = sweep.trajectory
    if print_note is not None:
        low, high = trajectory.positions_m[:, 2].min(), trajectory.positions_m[:, 2].max()
        if max(abs(low), abs(high)) >= NOTED_M:
            heights = f"{low:.2f} m" if high - low < NOTED_M else f"{low:.2f} to {high:.2f} m"
            print_note(f"{route.path}: on the floor, at {heights}; --ground M drives at one height")
    return PlannedRoute(trajectory, sweep, follows_floor=True, motion=motion)


@dataclass(frozen=True, eq=False)
class _RecordedPath:
    """Trajectory from a file with poses.

    Attributes:
        trajectory: trajectory with the file's own times, or timed by a rate.
        has_heights: true if the heights are the file's.
        has_times: true if the times are the file's, or follow from a rate.
    """

    trajectory: Trajectory
    has_heights: bool
    has_times: bool


def _motion(plan: Plan | _RecordedPath, trajectory: Trajectory) -> BodyMotion:
    """Motion through poses from a file, or poses off the floor."""
    if isinstance(plan, Plan):
        return plan.motion.at_height(float(trajectory.positions_m[0, 2]))
    return SplineMotion(trajectory, from_rest=not plan.has_times)


def _at_height(trajectory: Trajectory, ground_m: float) -> Trajectory:
    poses = trajectory.world_from_base.copy()
    poses[:, 2, 3] = ground_m
    return Trajectory(trajectory.times_s, poses)


def _check_numbers(route: Route) -> None:
    """Reject invalid steps, rates and ground heights, including NaN."""
    if not route.step_m > 0.0:
        raise TrajectoryError(f"step {route.step_m:g} m: expected more than 0")
    if not 0.0 < route.step_deg <= MAX_STEP_DEG:
        raise TrajectoryError(
            f"turn step {route.step_deg:g}°: expected more than 0, at most {MAX_STEP_DEG:g}"
        )
    if route.rate_hz is not None and not 0.0 < route.rate_hz < math.inf:
        raise TrajectoryError(f"rate {route.rate_hz:g} Hz: expected a finite number above 0")
    if route.ground_m is not None and not abs(route.ground_m) < MAX_M:
        raise TrajectoryError(
            f"ground {route.ground_m:g} m: expected a finite number below {MAX_M:g}"
        )


def _from_scene(scene: Scene, vehicle: Vehicle, route: Route) -> Plan:
    paths = {path.name: path for path in scene.paths}
    if route.path not in paths:
        hint = did_you_mean(route.path, paths, "it has")
        raise TrajectoryError(
            f"path {route.path!r}: no such file, and no such path in {scene.name}; {hint}"
        )
    scene_path = paths[route.path]
    yaw_deg = scene_path.start_yaw_deg
    start_yaw_rad = None if yaw_deg is None else math.radians(yaw_deg)
    where = f"path {route.path!r} of {scene.name}"
    return _along(np.array(scene_path.waypoints_m), start_yaw_rad, vehicle, route, where)


def _refuse_axes(route: Route) -> None:
    if route.axes is not None:
        raise TrajectoryError(f"{route.path}: expected poses with --axes, got waypoints")


def _from_file(
    path: Path, vehicle: Vehicle, route: Route, print_note: Callable[[str], None] | None
) -> Plan | _RecordedPath:
    """Plan along waypoints or poses from a file."""
    waypoints_m = read_waypoints(path) if path.suffix.lower() == ".csv" else None
    if waypoints_m is not None:
        _refuse_axes(route)
        return _along(waypoints_m, None, vehicle, route, str(path))
    recording = parse_trajectory(path, axes=route.axes)
    if print_note is not None and route.axes is None and recording.axes != "world":
        print_note(
            f"{path}: poses in KITTI's axes, x right, y down, z ahead; --axes world takes them "
            "as x forward, y left, z up"
        )
    if recording.has_heights and route.ground_m is not None:
        raise TrajectoryError(
            f"{path}: expected waypoints with --ground, got poses, which have heights of their own"
        )
    limited = not route.ignore_limits
    lines = recording.line_numbers
    if recording.times_s is None and route.rate_hz is None:
        kinematics = _kinematics(vehicle, str(path))
        if limited:
            _check_steps(recording)
        try:
            trajectory = time_poses(recording.world_from_base, kinematics)
        except TrajectoryError as reason:
            raise TrajectoryError(f"{path}: {reason}") from None
    else:
        trajectory = recording.trajectory(route.rate_hz)
    if limited:
        try:
            if vehicle.kinematics is not None:
                check_drivable(trajectory, vehicle.kinematics, recording.source, lines)
            else:
                check_continuous(trajectory, math.inf, recording.source, MAX_SPEED_MPS, lines)
        except TrajectoryError as reason:
            raise TrajectoryError(f"{reason}; --ignore-limits drives it all the same") from None
    has_times = recording.times_s is not None or route.rate_hz is not None
    return _RecordedPath(trajectory, recording.has_heights, has_times)


def _check_steps(recording: ParsedTrajectory) -> None:
    """Reject jumps between poses without times, which have no speed to check."""
    lengths_m = step_lengths_m(recording.world_from_base)
    jumps = np.flatnonzero(lengths_m > MAX_STEP_M)
    if len(jumps):
        k = jumps[0]
        raise TrajectoryError(
            f"{recording.source}:{recording.line_numbers[k + 1]}: step {k} → {k + 1}: "
            f"{lengths_m[k]:g} m without times: expected at most {MAX_STEP_M:g} m: --rate HZ "
            "gives times, --ignore-limits drives it all the same"
        )


def _along(
    waypoints_m: NDArray[np.float64],
    start_yaw_rad: float | None,
    vehicle: Vehicle,
    route: Route,
    where: str,
) -> Plan:
    kinematics = _kinematics(vehicle, where)
    try:
        if route.rate_hz is not None:
            return plan_with_period(waypoints_m, kinematics, 1.0 / route.rate_hz, start_yaw_rad)
        step_rad = math.radians(route.step_deg)
        return plan_in_steps(waypoints_m, kinematics, route.step_m, step_rad, start_yaw_rad)
    except TrajectoryError as reason:
        raise TrajectoryError(f"{where}: {reason}") from None


def _kinematics(vehicle: Vehicle, where: str) -> Kinematics:
    if vehicle.kinematics is None:
        raise TrajectoryError(
            f"{where}: has no times, and robot {vehicle.name!r} has no [kinematics] to drive "
            "it by: add them to one of the two"
        )
    return vehicle.kinematics


def _check_on_the_map(scene: Scene, trajectory: Trajectory, name: str, with_heights: bool) -> None:
    low, high = scene.bounds_m()
    places = trajectory.positions_m
    outside = np.any((places[:, :2] < low[:2]) | (places[:, :2] > high[:2]), axis=1)
    if outside.any():
        step = int(np.argmax(outside))
        x, y, _ = places[step]
        raise TrajectoryError(
            f"{name}: leaves the map at step {step}, ({x:.2f}, {y:.2f}) m: {scene.name} spans "
            f"({low[0]:.2f}, {low[1]:.2f}) to ({high[0]:.2f}, {high[1]:.2f}) m"
        )
    outside = (places[:, 2] < low[2] - ROOM_M) | (places[:, 2] > high[2] + ROOM_M)
    if with_heights and outside.any():
        step = int(np.argmax(outside))
        raise TrajectoryError(
            f"{name}: leaves the map at step {step}, at a height of {places[step, 2]:.6g} m: "
            f"{scene.name} spans heights from {low[2]:.2f} to {high[2]:.2f} m"
        )
