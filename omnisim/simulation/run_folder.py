"""The folder of a run: what is in it, whether it may be gone on with, and what is still missing.

    manifest.json               what made the run: versions, contents, settings, seeds
    ground_truth.tum            poses of the base (TUM: s, metres, quaternion xyzw)
    odometry.csv                what the wheels report, and dead reckoning by it
    <camera>/sensor.toml        the camera as it was used
    <camera>/calibration.json   its parameters and its mount on the base
    <camera>/000000.png ...     a picture a step, with camera and pose inside
    <scanner>/000000.csv ...    a scan a step

Every file appears only when it is whole, so whatever is there is finished.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field

from omnisim.atomic_file import whole_file
from omnisim.errors import RunError
from omnisim.robot.sensor_mounts import SensorName
from omnisim.toml_file import Table, parse_table

MANIFEST = "manifest.json"
MANIFEST_FORMAT = 1
GROUND_TRUTH, ODOMETRY = "ground_truth.tum", "odometry.csv"
PARTIAL = ".omnisim-*.partial"
OURS = re.compile(r"\d{6,}\.(png|csv)|sensor\.toml|calibration\.json|\.omnisim-.*\.partial")
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


class RunFolder:
    """The folder of one run.

    Attributes:
        path: the folder.
        manifest: what made the run.
    """

    def __init__(self, path: Path, manifest: dict[str, Any]):
        self.path, self.manifest = path, manifest

    @classmethod
    def open(cls, path: Path, manifest: dict[str, Any], force: bool = False) -> RunFolder:
        """Begin a run, or go on with the one that is there.

        Args:
            path: the folder; it is made where it is missing, in a folder that is there.
            manifest: what is going to make the run.
            force: throw another run away that is there.

        Raises:
            RunError: another run is there, or files that are none of ours, or it cannot be
                written to.
        """
        folder = cls(path, manifest)
        try:
            folder._begin(force)
        except OSError as reason:
            raise RunError(f"{path}: cannot be written to: {reason.strerror}") from None
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

    def write_text(self, name: str, text: str) -> None:
        """Write a text file, unless it is there.

        Raises:
            OutputError: it cannot be written.
        """
        target = self.path / name
        if not target.exists():
            with whole_file(target) as partial:
                partial.write_text(text, encoding="utf-8", newline="\n")

    def steps_done(self) -> int:
        """How many steps have all their files."""
        done = 0
        while done < self.manifest["steps"] and self.is_done(done):
            done += 1
        return done

    def is_done(self, step: int) -> bool:
        """Whether a step has all its files."""
        return all(
            self.file(name, step, suffix).exists()
            for kind, suffix in (("cameras", ".png"), ("scanners", ".csv"))
            for name in self.manifest[kind]
        )

    def _begin(self, force: bool) -> None:
        if self.path.exists() and not self.path.is_dir():
            raise RunError(f"{self.path}: is a file: want a folder")
        if not self.path.parent.is_dir():
            raise RunError(
                f"{self.path}: the folder {self.path.parent} does not exist: create it first"
            )
        self.path.mkdir(exist_ok=True)
        there = _read_manifest(self.path / MANIFEST)
        if there is not None:
            difference = _first_difference(there, self.manifest)
            if difference and not force:
                raise RunError(
                    f"{self.path / MANIFEST}: {difference}: another run is in this folder; "
                    "choose another, or throw that one away with --force"
                )
            if force:
                self._clear(there)
                there = None
        else:
            foreign = [p for p in self.path.iterdir() if not p.match(PARTIAL)]
            if foreign:
                raise RunError(
                    f"{self.path}: is not empty and has no {MANIFEST}: want a new folder, an empty "
                    "one, or that of a run"
                )
        for leftover in self.path.rglob(PARTIAL):  # of a run that was killed
            leftover.unlink()
        if there is None:
            self.write_text(MANIFEST, json.dumps(self.manifest, indent=2) + "\n")
        for kind in ("cameras", "scanners"):
            for name in self.manifest[kind]:
                (self.path / name).mkdir(exist_ok=True)

    def _clear(self, manifest: dict[str, Any]) -> None:
        """Remove what a run has put here, the manifest last, and nothing else."""
        for kind in ("cameras", "scanners"):
            for name in manifest.get(kind, ()):
                folder = self.path / name
                if folder.parent != self.path or folder.is_symlink() or not folder.is_dir():
                    continue
                for file in folder.iterdir():
                    if OURS.fullmatch(file.name):
                        file.unlink()
                if not any(folder.iterdir()):
                    folder.rmdir()
        for name in (GROUND_TRUTH, ODOMETRY, MANIFEST):
            (self.path / name).unlink(missing_ok=True)


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
    """The first key with two values, in words; empty where there is none."""
    for key in dict.fromkeys((*wanted, *there)):
        if f"{at}{key}" in FOR_THE_RECORD:
            continue
        old, new = there.get(key), wanted.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            difference = _first_difference(old, new, f"{at}{key}.")
            if difference:
                return difference
        elif old != new:
            return f"{at}{key} was {old!r}, is {new!r}"
    return ""
