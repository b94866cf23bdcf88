"""Simulation of a robot's drive in MuJoCo: the scene collides, wheels slip, objects are pushed.

All of the motion is simulated before anything is rendered, so that a drive that was stopped goes on
with the same motion.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import TrajectoryError
from omnisim.poses import pose_from_rotation, rotation_from_quaternion
from omnisim.scene import Scene
from omnisim.simulation.physics.path_follower import PathFollower
from omnisim.simulation.physics.rover import Rover
from omnisim.simulation.physics.simulated_motion import SimulatedMotion
from omnisim.simulation.physics.simulated_world import PERIOD_S, SimulatedWorld, without_log
from omnisim.simulation.physics.surroundings import solid_objects, static_pieces
from omnisim.simulation.physics.world_model import STEP_S, WorldModel
from omnisim.trajectories import Trajectory

PERIODS_PER_COMMAND = 2  # the wheels are commanded at 100 Hz
SETTLING = 100  # periods at rest before the start: tyres and objects come to bear
TIPPED_COSINE = 0.7  # of the base's tilt: 45°
LOST_M = 0.5  # farthest from the path
LONGEST_S = 3600.0


def simulate(
    scene: Scene, rover: Rover, planned: Trajectory, where: str, ignore_limits: bool = False
) -> SimulatedMotion:
    """Simulate a robot that follows a planned trajectory through a scene.

    Args:
        scene: where; its dynamic objects move, and those with a mass can be pushed.
        rover: that drives.
        planned: trajectory; the robot begins at its first pose.
        where: the path's name in messages.
        ignore_limits: go on where the robot leaves its path or tips over.

    Raises:
        TrajectoryError: the robot cannot follow the path, or tips over; a path that is too long; a
            scene that is too large.
    """
    if planned.duration_s > LONGEST_S:
        raise TrajectoryError(
            f"{where}: expected at most {LONGEST_S:g} s with --physics, got "
            f"{planned.duration_s:g} s"
        )
    objects = solid_objects(scene)
    pieces = static_pieces(scene, rover, planned, objects)
    model = WorldModel.of(pieces, objects, rover, planned.world_from_base[0])
    free = [name for name, one in objects.items() if one.mass_kg is not None]
    motions = {one.name: one.motion for one in scene.objects if one.name not in free}
    with without_log():
        try:
            world = SimulatedWorld(model, rover, motions, free)
        except ValueError as reason:
            raise TrajectoryError(f"{scene.name}: MuJoCo: {str(reason).splitlines()[0]}") from None
        return _drive(world, rover, planned, free, None if ignore_limits else where)


def _drive(
    world: SimulatedWorld, rover: Rover, planned: Trajectory, free: list[str], where: str | None
) -> SimulatedMotion:
    """Drive along a planned trajectory; `where` is None: wherever it leads."""
    start_s = float(planned.times_s[0])
    count = math.ceil(planned.duration_s / PERIOD_S) + 1
    times_s = start_s + PERIOD_S * np.arange(count, dtype=np.float64)
    follower = PathFollower(planned, rover, times_s)
    for _ in range(SETTLING):
        world.advance(start_s, (0.0, 0.0))
    bodies = np.empty((count, 1 + len(free), 7))
    wheels = np.empty((count, 2))
    touched_s: dict[str, list[float]] = {}
    rates = (0.0, 0.0)
    for k, time_s in enumerate(times_s.tolist()):
        bodies[k], wheels[k] = world.bodies, world.wheels_rad
        for name in sorted(world.touched()):
            touched_s.setdefault(name, []).append(time_s)
        if k % PERIODS_PER_COMMAND == 0:
            base = bodies[k, 0]
            if where is not None:
                _check_way(world, base, follower.distance_m(k, base), touched_s, time_s, where)
            rates = follower.wheel_rates(k, base)
        world.advance(time_s + PERIOD_S, rates)
    return SimulatedMotion(
        base=_trajectory(times_s, bodies[:, 0]),
        wheels_m=rover.wheel_radius_m * (wheels - wheels[0]),
        effective_track_m=rover.effective_track_m,
        objects={name: _trajectory(times_s, bodies[:, k]) for k, name in enumerate(free, start=1)},
        touched_s={name: np.array(times) for name, times in touched_s.items()},
        engine=f"mujoco {mujoco.__version__}",
        step_s=STEP_S,
    )


def _check_way(
    world: SimulatedWorld,
    base: NDArray[np.float64],
    distance_m: float,
    touched_s: dict[str, list[float]],
    time_s: float,
    where: str,
) -> None:
    """Refuse a robot that has tipped over or left its path, and a state that is none."""
    x, y, _, _, i, j, _ = base.tolist()
    at = f"{where}: at {time_s:.2f} s, ({x:.2f}, {y:.2f}) m"
    if world.has_diverged or not np.all(np.isfinite(base)):
        raise TrajectoryError(
            f"{at}: MuJoCo diverges: expected lighter or slower things to collide"
        )
    touching = [name for name, times in touched_s.items() if times[-1] > time_s - 2.0 * PERIOD_S]
    against = f" against {', '.join(touching)}" if touching else ""
    hint = "--ignore-limits drives on all the same"
    if 1.0 - 2.0 * (i * i + j * j) < TIPPED_COSINE:
        raise TrajectoryError(f"{at}: the robot tips over{against}: {hint}")
    if distance_m > LOST_M:
        raise TrajectoryError(
            f"{at}: the robot cannot follow{against}: expected at most {LOST_M:g} m from the path, "
            f"got {distance_m:.2f} m: {hint}"
        )


def _trajectory(times_s: NDArray[np.float64], bodies: NDArray[np.float64]) -> Trajectory:
    """Trajectory of positions and quaternions wxyz (n, 7)."""
    rotations = rotation_from_quaternion(np.roll(bodies[:, 3:], -1, axis=1))
    return Trajectory(times_s, pose_from_rotation(rotations, bodies[:, :3]))
