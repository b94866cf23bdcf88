"""Routes of a vehicle through a scene: a path of the scene, or one from a file."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import TrajectoryError, did_you_mean
from omnisim.core.files.sources import SourceReader, source_digest
from omnisim.core.poses import MAX_M, pose_from_rotation, wrap_angles, yaw_from_rotation
from omnisim.core.short_repr import short_repr
from omnisim.core.trajectories import Trajectory, check_continuous, parse_trajectory
from omnisim.core.trajectories.body_motion import BodyMotion, SplineMotion
from omnisim.core.trajectories.formats.parsed_trajectory import (
    Axes,
    ParsedTrajectory,
    check_printed_times,
)
from omnisim.core.trajectories.trajectory import step_lengths_m
from omnisim.robots import Kinematics, check_drivable, time_poses
from omnisim.robots.motion_profile import (
    MotionPlan,
    PlannedMotion,
    in_sequence,
    plan_in_steps,
    plan_with_period,
    read_waypoints,
)
from omnisim.robots.robot_file import DEFAULT_CLEARANCE_M
from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.runs.commanded_motion import CommandsFile, sampled
from omnisim.runs.contacts import SPACING_M, Sweep
from omnisim.runs.ground import Ground
from omnisim.scene import Scene
from omnisim.scene.space.floor import HeightField

DEFAULT_STEP_M, DEFAULT_STEP_DEG = 0.41, 12.0  # the paper's lap in about a hundred steps
COMMANDED_RATE_HZ = 10.0  # steps per second along velocity commands
MAX_STEP_DEG = 90.0
MAX_STEP_M = 1.0  # between poses without times: a longer step is a jump
MAX_SPEED_MPS = 100.0  # for a robot without limits of its own: a faster step is a jump
# Margin above and below the map: recorded heights have errors, and a flat map has no height.
ROOM_M = 1.0
NOTED_M = 0.005  # heights closer to 0 cause no note


@dataclass(frozen=True)
class Route:
    """Path to drive, and the size of its steps."""

    path: str  # name of one of the scene's paths, or a file with poses or waypoints
    # step_m, step_deg: maximum step along waypoints and on the spot
    step_m: float = DEFAULT_STEP_M
    step_deg: float = DEFAULT_STEP_DEG
    # steps per second along waypoints, in place of `step_m` and `step_deg`; or poses per second of
    # a file without times
    rate_hz: float | None = None
    ignore_limits: bool = False  # allow jumps and motion beyond the robot's limits
    ground_m: float | None = None  # height of the waypoints, or None: on the scene's floor
    # axes of a file's poses, or None: by the convention of the file's format
    axes: Axes | None = None


def route_digest(route: Route) -> str:
    """Digest (16 hexadecimal digits) of a route: its options, and the content of its file.

    The scene's own digest covers its paths.
    """
    path, options = Path(route.path), dict(vars(route))
    options["path"] = path.name
    reader = SourceReader()
    if path.is_file():
        reader.note(path)
    return source_digest(options, reader.digest(path.parent))[:16]


@dataclass(frozen=True, eq=False)
class PlannedRoute:
    """Route with its trajectory."""

    trajectory: Trajectory  # poses of the vehicle's base
    sweep: Sweep  # closely spaced poses along the trajectory, for contacts
    # true on the scene's floor; false at a fixed height, or at heights of a file
    follows_floor: bool
    # continuous motion of the vehicle's base: the plan's, or smooth through the poses of a file,
    # from rest to rest if the file has no times
    motion: BodyMotion

    def __repr__(self) -> str:
        return short_repr(self, repr(self.trajectory))


def plan_route(
    scene: Scene, vehicle: Vehicle, route: Route, print_note: Callable[[str], None] | None = None
) -> PlannedRoute:
    """Plan the trajectory of the vehicle's base along a route.

    Waypoints, and poses of a file without heights, are on the scene's floor (`follow_floor`), or at
    `ground_m`; poses with heights stay unchanged.

    A route without a suffix names a path of the scene, if there is one, before a file. `print_note`
    takes notes on assumed axes, if they differ from the world's, and on the floor's heights, if
    they differ from 0.

    Raises:
        TrajectoryError: an invalid step, rate or ground height; an unknown path; a file that is
            damaged, jumps, or exceeds the vehicle's limits; or a path that leaves the map or the
            floor.
    """
    _check_numbers(route)
    path = Path(route.path)
    commands = CommandsFile.read(path) if path.suffix.lower() == ".csv" and path.is_file() else None
    if commands is not None:
        return _by_commands(commands, scene, vehicle, route)
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
        poses = trajectory.world_from_base.copy()
        poses[:, 2, 3] = route.ground_m
        trajectory = Trajectory(trajectory.times_s, poses)
    _check_on_the_map(scene, trajectory, route.path, with_heights=not follows_floor)
    try:
        check_printed_times(trajectory.times_s)
    except TrajectoryError as reason:
        raise TrajectoryError(f"{route.path}: {reason}") from None
    box = BodyBoxes.of(vehicle)
    sweep = Sweep.along(trajectory, 0.0 if box is None else box.reach_m)
    motion: BodyMotion
    if follows_floor:
        sweep = follow_floor(scene, sweep, box, route.path)
    if isinstance(plan, _RecordedPath):
        if follows_floor and not plan.has_times:
            sweep = slow_on_slopes(sweep)
        motion = SplineMotion(sweep.trajectory, from_rest=not plan.has_times)
    elif follows_floor:
        sweep, motion = on_floor(plan, sweep)
    else:
        motion = plan.motion.at_height(float(trajectory.positions_m[0, 2]))
    if not follows_floor:
        return PlannedRoute(trajectory, sweep, follows_floor=False, motion=motion)
    trajectory = sweep.trajectory
    if print_note is not None:
        low, high = trajectory.positions_m[:, 2].min(), trajectory.positions_m[:, 2].max()
        if max(abs(low), abs(high)) >= NOTED_M:
            heights = f"{low:z.2f} m" if high - low < NOTED_M else f"{low:z.2f} to {high:z.2f} m"
            print_note(f"{route.path}: on the floor, at {heights}; --ground M drives at one height")
    return PlannedRoute(trajectory, sweep, follows_floor=True, motion=motion)


def _by_commands(
    commands: CommandsFile, scene: Scene, vehicle: Vehicle, route: Route
) -> PlannedRoute:
    """Drive as velocity commands say; nothing else is planned."""
    _refuse_axes(route)
    kinematics, box = _kinematics(vehicle, route.path), BodyBoxes.of(vehicle)
    if route.ground_m is not None:
        raise TrajectoryError(
            f"{route.path}: expected none with --ground, as the robot follows the floor"
        )
    motion = commands.motion(kinematics, Ground(scene, box), 0.0)
    trajectory = sampled(motion, route.rate_hz or COMMANDED_RATE_HZ)
    sweep = Sweep.along(trajectory, 0.0 if box is None else box.reach_m)
    return PlannedRoute(trajectory, sweep, follows_floor=True, motion=motion)


@dataclass(frozen=True, eq=False)
class _RecordedPath:
    """Trajectory from a file with poses."""

    trajectory: Trajectory  # trajectory with the file's own times, or timed by a rate
    has_heights: bool  # true if the heights are the file's
    has_times: bool  # true if the times are the file's, or follow from a rate


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


def _from_scene(scene: Scene, vehicle: Vehicle, route: Route) -> MotionPlan:
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
) -> MotionPlan | _RecordedPath:
    """Plan along waypoints or poses from a file."""
    waypoints_m = read_waypoints(path) if path.suffix.lower() == ".csv" else None
    if waypoints_m is not None:
        _refuse_axes(route)
        return _along(waypoints_m, None, vehicle, route, str(path))
    recording = parse_trajectory(path, axes=route.axes)
    if print_note is not None and route.axes is None and recording.axes != "world":
        print_note(
            f"{path}: poses in KITTI's axes, x right, y down, z ahead; --axes world reads them "
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
            raise TrajectoryError(f"{reason}; --ignore-limits drives it regardless") from None
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
            "gives times, --ignore-limits drives it regardless"
        )


def _along(
    waypoints_m: Floats, start_yaw_rad: float | None, vehicle: Vehicle, route: Route, where: str
) -> MotionPlan:
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
            f"{name}: leaves the map at step {step}, ({x:z.2f}, {y:z.2f}) m: {scene.name} spans "
            f"({low[0]:z.2f}, {low[1]:z.2f}) to ({high[0]:z.2f}, {high[1]:z.2f}) m"
        )
    outside = (places[:, 2] < low[2] - ROOM_M) | (places[:, 2] > high[2] + ROOM_M)
    if with_heights and outside.any():
        step = int(np.argmax(outside))
        raise TrajectoryError(
            f"{name}: leaves the map at step {step}, at a height of {places[step, 2]:.6g} m: "
            f"{scene.name} spans heights from {low[2]:z.2f} to {high[2]:z.2f} m"
        )


# Wheels on the scene's floor: height, pitch and roll of a vehicle along a level path.


TIRE_M = 0.05  # half side of the square under a wheel, whose median height bears it
SPOT_M = 1e-4  # a shorter step is a rotation on the spot
POSES_AT_ONCE = 256  # batch size, which bounds the memory
# Five points per wheel: their median is exact on slopes and bridges joints and pebbles.
_POINTS = np.array(((0.0, 0.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)))
# Four wheels at the corners, and the middle of the robot.
_PLACES = np.array(((1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0), (0.0, 0.0)))
_MIDDLE = 4


def follow_floor(scene: Scene, sweep: Sweep, box: BodyBoxes | None, where: str) -> Sweep:
    """Put a level path on the floor under the robot's wheels, which are at its corners.

    The floor at the start is the surface nearest to a height of 0. From there on each wheel takes
    the highest surface seen from above that is at most the robot's clearance above its last one.
    The base is on the plane through the wheels: level floors leave it level. If one wheel has no
    floor within the clearance, the other three bear the robot. Fewer suffice as long as the robot's
    middle is above the floor. Without `box`, the boxes of the robot's body, all wheels are at one
    point. Messages name the path `where`.

    Raises:
        TrajectoryError: the floor ends or drops, at a step.
    """
    poses = sweep.world_from_base
    clearance_m = DEFAULT_CLEARANCE_M if box is None else box.clearance_m
    track, yaw = _Track.of(box), yaw_from_rotation(poses)
    places = poses[:, :2, 3]
    reach_m = 0.0 if box is None else box.reach_m
    field = HeightField(scene, places.min(axis=0) - reach_m, places.max(axis=0) + reach_m)
    # at the start the wheels are spread outwards from the middle, each along the floor
    spread = np.linspace(0.0, 1.0, math.ceil(track.radius_m / SPACING_M), endpoint=False)
    at = np.concatenate((np.zeros(len(spread), dtype=np.intp), np.arange(len(poses))))
    spread = np.concatenate((spread, np.ones(len(poses))))
    heights = np.empty((len(at), len(_PLACES)))
    last: Floats | None = None
    for begin in range(0, len(at), POSES_AT_ONCE):
        part = slice(begin, begin + POSES_AT_ONCE)
        points = _points_under(track, places[at[part]], yaw[at[part]], spread[part])
        surfaces = field.heights_m(points.reshape(-1, len(_POINTS), 2))
        surfaces = surfaces.reshape(len(points), len(_PLACES), len(_POINTS), -1)
        for k, columns in enumerate(surfaces, start=begin):
            if last is None:
                surface_heights = columns[np.isfinite(columns)]
                nearest = np.argmin(np.abs(surface_heights)) if len(surface_heights) else None
                last = np.full(len(_PLACES), 0.0 if nearest is None else surface_heights[nearest])
            floor_heights = _floor_heights(columns, last, clearance_m)
            if floor_heights is None:
                x, y = places[at[k]].tolist()
                raise TrajectoryError(
                    f"{where}: leaves the floor at step {sweep.steps[at[k]]}, "
                    f"({x:z.2f}, {y:z.2f}) m: expected floor within {clearance_m:g} m of "
                    f"{last[_MIDDLE]:z.2f} m: --ground M drives at one height"
                )
            heights[k] = last = floor_heights
    grounded = _on_wheels(poses, yaw, track, heights[-len(poses) :])
    return dataclasses.replace(sweep, world_from_base=grounded)


def slow_on_slopes(sweep: Sweep) -> Sweep:
    """Lengthen the durations of steps by the ratio of their length to that in the floor plan.

    The robot's speed along the floor then equals its planned speed, and its acceleration does not
    exceed the planned one.
    """
    poses, times = sweep.world_from_base[sweep.is_step], sweep.times_s[sweep.is_step]
    moves = np.diff(poses[:, :3, 3], axis=0)
    planar = np.linalg.norm(moves[:, :2], axis=1)
    longer = np.ones(len(poses))
    moving = np.flatnonzero(planar > SPOT_M)
    longer[moving] = np.hypot(planar, moves[:, 2])[moving] / planar[moving]
    if np.all(longer == 1.0):  # a level path keeps its bytes
        return sweep
    ends = times[0] + np.cumsum(np.diff(times) * longer[:-1])
    slowed = np.concatenate((times[:1], ends))
    within_s = sweep.times_s - times[sweep.steps]
    return dataclasses.replace(sweep, times_s=slowed[sweep.steps] + within_s * longer[sweep.steps])


@dataclasses.dataclass(frozen=True)
class _Track:
    """Positions of the wheels: their center in the base frame, and half their distances."""

    middle_m: Floats
    half_m: Floats
    tire_m: float

    @classmethod
    def of(cls, box: BodyBoxes | None) -> _Track:
        if box is None:
            return cls(np.zeros(2), np.zeros(2), 0.0)
        half = 0.5 * (box.high_m - box.low_m)[:2]
        tire_m = min(TIRE_M, 0.5 * float(half.min()))
        return cls(0.5 * (box.low_m + box.high_m)[:2], half - tire_m, tire_m)

    @property
    def radius_m(self) -> float:
        """Distance of the wheels from their center."""
        return math.hypot(*self.half_m)


def _points_under(track: _Track, positions_m: Floats, yaw_rad: Floats, spread: Floats) -> Floats:
    """Points (n, 5, 5, 2) under the wheels and the middle at positions (n, 2) and headings (n,).

    `spread` (n,) are fractions of the wheels' distances from the middle.
    """
    places = track.middle_m + spread[:, None, None] * track.half_m * _PLACES
    local = places[:, :, None] + track.tire_m * _POINTS
    cos, sin = np.cos(yaw_rad)[:, None, None], np.sin(yaw_rad)[:, None, None]
    x, y = local[..., 0], local[..., 1]
    turned = np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1)
    return positions_m[:, None, None] + turned


def _floor_heights(columns: Floats, last_m: Floats, reach_m: float) -> Floats | None:
    """Heights (5,) of the floor under the wheels and the middle; None: the robot has no support.

    Args:
        columns: (5, 5, surfaces) surface heights at five points per wheel and under the middle.
        last_m: (5,) heights at the previous pose.
        reach_m: maximum change of height, up or down.
    """
    below = np.where(columns <= (last_m + reach_m)[:, None, None], columns, -np.inf)
    heights: Floats = np.sort(below.max(axis=2), axis=1)[:, len(_POINTS) // 2]
    hanging = heights < last_m - reach_m
    if not hanging.any():
        return heights
    wheels = np.flatnonzero(hanging[:_MIDDLE]).tolist()
    if len(wheels) == 1:  # the wheel is in the plane of the other three
        (wheel,) = wheels
        beside, opposite, behind = heights[[(wheel + k) % 4 for k in (1, 2, 3)]]
        heights[wheel] = beside + behind - opposite
    elif wheels:
        if hanging[_MIDDLE]:
            return None
        for wheel in wheels:
            opposite = (wheel + 2) % 4
            hold_m = heights[_MIDDLE if opposite in wheels else opposite]
            heights[wheel] = 2.0 * heights[_MIDDLE] - hold_m
    if hanging[_MIDDLE]:
        heights[_MIDDLE] = heights[:_MIDDLE].mean()
    return heights


def _on_wheels(poses: Floats, yaw_rad: Floats, track: _Track, heights: Floats) -> Floats:
    """Poses (n, 4, 4) on least-squares planes through wheels at heights (n, 5)."""
    wheels = heights[:, :_MIDDLE]
    mean = wheels.mean(axis=1)
    along, across = (
        wheels @ _PLACES[:_MIDDLE, axis] / (4.0 * half) if half > 0.0 else np.zeros(len(heights))
        for axis, half in enumerate(track.half_m)
    )
    grounded = poses.copy()
    grounded[:, 2, 3] = mean - along * track.middle_m[0] - across * track.middle_m[1]
    tilted = (along != 0.0) | (across != 0.0)
    cos, sin = np.cos(yaw_rad[tilted]), np.sin(yaw_rad[tilted])
    a, b = along[tilted], across[tilted]
    ahead = np.column_stack((cos, sin, a)) / np.sqrt(1.0 + a * a)[:, None]
    up = np.column_stack((sin * b - cos * a, -sin * a - cos * b, np.ones(len(a))))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    rotations = np.stack((ahead, np.cross(up, ahead), up), axis=2)
    grounded[tilted] = pose_from_rotation(rotations, grounded[tilted, :3, 3])
    return grounded


# Plans on the scene's floor: motion of a plan along slopes.


EVEN_M = 1e-9  # also radians: rounding on an even floor


def on_floor(plan: MotionPlan, sweep: Sweep) -> tuple[Sweep, PlannedMotion]:
    """Time a plan's poses on the floor, and find the motion there.

    Steps of equal length keep the limits along the floor, and so last longer on slopes; steps of
    equal duration keep their times. Between the sweep's poses the motion is a spline.
    """
    poses = sweep.world_from_base
    heights_m = poses[:, 2, 3]
    if np.ptp(heights_m) < EVEN_M and np.abs(poses[:, 2, :2]).max() < EVEN_M:
        return sweep, plan.motion.at_height(float(heights_m[0]))
    bounds = np.searchsorted(sweep.steps, np.cumsum((0, *plan.counts)))
    segments, ways = [], []
    for number, segment in enumerate(plan.motion.segments):
        first, last = int(bounds[number]), int(bounds[number + 1])
        part = slice(first, last + 1)
        if segment.turn_rad != 0.0:
            yaw_rad = yaw_from_rotation(poses[part])
            steps = np.abs(wrap_angles(np.diff(yaw_rad)))
        elif plan.period_s is None:
            steps = _along_chords(poses[part], sweep.is_step[part])
        else:
            steps = np.linalg.norm(np.diff(poses[part, :2, 3], axis=0), axis=1)
        way = np.concatenate(((0.0,), np.cumsum(steps)))
        ways.append(way)
        spline = SplineMotion(Trajectory(way, poses[part]))
        segments.append(dataclasses.replace(segment, way=spline))
    if plan.period_s is not None:
        return sweep, PlannedMotion(segments)
    segments = in_sequence(segments)
    times = [segments[0].start_s + np.zeros(1)]
    times += [
        segment.start_s + segment.trapezoid.times_at(way)[1:]
        for segment, way in zip(segments, ways, strict=True)
    ]
    return dataclasses.replace(sweep, times_s=np.concatenate(times)), PlannedMotion(segments)


def _along_chords(poses: Floats, is_step: Bools) -> Floats:
    """Distances (n − 1,) in meters between poses (n, 4, 4), scaled to sum to each step's chord.

    A bump within a step adds nothing to them: steps are checked by the length of their chords.
    """
    ways_m = step_lengths_m(poses)
    first = np.flatnonzero(is_step)[:-1]
    chords_m = step_lengths_m(poses[is_step])
    scales = chords_m / np.add.reduceat(ways_m, first)
    return ways_m * np.repeat(scales, np.diff(np.append(first, len(ways_m))))
