"""Samples of a data set as recordings, for writing them in other tools' formats.

These formats hold images of one scene, taken by the same cameras. A data set with several scenes or
rigs becomes one folder per scene and rig: `soccer/fisheye`.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import OutputError, PlanError
from omnisim.core.files.atomic_file import atomic_folder, check_new_folder
from omnisim.core.poses import check_pose, inverse
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.export import for_format
from omnisim.datasets.export.export_format import ExportSettings, PrintNote
from omnisim.datasets.export.export_formats import format_named
from omnisim.datasets.export.recording import RecordedCamera, Recording
from omnisim.datasets.generate.samples import Shards, in_shard
from omnisim.runs.run_folder import RunFolder
from omnisim.runs.run_manifest import MANIFEST_FORMAT, parse_manifest
from omnisim.sensors.calibration_file import parse_mount
from omnisim.sensors.sensor_names import folder_name

SAME = 1e-6  # meters and radians: rounding of a camera's pose on its base from two other poses


class _Files:
    """Files of one sample at a time, extracted to a temporary folder.

    Args:
        shards: shards of the data set.
        folder: folder to extract to.
    """

    def __init__(self, shards: Shards, folder: Path):
        self._shards, self._folder, self._row = shards, folder, -1
        self._images: dict[str, Path] = {}

    def image(self, row: int, camera: str) -> Path:
        """Path of a sample's image from a camera; its channels are in the same folder.

        Raises:
            PlanError: the sample has no such image.
        """
        if row != self._row:
            self._row = -1
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir()
            paths = self._shards.images(self._shards.extract(row, self._folder))
            self._images = {path.stem.partition(".")[2] or "camera": path for path in paths}
            self._row = row
        if camera not in self._images:
            raise PlanError(
                f"{self._shards.folder}: sample {row}: expected an image of {camera}: its shard "
                "is damaged"
            )
        return self._images[camera]


@dataclass(frozen=True, eq=False)
class _SampleCamera(RecordedCamera):
    """Camera of a group of samples, as the camera of a run whose steps are the samples."""

    files: _Files
    rows: Sequence[int]

    def image_file(self, step: int) -> Path:
        """Image file of a step."""
        return self.files.image(self.rows[step], self.name)


@dataclass(frozen=True, eq=False)
class _Group:
    """Samples of one scene and rig: their indices, and the contents of their JSON files."""

    scene: str
    rig: str
    rows: list[int]
    contents: list[dict[str, Any]]


def write_recordings(
    shards: Shards, format: str, folder: Path, print_note: PrintNote = lambda note: None
) -> Iterator[int]:
    """Write the samples in a format of `omnisim.datasets.export`, atomically; yield after each one.

    Raises:
        OmnisimError: a damaged shard, cameras that vary or that the format does not support, or a
            folder that cannot be written.
    """
    check_new_folder(folder)
    form, settings = format_named(format), ExportSettings()
    with _files_of(shards) as files:
        groups = _groups(shards)
        recordings = [_recording(shards, group, files) for group in groups]
        with atomic_folder(folder) as target:
            for group, recording in zip(groups, recordings, strict=True):
                place = target
                if len(groups) > 1:
                    place = target / folder_name(group.scene) / folder_name(group.rig)
                    place.mkdir(parents=True)
                taken = for_format(recording, form, print_note)
                try:
                    yield from form.write(taken, place, settings, print_note)
                except OutputError as reason:
                    message = in_shard(str(reason))
                    if message == str(reason):
                        raise
                    raise PlanError(f"{shards.folder}: {message}") from None


@contextmanager
def _files_of(shards: Shards) -> Iterator[_Files]:
    with tempfile.TemporaryDirectory(prefix="omnisim-") as name:
        yield _Files(shards, Path(name) / "sample")


def _groups(shards: Shards) -> list[_Group]:
    """Samples grouped by scene and rig; groups are in the order of their first samples."""
    groups: dict[tuple[str, str], _Group] = {}
    for row in range(len(shards)):
        content = shards.metadata(row)
        with shards.damage_named(row):
            key = str(content["scene"]), str(content["camera"])
            group = groups.setdefault(key, _Group(*key, [], []))
            group.rows.append(row)
            group.contents.append(content)
    return list(groups.values())


def _recording(shards: Shards, group: _Group, files: _Files) -> Recording:
    """Recording of a group's samples; a sample's number is its time in seconds."""
    first: dict[str, Any] = {}
    mounts: dict[str, Floats] = {}
    numbers, poses = [], []
    for row, content in zip(group.rows, group.contents, strict=True):
        with shards.damage_named(row):
            images: dict[str, dict[str, Any]] = dict(content["images"])
            first = first or images
            numbers.append(float(content["number"]))
            poses.append(images[next(iter(first))]["world_from_base"])
            for name, image in first.items():
                other, mount = images[name], _mount(images[name])
                known = mounts.setdefault(name, mount)
                if other["camera"] != image["camera"] or np.abs(mount - known).max() > SAME:
                    raise PlanError(
                        f"{shards.folder}: sample {content['number']}: {name} is not as in sample "
                        f"{numbers[0]:.0f}: expected cameras that do not vary, as this format has "
                        "one calibration for all images"
                    )
    run = _run(shards, group, list(first))
    cameras = []
    for name, image in first.items():
        camera = parse_mount(image | {"base_from_optical": mounts[name]}, run.path / name)
        cameras.append(_SampleCamera(run, name, camera, files, group.rows))
    return Recording(run, Trajectory(np.array(numbers), np.array(poses)), None, tuple(cameras))


def _mount(image: dict[str, Any]) -> Floats:
    """Pose (4, 4) of an image's camera on its base."""
    world_from_base = check_pose(image["world_from_base"])
    return inverse(world_from_base) @ np.array(image["world_from_optical"])


def _run(shards: Shards, group: _Group, cameras: list[str]) -> RunFolder:
    """Run with one step per sample of a group; its manifest is not in a file."""
    scene = {"name": group.scene, "file": group.scene, "up_axis": None, "contents": ""}
    content = {
        "format": MANIFEST_FORMAT,
        "scene": scene,
        "robot": {"name": group.rig},
        "path": {"name": shards.manifest.title},
        "steps": len(group.rows),
        "sensors": {name: {"type": "omnicamera"} for name in cameras},
        "channels": list(shards.manifest.channels),
        "is_rig": True,
    }
    return RunFolder(shards.folder, parse_manifest(content, str(shards.folder)))
