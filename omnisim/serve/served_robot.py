"""Served robot: its motion by commands, the clocks of its sensors, and its odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import RobotFileError
from omnisim.core.pending import Pending
from omnisim.core.poses import inverse
from omnisim.core.rate import printed_s
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.odometry import Odometry, WheelErrors, wheel_readings
from omnisim.datasets.export.ros2 import ros_messages as ros
from omnisim.datasets.export.ros2 import sensor_messages as of_sensors
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.sensor import Mount, Reading, SensorSettings
from omnisim.rendering.stage import AnyInstrument
from omnisim.robots.kinematics import Kinematics
from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.runs.commanded_motion import (
    CommandedMotion,
    VelocityCommand,
    WheelState,
    command_line,
)
from omnisim.runs.ground import Ground
from omnisim.scene import Scene
from omnisim.sensors.depth_camera.depth_camera import DepthCamera
from omnisim.sensors.imu.imu import Imu
from omnisim.serve.publisher import Topic

MAP, ODOM, BASE = "map", "odom", "base_link"
PLACED = "put at another place"
KEPT_S = 10.0  # past motion at hand; revolutions and exposures are far shorter
BLOCK = 1024  # stamps that are made at once
BEST_EFFORT = frozenset(  # as drivers publish the data of sensors (rmw_qos_profile_sensor_data)
    {"image_raw", "compressed", "image_rect", "points", "scan", "range", "data_raw"}
)


@dataclass(eq=False)
class SensorClock:
    """Times of one sensor's measurements, one after the other.

    Attributes:
        mount: the sensor.
        step_hz: rate of a sensor without its own.
        seed: seed of the drive.
        margin_s: time from a stamp to the last state that its measurement needs.
        index: number of the next measurement.
    """

    mount: Mount[SensorSettings]
    step_hz: float
    seed: int
    margin_s: float = 0.0
    index: int = 0
    _first: int = 0
    _block_s: Floats = field(default_factory=lambda: np.zeros(0))

    def time_s(self, index: int) -> float:
        """Stamp of a measurement, as in a drive."""
        if not 0 <= index - self._first < len(self._block_s):
            self._first = max(0, index - 1)
            indices = np.arange(self._first, self._first + BLOCK)
            rate = self.mount.rate
            self._block_s = (
                printed_s(indices / self.step_hz)
                if rate is None
                else rate.stamps_s(indices, 0.0, math.inf, self.seed)
            )
        return float(self._block_s[index - self._first])

    def is_ready(self, now_s: float) -> bool:
        """True if the next measurement can be made at a simulated time."""
        return self.time_s(self.index) + self.margin_s <= now_s


@dataclass(eq=False)
class Eye(SensorClock):
    """Sensor that is rendered."""

    instrument: AnyInstrument | None = None
    topics: tuple[Topic, ...] = ()
    lens: Any = None  # `true_lens` of a camera
    # motion, number and reading of the last measurement
    last: tuple[CommandedMotion, int, Pending[Reading]] | None = None
    turn: int = 0  # number of its last measurement among those of all sensors
    skipped: int = 0  # measurements that were not made, as the simulation was late

    @classmethod
    def of(cls, instrument: AnyInstrument, channels: tuple[str, ...], **clock: Any) -> Eye:
        """Eye of an open instrument; `channels` of ground truth are those of cameras."""
        mount = clock["mount"]
        sensor, margin_s = mount.sensor, 0.0
        lens = None
        if isinstance(sensor, OmniCamera | DepthCamera):
            lens = of_sensors.true_lens(mount.name, sensor.model)
        if isinstance(sensor, OmniCamera):
            shutter = sensor.degradation.shutter
            half_s = 0.0 if shutter is None else 0.5 * shutter.duration_s
            margin_s = max(0.0, mount.time_shift_s + half_s)
        kinds = of_sensors.topics_of(mount, lens, channels)
        topics = tuple(Topic(name, kind) for name, kind in kinds.items())
        return cls(**clock, margin_s=margin_s, instrument=instrument, topics=topics, lens=lens)


@dataclass(eq=False)
class InertialUnit(SensorClock):
    """Inertial measurement unit, whose biases walk on."""

    _begin: int = 0  # index of the first reading whose errors are drawn, which many share
    _errors: tuple[Floats, Floats] = (np.zeros((0, 6)), np.zeros((0, 6)))

    def begin_again(self) -> None:
        """Make the first reading next."""
        self.index = self._begin = 0
        self._errors = np.zeros((0, 6)), np.zeros((0, 6))

    def readings(
        self, motion: CommandedMotion, now_s: float, is_wanted: bool
    ) -> list[tuple[float, list[float]]]:
        """Stamps and values (6,) of the readings that are due at a simulated time, if wanted."""
        first, imu = self.index, self.mount.sensor
        assert isinstance(imu, Imu)
        while self.is_ready(now_s):
            if self.index == self._begin + len(self._errors[0]):
                before = self._errors[0][-1] if self.index else np.zeros(6)
                drawn = imu.next_errors(self.mount, self.seed, self.index, BLOCK, before)
                kept = slice(first - self._begin, None)  # of readings that are due, too
                pairs = zip(self._errors, drawn, strict=True)
                biases, noise = (np.concatenate((old[kept], new)) for old, new in pairs)
                self._begin, self._errors = first, (biases, noise)
            self.index += 1
        if self.index == first or not is_wanted:
            return []
        times_s = np.array([self.time_s(index) for index in range(first, self.index)])
        rows = slice(first - self._begin, self.index - self._begin)
        biases, noise = (errors[rows] for errors in self._errors)
        values = imu.readings_at(self.mount, motion, times_s, biases, noise)
        return list(zip(times_s.tolist(), values.tolist(), strict=True))


class ServedRobot:
    """Robot that follows commands, with its sensors.

    Args:
        name: unique name.
        vehicle: the robot.
        scene: scene in which it drives.
        start: x and y in meters, and heading in radians, at time 0.
        prefix: name and slash of topics and frames; empty for an only robot.
        step_hz, seed, timeout_s, keeps_commands: see `ServeSettings`.

    Raises:
        RobotFileError: the robot has no kinematic limits.
    """

    def __init__(
        self,
        name: str,
        vehicle: Vehicle,
        scene: Scene,
        start: tuple[float, float, float],
        prefix: str,
        step_hz: float,
        seed: int,
        timeout_s: float,
        keeps_commands: bool = False,
    ):
        if vehicle.kinematics is None:
            expected = "expected [kinematics], to be driven by commands"
            raise RobotFileError(f"robot {vehicle.name!r}: {expected}")
        self.name, self.vehicle, self.prefix = name, vehicle, prefix
        self.boxes = BodyBoxes.of(vehicle)
        self._limits: Kinematics = vehicle.kinematics
        self._ground = Ground(scene, self.boxes)
        x, y, yaw = start
        self.start = WheelState(x, y, self._ground.height_m((x, y), 0.0), yaw)
        self._step_hz, self._seed, self._timeout_s = step_hz, seed, timeout_s
        self._keeps_commands = keeps_commands
        self.eyes: list[Eye] = []
        self.units = [
            InertialUnit(mount, step_hz, seed, 0.5 / mount.sensor.rate_hz)
            for mount in vehicle.sensors
            if isinstance(mount.sensor, Imu)
        ]
        self.reset()

    def reset(self) -> None:
        """Begin again at the start, at rest."""
        limits, ground = self._limits, self._ground
        heard = self._keep if self._keeps_commands else None
        self.motion = CommandedMotion(self.start, limits, ground, self._timeout_s, KEPT_S, heard)
        self.lines = [command_line(VelocityCommand(0.0, 0.0, 0.0), self.start)]
        self._wheels = WheelErrors(self.vehicle.odometry, self._seed)
        self._steps = 0
        self._before: Floats | None = None  # pose at the step before
        self._reckoned = np.array((*self.start[:2], self.start.yaw_rad))
        for eye in self.eyes:
            eye.index = 0
        for unit in self.units:
            unit.begin_again()

    def place(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Put the robot at a place, at rest; its odometry does not notice."""
        z_m = self._ground.height_m((x_m, y_m), self.motion.state.z_m)
        self.motion.place(WheelState(x_m, y_m, z_m, yaw_rad))
        self._before = None
        if self._keeps_commands:
            at = f"{self.motion.end_s:g} s"
            self.lines.append(f"# {PLACED} at {at}: a drive does not repeat what follows")

    def _keep(self, command: VelocityCommand, state: WheelState) -> None:
        """Keep a command as a line of the commands file."""
        self.lines.append(command_line(command, state))

    # Topics, frames and messages.

    def frame(self, name: str) -> str:
        """Name of one of its frames in the world."""
        return f"{self.prefix}{name}"

    def topic(self, name: str) -> str:
        """Name of one of its topics, given with its slash, in the world."""
        return f"/{self.prefix}{name[1:]}"

    def named(self, messages: dict[str, Any]) -> dict[str, Any]:
        """Messages by the robot's topics, in its frames."""
        if self.prefix:
            for message in messages.values():
                message.header.frame_id = self.frame(message.header.frame_id)
        return {self.topic(name): message for name, message in messages.items()}

    def topics(self) -> list[Topic]:
        """All topics, sensor by sensor."""
        text, odometry = "std_msgs/msg/String", "nav_msgs/msg/Odometry"
        found = [
            Topic("/odom", odometry),
            Topic("/ground_truth/odom", odometry),
            Topic("/robot_description", text, is_latched=True),
        ]
        for unit in self.units:
            name = of_sensors.ros_name(unit.mount.name)
            found.append(Topic(f"/{name}/data_raw", "sensor_msgs/msg/Imu"))
        for eye in self.eyes:
            found += eye.topics
            if isinstance(eye.mount.sensor, OmniCamera):
                name = of_sensors.ros_name(eye.mount.name)
                found.append(Topic(f"/{name}/calibration", text, is_latched=True))
        return [
            Topic(
                self.topic(topic.name),
                topic.type,
                topic.is_latched,
                is_best_effort(topic.name),
            )
            for topic in found
        ]

    def static_frames(self) -> dict[tuple[str, str], Floats]:
        """Poses (4, 4) of its sensors' frames on its base, by names of parent and child."""
        frames = {}
        for mount in self.vehicle.sensors:
            sensor, base_from_frame = mount.sensor, mount.base_from_sensor
            frame = of_sensors.ros_name(mount.name)
            if isinstance(sensor, OmniCamera | DepthCamera):
                camera = (
                    OmniCamera(sensor.model, base_from_rig=base_from_frame)
                    if isinstance(sensor, DepthCamera)
                    else sensor
                )
                base_from_frame = camera.base_from_optical
                frame = of_sensors.optical_frame(mount.name)
            frames[self.frame(BASE), self.frame(frame)] = base_from_frame
        return frames

    @property
    def next_step_s(self) -> float:
        """Time of the next step of odometry and transforms."""
        return float(printed_s(np.array([self._steps / self._step_hz]))[0])

    def step(self) -> tuple[dict[str, Any], dict[tuple[str, str], Floats]]:
        """Odometry messages, and poses of the base, at the next step."""
        time_s = self.next_step_s
        stamp_ns, states = round(time_s * 1e9), self.motion.at(np.array([time_s]))
        pose, speed_mps, rate_radps = states.world_from_base[0], 0.0, 0.0
        if self._before is not None:
            times_s, poses = np.array((0.0, 1.0 / self._step_hz)), np.stack((self._before, pose))
            true = wheel_readings(Trajectory(times_s, poses))
            distances_m, turns_rad = self._wheels.apply(true.distances_m, true.turns_rad)
            start = (self._reckoned[0], self._reckoned[1], self._reckoned[2])
            self._reckoned = Odometry(times_s, distances_m, turns_rad, start).planar_poses[-1]
            speed_mps, rate_radps = distances_m[0] * self._step_hz, turns_rad[0] * self._step_hz
        self._steps, self._before = self._steps + 1, pose
        reckoned = Trajectory.on_ground(
            np.zeros(1), self._reckoned[None, :2], self._reckoned[2:]
        ).world_from_base[0]
        rates = (float(speed_mps), 0.0, 0.0), (0.0, 0.0, float(rate_radps))
        velocity_mps = pose[:3, :3].T @ states.velocity_mps[0]
        truth = velocity_mps.tolist(), states.angular_rate_radps[0].tolist()
        odom, base = self.frame(ODOM), self.frame(BASE)
        messages = {
            self.topic("/odom"): ros.odometry(stamp_ns, (odom, base), reckoned, *rates),
            self.topic("/ground_truth/odom"): ros.odometry(stamp_ns, (MAP, base), pose, *truth),
        }
        return messages, {(MAP, odom): pose @ inverse(reckoned), (odom, base): reckoned}


def is_best_effort(topic: str) -> bool:
    """True for the topics of sensors' data."""
    return topic.rpartition("/")[2] in BEST_EFFORT
