"""Drives: a vehicle along a path through a scene, recorded on disk by its sensors."""

from __future__ import annotations

import dataclasses
import json
import platform
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import RunError, TrajectoryError
from omnisim.core.extras import is_installed, require_extra
from omnisim.core.files.atomic_file import is_written, write_text
from omnisim.core.files.number_files import write_table
from omnisim.core.files.sources import fingerprint
from omnisim.core.pending import Pending
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import Trajectory, read_trajectory, write_trajectory
from omnisim.core.trajectories.body_motion import BodyMotion, SplineMotion
from omnisim.core.trajectories.odometry import Odometry
from omnisim.core.version import __version__
from omnisim.core.world import Pose, WorldState
from omnisim.ground_truth.channel_files import ChannelFormat
from omnisim.rendering.camera.omnicamera import CAMERA_POSES
from omnisim.rendering.missed_surfaces import viewpoint_notes
from omnisim.rendering.reflection_kinds import specular_notes
from omnisim.rendering.sensor import Moment, Reading
from omnisim.rendering.shared_scene import BackendName
from omnisim.rendering.stage import Sensor, Stage
from omnisim.robots import Chassis, simulate_odometry, with_errors, write_odometry
from omnisim.robots.vehicle import BodyBoxes, Vehicle
from omnisim.runs import run_folder
from omnisim.runs.contacts import Contact, find_contacts
from omnisim.runs.physics.rover import Driver, Rover, SimulatedMotion
from omnisim.runs.route import PlannedRoute, Route, plan_route, route_digest
from omnisim.runs.run_manifest import MANIFEST_FORMAT
from omnisim.scene import Scene
from omnisim.scene.labels import BODY, find_labels
from omnisim.sensors.sensor_table import folder_name

MAX_SEED = 2**63 - 1
MAX_BEGUN = 8  # measurements of a step in progress; more of them are written at once
SAME_MOTION_M = 1e-3  # far below a pixel; contacts that amplify rounding exceed it


@dataclass(frozen=True, eq=False)
class Drive:
    """Settings of a drive; they determine the run's files."""

    scene: Scene
    vehicle: Vehicle
    route: Route
    # seed of the odometry's and the cameras' noise; a scanner's noise has its own seed in the robot
    # file
    seed: int = 0
    unlit: bool = False  # show plain base colors
    device: int | None = None  # EGL's number of the GPU; None: the default GPU
    backend: BackendName = "cube"  # back end that renders images and casts rays
    # up_axis, meters_per_unit: loading options of the scene, for the manifest; None: default
    up_axis: str | None = None
    meters_per_unit: float | None = None
    # search folders of the scene's models and packages, for the manifest
    resources: tuple[Path, ...] = ()
    channels: tuple[str, ...] = ()  # ground-truth channels, as `check_channels` returns them
    channel_format: ChannelFormat = ChannelFormat.AUTO  # file format of the channels
    boxes_3d: bool = False  # also record the oriented boxes of the visible instances
    # chassis of the vehicle, simulated in MuJoCo; None: it drives exactly as planned
    physics: Chassis | None = None

    def __repr__(self) -> str:
        return short_repr(self, f"{self.vehicle.name} in {self.scene.name}", f"seed {self.seed}")

    def plan(self, print_note: Callable[[str], None] | None = None) -> PlannedDrive:
        """Plan the vehicle's trajectory, and simulate its odometry; see `plan_route`.

        Raises:
            TrajectoryError: the path cannot be driven.
            OmnisimError: physics is set, but its extra is not installed.
            RunError: an invalid seed, or an exposure longer than a step.
        """
        return plan_together({BODY: self}, print_note)[BODY]

    def _plan_route(self, print_note: Callable[[str], None] | None) -> PlannedRoute:
        self._check_seed()
        if self.physics is not None and self.route.ground_m is not None:
            raise TrajectoryError(
                "--ground: expected none with --physics, as wheels stand on the scene's floor"
            )
        return plan_route(self.scene, self.vehicle, self.route, print_note)

    def _planned(self, route: PlannedRoute, simulated: SimulatedMotion | None) -> PlannedDrive:
        """Drive along the motion that physics simulated, or exactly along a planned route."""
        self._check_sensors(route.trajectory)  # before contacts widen turns between steps
        if simulated is None:
            truth, motion, box = route.trajectory, route.motion, BodyBoxes.of(self.vehicle)
            odometry = simulate_odometry(truth, self.vehicle.odometry, self.seed)
            contacts = None if box is None else find_contacts(self.scene, route.sweep, box)
            return PlannedDrive(self, truth, motion, odometry, route.follows_floor, contacts)
        times_s = route.trajectory.times_s
        truth, motion = simulated.at(times_s), simulated.smooth
        # skidding wheels slip in the simulation already
        errors = dataclasses.replace(self.vehicle.odometry, turn_scale=1.0)
        odometry = with_errors(simulated.readings_at(times_s), errors, self.seed)
        contacts = simulated.contacts_at(truth)
        return PlannedDrive(
            self, truth, motion, odometry, route.follows_floor, contacts, simulated=simulated
        )

    def along(self, truth: Trajectory, given: str | None = None) -> PlannedDrive:
        """Move the vehicle's base exactly along given poses, without wheels or odometry.

        `given` is the digest of the poses' inputs; None: the poses identify themselves.

        Raises:
            RunError: an invalid seed, or an exposure longer than a step.
        """
        self._check_seed()
        self._check_sensors(truth)
        digest = given or fingerprint(truth.times_s, truth.world_from_base)
        return PlannedDrive(self, truth, SplineMotion(truth), route_given=digest)

    def _check_seed(self) -> None:
        if not 0 <= self.seed <= MAX_SEED:
            raise RunError(f"seed: expected a whole number from 0 to 2**63 - 1, got {self.seed}")

    def _check_sensors(self, truth: Trajectory) -> None:
        for mount in self.vehicle.sensors:
            mount.sensor.check_trajectory(mount, truth, mount.times_s(truth.times_s, self.seed))


@dataclass(frozen=True, eq=False)
class PlannedDrive:
    """Drive with its trajectory, ready to be rendered."""

    drive: Drive
    truth: Trajectory  # poses of the base at the steps
    motion: BodyMotion  # continuous motion of the base, also between the steps
    odometry: Odometry | None = None  # readings of the wheels; None: no odometry
    follows_floor: bool = False  # see `PlannedRoute`
    # contacts of the body with the scene, in the order in which they begin; None: not checked
    contacts: tuple[Contact, ...] | None = None
    name: str = BODY  # name of the vehicle in the world
    # other vehicles in the world, by name
    others: Mapping[str, MovingVehicle] = field(default_factory=dict)
    # motion of the robot and of the objects around it in physics, or None
    simulated: SimulatedMotion | None = None
    # digest of the poses' inputs; None: the digest of the drive's route
    route_given: str | None = None

    def __repr__(self) -> str:
        vehicle, scene = self.drive.vehicle.name, self.drive.scene.name
        return short_repr(self, f"{vehicle} in {scene}", counted(len(self.truth), "pose"))

    @cached_property
    def world(self) -> DriveWorld:
        """Motion of the world."""
        scene = with_short_name(self.drive.scene)
        if self.simulated is not None:
            scene = self.simulated.scene_with_motions(scene)
        return DriveWorld(scene, self.moving, self.name, self.others)

    @property
    def moving(self) -> MovingVehicle:
        """Vehicle and its motion."""
        return MovingVehicle(self.drive.vehicle.body, self.truth, self.motion)

    def record(self, folder: Path, force: bool = False) -> Iterator[int]:
        """Render the missing files of a run, step by step; yields the number of finished steps.

        The first number counts the steps finished before the call. Measurements between two steps
        are recorded with the second. An interrupted run resumes, and its bytes equal those of an
        uninterrupted one. `force` overwrites another run in the folder.

        Raises:
            RunError: the folder holds another run, or another command is writing to it.
            OmnisimError: OpenGL is missing, or a file cannot be written.
        """
        drive, vehicle = self.drive, self.drive.vehicle
        with ExitStack() as stack:
            world = self.world
            stage = Stage(
                world.scene, vehicles=world.bodies, device=drive.device, backend=drive.backend
            )
            stack.enter_context(stage)
            stack.enter_context(stage.current())  # throughout, not image by image
            instruments = {}
            for mount in vehicle.sensors:
                placed = dataclasses.replace(
                    mount,
                    vehicle=self.name,
                    seed=f"{drive.seed} {mount.name}",  # the noise seeds of all sensors differ
                    unlit=drive.unlit,
                    channel_format=drive.channel_format,
                    boxes_3d=drive.boxes_3d,
                )
                if isinstance(mount.sensor, Sensor):
                    instruments[mount.name] = stack.enter_context(mount.sensor.open(stage, placed))
            content = self._manifest(stage.backend.renderer)
            run = stack.enter_context(run_folder.open_run(folder, content, force))
            is_new = not run.has(run_folder.STATES)
            self._write_records(run)
            labels = find_labels(drive.scene, stage.objects, tuple(world.bodies))
            run_folder.write_labels(run, labels)
            missing = [step for step in range(len(self.truth)) if not run.is_done(step)]
            finished = len(self.truth) - len(missing)
            if is_new:  # steps without a file, and files of the whole run, were not there before
                yield 0
            if not (is_new and missing):
                yield finished
            writer = stack.enter_context(ThreadPoolExecutor(1))
            last: dict[str, tuple[int, Pending[Reading]]] = {}  # index and reading
            writes: list[Future[None]] = []
            for done, step in enumerate([*missing, None], start=finished):
                begun: deque[tuple[Path, Pending[Reading]]] = deque()
                following: list[Future[None]] = []
                for name, instrument in instruments.items():
                    for index in () if step is None else run.indices_at(name, step):
                        if run.missing_at(name, index):
                            before, previous = last.get(name, (index, None))
                            moment = self._moment(
                                run, name, index, previous if before == index - 1 else None
                            )
                            last[name] = index, instrument.begin(moment)
                            begun.append((run.stem(name, index), last[name][1]))
                        if len(begun) > MAX_BEGUN:
                            following.append(_write(writer, *begun.popleft()))
                            if len(following) > MAX_BEGUN:
                                following[-MAX_BEGUN].result()
                for write in writes:  # of the step before: it was written meanwhile
                    write.result()
                if done > finished:
                    yield done
                writes = [*following, *(_write(writer, *measurement) for measurement in begun)]
            run_folder.write_boxes(run, labels)

    @cached_property
    def sensor_times_s(self) -> dict[str, Floats]:
        """Times (n,) of each sensor's measurements, by the sensor's name."""
        steps_s, seed = self.truth.times_s, self.drive.seed
        return {mount.name: mount.times_s(steps_s, seed) for mount in self.drive.vehicle.sensors}

    @property
    def notes(self) -> list[str]:
        """Notices on omissions of sensors, and on surfaces too near to the cameras at the start."""
        drive, start = self.drive, self.truth.world_from_base[0]
        sensors, times_s = drive.vehicle.sensors, self.sensor_times_s
        notes = [mount.sensor.note(mount, times_s[mount.name]) for mount in sensors]
        for camera in drive.vehicle.cameras:
            unusual = viewpoint_notes(drive.scene, camera.sensor, start)
            notes += [f"{camera.name}: {note}" for note in unusual]
        if any(mount.sensor.specular for mount in sensors):
            objects = [moving.shape for moving in drive.scene.objects]
            notes += specular_notes(drive.scene, objects, drive.backend)
        return [note for note in notes if note is not None]

    def _moment(
        self, run: run_folder.RunFolder, sensor: str, index: int, previous: Pending[Reading] | None
    ) -> Moment:
        """Moment of a measurement; the folder has all earlier measurements."""
        times_s = self.sensor_times_s[sensor]
        return Moment(
            self.world.state_at,
            index,
            float(times_s[index]),
            float(times_s[index - 1]) if index > 0 else None,
            float(times_s[index + 1]) if index + 1 < len(times_s) else None,
            run.channels_at(index, sensor),
            run.stem(sensor, index - 1) if index > 0 else None,
            previous,
        )

    def _manifest(self, renderer: str) -> dict[str, Any]:
        """Manifest of the run, in JSON types; it names the renderer, since they round apart."""
        drive, vehicle = self.drive, self.drive.vehicle
        unit = {} if drive.meters_per_unit is None else {"meters_per_unit": drive.meters_per_unit}
        folders = [str(folder.absolute()) for folder in drive.resources]
        scene = Path(drive.scene.name)
        is_file = scene.is_file() or (scene / "scene.toml").is_file()
        physics: dict[str, Any] = {}
        if self.simulated is not None and drive.physics is not None:
            chassis = dataclasses.asdict(drive.physics)
            physics = {"physics": {**self.simulated.manifest(), "chassis": chassis}}
        sensors: dict[str, dict[str, Any]] = {}
        for mount in vehicle.sensors:
            table = sensors[mount.name] = {"type": mount.type}
            if mount.rate is not None:
                table["rate_hz"] = mount.rate.rate_hz
                table["measurements"] = len(self.sensor_times_s[mount.name])
            table |= mount.sensor.manifest(mount)
        content = {
            "format": MANIFEST_FORMAT,
            "omnisim": __version__,
            "scene": {
                "name": with_short_name(drive.scene).name,
                # valid in any working folder
                "file": str(scene.resolve()) if is_file else drive.scene.name,
                "up_axis": drive.up_axis,
                **unit,
                **({"resources": folders} if folders else {}),
                "contents": scene_contents(drive.scene),
            },
            "sensors": sensors,
            "robot": {"name": vehicle.name, "contents": fingerprint(vehicle)},
            **physics,
            "path": {
                "name": Path(drive.route.path).name,
                "route": self.route_given or route_digest(drive.route),
                "length_m": round(self.truth.path_length_m, 6),
                "duration_s": round(self.truth.duration_s, 6),
                "follows_floor": self.follows_floor,
                "contacts": self.contacts and list(map(dataclasses.asdict, self.contacts)),
            },
            "steps": len(self.truth),
            "seed": drive.seed,
            "unlit": drive.unlit,
            "channels": drive.channels,
            **({"is_rig": True} if self.odometry is None else {}),
            **self.world.manifest(),
            "renderer": renderer,
            "libraries": {
                "python": platform.python_version(),
                **{
                    name: metadata.version(name)
                    for name in ("moderngl", "numpy", "trimesh")
                    if is_installed(name)
                },
            },
        }
        if drive.channel_format is not ChannelFormat.AUTO:
            content["channel_format"] = drive.channel_format
        if drive.boxes_3d:
            content["boxes_3d"] = True
        return json.loads(json.dumps(content))

    def _write_records(self, run: run_folder.RunFolder) -> None:
        """Write the files that need no rendering."""
        if not run.has(run_folder.GROUND_TRUTH):
            write_trajectory(run.path / run_folder.GROUND_TRUTH, self.truth)
        elif self.simulated is not None:  # another processor may round differently
            file = run.path / run_folder.GROUND_TRUTH
            recorded = read_trajectory(file)
            run.check_steps(file.name, len(recorded))
            apart_m = np.linalg.norm(recorded.positions_m - self.truth.positions_m, axis=1).max()
            if apart_m > SAME_MOTION_M:
                raise RunError(
                    f"{file}: on this machine, physics diverges from it by {apart_m:.2g} m: resume "
                    "the run where it began, or record it again with --force"
                )
        if self.odometry is not None and not run.has(run_folder.ODOMETRY):
            write_odometry(run.path / run_folder.ODOMETRY, self.odometry)
        self.world.write_poses(run.path / run_folder.OBJECTS)
        times_s = self.sensor_times_s
        if not run.has(run_folder.STATES):
            sensors = self.drive.vehicle.sensors
            needed_s = (mount.sensor.state_times_s(times_s[mount.name]) for mount in sensors)
            run_folder.write_states(
                run.path / run_folder.STATES, self.motion, (self.truth.times_s, *needed_s)
            )
        for mount in self.drive.vehicle.sensors:
            own_s, folder = times_s[mount.name], run.path / mount.name
            mount.sensor.write_readings(folder, mount, self.motion, self.drive.seed, own_s)
            if run.has_own_rate(mount.name) and not is_written(folder / run_folder.TIMES):
                write_table(folder / run_folder.TIMES, run_folder.TIME, (own_s[:, None],))
            for name, text in mount.sensor.documents(mount).items():
                if not is_written(folder / name):
                    write_text(folder / name, text)
        for camera in self.drive.vehicle.cameras:
            if self.odometry is None and not run.has(f"{camera.name}/{CAMERA_POSES}"):
                own_s = times_s[camera.name]
                poses = np.stack([self.moving.pose_at(time_s) for time_s in own_s.tolist()])
                write_trajectory(
                    run.path / camera.name / CAMERA_POSES,
                    Trajectory(own_s, poses @ camera.sensor.base_from_optical),
                )


def _write(writer: Executor, stem: Path, reading: Pending[Reading]) -> Future[None]:
    """Begin to write a reading once it is made."""
    return writer.submit(reading.result().save, stem)


def plan_together(
    drives: Mapping[str, Drive], print_note: Callable[[str], None] | None = None
) -> dict[str, PlannedDrive]:
    """Plan drives through one scene, by vehicle name; with physics, the vehicles can collide.

    Raises:
        TrajectoryError: a path cannot be driven.
        OmnisimError: physics is set, but its extra is not installed.
        RunError: an invalid seed, or an exposure longer than a step.
    """
    if not any(drive.physics for drive in drives.values()):
        return {
            name: drive._planned(drive._plan_route(print_note), None)
            for name, drive in drives.items()
        }
    require_extra("mujoco", "--physics")
    from omnisim.runs.physics.simulation import simulate  # needs the extra

    rovers = {
        name: Rover.of(drive.vehicle, drive.physics or Chassis()) for name, drive in drives.items()
    }
    routes = {name: drive._plan_route(print_note) for name, drive in drives.items()}
    drivers = {
        name: Driver(
            rovers[name],
            routes[name].trajectory,
            routes[name].motion,
            drive.route.path,
            drive.route.ignore_limits,
        )
        for name, drive in drives.items()
    }
    motions = simulate(next(iter(drives.values())).scene, drivers)
    return {name: drive._planned(routes[name], motions[name]) for name, drive in drives.items()}


def drive_together(plans: Mapping[str, PlannedDrive]) -> dict[str, PlannedDrive]:
    """Put planned drives, by the names of their vehicles, into one world with mutual visibility.

    All drives begin at time 0 s of their trajectories.
    """
    vehicles = {name: plan.moving for name, plan in plans.items()}
    together = {}
    for name, plan in plans.items():
        others = {other: vehicle for other, vehicle in vehicles.items() if other != name}
        together[name] = dataclasses.replace(plan, name=name, others=others)
    return together


def scene_contents(scene: Scene) -> str:
    """Fingerprint of a scene, independent of its file's location and the machine."""
    return fingerprint(with_short_name(scene))


def with_short_name(scene: Scene) -> Scene:
    """Name a scene by its file name alone: the folder on this machine makes no difference."""
    return scene.altered(name=Path(scene.name).name or scene.name)


# World of a drive: the vehicle on its trajectory, other vehicles, and the scene's objects.


@dataclass(frozen=True, eq=False)
class MovingVehicle:
    """Vehicle in motion through the world."""

    body: Scene | None  # body in the base frame, or None: invisible
    truth: Trajectory  # poses of the base at the steps
    motion: BodyMotion  # continuous motion of the base, also between the steps

    def pose_at(self, time_s: float) -> Pose:
        """Pose (4, 4) of the base; at a step, bit for bit the step's pose."""
        step = int(np.searchsorted(self.truth.times_s, time_s))
        if step < len(self.truth) and self.truth.times_s[step] == time_s:
            return np.array(self.truth.world_from_base[step])
        return self.motion.pose_at(time_s)


@dataclass(frozen=True, eq=False)
class DriveWorld:
    """Motion of the world in which a vehicle drives."""

    scene: Scene  # scene with its dynamic objects
    ego: MovingVehicle  # the vehicle and its motion
    vehicle: str = BODY  # name of the vehicle in the world
    others: Mapping[str, MovingVehicle] = field(default_factory=dict)  # other vehicles by name

    @property
    def bodies(self) -> dict[str, Scene]:
        """Bodies of the visible vehicles, by name."""
        bodies = ((name, moving.body) for name, moving in self._vehicles.items())
        return {name: body for name, body in bodies if body is not None}

    def state_at(self, time_s: float) -> WorldState:
        """State of the world; vehicles rest before and after their trajectories."""
        poses = {name: moving.pose_at(time_s) for name, moving in self._vehicles.items()}
        poses |= {moving.name: moving.motion.pose_at(time_s) for moving in self.scene.objects}
        return WorldState(poses, time_s)

    @property
    def _vehicles(self) -> dict[str, MovingVehicle]:
        return {self.vehicle: self.ego, **self.others}

    def manifest(self) -> dict[str, Any]:
        """Other vehicles for a run's manifest; empty without other vehicles."""
        if not self.others:
            return {}
        others = {name: fingerprint(other.body) for name, other in self.others.items()}
        return {"world": {"vehicle": self.vehicle, "others": others}}

    def write_poses(self, folder: Path) -> None:
        """Write missing files with poses of the others and of dynamic objects, at the steps' times.

        Raises:
            OutputError: a file cannot be written.
        """
        times_s = self.ego.truth.times_s
        motions = {name: other.pose_at for name, other in self.others.items()}
        motions |= {moving.name: moving.motion.pose_at for moving in self.scene.objects}
        if motions:
            folder.mkdir(exist_ok=True)
        for name, pose_at in motions.items():
            target = folder / f"{folder_name(name)}.tum"
            if is_written(target):
                continue
            poses = np.stack([pose_at(float(time_s)) for time_s in times_s])
            write_trajectory(target, Trajectory(times_s, poses))
