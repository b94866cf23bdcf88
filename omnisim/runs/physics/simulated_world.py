"""World in MuJoCo: a compiled model, its state, and the contacts of its robots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import quaternion_from_rotation
from omnisim.runs.physics.rover import Rover
from omnisim.runs.physics.world_model import ROBOT, SERVO_RADPS, STEP_S, WHEEL, WorldModel
from omnisim.scene.motion.object_motion import ObjectMotion

STEPS_AT_ONCE = 5
PERIOD_S = STEPS_AT_ONCE * STEP_S
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
    def bodies(self) -> NDArray[np.float64]:
        """Positions and quaternions wxyz (n, 7) of the robots' bases and of the free objects."""
        return self._data.qpos[self._bodies]

    @property
    def wheels_rad(self) -> NDArray[np.float64]:
        """Mean angles (n, 2) that the robots' left and right wheels have turned."""
        angles: NDArray[np.float64] = self._data.qpos
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
