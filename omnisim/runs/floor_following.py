"""Wheels on the scene's floor: height, pitch and roll of a vehicle along a level path."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import pose_from_rotation, yaw_from_rotation
from omnisim.robots.body_boxes import BodyBoxes
from omnisim.robots.robot_file import DEFAULT_CLEARANCE_M
from omnisim.runs.pose_sweep import SPACING_M, Sweep
from omnisim.scene import Scene
from omnisim.scene.space.floor import HeightField

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
    floor within the clearance, the other three bear the robot. Fewer suffice as long as the
    robot's middle is above the floor.

    Args:
        scene: scene with the floor.
        sweep: level path at z = 0.
        box: boxes of the robot's body; None: all wheels are at one point.
        where: name of the path in messages.

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
    last: NDArray[np.float64] | None = None
    for begin in range(0, len(at), POSES_AT_ONCE):
        part = slice(begin, begin + POSES_AT_ONCE)
        points = _points_under(track, places[at[part]], yaw[at[part]], spread[part])
        surfaces = field.heights_m(points.reshape(-1, len(_POINTS), 2))
        surfaces = surfaces.reshape(len(points), len(_PLACES), len(_POINTS), -1)
        for k, columns in enumerate(surfaces, start=begin):
            if last is None:
                last = np.full(len(_PLACES), _nearest_to_zero(columns))
            floor_heights = _floor_heights(columns, last, clearance_m)
            if floor_heights is None:
                x, y = places[at[k]].tolist()
                raise TrajectoryError(
                    f"{where}: leaves the floor at step {sweep.steps[at[k]]}, ({x:.2f}, {y:.2f}) m:"
                    f" expected floor within {clearance_m:g} m of {last[_MIDDLE]:.2f} m: "
                    "--ground M drives at one height"
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

    middle_m: NDArray[np.float64]
    half_m: NDArray[np.float64]
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


def _points_under(
    track: _Track,
    positions_m: NDArray[np.float64],
    yaw_rad: NDArray[np.float64],
    spread: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Points (n, 5, 5, 2) under the wheels and the middle at positions (n, 2) and headings (n,).

    Args:
        track: positions of the wheels.
        positions_m, yaw_rad: positions and headings of the base.
        spread: (n,) fractions of the wheels' distances from the middle.
    """
    places = track.middle_m + spread[:, None, None] * track.half_m * _PLACES
    local = places[:, :, None] + track.tire_m * _POINTS
    cos, sin = np.cos(yaw_rad)[:, None, None], np.sin(yaw_rad)[:, None, None]
    x, y = local[..., 0], local[..., 1]
    turned = np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1)
    points: NDArray[np.float64] = positions_m[:, None, None] + turned
    return points


def _nearest_to_zero(columns: NDArray[np.float64]) -> float:
    """Height nearest to 0 among surfaces (...); 0 without surfaces."""
    heights = columns[np.isfinite(columns)]
    return float(heights[np.argmin(np.abs(heights))]) if len(heights) else 0.0


def _floor_heights(
    columns: NDArray[np.float64], last_m: NDArray[np.float64], reach_m: float
) -> NDArray[np.float64] | None:
    """Heights (5,) of the floor under the wheels and the middle; None: the robot has no support.

    Args:
        columns: (5, 5, surfaces) surface heights at five points per wheel and under the middle.
        last_m: (5,) heights at the previous pose.
        reach_m: maximum change of height, up or down.
    """
    below = np.where(columns <= (last_m + reach_m)[:, None, None], columns, -np.inf)
    heights: NDArray[np.float64] = np.sort(below.max(axis=2), axis=1)[:, len(_POINTS) // 2]
    hanging = heights < last_m - reach_m
    if not hanging.any():
        return heights
    wheels = np.flatnonzero(hanging[:_MIDDLE]).tolist()
    if len(wheels) == 1:  # the wheel is in the plane of the other three
        (wheel,) = wheels
        heights[wheel] = heights[wheel - 1] + heights[wheel - 3] - heights[wheel - 2]
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


def _on_wheels(
    poses: NDArray[np.float64],
    yaw_rad: NDArray[np.float64],
    track: _Track,
    heights: NDArray[np.float64],
) -> NDArray[np.float64]:
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
