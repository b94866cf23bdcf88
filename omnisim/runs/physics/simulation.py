"""Simulation of robots' drives in MuJoCo: the scene collides, wheels slip, objects are pushed.

All of the motion is simulated before rendering begins, so that an interrupted drive resumes with
the same motion.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import TrajectoryError
from omnisim.core.poses import (
    pose_from_rotation,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from omnisim.core.trajectories import Trajectory
from omnisim.runs.physics.convex_pieces import ConvexPiece, Region, convex_pieces, hull_of
from omnisim.runs.physics.rover import Driver, PathFollower, Rover
from omnisim.runs.physics.simulated_motion import SimulatedMotion
from omnisim.runs.physics.world_model import (
    ROBOT,
    SERVO_RADPS,
    STEP_S,
    WHEEL,
    SolidObject,
    WorldModel,
)
from omnisim.scene import Scene
from omnisim.scene.model import DynamicObject
from omnisim.scene.motion.object_motion import FreeBody, ObjectMotion

STEPS_AT_ONCE = 5
PERIOD_S = STEPS_AT_ONCE * STEP_S
PERIODS_PER_COMMAND = 2  # the wheels are commanded at 100 Hz
SETTLING = 100  # periods at rest before the start, in which tires and objects settle
TIPPED_COSINE = 0.7  # cosine of the base's maximum tilt: 45°
LOST_M = 0.5  # maximum distance from the path
MAX_S = 3600.0
# Above the braking by friction. Below (1 - d) / d of gravity over friction, where d is the
# contacts' impedance, sliding does not lift the load.
SLIDING_MPS2 = 10.0
SIDE_COSINE = 0.7  # cosine of a contact's normal to the vertical; below it a tire hits an obstacle
DIVERGED = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


class SimulatedWorld:
    """World of robots driven by their wheels.

    Args:
        model: model to compile.
        rovers: robots by name.
        motions: scripted motions of the scene's objects, by name.
        free: names of the free objects, which physics moves.

    Raises:
        ValueError: MuJoCo cannot compile the model.
    """

    def __init__(
        self,
        model: WorldModel,
        rovers: Mapping[str, Rover],
        motions: Mapping[str, ObjectMotion],
        free: list[str],
    ):
        self._model = compiled = model.spec.compile()
        self._data = mujoco.MjData(compiled)
        self._motions = [
            (int(compiled.body(f"object {name}").mocapid[0]), motion)
            for name, motion in motions.items()
        ]
        wheels = [
            [self._address(WHEEL.format(name, number)) for number in range(len(rover.wheels_m))]
            for name, rover in rovers.items()
        ]
        self._wheels = [np.array(numbers).reshape(2, -1) for numbers in wheels]
        self._turned_rad = np.zeros(sum(map(len, wheels)))
        joints = [*(ROBOT.format(name) for name in rovers), *(f"object {name}" for name in free)]
        self._bodies = np.array([self._address(name) for name in joints])[:, None] + np.arange(7)
        names = [compiled.geom(number).name for number in range(compiled.ngeom)]
        self._owners = [model.owners[name] for name in names]
        robots = {name: number for number, name in enumerate(rovers)}
        self._robots = np.array([robots.get(model.robots.get(name, ""), -1) for name in names])
        self._is_round = np.array([name in model.wheel_geoms for name in names])

    def _address(self, joint: str) -> int:
        return int(self._model.joint(joint).qposadr[0])

    @property
    def bodies(self) -> Floats:
        """Positions and quaternions wxyz (n, 7) of the robots' bases and of the free objects."""
        return self._data.qpos[self._bodies]

    @property
    def wheels_rad(self) -> Floats:
        """Mean angles (n, 2) that the robots' left and right wheels have turned."""
        angles: Floats = self._data.qpos
        return np.array([angles[numbers].mean(axis=1) for numbers in self._wheels])

    def advance(self, time_s: float, rates_radps: Sequence[tuple[float, float]]) -> None:
        """Advance the simulation by one period.

        Args:
            time_s: time at the end of the period, for the scripted objects.
            rates_radps: rates of the left and the right wheels, per robot.
        """
        sides = zip(rates_radps, self._wheels, strict=True)
        rates = np.concatenate([np.repeat(rate, wheels.shape[1]) for rate, wheels in sides])
        for number, motion in self._motions:
            pose = motion.pose_at(time_s)
            self._data.mocap_pos[number] = pose[:3, 3]
            quaternion = quaternion_from_rotation(pose[None, :3, :3])[0]
            self._data.mocap_quat[number] = np.roll(quaternion, 1)
        for _ in range(STEPS_AT_ONCE):
            self._turned_rad += STEP_S * rates
            # the servos damp the wheel rates
            self._data.ctrl[:] = self._turned_rad + 2.0 / SERVO_RADPS * rates
            mujoco.mj_step1(self._model, self._data)
            self._limit_lift()
            mujoco.mj_step2(self._model, self._data)

    def _limit_lift(self) -> None:
        """Limit the accelerations that contacts demand against sliding.

        MuJoCo's friction cone is convex: a sliding body is also pushed off the ground, more
        strongly at higher speed, so skidding wheels would hop. Friction itself stays Coulomb's.

        Source: the dual cone in MuJoCo's documentation, "Computation: Constraint model". The
        effective track of a rotation on the spot then follows from the torque balance, at any
        speed.
        """
        demanded, contact = self._data.efc_aref, self._data.contact
        if len(demanded) == 3 * len(contact):  # usually each contact has three rows
            along, across = demanded[1::3], demanded[2::3]
            share = SLIDING_MPS2 / np.maximum(np.hypot(along, across), SLIDING_MPS2)
            along *= share
            across *= share
            return
        rows = contact.efc_address[(contact.dim > 1) & (contact.efc_address >= 0)]
        share = SLIDING_MPS2 / np.maximum(
            np.hypot(demanded[rows + 1], demanded[rows + 2]), SLIDING_MPS2
        )
        demanded[rows + 1] *= share
        demanded[rows + 2] *= share

    def touched(self) -> list[set[str]]:
        """Names of the objects touched by each robot's body, or by its wheels from the side."""
        contact = self._data.contact
        geoms: NDArray[np.int32] = contact.geom
        robots = self._robots[geoms]
        aslant = np.abs(contact.frame[:, 2]) < SIDE_COSINE
        hits = (robots >= 0) & (~self._is_round[geoms] | aslant[:, None])
        touched: list[set[str]] = [set() for _ in self._wheels]
        for row, side in np.argwhere(hits & (robots != robots[:, ::-1])).tolist():
            touched[int(robots[row, side])].add(self._owners[int(geoms[row, 1 - side])])
        return touched

    @property
    def has_diverged(self) -> bool:
        """True if the engine has met invalid numbers and reset its state."""
        return any(self._data.warning[kind.value].number for kind in DIVERGED)


@contextmanager
def without_log() -> Iterator[None]:
    """Keep MuJoCo's log out of the working folder and the console."""
    before, quiet = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    quiet.logto_file = quiet.logto_console = False
    quiet.set()
    try:
        yield
    finally:
        before.set()


def simulate(scene: Scene, drivers: Mapping[str, Driver]) -> dict[str, SimulatedMotion]:
    """Simulate robots that follow planned trajectories through a scene.

    Args:
        scene: scene to drive in; its dynamic objects move, and objects with a mass can be pushed.
        drivers: robots by name, which can collide with each other.

    Returns:
        Motion of each robot, from the first start to the last end.

    Raises:
        TrajectoryError: a robot cannot follow its path or tips over, a path is too long, or the
            scene is too large.
    """
    start_s = min(one.motion.start_s for one in drivers.values())
    for one in drivers.values():
        if (duration_s := one.motion.end_s - start_s) > MAX_S:
            raise TrajectoryError(
                f"{one.where}: expected at most {MAX_S:g} s with --physics, got {duration_s:g} s"
            )
    objects = solid_objects(scene)
    pieces = static_pieces(scene, drivers.values(), objects)
    rovers = {name: one.rover for name, one in drivers.items()}
    starts = {name: (one.rover, one.planned.world_from_base[0]) for name, one in drivers.items()}
    model = WorldModel.of(pieces, objects, starts)
    free = [name for name, one in objects.items() if one.mass_kg is not None]
    motions = {one.name: one.motion for one in scene.objects if one.name not in free}
    with without_log():
        try:
            world = SimulatedWorld(model, rovers, motions, free)
        except ValueError as reason:
            raise TrajectoryError(f"{scene.name}: MuJoCo: {str(reason).splitlines()[0]}") from None
        return _drive(world, drivers, start_s, free)


def _drive(
    world: SimulatedWorld, drivers: Mapping[str, Driver], start_s: float, free: list[str]
) -> dict[str, SimulatedMotion]:
    """Drive all robots until the last has reached the end of its trajectory."""
    duration_s = max(one.motion.end_s for one in drivers.values()) - start_s
    count = math.ceil(duration_s / PERIOD_S) + 1
    times_s = start_s + PERIOD_S * np.arange(count, dtype=np.float64)
    robots = [_Robot(name, one, times_s) for name, one in drivers.items()]
    rates = [(0.0, 0.0)] * len(robots)
    for _ in range(SETTLING):
        world.advance(start_s, rates)
    bodies = np.empty((count, len(robots) + len(free), 7))
    wheels = np.empty((count, len(robots), 2))
    for k, time_s in enumerate(times_s.tolist()):
        bodies[k], wheels[k] = world.bodies, world.wheels_rad
        for robot, names in zip(robots, world.touched(), strict=True):
            for name in sorted(names):
                robot.contact_times_s.setdefault(name, []).append(time_s)
        if k % PERIODS_PER_COMMAND == 0:
            for robot, base in zip(robots, bodies[k], strict=False):
                robot.check(world, base, k, time_s)
            rates = [
                robot.follower.wheel_rates(k, base)
                for robot, base in zip(robots, bodies[k], strict=False)
            ]
        world.advance(time_s + PERIOD_S, rates)
    objects = {
        name: _trajectory(times_s, bodies[:, k]) for k, name in enumerate(free, start=len(robots))
    }
    return {
        robot.name: SimulatedMotion(
            base=_trajectory(times_s, bodies[:, k]),
            wheels_m=robot.rover.wheel_radius_m * (wheels[:, k] - wheels[0, k]),
            effective_track_m=robot.rover.effective_track_m,
            objects=objects,
            contact_times_s={
                name: np.array(times) for name, times in robot.contact_times_s.items()
            },
            engine=f"mujoco {mujoco.__version__}",
            step_s=STEP_S,
        )
        for k, robot in enumerate(robots)
    }


class _Robot:
    """Robot during the simulation.

    Attributes:
        name: name in the world.
        rover: robot on wheels.
        follower: controller that follows the trajectory.
        contact_times_s: contact times by the touched object's name.
    """

    def __init__(self, name: str, driver: Driver, times_s: Floats):
        self.name, self.rover, self._driver = name, driver.rover, driver
        self.follower = PathFollower(driver.motion, driver.rover, times_s)
        self.contact_times_s: dict[str, list[float]] = {}

    def check(self, world: SimulatedWorld, base: Floats, command: int, time_s: float) -> None:
        """Reject an invalid state, and a robot that has tipped over or left its path.

        Args:
            world: simulated world.
            base: (7,) position and quaternion wxyz of the robot's base.
            command: index of the current command.
            time_s: time of the state.

        Raises:
            TrajectoryError: the simulation diverges, or the robot has tipped over or left its path.
        """
        if self._driver.ignores_limits:
            return
        x, y, _, _, i, j, _ = base.tolist()
        at = f"{self._driver.where}: at {time_s:.2f} s, ({x:z.2f}, {y:z.2f}) m"
        if world.has_diverged or not np.all(np.isfinite(base)):
            raise TrajectoryError(
                f"{at}: MuJoCo diverges: expected lighter or slower things to collide"
            )
        recent_s = time_s - 2.0 * PERIOD_S
        touching = [name for name, times in self.contact_times_s.items() if times[-1] > recent_s]
        against = f" against {', '.join(touching)}" if touching else ""
        hint = "--ignore-limits drives on all the same"
        if 1.0 - 2.0 * (i * i + j * j) < TIPPED_COSINE:
            raise TrajectoryError(f"{at}: the robot tips over{against}: {hint}")
        distance_m = self.follower.distance_m(command, base)
        if distance_m > LOST_M:
            raise TrajectoryError(
                f"{at}: the robot cannot follow{against}: expected at most {LOST_M:g} m from the "
                f"path, got {distance_m:.2f} m: {hint}"
            )


def _trajectory(times_s: Floats, bodies: Floats) -> Trajectory:
    """Trajectory of positions and quaternions wxyz (n, 7)."""
    rotations = rotation_from_quaternion(np.roll(bodies[:, 3:], -1, axis=1))
    return Trajectory(times_s, pose_from_rotation(rotations, bodies[:, :3]))


# Surroundings of robots' paths in physics: static pieces and objects.


# Reach within which the scene collides: around the path, in addition to half of the robot's
# diagonal; and around free objects.
PATH_REACH_M, OBJECT_REACH_M = 1.0, 20.0
HEADROOM_M = 0.5  # reach above the robot
MAX_PIECES = 30_000  # about 0.4 ms per step


def solid_objects(scene: Scene) -> dict[str, SolidObject]:
    """Dynamic objects of a scene by name; free objects collide as their hulls.

    Raises:
        TrajectoryError: a free object is flat.
    """
    return {one.name: _solid(one) for one in scene.objects}


def static_pieces(
    scene: Scene, drivers: Collection[Driver], objects: Mapping[str, SolidObject]
) -> list[ConvexPiece]:
    """Pieces of a scene within reach of robots' trajectories and of free objects.

    Raises:
        TrajectoryError: too many pieces.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for driver in drivers:
        size_m, places = driver.rover.size_m, driver.planned.positions_m
        reach_m = PATH_REACH_M + 0.5 * float(np.hypot(*size_m[:2]))
        top_m = float(size_m[2]) + HEADROOM_M
        low = np.minimum(low, places.min(axis=0) - reach_m)
        high = np.maximum(high, places.max(axis=0) + (reach_m, reach_m, top_m))
    for one in objects.values():
        if one.mass_kg is not None:
            low = np.minimum(low, one.pose[:3, 3] - OBJECT_REACH_M)
            high = np.maximum(high, one.pose[:3, 3] + OBJECT_REACH_M)
    middles = [
        one.planned.positions_m
        + one.planned.world_from_base[:, :3, 2] * 2.0 * one.rover.wheel_radius_m
        for one in drivers
    ]
    pieces = convex_pieces(scene, Region(low, high, np.concatenate(middles)))
    if len(pieces) > MAX_PIECES:
        raise TrajectoryError(
            f"{scene.name}: expected at most {MAX_PIECES} convex pieces about the path with "
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
