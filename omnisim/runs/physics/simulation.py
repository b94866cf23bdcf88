"""Simulation of robots' drives in MuJoCo: the scene collides, wheels slip, objects are pushed.

All of the motion is simulated before rendering begins, so that an interrupted drive resumes with
the same motion.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core import poses
from omnisim.core.arrays import Floats
from omnisim.core.errors import TrajectoryError
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory
from omnisim.core.world import Pose
from omnisim.runs.physics.convex_pieces import (
    ConvexPiece,
    SolidRegion,
    SolidShape,
    convex_pieces,
    hull_of,
)
from omnisim.runs.physics.rover import Driver, PathFollower, Rover, SimulatedMotion
from omnisim.scene import Scene
from omnisim.scene.motion.object_motion import FreeBody, ObjectMotion
from omnisim.sensors.imu.imu import STANDARD_GRAVITY_MPS2

STEP_S = 1e-3
# Names of a robot, then of its parts.
ROBOT, PART, WHEEL, CASTER = "robot {}", "robot {} part {}", "robot {} wheel {}", "robot {} caster"
MAX_HULL = 64  # maximum number of a hull's vertices
# Contacts yield by less than 0.2 mm under a robot's weight, and do not bounce.
CONTACT_S, IMPEDANCE = 0.005, 0.3
FRICTION_IMPEDANCE = 100.0  # ratio of friction's impedance to that of contacts: 0.1 mm/s of creep
SERVO_RADPS = 100.0  # natural frequency of the wheels' servos, which are critically damped
FRICTION = (0.5, 5e-3, 1e-4)  # everything but tires: sliding; torsional and rolling, in meters
ROLLING_RESISTANCE = 0.02  # for balls
CASTER_FRICTION = 1e-3
WHEEL_WIDTH = 0.4  # share of the diameter
WHEEL_MASS = 0.03  # share of the robot's mass
TIRE_PRIORITY, CASTER_PRIORITY = 1, 2  # the higher one's friction applies

GEOMS = {
    "ball": mujoco.mjtGeom.mjGEOM_SPHERE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}

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
    """World of robots driven by their wheels, of scripted objects, and of free ones.

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
        """Advance by one period, to `time_s`, at rates of each robot's left and right wheels."""
        sides = zip(rates_radps, self._wheels, strict=True)
        rates = np.concatenate([np.repeat(rate, wheels.shape[1]) for rate, wheels in sides])
        for number, motion in self._motions:
            pose = motion.pose_at(time_s)
            self._data.mocap_pos[number] = pose[:3, 3]
            quaternion = poses.quaternion_from_rotation(pose[None, :3, :3])[0]
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
    """Simulate robots that follow planned trajectories through a scene, by name.

    They can collide with each other, with dynamic objects, and push objects that have a mass. The
    motion of each is from the first start to the last end.

    Raises:
        TrajectoryError: a robot cannot follow its path or tips over, a path is too long, or the
            scene is too large.
    """
    start_s = min(driver.motion.start_s for driver in drivers.values())
    for driver in drivers.values():
        if (duration_s := driver.motion.end_s - start_s) > MAX_S:
            raise TrajectoryError(
                f"{driver.where}: expected at most {MAX_S:g} s with --physics, got {duration_s:g} s"
            )
    objects = solid_objects(scene)
    pieces = static_pieces(scene, drivers.values(), objects)
    rovers = {name: driver.rover for name, driver in drivers.items()}
    starts = {
        name: (driver.rover, driver.planned.world_from_base[0]) for name, driver in drivers.items()
    }
    model = WorldModel.of(pieces, objects, starts)
    free = [name for name, solid in objects.items() if solid.mass_kg is not None]
    motions = {moving.name: moving.motion for moving in scene.objects if moving.name not in free}
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
    duration_s = max(driver.motion.end_s for driver in drivers.values()) - start_s
    count = math.ceil(duration_s / PERIOD_S) + 1
    times_s = start_s + PERIOD_S * np.arange(count, dtype=np.float64)
    robots = [_Robot(name, driver, times_s) for name, driver in drivers.items()]
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
    """Robot during the simulation."""

    def __init__(self, name: str, driver: Driver, times_s: Floats):
        self.name, self.rover, self._driver = name, driver.rover, driver
        self.follower = PathFollower(driver.motion, driver.rover, times_s)
        self.contact_times_s: dict[str, list[float]] = {}  # by the touched object's name

    def check(self, world: SimulatedWorld, base: Floats, command: int, time_s: float) -> None:
        """Check the base, position and quaternion wxyz (7,), at a command.

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
        hint = "--ignore-limits drives on regardless"
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
    rotations = poses.rotation_from_quaternion(np.roll(bodies[:, 3:], -1, axis=1))
    return Trajectory(times_s, poses.pose_from_rotation(rotations, bodies[:, :3]))


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
    solids: dict[str, SolidObject] = {}
    for moving in scene.objects:
        name, motion, pose = moving.name, moving.motion, moving.motion.pose_at(0.0)
        if not isinstance(motion, FreeBody):
            solids[name] = SolidObject(convex_pieces(moving.shape, SolidRegion.everywhere()), pose)
            continue
        hull = hull_of(moving.shape)
        if hull is None:
            raise TrajectoryError(f"object {name!r}: mass_kg: expected a solid, got a flat object")
        solids[name] = SolidObject([ConvexPiece(name, hull)], pose, motion.mass_kg)
    return solids


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
    for solid in objects.values():
        if solid.mass_kg is not None:
            low = np.minimum(low, solid.pose[:3, 3] - OBJECT_REACH_M)
            high = np.maximum(high, solid.pose[:3, 3] + OBJECT_REACH_M)
    middles = [
        driver.planned.positions_m
        + driver.planned.world_from_base[:, :3, 2] * 2.0 * driver.rover.wheel_radius_m
        for driver in drivers
    ]
    pieces = convex_pieces(scene, SolidRegion(low, high, np.concatenate(middles)))
    if len(pieces) > MAX_PIECES:
        raise TrajectoryError(
            f"{scene.name}: expected at most {MAX_PIECES} convex pieces about the path with "
            f"--physics, got {len(pieces)}"
        )
    return pieces


# MuJoCo's model of a scene and its robots.


@dataclass(frozen=True, eq=False)
class SolidObject:
    """Dynamic object of a scene."""

    pieces: Sequence[ConvexPiece]  # convex pieces in the object's frame
    pose: Pose  # (4, 4) initial pose
    # mass of a free object; None: the object follows the scene's motion
    mass_kg: float | None = None


@dataclass(eq=False)
class WorldModel:
    """Specification of a model, and the owners of its geoms."""

    spec: mujoco.MjSpec = field(default_factory=mujoco.MjSpec)  # specification to compile
    # names of the instances, objects and robots, by the names of their geoms
    owners: dict[str, str] = field(default_factory=dict)
    # names of the robots, by the names of their geoms
    robots: dict[str, str] = field(default_factory=dict)
    wheel_geoms: set[str] = field(default_factory=set)  # names of the wheels' and casters' geoms

    def __repr__(self) -> str:
        return short_repr(self, counted(len(self.owners), "piece"))

    @classmethod
    def of(
        cls,
        pieces: Sequence[ConvexPiece],
        objects: Mapping[str, SolidObject],
        rovers: Mapping[str, tuple[Rover, Pose]],
    ) -> WorldModel:
        """Model of static pieces, objects by name, and robots by name at poses of their bases."""
        model = cls()
        contacts = model.spec.default.geom
        contacts.solref = (CONTACT_S, 1.0)
        contacts.solimp[:2] = IMPEDANCE
        contacts.friction = FRICTION
        option = model.spec.option
        option.timestep = STEP_S
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        option.impratio = FRICTION_IMPEDANCE
        # bodies at rest cost nothing
        option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
        option.gravity = (0.0, 0.0, -STANDARD_GRAVITY_MPS2)
        for piece in pieces:
            model._add_piece(model.spec.worldbody, piece.name, piece.shape)
        for name, solid in objects.items():
            body = model.spec.worldbody.add_body(
                name=f"object {name}", pos=solid.pose[:3, 3], quat=_quaternion(solid.pose[:3, :3])
            )
            body.mocap = solid.mass_kg is None
            if solid.mass_kg is not None:
                body.add_freejoint(name=f"object {name}")
            for piece in solid.pieces:
                share_kg = (solid.mass_kg or 0.0) / len(solid.pieces)
                model._add_piece(body, name, piece.shape, share_kg)
        for name, (rover, pose) in rovers.items():
            model._add_rover(name, rover, pose)
        return model

    def _add_piece(
        self, body: mujoco.MjsBody, owner: str, shape: SolidShape, mass_kg: float = 0.0
    ) -> None:
        """Add a piece of an owner to a body."""
        name = f"piece {len(self.owners)}"
        self.owners[name] = owner
        geom = body.add_geom(
            name=name,
            type=GEOMS[shape.kind],
            pos=shape.center_m,
            quat=_quaternion(shape.axes),
            mass=mass_kg,
        )
        if shape.kind == "hull":
            self.spec.add_mesh(
                name=name,
                uservert=shape.vertices_m.ravel(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
                maxhullvert=MAX_HULL,
            )
            geom.meshname = name
        else:
            geom.size = shape.half_m
        if shape.kind == "ball" and mass_kg > 0.0:
            geom.condim = 6
            rolling_m = ROLLING_RESISTANCE * float(shape.half_m[0])
            geom.friction = (FRICTION[0], FRICTION[1], rolling_m)

    def _add_rover(self, owner: str, rover: Rover, pose: Pose) -> None:
        robot = ROBOT.format(owner)
        base = self.spec.worldbody.add_body(
            name=robot, pos=pose[:3, 3], quat=_quaternion(pose[:3, :3])
        )
        base.add_freejoint(name=robot)
        wheel_kg = WHEEL_MASS * rover.mass_kg
        base.explicitinertial = True
        base.mass = rover.mass_kg - wheel_kg * len(rover.wheels_m)
        base.ipos = rover.center_m
        squares = rover.size_m**2
        base.inertia = base.mass / 12.0 * (squares.sum() - squares)
        for number, (low, high) in enumerate(rover.parts_m):
            part = PART.format(owner, number)
            self._own(part, owner)
            base.add_geom(
                name=part,
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=0.5 * (low + high),
                size=np.maximum(0.5 * (high - low), 1e-4),
            )
        if rover.caster_m is not None:
            caster = CASTER.format(owner)
            self._own(caster, owner, is_round=True)
            base.add_geom(
                name=caster,
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                pos=rover.caster_m,
                size=np.full(3, rover.caster_m[2]),
                friction=(CASTER_FRICTION, *FRICTION[1:]),
                priority=CASTER_PRIORITY,
            )
        for number, middle_m in enumerate(rover.wheels_m):
            wheel = WHEEL.format(owner, number)
            self._own(wheel, owner, is_round=True)
            self._add_wheel(base, wheel, rover, middle_m, wheel_kg)

    def _own(self, geom: str, robot: str, is_round: bool = False) -> None:
        self.owners[geom] = self.robots[geom] = robot
        if is_round:
            self.wheel_geoms.add(geom)

    def _add_wheel(
        self, base: mujoco.MjsBody, name: str, rover: Rover, middle_m: Floats, mass_kg: float
    ) -> None:
        """Add a driven wheel: its tire is an ellipsoid, which meets the ground below its center."""
        radius_m = rover.wheel_radius_m
        wheel = base.add_body(name=name, pos=middle_m)
        joint = wheel.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0.0, 1.0, 0.0))
        wheel.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=(radius_m, WHEEL_WIDTH * radius_m, radius_m),
            mass=mass_kg,
            friction=(rover.friction, *FRICTION[1:]),
            priority=TIRE_PRIORITY,
        )
        # the motor's inertia equals that of the wheel's share of the robot's mass
        inertia = rover.mass_kg * radius_m**2 / len(rover.wheels_m)
        joint.armature = inertia
        servo = self.spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=name)
        servo.set_to_position(kp=inertia * SERVO_RADPS**2, kv=2.0 * inertia * SERVO_RADPS)


def _quaternion(rotation: Floats) -> Floats:
    """Quaternion (4,) wxyz of a rotation (3, 3)."""
    return np.roll(poses.quaternion_from_rotation(rotation[None])[0], 1)
