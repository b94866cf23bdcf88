"""MuJoCo's model of a scene and its robots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.poses import quaternion_from_rotation
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.world import Pose
from omnisim.runs.physics.convex_pieces import ConvexPiece, Shape
from omnisim.runs.physics.rover import WHEEL_MASS, WHEEL_WIDTH, Rover
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
TIRE_PRIORITY, CASTER_PRIORITY = 1, 2  # the higher one's friction applies

GEOMS = {
    "ball": mujoco.mjtGeom.mjGEOM_SPHERE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "hull": mujoco.mjtGeom.mjGEOM_MESH,
}


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
        for name, one in objects.items():
            model._add_object(name, one)
        for name, (rover, pose) in rovers.items():
            model._add_rover(name, rover, pose)
        return model

    def _add_piece(
        self, body: mujoco.MjsBody, owner: str, shape: Shape, mass_kg: float = 0.0
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

    def _add_object(self, name: str, solid: SolidObject) -> None:
        body = self.spec.worldbody.add_body(
            name=f"object {name}", pos=solid.pose[:3, 3], quat=_quaternion(solid.pose[:3, :3])
        )
        body.mocap = solid.mass_kg is None
        if solid.mass_kg is not None:
            body.add_freejoint(name=f"object {name}")
        for piece in solid.pieces:
            share_kg = (solid.mass_kg or 0.0) / len(solid.pieces)
            self._add_piece(body, name, piece.shape, share_kg)

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
    return np.roll(quaternion_from_rotation(rotation[None])[0], 1)
