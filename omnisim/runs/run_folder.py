"""Folder of a run: its files, the missing ones, and whether the run may resume.

    manifest.json               provenance: versions, contents, settings, seeds
    ground_truth.tum            poses of the base (TUM: s, meters, quaternion xyzw)
    odometry.csv                readings of the wheels, and dead reckoning by them
    objects/<name>.tum          poses of another vehicle or a dynamic object, at the same times
    states.csv                  true states of the base at the times of all measurements
    <sensor>/000000.<suffix>    files of a measurement, see `omnisim.sensors`; one measurement per
                                step, or at the sensor's own rate
    <sensor>/times.csv          times of the measurements, for a sensor with its own rate
    <imu>/readings.csv          all readings; their biases are in biases.csv
    <camera>/sensor.toml        the camera's sensor file
    <camera>/calibration.json   the camera's parameters and its mount on the base
    <camera>/000000.png ...     one image per step, with camera and pose inside
    <scanner>/000000.csv ...    one scan per step
    <lidar>/000000.ply ...      one point cloud per step, or .pcd

A rig has no wheels; instead of the odometry it has:

    <camera>/poses.tum          poses of the camera's optical frame

With ground-truth channels it also has these files (labels.json also with a lidar):

    labels.json                             numbers, names and colors of classes and instances
    <camera>/000000.channels.exr ...        the channels of a step, see `channel_files.py`
    <camera>/000000.range.npy ...           one file per channel instead, in the format npy
    <camera>/000000.channels.json ...       the channels' units and meanings, with the format npy
    <camera>/000000.coco.json ...           boxes of the instances at a step, with `instance`
    <camera>/coco.json                      boxes of all steps, once the run is complete
    <camera>/000000.boxes_3d.json ...       oriented 3-D boxes of the instances at a step

Files are written atomically, so every file present is complete. An empty file, left by a power
cut, counts as missing.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import RunError, did_you_mean
from omnisim.core.files.atomic_file import is_written, write_text
from omnisim.core.files.number_files import BLOCK, write_table
from omnisim.core.poses import (
    pose_from_rotation,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from omnisim.core.rate import printed_s
from omnisim.core.short_repr import counted, short_repr
from omnisim.core.trajectories import read_trajectory
from omnisim.core.trajectories.body_motion import BodyMotion, MotionStates
from omnisim.core.trajectories.trajectory import MAX_S
from omnisim.ground_truth import CHANNELS, Labels
from omnisim.ground_truth.boxes import merged, write_json
from omnisim.ground_truth.channels import CLASSES
from omnisim.rendering.camera.omnicamera import BOXES_SUFFIX
from omnisim.rendering.sensor import SensorSettings
from omnisim.runs.run_manifest import Manifest, first_difference, parse_manifest, read_manifest

MANIFEST = "manifest.json"
GROUND_TRUTH, ODOMETRY = "ground_truth.tum", "odometry.csv"
OBJECTS = "objects"  # folder of the poses of other vehicles and dynamic objects
STATES = "states.csv"
TIMES, TIME = "times.csv", "t_s"  # file of a sensor with its own rate, and its column
LABELS, BOXES = "labels.json", "coco.json"  # BOXES in the folder of each camera
PLOT = "plot.png"  # the run's plot, by default
PARTIAL = ".omnisim-*.partial"


@dataclass(frozen=True)
class RunFolder:
    """Folder of one run."""

    path: Path  # path of the folder
    manifest: Manifest  # provenance of the run

    def __repr__(self) -> str:
        manifest = self.manifest
        steps = counted(manifest.steps, "step")
        return short_repr(self, repr(str(self.path)), steps, *manifest.sensors, manifest.title)

    @classmethod
    def read(cls, path: Path) -> RunFolder:
        """Read the run in a folder.

        Raises:
            RunError: the folder holds no run.
        """
        expected = "expected the folder of a run, as drive and record make it"
        if not path.is_dir():
            raise RunError(f"{path}: no such folder: {expected}")
        content = read_manifest(path / MANIFEST)
        if content is None:
            raise RunError(f"{path}: has no {MANIFEST}: {expected}")
        return cls(path, parse_manifest(content, f"{path / MANIFEST}: is damaged"))

    @classmethod
    def read_each(cls, path: Path) -> list[RunFolder]:
        """Read the run in a folder, or the runs in its subfolders, of robots that drove together.

        Raises:
            RunError: the folder holds no run.
        """
        if path.is_dir() and not (path / MANIFEST).exists():
            folders = sorted(file.parent for file in path.glob(f"*/{MANIFEST}"))
            if folders:
                return [cls.read(folder) for folder in folders]
        return [cls.read(path)]

    def stem(self, sensor: str, index: int) -> Path:
        """Path of a measurement's files, without their suffixes."""
        return self.path / sensor / f"{index:06d}"

    def file(self, sensor: str, index: int, suffix: str) -> Path:
        """Path of a measurement's file, present or not."""
        return self.stem(sensor, index).with_suffix(suffix)

    def has_own_rate(self, sensor: str) -> bool:
        """True if a sensor measures at its own rate, and not at each step."""
        return self.manifest.sensors[sensor].measurements is not None

    def measurements(self, sensor: str) -> int:
        """Number of a sensor's measurements: that of the steps, unless it has its own rate."""
        own = self.manifest.sensors[sensor].measurements
        return self.manifest.steps if own is None else own

    def times_s(self, sensor: str) -> Floats:
        """Times (n,) of a sensor's measurements.

        Raises:
            OmnisimError: a file of times is missing or damaged.
        """
        if sensor not in self._times:
            times = self._step_times_s
            if self.has_own_rate(sensor):
                times = read_times(self.path / sensor / TIMES, self.measurements(sensor))
            self._times[sensor] = times
        return self._times[sensor]

    def indices_at(self, sensor: str, step: int) -> range:
        """Indices of a sensor's measurements after the previous step, up to a step's time.

        Raises:
            OmnisimError: a file of times is missing or damaged.
        """
        if not self.has_own_rate(sensor):
            return range(step, step + 1)
        steps_s, times_s = self._step_times_s, self.times_s(sensor)
        last = len(steps_s) - 1
        begin = 0 if step == 0 else int(np.searchsorted(times_s, steps_s[step - 1], side="right"))
        end = int(np.searchsorted(times_s, steps_s[step], side="right"))
        return range(begin, len(times_s) if step == last else end)

    def index_at(self, sensor: str, step: int) -> int:
        """Index of a sensor's last measurement at or before a step, else 0."""
        return max(self.indices_at(sensor, step).stop - 1, 0)

    def measurements_done(self, sensor: str) -> int:
        """Count a sensor's measurements up to the last finished step."""
        steps = self.steps_done()
        return self.indices_at(sensor, steps - 1).stop if steps > 0 else 0

    @cached_property
    def _step_times_s(self) -> Floats:
        truth = read_trajectory(self.path / GROUND_TRUTH)
        self.check_steps(GROUND_TRUTH, len(truth))
        return truth.times_s

    @cached_property
    def _times(self) -> dict[str, Floats]:
        return {}

    def has(self, name: str) -> bool:
        """True if a file of the run exists, such as `GROUND_TRUTH`."""
        return is_written(self.path / name)

    def camera(self, name: str | None = None) -> str:
        """Name of a camera of the run; by default the first.

        Raises:
            RunError: the run has no camera, or none of this name.
        """
        names = self.manifest.cameras
        if not names:
            raise RunError(f"{self.path}: this run has no camera")
        if name is not None and name not in names:
            hint = did_you_mean(name, names, "it has")
            raise RunError(f"{self.path}: camera {name!r}: not found; {hint}")
        return names[0] if name is None else name

    def check_steps(self, name: str, count: int) -> None:
        """Reject a file of the run with another number of steps.

        Raises:
            RunError: the numbers differ; names the file and both numbers.
        """
        if count != self.manifest.steps:
            raise RunError(
                f"{self.path / name}: has {count} steps, the run has {self.manifest.steps}: "
                "delete it, and record the run again to have it back"
            )

    def steps_done(self) -> int:
        """Count the steps before the first step with a missing file."""
        steps = range(self.manifest.steps)
        return next((step for step in steps if not self.is_done(step)), len(steps))

    def unfinished(self) -> str | None:
        """Notice about an incomplete run, or None.

        Steps after the first with a missing file are unused, even if complete.
        """
        total = self.manifest.steps
        missing = [file for step in range(total) if (file := self.missing_file(step))]
        if not missing:
            return None
        return (
            f"{missing[0]}: is missing: only the first {self.steps_done()} of {total} steps are "
            f"used; record the run again to complete the {len(missing)} steps with missing files"
        )

    def is_done(self, step: int) -> bool:
        """True if a step has all its files."""
        return self.missing_file(step) is None

    def missing_file(self, step: int) -> Path | None:
        """Find a step's first missing or empty file; None: all exist."""
        sensors = self.manifest.sensors
        return next((file for name in sensors if (file := self.missing_of(name, step))), None)

    def missing_of(self, sensor: str, step: int) -> Path | None:
        """Find the first missing file of a sensor at a step; None: all exist."""
        if self.has_own_rate(sensor) and self.suffixes(sensor, 0):
            for path in (self.path / GROUND_TRUTH, self.path / sensor / TIMES):
                if not is_written(path):
                    return path
        missing = (self.missing_at(sensor, index) for index in self.indices_at(sensor, step))
        return next((file for file in missing if file), None)

    def missing_at(self, sensor: str, index: int) -> Path | None:
        """Find the first missing file of a sensor's measurement; None: all exist."""
        files = (self.file(sensor, index, suffix) for suffix in self.suffixes(sensor, index))
        return next((file for file in files if not is_written(file)), None)

    def suffixes(self, sensor: str, index: int) -> tuple[str, ...]:
        """Suffixes of the files of a sensor's measurement."""
        manifest = self.manifest
        own = manifest.sensors[sensor].model_extra or {}
        ground_truth = {
            "channels": self.channels_at(index, sensor),
            "channel_format": manifest.channel_format,
            "boxes_3d": manifest.boxes_3d,
        }
        return manifest.sensor_class(sensor).suffixes_of({**own, **ground_truth})

    def channels_at(self, index: int, sensor: str) -> tuple[str, ...]:
        """Channels of a measurement: the first lacks a previous one, the last a next one."""
        available = {""}
        available |= {"previous"} if index > 0 else set()
        available |= {"next"} if index < self.measurements(sensor) - 1 else set()
        names = self.manifest.channels
        return tuple(
            name for name in names if name in CHANNELS and CHANNELS[name].other in available
        )


def read_times(path: Path, count: int) -> Floats:
    """Read the times (count,) of a sensor's measurements.

    Raises:
        RunError: the times cannot be read, or do not increase.
    """
    try:
        head, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
        times_s = np.array([float(line) for line in lines])
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except ValueError:
        raise RunError(f"{path}: expected the column {TIME}, a number a line") from None
    is_known = np.all(np.abs(times_s) < MAX_S)  # also false for NaN
    if head != TIME or len(times_s) != count or not (is_known and np.all(np.diff(times_s) > 0.0)):
        raise RunError(f"{path}: expected {TIME} and {count} times that increase")
    return times_s


@contextmanager
def open_run(path: Path, content: dict[str, Any], force: bool = False) -> Iterator[RunFolder]:
    """Begin or resume a run by its manifest; other drives are locked out meanwhile.

    `force` overwrites another run in the folder.

    Raises:
        RunError: the folder holds another run or foreign files, another command is writing to it,
            or it cannot be written to.
        OutputError: the manifest cannot be written.
    """
    run = RunFolder(path, parse_manifest(content, str(path / MANIFEST)))
    with ExitStack() as stack:
        try:
            stack.enter_context(_locked(path))
            _begin(run, content, force)
        except OSError as reason:
            where = reason.filename or path
            raise RunError(f"{where}: cannot be written to: {reason.strerror}") from None
        yield run


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Create a folder if it is missing, and lock other drives out of it.

    Raises:
        RunError: another drive holds the lock, or the folder cannot be created.
    """
    if path.exists() and not path.is_dir():
        raise RunError(f"{path}: expected a folder, got a file")
    if path.is_symlink() and not path.exists():
        raise RunError(f"{path}: expected a folder, got a link that leads nowhere")
    path.mkdir(parents=True, exist_ok=True)
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):  # the file system has no locks
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise RunError(
                    f"{path}: another command is writing to it: wait until it ends"
                ) from None
        yield
    finally:
        os.close(handle)


def _begin(run: RunFolder, content: dict[str, Any], force: bool) -> None:
    """Write the manifest if it is missing, and clear leftovers; reject another run's folder."""
    path = run.path
    old = read_manifest(path / MANIFEST)
    if old is None:
        if any(not file.match(PARTIAL) for file in path.iterdir()):
            raise RunError(
                f"{path}: is not empty and has no {MANIFEST}: expected a new folder, an empty one, "
                "or that of a run"
            )
    else:
        existing = parse_manifest(old, f"{path / MANIFEST}: is damaged")
        if force:
            _clear(RunFolder(path, existing))
        elif difference := first_difference(old, content):
            raise RunError(
                f"{path / MANIFEST}: {difference}: another run is in this folder; choose another "
                "folder, or overwrite that run with --force"
            )
    for leftover in path.rglob(PARTIAL):  # from an interrupted run
        leftover.unlink()
    if old is None or force:
        write_text(path / MANIFEST, json.dumps(content, indent=2) + "\n")
    for name in run.manifest.sensors:
        (path / name).mkdir(exist_ok=True)


def _clear(run: RunFolder) -> None:
    """Remove only a run's own files; its manifest stays until it is replaced."""
    folders = {run.path / name: run.manifest.sensor_class(name) for name in run.manifest.sensors}
    for folder in folders:
        if folder.is_symlink():
            raise RunError(f"{folder}: is a link: --force removes no files elsewhere")
    for folder in filter(Path.is_dir, folders):
        for file in folder.iterdir():
            if _is_own(file.name, folders[folder]):
                file.unlink()
        if not any(folder.iterdir()):
            folder.rmdir()
    objects = run.path / OBJECTS
    if objects.is_symlink():
        raise RunError(f"{objects}: is a link: --force removes no files elsewhere")
    for file in objects.glob("*.tum"):
        file.unlink()
    if objects.is_dir() and not any(objects.iterdir()):
        objects.rmdir()
    for name in (GROUND_TRUTH, ODOMETRY, STATES, PLOT, LABELS):
        (run.path / name).unlink(missing_ok=True)


def _is_own(name: str, sensor: type[SensorSettings]) -> bool:
    """True if a file of this name in a sensor's folder belongs to the run."""
    if name in (*sensor.document_names, BOXES, TIMES) or fnmatch(name, PARTIAL):
        return True
    step, dot, suffix = name.partition(".")
    is_of_sensor = any(fnmatch(dot + suffix, pattern) for pattern in sensor.suffixes)
    return len(step) >= 6 and step.isdecimal() and is_of_sensor


# Ground truth in the folder of a run: files of the whole run.


def write_labels(run: RunFolder, labels: Labels) -> None:
    """Write the table of class and instance IDs, if the run records them.

    Raises:
        OutputError: the file cannot be written.
    """
    manifest = run.manifest
    is_needed = bool({*CLASSES, "instance"} & set(manifest.channels)) or any(
        manifest.sensor_class(name).has_instances for name in manifest.sensors
    )
    if is_needed and not run.has(LABELS):
        write_json(run.path / LABELS, labels.to_json())


def write_boxes(run: RunFolder, labels: Labels) -> None:
    """Merge the boxes of all steps of each camera into one file, if the run records them.

    Raises:
        RunError: boxes of a step are damaged.
        OutputError: a file cannot be written.
    """
    if "instance" not in run.manifest.channels:
        return
    for camera in run.manifest.cameras:
        if not run.has(f"{camera}/{BOXES}"):
            indices = range(run.measurements(camera))
            parts = []
            for path in (run.file(camera, index, BOXES_SUFFIX) for index in indices):
                try:
                    parts.append(json.loads(path.read_text(encoding="utf-8")))
                except (OSError, ValueError, RecursionError):
                    raise RunError(
                        f"{path}: cannot be read: remove it, and record the run again"
                    ) from None
            write_json(run.path / camera / BOXES, merged(parts, labels))


# True states of a run's base at the times of all measurements, in one file.


COLUMNS = (
    "t_s,x_m,y_m,z_m,qx,qy,qz,qw,vx_mps,vy_mps,vz_mps,ax_mps2,ay_mps2,az_mps2,"
    "wx_radps,wy_radps,wz_radps"
)


def write_states(path: Path, motion: BodyMotion, times_s: Iterable[Floats]) -> None:
    """Write the base's states at times of steps and measurements, but for those before the motion.

    A state is position, orientation, velocity and acceleration in the world, and the angular rate
    in the base's frame.

    Raises:
        OutputError: the file cannot be written.
    """
    times = np.unique(np.concatenate([printed_s(time_s) for time_s in times_s]))
    times = times[times >= printed_s(np.array([motion.start_s]))]
    parts = (times[first : first + BLOCK] for first in range(0, len(times), BLOCK))
    write_table(path, COLUMNS, (_rows(part, motion.at(part)) for part in parts))


def _rows(times_s: Floats, states: MotionStates) -> Floats:
    quaternions = quaternion_from_rotation(states.world_from_base[:, :3, :3])
    return np.column_stack((times_s, states.world_from_base[:, :3, 3], quaternions, *states[1:]))


def write_state(path: Path, time_s: float, state: MotionStates) -> None:
    """Write one state, whose arrays have one row, at the time of a sensor's own clock.

    Raises:
        OutputError: the file cannot be written.
    """
    write_table(path, COLUMNS, iter((_rows(np.array([time_s]), state),)))


def read_states(path: Path) -> tuple[Floats, MotionStates]:
    """Read times (n,) and states.

    Raises:
        RunError: the file cannot be read, or is damaged.
    """
    try:
        with path.open(encoding="utf-8") as file:
            head = file.readline().rstrip("\n")
            table = np.array([line.split(",") for line in file], dtype=np.float64)
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except ValueError:
        raise RunError(f"{path}: is damaged: expected numbers between commas") from None
    width = len(COLUMNS.split(","))
    is_known = table.shape == (len(table), width) and np.all(np.abs(table) < MAX_S)
    if head != COLUMNS or not len(table) or not is_known:  # also false for NaN
        raise RunError(f"{path}: expected the columns {COLUMNS} and finite numbers")
    norms = np.linalg.norm(table[:, 4:8], axis=1)
    if not np.all(np.diff(table[:, 0]) > 0.0) or np.any(np.abs(norms - 1.0) > 1e-6):
        raise RunError(f"{path}: expected times that increase, and unit quaternions")
    poses = pose_from_rotation(rotation_from_quaternion(table[:, 4:8]), table[:, 1:4])
    return table[:, 0], MotionStates(poses, table[:, 8:11], table[:, 11:14], table[:, 14:17])
