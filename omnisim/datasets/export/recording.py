"""Recorded runs for exporters: poses, odometry and sensors.

A file that is missing or damaged, or has another size than its camera, raises an `OmnisimError`.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import CentralCamera, NonCentralCamera
from omnisim.cameras.calibration.documents import parse_yaml, read_text
from omnisim.cameras.camera import pixel_grid
from omnisim.core.arrays import Bools, Bytes, Floats, Floats32, Indices
from omnisim.core.errors import OmnisimError, RunError
from omnisim.core.files.image_files import read_image
from omnisim.core.poses import check_pose, inverse
from omnisim.core.trajectories import Trajectory, read_trajectory
from omnisim.core.trajectories.body_motion import MotionStates, SplineMotion
from omnisim.core.trajectories.odometry import Odometry
from omnisim.ground_truth.channel_files import StoredChannels
from omnisim.ground_truth.label_names import Labels
from omnisim.perception.unwarping import CameraMount
from omnisim.rendering.camera.omnicamera import CALIBRATION
from omnisim.rendering.sensor import SensorSettings
from omnisim.robots import read_odometry
from omnisim.runs.run_folder import GROUND_TRUTH, OBJECTS, ODOMETRY, STATES, RunFolder, read_states
from omnisim.sensors.calibration_file import read_colors, read_mount
from omnisim.sensors.depth_camera.depth_camera import STEPS_PER_M
from omnisim.sensors.imu.imu import BIAS_COLUMNS, BIASES, PARAMETERS, READINGS
from omnisim.sensors.imu.imu import COLUMNS as IMU_COLUMNS
from omnisim.sensors.lidar.point_files import PLAIN_POINT, POINT

START = "start.csv"  # of a sensor: true state at its first measurement, by its own clock
STAMP_S = 2e-9  # rounding of two times with nine digits
NOTED_S = 1e-3


@dataclass(frozen=True, eq=False)
class ImuReadings:
    """Readings of an IMU."""

    times_s: Floats  # (n,)
    # (n, 6) angular rate in rad/s and specific force in m/s², IMU's frame
    values: Floats
    biases: Floats | None  # (n, 6) in the same units; None: not recorded


@dataclass(frozen=True, eq=False)
class Recording:
    """Finished run.

    Steps have poses and odometry. A sensor measures at each step, or at its own rate: its
    measurements are numbered from 0, stamped by `times_s(name)`, in the files `run.file(name,
    index, suffix)`; `indices_at(name, step)` are those since the previous step. Formats with one
    measurement of each sensor per frame use `in_frames`, with frames in place of steps.
    """

    run: RunFolder  # folder of the run
    truth: Trajectory  # poses of the base at the steps or frames
    odometry: Odometry | None  # readings of the wheels; None: there are none
    cameras: tuple[RecordedCamera, ...]  # exported cameras
    # by sensor name, number of its measurement at each frame; empty: frames are steps
    frames: Mapping[str, Indices] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path, camera_name: str | None = None) -> Recording:
        """Read a run, with one of its cameras or all.

        Raises:
            OmnisimError: not a run, an unfinished run, an unknown camera, or a damaged file.
        """
        run = RunFolder.read(path)
        for step in range(run.manifest.steps):
            if (missing := run.missing_file(step)) is not None:
                raise RunError(
                    f"{missing}: is missing: expected a finished run: run its command again to "
                    "resume it"
                )
        names = run.manifest.cameras if camera_name is None else [run.camera(camera_name)]
        truth = read_trajectory(path / GROUND_TRUTH)
        run.check_steps(GROUND_TRUTH, len(truth))
        odometry = None
        if not run.manifest.is_rig:
            odometry = read_odometry(path / ODOMETRY)
            run.check_steps(ODOMETRY, len(odometry.times_s))
        return cls(run, truth, odometry, tuple(RecordedCamera.read(run, name) for name in names))

    @property
    def steps(self) -> int:
        """Number of steps or frames."""
        return len(self.truth)

    def times_s(self, name: str) -> Floats:
        """Times (n,) of a sensor's measurements; with frames, of its measurement at each frame."""
        times_s = self.run.times_s(name)
        return times_s[self.frames[name]] if name in self.frames else times_s

    def indices_at(self, name: str, step: int) -> range:
        """Numbers of a sensor's measurements after the previous step, up to a step's time."""
        return self.run.indices_at(name, step)

    def index_of(self, name: str, frame: int) -> int:
        """Number of a sensor's measurement at a frame."""
        return int(self.frames[name][frame]) if name in self.frames else frame

    @cached_property
    def _states(self) -> tuple[Floats, MotionStates] | None:
        path = self.run.path / STATES
        return read_states(path) if self.run.has(STATES) else None

    @property
    def state_times_s(self) -> Floats:
        """Times (n,) of the base's recorded states: at all measurements; older runs: at steps."""
        return self.truth.times_s if self._states is None else self._states[0]

    @property
    def fine_truth(self) -> Trajectory:
        """Poses of the base at all times of recorded states."""
        return Trajectory(self.state_times_s, self.states(self.state_times_s).world_from_base)

    def states(self, times_s: Floats) -> MotionStates:
        """True states of the base at times (n,); from a spline if one of them was not recorded."""
        if self._states is None:
            return SplineMotion(self.truth).at(times_s)
        known_s, states = self._states
        index = np.clip(np.searchsorted(known_s, times_s - STAMP_S), 0, len(known_s) - 1)
        if np.all(np.abs(known_s[index] - times_s) <= STAMP_S):
            return MotionStates(*(state[index] for state in states))
        return SplineMotion(Trajectory(known_s, states.world_from_base)).at(times_s)

    def in_frames(self, names: Sequence[str], print_note: Callable[[str], None]) -> Recording:
        """Recording whose steps are frames, at the measurements of the slowest of several sensors.

        A frame has the measurement of each other sensor that is nearest in time; notes name sensors
        that measure at other times. If no sensor has its own rate, the result is the recording
        itself.
        """
        if not any(self.run.has_own_rate(name) for name in names):
            return self
        times = {name: self.run.times_s(name) for name in names}
        clock = min(names, key=lambda name: len(times[name]))
        frames = {name: _nearest(times[name], times[clock]) for name in names}
        for name in names:
            late_s = float(np.abs(times[name][frames[name]] - times[clock]).max())
            if late_s > NOTED_S:
                print_note(
                    f"{name}: measures up to {late_s:.3g} s from {clock}, whose times are used"
                )
        poses = self.states(times[clock]).world_from_base
        return self._framed(Trajectory(times[clock], poses), frames)

    def every(self, stride: int) -> Recording:
        """Recording with every `stride`-th step or frame, from the first, and no wheel odometry."""
        if stride == 1:
            return self
        names = self.frames or [camera.name for camera in self.cameras]
        numbers = np.arange(self.steps)
        frames = {name: self.frames.get(name, numbers)[::stride] for name in names}
        truth = Trajectory(self.truth.times_s[::stride], self.truth.world_from_base[::stride])
        return self._framed(truth, frames)

    def _framed(self, truth: Trajectory, frames: dict[str, Indices]) -> Recording:
        cameras = tuple(
            dataclasses.replace(camera, indices=frames.get(camera.name)) for camera in self.cameras
        )
        return dataclasses.replace(self, truth=truth, odometry=None, cameras=cameras, frames=frames)

    def imu_readings(self, name: str) -> ImuReadings:
        """Readings of an IMU."""
        folder, columns = self.run.path / name, IMU_COLUMNS.split(",")
        if (folder / READINGS).is_file():
            table = read_table(folder / READINGS, *columns).columns
            biases = read_table(folder / BIASES, *BIAS_COLUMNS.split(",")).columns
            walks = np.column_stack(list(biases.values())[1:])
            if len(walks) != len(table["t_s"]):
                rows = f"{len(table['t_s'])} rows, as in {READINGS}"
                raise RunError(f"{folder / BIASES}: expected {rows}")
            values = np.column_stack(list(table.values()))
            return ImuReadings(values[:, 0], values[:, 1:], walks)
        files = [self.run.file(name, step, ".csv") for step in range(self.run.manifest.steps)]
        parts = [
            np.column_stack(list(read_table(file, *columns).columns.values())) for file in files
        ]
        values = np.concatenate(parts)
        return ImuReadings(values[:, 0], values[:, 1:], None)

    def start_state(self, name: str, first_s: float) -> MotionStates:
        """True state of the base at a sensor's first measurement, stamped `first_s`; one row.

        It does not depend on an error of the sensor's stamps.
        """
        path = self.run.path / name / START
        return read_states(path)[1] if path.is_file() else self.states(np.array([first_s]))

    def sensors(self, kind: type[SensorSettings]) -> list[str]:
        """Names of the sensors of a class."""
        manifest = self.run.manifest
        return [name for name in manifest.sensors if issubclass(manifest.sensor_class(name), kind)]

    def objects(self) -> dict[str, Trajectory]:
        """Poses of other vehicles and dynamic objects by name."""
        files = sorted((self.run.path / OBJECTS).glob("*.tum"))
        return {file.stem: read_trajectory(file) for file in files}

    def mount(self, world_from_sensor: Floats, time_s: float | None = None) -> Floats:
        """Pose (4, 4) of a sensor on the base, from its world pose at a time (None: first step)."""
        world_from_base = self.truth.world_from_base[0]
        if time_s is not None and time_s != self.truth.times_s[0]:
            world_from_base = self.states(np.array([time_s])).world_from_base[0]
        return inverse(world_from_base) @ world_from_sensor

    def cloud(self, name: str, step: int) -> StoredCloud:
        """Point cloud of a lidar at a frame, or by its own number if `frames` has not the lidar."""
        table = self.run.manifest.sensors[name].model_extra or {}
        index = self.index_of(name, step)
        return read_cloud(self.run.file(name, index, f".{table['file_format']}"))

    def depth_camera(self, name: str) -> RecordedCamera:
        """Depth camera; its images are depths."""
        camera = RecordedCamera.read(self.run, name)
        return dataclasses.replace(camera, indices=self.frames.get(name))

    def base_from_lidar(self, name: str) -> Floats:
        """Pose (4, 4) of a lidar on the base."""
        pose = self.cloud(name, 0).header.pose("world_from_lidar")
        return self.mount(pose, self.times_s(name)[0])

    def base_from_imu(self, name: str) -> Floats:
        """Pose (4, 4) of an IMU on the base."""
        path = self.run.path / name / PARAMETERS
        try:
            numbers = np.array(parse_yaml(read_text(path), str(path))["T_BS"]["data"])
            return check_pose(numbers.astype(np.float64).reshape(4, 4))
        except (KeyError, TypeError, ValueError, OmnisimError):
            raise RunError(f"{path}: T_BS: expected the 16 numbers of a pose") from None

    def imu_parameters(self, name: str) -> str:
        """Text of an IMU's parameters, with EuRoC's keys."""
        return read_text(self.run.path / name / PARAMETERS)


def _nearest(times_s: Floats, wanted_s: Floats) -> Indices:
    """Indices (n,) of the times among `times_s` (m,) nearest to the times `wanted_s` (n,)."""
    after = np.clip(np.searchsorted(times_s, wanted_s), 1, max(len(times_s) - 1, 1))
    after = np.minimum(after, len(times_s) - 1)
    before = np.maximum(after - 1, 0)
    is_before = wanted_s - times_s[before] <= times_s[after] - wanted_s
    return np.where(is_before, before, after)


# Cameras of a recorded run: images and ground truth at each step.


IMAGE = ".png"


@dataclass(frozen=True, eq=False)
class RecordedCamera:
    """Camera of a run."""

    run: RunFolder
    name: str
    mount: CameraMount  # model, pose on the base, and mask of pixels that show the scene
    # (n,) number of the camera's image at each frame; None: the frame's own number
    indices: Indices | None = field(default=None, kw_only=True)

    @classmethod
    def read(cls, run: RunFolder, name: str) -> RecordedCamera:
        """Read the calibration of a camera."""
        return cls(run, name, read_mount(run.path / name / CALIBRATION))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the images."""
        return self.mount.camera.width_px, self.mount.camera.height_px

    @property
    def has_one_viewpoint(self) -> bool:
        """False for non-central optics."""
        return not isinstance(self.mount.camera, NonCentralCamera)

    @property
    def central(self) -> CentralCamera:
        """Central model of the camera.

        Raises:
            RunError: the camera is non-central.
        """
        if not self.has_one_viewpoint:
            raise RunError(
                f"{self.run.path / self.name}: expected a central camera, got optics: "
                "`omnisim calibration convert` fits one to it"
            )
        return self.mount.camera

    def image_file(self, step: int) -> Path:
        """Image file of a step."""
        index = step if self.indices is None else int(self.indices[step])
        return self.run.file(self.name, index, IMAGE)

    def image(self, step: int) -> Bytes:
        """Image (height, width, 3) of a step, sRGB."""
        return read_colors(self.image_file(step), self.mount.camera)

    def depths_m(self, step: int) -> Floats32:
        """Depths (height, width) of a depth camera along its axis; +inf: none."""
        path = self.image_file(step)
        depths = read_image(path)[0][..., 0]
        width, height = self.size_px
        if depths.shape != (height, width) or depths.dtype != np.uint16:
            raise RunError(f"{path}: expected depths of {width} × {height} px in 16 bits")
        return np.where(depths, depths / STEPS_PER_M, np.inf).astype("f4")

    def has(self, channel: str) -> bool:
        """True if the run has a channel of ground truth."""
        return channel in self.run.manifest.channels

    def channel(self, step: int, name: str) -> NDArray[Any]:
        """Channel (height, width, …) of ground truth at a step."""
        path = self.image_file(step)
        values: NDArray[Any] = StoredChannels(path, {}).read([name])[name]
        width, height = self.size_px
        if values.shape[:2] != (height, width):
            raise RunError(f"{path}: channel {name!r}: expected {width} × {height} px")
        return values

    def labels(self, step: int) -> Labels | None:
        """Labels of the classes and instances at a step; None: unknown."""
        return StoredChannels(self.image_file(step), {}).labels

    @cached_property
    def _rays(self) -> tuple[Floats, Floats | None, Bools]:
        rays = self.mount.camera.ray_from_pixel(pixel_grid(*self.size_px))
        return rays.directions, rays.origins_m, rays.valid

    @property
    def directions(self) -> Floats:
        """Unit vectors (height, width, 3) along the pixels' rays, optical frame."""
        return self._rays[0]

    @property
    def valid(self) -> Bools:
        """Mask (height, width) of the pixels with a ray."""
        return self._rays[2]

    def points_m(self, ranges_m: NDArray[Any]) -> tuple[Floats, Bools]:
        """Points (n, 3) in the optical frame of rays with ranges (height, width), and their mask.

        A range of +inf is no hit.
        """
        directions, origins_m, valid = self._rays
        hit = np.isfinite(ranges_m) & valid
        points: Floats = directions[hit] * ranges_m[hit, None]
        return points if origins_m is None else points + origins_m[hit], hit


# Stored clouds and scans of a run; a missing or damaged file or value raises `RunError`.


class FileHeader:
    """Header of a file of a run: lines `key: value`, and its path for messages."""

    def __init__(self, path: Path, lines: Iterable[str]):
        self._path = path
        self._texts = {key: text for key, _, text in (line.partition(": ") for line in lines)}

    @property
    def values(self) -> dict[str, Any]:
        """Values by key, in the order of the file; lines without a value are left out."""
        return {key: self.value(key) for key, text in self._texts.items() if text}

    def value(self, key: str) -> Any:
        """Value of a key."""
        try:
            return json.loads(self._texts[key])
        except (KeyError, ValueError, RecursionError):
            raise RunError(f"{self._path}: {key}: is missing or damaged: expected JSON") from None

    def number(self, key: str) -> float:
        """Number of a key."""
        value = self.value(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RunError(f"{self._path}: {key}: expected a number, got {value!r}")
        return float(value)

    def count(self, key: str) -> int:
        """Number of entries of a key's list."""
        value = self.value(key)
        if not isinstance(value, list):
            raise RunError(f"{self._path}: {key}: expected a list, got {value!r}")
        return len(value)

    def pose(self, key: str) -> Floats:
        """Pose (4, 4) of a key."""
        try:
            return check_pose(self.value(key))
        except OmnisimError as reason:
            if isinstance(reason, RunError):
                raise
            raise RunError(f"{self._path}: {key}: {reason}") from None


# Point clouds of a run's lidars, read from PLY and PCD files.


_ENDS = {".ply": b"end_header\n", ".pcd": b"DATA binary\n"}
_COMMENTS = {".ply": "comment ", ".pcd": "# "}
_COUNTS = {".ply": "element vertex ", ".pcd": "POINTS "}


@dataclass(frozen=True, eq=False)
class StoredCloud:
    """Point cloud of a revolution, with parameters and poses of the lidar in its header.

    Points (n,) are of type `POINT`, or `PLAIN_POINT` in older runs, of
    `omnisim.sensors.lidar.point_files`.
    """

    header: FileHeader
    points: NDArray[np.void]

    @property
    def points_m(self) -> Floats:
        """Points (n, 3) in the lidar's frame at each point's own time."""
        return np.stack([self.points[axis] for axis in "xyz"], axis=-1).astype(np.float64)

    @property
    def reflectances(self) -> Floats32:
        """Intensities (n,), at most 1; 0 without intensities."""
        if self.points.dtype != POINT:
            return np.zeros(len(self.points), dtype=np.float32)
        return np.minimum(self.points["intensity"], np.float32(1.0))


def read_cloud(path: Path) -> StoredCloud:
    """Read a point cloud written by `PointCloud.save`."""
    try:
        content = path.read_bytes()
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    head, end, data = content.partition(_ENDS[path.suffix])
    lines = head.decode("utf-8", errors="replace").splitlines()
    counts = [line.removeprefix(_COUNTS[path.suffix]) for line in lines if
              line.startswith(_COUNTS[path.suffix])]  # fmt: skip
    count = int(counts[0]) if counts and counts[0].isdecimal() else -1
    kind = POINT if any("intensity" in line.split() for line in lines) else PLAIN_POINT
    if not end or len(data) != count * kind.itemsize:
        raise RunError(f"{path}: is damaged: expected a point cloud as a drive writes it")
    comment = _COMMENTS[path.suffix]
    comments = [line.removeprefix(comment) for line in lines if line.startswith(comment)]
    return StoredCloud(FileHeader(path, comments), np.frombuffer(data, dtype=kind))


# Tables of a run's sensors, read back: laser scans, ranges, IMU readings.


MAX_NUMBER = 1e30  # within the range of the formats' floats


@dataclass(frozen=True, eq=False)
class StoredTable:
    """Table of a sensor: parameters and pose of the sensor, and values (n,) by column."""

    header: FileHeader
    columns: dict[str, Floats]


def read_table(path: Path, *names: str) -> StoredTable:
    """Read a table with the given columns."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as reason:
        raise RunError(f"{path}: cannot be read: {reason}") from None
    comments = [line.removeprefix("# ") for line in lines if line.startswith("#")]
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    if not rows or rows[0] != list(names):
        raise RunError(f"{path}: expected the columns {','.join(names)}")
    try:
        values = np.array(rows[1:], dtype=np.float64).reshape(-1, len(names))
    except ValueError:
        raise RunError(f"{path}: expected {len(names)} numbers a line") from None
    if np.any(np.isfinite(values) & (np.abs(values) > MAX_NUMBER)):
        raise RunError(f"{path}: expected numbers below {MAX_NUMBER:g}")
    columns = {name: values[:, index] for index, name in enumerate(names)}
    return StoredTable(FileHeader(path, comments), columns)
