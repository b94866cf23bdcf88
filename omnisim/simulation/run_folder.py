"""The folder of a run: what is in it, whether it may be gone on with, and what is still missing.

    manifest.json               what made the run: versions, contents, settings, seeds
    ground_truth.tum            poses of the base (TUM: s, metres, quaternion xyzw)
    odometry.csv                what the wheels report, and dead reckoning by it
    <camera>/sensor.toml        the camera as it was used
    <camera>/calibration.json   its parameters and its mount on the base
    <camera>/000000.png ...     a picture a step, with camera and pose inside
    <scanner>/000000.csv ...    a scan a step

With channels of ground truth also:

    labels.json                             numbers, names and colours of classes and instances
    <camera>/000000.channels.exr ...        the channels of a step, see omnisim/ground_truth/exr.py
    <camera>/000000.coco.json ...           boxes of the instances at a step, with `instance`
    <camera>/coco.json                      boxes of all steps, when all are there

Every file appears only when it is whole, so whatever is there is finished; what a power cut has
left empty counts as missing.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field

from omnisim.atomic_file import atomic_write
from omnisim.errors import RunError
from omnisim.parameters import Table, parse_table
from omnisim.robot.sensor_mounts import SensorName

MANIFEST = "manifest.json"
MANIFEST_FORMAT = 1
GROUND_TRUTH, ODOMETRY = "ground_truth.tum", "odometry.csv"
PLOT = "plot.png"  # where the run's plot goes when nobody says
PARTIAL = ".omnisim-*.partial"
CHANNELS_SUFFIX, BOXES_SUFFIX = ".channels.exr", ".coco.json"
OURS = re.compile(
    r"\d{6,}\.(png|csv|channels\.exr|coco\.json)|coco\.json|sensor\.toml|calibration\.json"
    r"|\.omnisim-.*\.partial"
)
_TO_THE_NEXT = ("flow", "occluded")
# For the record: other versions of these, or from elsewhere, may go on with a run.
FOR_THE_RECORD = ("libraries", "scene.file", "path.name")


class _Open(Table):
    """What others rely on; there is more in it."""

    model_config = ConfigDict(extra="allow", strict=True)


class _SceneTable(_Open):
    name: str
    file: str
    up_axis: str | None
    contents: str


class _NameTable(_Open):
    name: str


class _Manifest(_Open):
    format: Literal[MANIFEST_FORMAT]
    scene: _SceneTable
    robot: _NameTable
    path: _NameTable
    steps: int = Field(ge=1)
    cameras: list[SensorName]
    scanners: list[SensorName]
    channels: tuple[str, ...] = Field(default=(), strict=False)


class RunFolder:
    """The folder of one run. Who has opened it to write has to close it: others wait.

    Attributes:
        path: the folder.
        manifest: what made the run.
    """

    def __init__(self, path: Path, manifest: dict[str, Any]):
        self.path, self.manifest = path, manifest
        self._lock: int | None = None

    def close(self) -> None:
        """Let others write; a second time does nothing."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @classmethod
    def open(cls, path: Path, manifest: dict[str, Any], force: bool = False) -> RunFolder:
        """Begin a run, or go on with the one that is there.

        Args:
            path: the folder; it is made where it is missing, in a folder that is there.
            manifest: what is going to make the run.
            force: throw another run away that is there.

        Raises:
            RunError: another run is there, or files that are none of ours, another drive is
                writing to it, or it cannot be written to.
            OutputError: the manifest cannot be written.
        """
        folder = cls(path, manifest)
        try:
            folder._begin(force)
        except OSError as reason:
            folder.close()
            where = reason.filename or path
            raise RunError(f"{where}: cannot be written to: {reason.strerror}") from None
        except BaseException:
            folder.close()
            raise
        return folder

    @classmethod
    def read(cls, path: Path) -> RunFolder:
        """The run that is in a folder.

        Raises:
            RunError: there is none.
        """
        if not path.is_dir():
            raise RunError(f"{path}: no such folder: want the folder of a run, as drive makes it")
        manifest = _read_manifest(path / MANIFEST)
        if manifest is None:
            raise RunError(
                f"{path}: has no {MANIFEST}: want the folder of a run, as drive makes it"
            )
        return cls(path, manifest)

    def file(self, sensor: str, step: int, suffix: str) -> Path:
        """Where a sensor's file of a step is, or is going to be."""
        return self.path / sensor / f"{step:06d}{suffix}"

    def has(self, name: str) -> bool:
        """Whether a file of the run is there, such as `GROUND_TRUTH`."""
        return is_written(self.path / name)

    def write_text(self, name: str, text: str) -> None:
        """Write a text file.

        Raises:
            OutputError: it cannot be written.
        """
        with atomic_write(self.path / name) as partial:
            partial.write_text(text, encoding="utf-8", newline="\n")

    def steps_done(self) -> int:
        """How many steps from the first one on have all their files."""
        done = 0
        while done < self.manifest["steps"] and self.is_done(done):
            done += 1
        return done

    def is_done(self, step: int) -> bool:
        """Whether a step has all its files."""
        return self.missing_file(step) is None

    def missing_file(self, step: int) -> Path | None:
        """The first of a step's files that is missing or empty, or None: all are there."""
        files = [self.file(name, step, ".csv") for name in self.manifest["scanners"]]
        for name in self.manifest["cameras"]:
            files += self.camera_files(name, step)
        return next((file for file in files if not is_written(file)), None)

    def channels_at(self, step: int) -> tuple[str, ...]:
        """The channels of ground truth of a step: from the last one, nothing flows anywhere."""
        names = self.manifest.get("channels", ())
        is_last = step == self.manifest["steps"] - 1
        return tuple(name for name in names if not (is_last and name in _TO_THE_NEXT))

    def camera_files(self, camera: str, step: int) -> list[Path]:
        """All files of a camera at a step."""
        channels = self.channels_at(step)
        suffixes = [".png"]
        suffixes += [CHANNELS_SUFFIX] if channels else []
        suffixes += [BOXES_SUFFIX] if "instance" in channels else []
        return [self.file(camera, step, suffix) for suffix in suffixes]

    def _begin(self, force: bool) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise RunError(f"{self.path}: is a file: want a folder")
        if not self.path.parent.is_dir():
            raise RunError(
                f"{self.path}: the folder {self.path.parent} does not exist: create it first"
            )
        if self.path.is_symlink() and not self.path.exists():
            raise RunError(f"{self.path}: is a link that leads nowhere: want a folder")
        self.path.mkdir(exist_ok=True)
        self._lock = _locked(self.path)
        there = _read_manifest(self.path / MANIFEST)
        if there is None:
            if any(not file.match(PARTIAL) for file in self.path.iterdir()):
                raise RunError(
                    f"{self.path}: is not empty and has no {MANIFEST}: want a new folder, an empty "
                    "one, or that of a run"
                )
        elif force:
            self._clear(there)
        elif difference := _first_difference(there, self.manifest):
            raise RunError(
                f"{self.path / MANIFEST}: {difference}: another run is in this folder; "
                "choose another, or throw that one away with --force"
            )
        for leftover in self.path.rglob(PARTIAL):  # of a run that was killed
            leftover.unlink()
        if there is None or force:
            self.write_text(MANIFEST, json.dumps(self.manifest, indent=2) + "\n")
        for kind in ("cameras", "scanners"):
            for name in self.manifest[kind]:
                (self.path / name).mkdir(exist_ok=True)

    def _clear(self, manifest: dict[str, Any]) -> None:
        """Remove what a run has put here, and nothing else; its manifest stays until another's."""
        folders = [self.path / name for kind in ("cameras", "scanners") for name in manifest[kind]]
        for folder in folders:
            if folder.is_symlink():
                raise RunError(f"{folder}: is a link: --force removes no files elsewhere")
        for folder in filter(Path.is_dir, folders):
            for file in folder.iterdir():
                if OURS.fullmatch(file.name):
                    file.unlink()
            if not any(folder.iterdir()):
                folder.rmdir()
        for name in (GROUND_TRUTH, ODOMETRY, PLOT, "labels.json"):
            (self.path / name).unlink(missing_ok=True)


def _locked(folder: Path) -> int:
    """A handle that keeps other drives out of a folder until it is closed, or its process ends.

    Raises:
        RunError: another drive has it.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise RunError(f"{folder}: another drive is writing to it: wait for its end") from None
    except OSError:  # a file system without locks
        pass
    return handle


def is_written(path: Path) -> bool:
    """Whether a file is there and not empty."""
    try:
        return path.stat().st_size > 0
    except FileNotFoundError:
        return False


def _read_manifest(path: Path) -> dict[str, Any] | None:
    """The manifest, or None: there is none.

    Raises:
        RunError: it is damaged.
    """
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as reason:
        raise RunError(f"{path}: cannot be read: {reason.strerror}") from None
    except (ValueError, RecursionError):
        raise RunError(f"{path}: is damaged: not JSON") from None
    if not isinstance(manifest, dict) or "steps" not in manifest:
        raise RunError(f"{path}: is damaged: not the manifest of a run")
    try:
        parse_table(manifest, _Manifest, RunError, f"{path}: is damaged")
    except RunError as faults:
        raise RunError(str(faults).partition("\n")[0]) from None
    return manifest


def _first_difference(there: dict[str, Any], wanted: dict[str, Any], at: str = "") -> str:
    """The first key with two values, in words; empty where there is none.

    A table that is not there is an empty one: the key that differs is told, not all of the table.
    """
    for key in dict.fromkeys((*wanted, *there)):
        if f"{at}{key}" in FOR_THE_RECORD:
            continue
        old, new = there.get(key), wanted.get(key)
        if isinstance(old, dict | None) and isinstance(new, dict | None):
            difference = _first_difference(old or {}, new or {}, f"{at}{key}.")
            if difference:
                return difference
        elif old != new:
            return f"{at}{key} was {old!r}, is {new!r}"
    return ""
