"""Simulation of served robots: their motion by commands, and what their sensors measure.

Simulated time advances by `advance`, which moves the robots and publishes what needs no rendering:
the clock, transforms, odometry and IMU readings. `measure` renders what is due by then. Images,
clouds and readings have the bits of a recorded drive along the same commands.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import scipy  # its submodules load when first used

from omnisim.core.arrays import Floats
from omnisim.core.errors import PlanError, ServeError, did_you_mean
from omnisim.core.files.image_files import image_bytes
from omnisim.core.pending import Pending
from omnisim.core.poses import MAX_M, roll_pitch_yaw_from_rotation
from omnisim.core.world import WorldState
from omnisim.datasets.export.export_format import NANOSECONDS
from omnisim.datasets.export.ros2 import CloudLayout
from omnisim.datasets.export.ros2 import ros_messages as ros
from omnisim.datasets.export.ros2 import sensor_messages as of_sensors
from omnisim.datasets.free_space import find_free_space
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import RecordedFrame
from omnisim.rendering.sensor import Moment, Reading
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import Sensor, Stage
from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.runs.commanded_motion import TICKS_PER_S, TIMEOUT_S, CommandedMotion, lines_of
from omnisim.runs.drive import MAX_BEGUN, with_short_name
from omnisim.scene import Scene
from omnisim.serve.publisher import Publisher, Topic
from omnisim.serve.served_robot import BASE, MAP, Eye, ServedRobot

JPEG_QUALITY = 90


class _Due(NamedTuple):
    """Measurement of a robot's sensor; a reset, which begins another motion, makes it void."""

    robot: ServedRobot
    eye: Eye
    motion: CommandedMotion
    moment: Moment


@dataclass(frozen=True, eq=False)
class ServeSettings:
    """World and robots to serve.

    Attributes:
        scene: scene with its dynamic objects.
        vehicles: robots by name; each needs kinematic limits.
        starts: x and y in meters and heading in radians of each robot at time 0, by name.
        rate_hz: rate of odometry and transforms, and of sensors without their own rate.
        seed: seed of the odometry's and the cameras' noise, as of a drive.
        timeout_s: duration of a velocity command.
        channels: channels of ground truth that cameras also publish: range, semantic, instance.
        layout: layout of lidar clouds.
        unlit, device, backend: as of a drive.
        keeps_commands: keep all commands, for `Simulation.commands`.
    """

    scene: Scene
    vehicles: Mapping[str, Vehicle]
    starts: Mapping[str, tuple[float, float, float]]
    rate_hz: float = 10.0
    seed: int = 0
    timeout_s: float = TIMEOUT_S
    channels: tuple[str, ...] = ()
    layout: CloudLayout = "generic"
    unlit: bool = False
    device: int | None = None
    backend: BackendName = "cube"
    keeps_commands: bool = False


class Served(ABC):
    """Source of a loop's messages: a simulation, or a recorded run.

    Attributes:
        publishers: protocols that receive the messages.
        topics: all topics, known after `open`.
        now_s: simulated time.
        end_s: its end; infinite for a simulation.
    """

    publishers: list[Publisher]
    topics: list[Topic]
    now_s: float
    end_s: float = math.inf

    @abstractmethod
    def open(self) -> None:
        """Open it, in the thread that also calls `measure` and `close`."""

    @abstractmethod
    def announce(self) -> None:
        """Publish what does not change."""

    @property
    @abstractmethod
    def robots(self) -> Sequence[str]:
        """Names of the robots."""

    @abstractmethod
    def command(self, robot: str, speed_mps: float, turn_rate_radps: float) -> None:
        """Drive at a speed and turn rate until the next command or the timeout."""

    @abstractmethod
    def set_pose(self, robot: str, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Put a robot at a place, at rest."""

    @abstractmethod
    def reset(self) -> None:
        """Begin again at time 0."""

    @abstractmethod
    def advance(self) -> None:
        """Advance simulated time by a tick, and publish what needs no rendering."""

    def measure(self, skips: bool = False) -> bool:
        """Render what is due, see `Simulation.measure`."""
        return False

    def finish(self) -> None:  # noqa: B027  # a run has nothing to wait for
        """Wait until all measurements are published."""

    def summary(self) -> str:
        """Skipped measurements as text, for the last line; empty: none."""
        return ""

    def close(self) -> None:  # noqa: B027
        """Free everything; a second call does nothing."""


class Simulation(Served):
    """World of served robots; whoever holds it advances it.

    `open`, `measure` and `close` belong to one thread; everything else may be called from any.

    Args:
        settings: world and robots.
        publishers: protocols that receive the messages.

    Attributes:
        now_s: simulated time.
        topics: all topics, known after `open`.

    Raises:
        RobotFileError: a robot without kinematic limits.
        ServeError: a start that is not finite, or too far away.
    """

    def __init__(self, settings: ServeSettings, publishers: Sequence[Publisher] = ()):
        for name, start in settings.starts.items():
            for key, value in zip(("x_m", "y_m", "yaw_rad"), start, strict=True):
                _check_number(f"robot {name!r}: start: {key}", value)
        self.settings, self.publishers = settings, list(publishers)
        self.now_s = 0.0
        self.topics: list[Topic] = []
        self._scene = with_short_name(settings.scene)
        self._lock = threading.RLock()  # of motions and clocks
        several = len(settings.vehicles) > 1
        self._robots = {
            name: ServedRobot(
                name, vehicle, self._scene, settings.starts[name], f"{name}/" if several else "",
                settings.rate_hz, settings.seed, settings.timeout_s, settings.keeps_commands,
            )
            for name, vehicle in settings.vehicles.items()
        }  # fmt: skip
        self._stack = ExitStack()
        self._writing: deque[Future[None]] = deque()
        self._turns = itertools.count(1)  # of late sensors, so that none waits for the others
        # what clients asked for, until the next tick, by kind and robot: the newest of each
        self._wishes: dict[tuple[str, str], Callable[[], object]] = {}
        self._wishing = threading.Lock()

    def open(self) -> None:
        """Load the scene, and open all sensors.

        Raises:
            OmnisimError: no OpenGL, or a scene beyond its limits.
        """
        settings, robots = self.settings, self._robots.values()
        bodies = {robot.name: robot.vehicle.body for robot in robots}
        visible = {name: body for name, body in bodies.items() if body is not None}
        stage = Stage(
            self._scene, vehicles=visible, device=settings.device, backend=settings.backend
        )
        self._stack.enter_context(stage)
        self._stack.enter_context(stage.current())
        self._writer = self._stack.enter_context(ThreadPoolExecutor(1, "omnisim-serve"))
        for robot in robots:
            for mount in robot.vehicle.sensors:
                if not isinstance(mount.sensor, Sensor):
                    continue
                placed = dataclasses.replace(
                    mount,
                    vehicle=robot.name,
                    seed=f"{settings.seed} {mount.name}",
                    unlit=settings.unlit,
                )
                instrument = self._stack.enter_context(mount.sensor.open(stage, placed))
                clock = {"mount": mount, "step_hz": settings.rate_hz, "seed": settings.seed}
                robot.eyes.append(Eye.of(instrument, settings.channels, **clock))
        shared = [("/clock", "rosgraph_msgs/msg/Clock"), ("/tf", "tf2_msgs/msg/TFMessage")]
        latched = [
            ("/tf_static", "tf2_msgs/msg/TFMessage"),
            ("/map", "nav_msgs/msg/OccupancyGrid"),
        ]
        self.topics = [
            *(Topic(*names) for names in shared),
            *(Topic(*names, is_latched=True) for names in latched),
            *(topic for robot in robots for topic in robot.topics()),
        ]

    def announce(self) -> None:
        """Publish what does not change: frames, map, calibrations and descriptions."""
        robots = list(self._robots.values())
        self._publish("/tf_static", 0, ros.transforms(0, _all_frames(robots)))
        floor = map_message(self._scene, 0, MAP, robots[0].boxes)
        if floor is not None:
            self._publish("/map", 0, floor)
        for robot in robots:
            urdf = robot_description(
                robot.vehicle.name, robot.boxes, robot.frame(BASE), robot.static_frames()
            )
            self._publish(robot.topic("/robot_description"), 0, ros.text(urdf))
            for eye in robot.eyes:
                if isinstance(eye.mount.sensor, OmniCamera):
                    topic = robot.topic(f"/{of_sensors.ros_name(eye.mount.name)}/calibration")
                    self._publish(topic, 0, ros.text(eye.mount.sensor.calibration_json()))

    def close(self) -> None:
        """Free all sensors and the scene; a second call does nothing."""
        self._stack.close()

    # What clients may ask, as `Controls`; it happens at the next tick.

    @property
    def robots(self) -> Sequence[str]:
        """Names of the robots."""
        return tuple(self._robots)

    def command(self, robot: str, speed_mps: float, turn_rate_radps: float) -> None:
        """Drive at a speed and turn rate until the next command or the timeout."""
        found = self._robot(robot)
        for name, value in (("speed_mps", speed_mps), ("turn_rate_radps", turn_rate_radps)):
            _check_number(name, value)
        rates = float(speed_mps), float(turn_rate_radps)
        self._wish("command", found.name, lambda: found.motion.command(*rates))

    def set_pose(self, robot: str, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Put a robot at a place, at rest."""
        found = self._robot(robot)
        for name, value in (("x_m", x_m), ("y_m", y_m), ("yaw_rad", yaw_rad)):
            _check_number(name, value)
        self._wish("set_pose", found.name, lambda: found.place(x_m, y_m, yaw_rad))

    def reset(self) -> None:
        """Begin again at time 0, with all robots at their starts."""
        with self._wishing:
            self._wishes = {("reset", ""): self._reset}

    def _wish(self, kind: str, robot: str, wish: Callable[[], object]) -> None:
        with self._wishing:
            self._wishes.pop((kind, robot), None)  # the newest comes last
            self._wishes[kind, robot] = wish

    def _reset(self) -> None:
        self.now_s = 0.0
        for robot in self._robots.values():
            robot.reset()

    def _robot(self, name: str) -> ServedRobot:
        if name not in self._robots and name:
            hint = did_you_mean(name, self._robots)
            raise ServeError(f"robot {name[:100]!r}: no such robot: {hint}")
        return self._robots[name or next(iter(self._robots))]

    def summary(self) -> str:
        """Measurements that were skipped, by sensor."""
        skipped = [
            f"{robot.frame(eye.mount.name)} {eye.skipped}"
            for robot in self._robots.values()
            for eye in robot.eyes
            if eye.skipped
        ]
        return f"; measurements skipped: {', '.join(skipped)}" if skipped else ""

    def commands(self, robot: str) -> str:
        """Text of the file of commands that repeats a robot's motion so far."""
        found = self._robot(robot)
        with self._lock:
            return "\n".join(lines_of(found.motion, found.lines)) + "\n"

    # Time, and measurements.

    def advance(self) -> None:
        """Do what clients asked for, advance by a tick, and publish what needs no rendering."""
        with self._wishing:
            wishes, self._wishes = self._wishes, {}
        with self._lock:
            for wish in wishes.values():
                wish()
            next_s = (round(self.now_s * TICKS_PER_S) + 1) / TICKS_PER_S
            for robot in self._robots.values():
                robot.motion.advance(next_s)
            self.now_s = next_s
            self._publish_motion()

    def _publish_motion(self) -> None:
        """Publish the clock, and the steps and IMU readings that are due."""
        stamp_ns = round(self.now_s * NANOSECONDS)
        if self._wants("/clock"):
            self._publish("/clock", stamp_ns, ros.clock(stamp_ns))
        for robot in self._robots.values():
            while robot.next_step_s <= self.now_s:
                time_s = robot.next_step_s
                step_ns = round(time_s * NANOSECONDS)
                messages, poses = robot.step()
                for motion in self._scene.objects:
                    frame = of_sensors.ros_name(motion.name)
                    poses[MAP, frame] = motion.motion.pose_at(time_s)
                messages["/tf"] = ros.transforms(step_ns, poses)
                self._publish_all(messages, step_ns)
            for unit in robot.units:
                name = unit.mount.name
                is_wanted = self._wants(robot.topic(f"/{of_sensors.ros_name(name)}/data_raw"))
                for time_s, values in unit.readings(robot.motion, self.now_s, is_wanted):
                    read_ns = round(time_s * NANOSECONDS)
                    reading = of_sensors.imu_messages(name, read_ns, values)
                    self._publish_all(robot.named(reading), read_ns)

    def measure(self, skips: bool = False) -> bool:
        """Render what is due and wanted by now; False: nothing was.

        Args:
            skips: of a sensor's several due measurements make only the last, as the wall clock
                does not wait; otherwise make all, in the order of their times.
        """
        begun: deque[tuple[_Due, Pending[Reading]]] = deque()
        found = False
        while (due := self._next_due(skips)) is not None:
            assert due.eye.instrument is not None
            reading = due.eye.instrument.begin(due.moment)
            due.eye.last, found = (due.motion, due.moment.number, reading), True
            begun.append((due, reading))
            if len(begun) > MAX_BEGUN:
                self._write(*begun.popleft())
            if skips:
                break
        for measurement in begun:
            self._write(*measurement)
        return found

    def _write(self, due: _Due, pending: Pending[Reading]) -> None:
        """Begin to publish a reading, which the thread of the stage must ask for."""
        reading = pending.result()
        self._writing.append(self._writer.submit(self._publish_reading, due, reading))
        while len(self._writing) > MAX_BEGUN:
            self._writing.popleft().result()

    def finish(self) -> None:
        """Wait until all measurements are published."""
        while self._writing:
            self._writing.popleft().result()

    def _next_due(self, skips: bool) -> _Due | None:
        """Measurement with the earliest time that is due and wanted; it counts as made."""
        with self._lock:
            due: list[tuple[float, int, ServedRobot, Eye]] = []
            for robot in self._robots.values():
                for eye in robot.eyes:
                    is_wanted = any(self._wants(robot.topic(topic.name)) for topic in eye.topics)
                    while eye.is_ready(self.now_s):
                        if is_wanted and not (skips and self._is_late(eye)):
                            order = eye.turn if skips else eye.time_s(eye.index)
                            due.append((order, len(due), robot, eye))
                            break
                        eye.skipped += is_wanted
                        eye.index += 1
            if not due:
                return None
            _, _, robot, eye = min(due)
            index, eye.turn = eye.index, next(self._turns)
            eye.index += 1
            motions = {each.name: each.motion for each in self._robots.values()}
        motion = motions[robot.name]
        previous = eye.last if eye.last is not None and eye.last[0] is motion else None
        moment = Moment(
            partial(self._state_at, motions),
            index,
            eye.time_s(index),
            None if previous is None else eye.time_s(previous[1]),
            None,
            self.settings.channels if isinstance(eye.mount.sensor, OmniCamera) else (),
            None if previous is None else Path(eye.mount.name),
            None if previous is None else previous[2],
        )
        return _Due(robot, eye, motion, moment)

    def _is_late(self, eye: Eye) -> bool:
        """True if the measurement after the next one is due, too."""
        return eye.time_s(eye.index + 1) + eye.margin_s <= self.now_s

    def _state_at(self, motions: Mapping[str, CommandedMotion], time_s: float) -> WorldState:
        """State of the world, as of a drive's."""
        with self._lock:
            poses: dict[str, Floats] = {
                name: motion.pose_at(time_s) for name, motion in motions.items()
            }
        poses |= {moving.name: moving.motion.pose_at(time_s) for moving in self._scene.objects}
        return WorldState.of_checked(poses, time_s)

    def _publish_reading(self, due: _Due, reading: Reading) -> None:
        robot, eye = due.robot, due.eye
        name, stamp_ns = eye.mount.name, round(due.moment.time_s * NANOSECONDS)
        rate = eye.mount.rate
        period_s = 1.0 / (self.settings.rate_hz if rate is None else rate.rate_hz)
        messages = of_sensors.of_reading(
            name, reading, stamp_ns, lens=eye.lens, period_s=period_s, layout=self.settings.layout
        )
        compressed = f"/{of_sensors.ros_name(name)}{of_sensors.COMPRESSED}"
        if isinstance(reading, RecordedFrame) and self._wants(robot.topic(compressed)):
            jpeg = image_bytes(Path("a.jpg"), reading.frame.rgb, None, JPEG_QUALITY)
            frame = of_sensors.optical_frame(name)
            messages[compressed] = ros.compressed_image(stamp_ns, frame, jpeg, "jpeg")
        with self._lock:  # of resets
            if due.motion is robot.motion:
                self._publish_all(robot.named(messages), stamp_ns)

    def _wants(self, topic: str) -> bool:
        return any(publisher.wants(topic) for publisher in self.publishers)

    def _publish_all(self, messages: Mapping[str, object], stamp_ns: int) -> None:
        for topic, message in messages.items():
            self._publish(topic, stamp_ns, message)

    def _publish(self, topic: str, stamp_ns: int, message: object) -> None:
        for publisher in self.publishers:
            publisher.publish(topic, stamp_ns, message)


def _all_frames(robots: Sequence[ServedRobot]) -> dict[tuple[str, str], Floats]:
    frames: dict[tuple[str, str], Floats] = {}
    for robot in robots:
        frames |= robot.static_frames()
    return frames


def _check_number(name: str, value: float) -> None:
    if not (isinstance(value, int | float) and abs(value) < MAX_M):  # nor is NaN
        raise ServeError(f"{name} = {str(value)[:50]}: expected a finite number below {MAX_M:g}")


# Latched messages: the floor map, and a robot's shape as URDF.


RADIUS_M = 0.2  # of cells that count as free: four cells
FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # of nav_msgs/OccupancyGrid


def map_message(scene: Scene, stamp_ns: int, frame: str, boxes: BodyBoxes | None) -> object | None:
    """OccupancyGrid of a scene's floor for a robot's height; None: the scene has no floor.

    It ends one cell beyond the floor. Cells whose surfaces are higher than the robot's clearance
    are occupied; without a floor they are unknown.
    """
    height_m, step_m = (1.0, 0.05) if boxes is None else (float(boxes.high_m[2]), boxes.clearance_m)
    try:
        free = find_free_space(scene, RADIUS_M, height_m, step_m, from_start=False)
    except PlanError:
        return None
    cells = np.where(np.isfinite(free.floor_m), FREE, UNKNOWN)
    cells[free.clearance_m <= 0.75 * free.cell_m] = OCCUPIED
    floor = scipy.ndimage.binary_dilation(cells == FREE)
    (around,) = scipy.ndimage.find_objects(floor.astype(np.int8))
    low_m = free.low_m + free.cell_m * np.array((around[1].start, around[0].start))
    return ros.occupancy_grid(stamp_ns, frame, cells[around].astype(np.int8), low_m, free.cell_m)


def robot_description(
    name: str,
    boxes: BodyBoxes | None,
    base: str,
    frames: Mapping[tuple[str, str], Floats],
) -> str:
    """URDF of a robot: the boxes of its body's parts, and its sensors' frames (4, 4) on the base.

    Source: ROS, the URDF specification.
    """
    root = ElementTree.Element("robot", name=name)
    link = ElementTree.SubElement(root, "link", name=base)
    for low, high in () if boxes is None else boxes.parts_m.tolist():
        visual = ElementTree.SubElement(link, "visual")
        middle = " ".join(f"{0.5 * (a + b):.6g}" for a, b in zip(low, high, strict=True))
        ElementTree.SubElement(visual, "origin", xyz=middle, rpy="0 0 0")
        size = " ".join(f"{b - a:.6g}" for a, b in zip(low, high, strict=True))
        ElementTree.SubElement(ElementTree.SubElement(visual, "geometry"), "box", size=size)
    for (parent, child), pose in frames.items():
        ElementTree.SubElement(root, "link", name=child)
        joint = ElementTree.SubElement(root, "joint", name=f"{child}_joint", type="fixed")
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        angles = roll_pitch_yaw_from_rotation(pose[:3, :3]).tolist()
        xyz, rpy = (
            " ".join(f"{value + 0.0:.9g}" for value in row)
            for row in (pose[:3, 3].tolist(), angles)
        )
        ElementTree.SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")
