"""Data sets in other layouts: COCO and YOLO, and recorded runs for the exports of runs."""

from __future__ import annotations

import json
import math
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import OutputError, PlanError
from omnisim.core.files.atomic_file import atomic_folder, check_new_folder, write_text
from omnisim.core.poses import check_pose, inverse
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.export import for_format
from omnisim.datasets.export.export_format import ExportSettings, PrintNote
from omnisim.datasets.export.export_formats import format_named
from omnisim.datasets.export.recording import RecordedCamera, Recording
from omnisim.datasets.generate.samples import Shards, without_folder
from omnisim.ground_truth.boxes import VISIBLE_SHARE, BoxLimits, mask_from_runs, polygons_of_mask
from omnisim.runs.run_folder import RunFolder
from omnisim.runs.run_manifest import MANIFEST_FORMAT, parse_manifest
from omnisim.sensors.calibration_file import parse_mount
from omnisim.sensors.sensor_table import folder_name

IMAGES, LABELS, ANNOTATIONS = "images", "labels", "annotations.json"
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@dataclass(frozen=True)
class CocoSettings:
    """Settings of a folder of images with boxes."""

    is_yolo: bool = False  # True: YOLO's layout instead of COCO's
    limits: BoxLimits = field(default_factory=BoxLimits)  # limits for annotated objects
    with_polygons: bool = False  # True: masks as polygons; False: as run lengths
    # share of the samples by split name; empty: one file for all samples
    splits: Mapping[str, float] = field(default_factory=dict)

    def split_of(self, number: int) -> str:
        """Name of a sample's split, which depends on its number only; "": no splits.

        Uses multiples of the golden ratio: their fractional parts are evenly spread over any range
        of numbers.
        """
        place, end = number * GOLDEN % 1.0, 0.0
        for name, share in self.splits.items():
            end += share
            if place < end:
                return name
        return list(self.splits)[-1] if self.splits else ""


@dataclass
class _Split:
    """Images and annotations of a split."""

    images: list[dict[str, Any]] = field(default_factory=list)
    annotations: list[dict[str, Any]] = field(default_factory=list)


def write_coco(shards: Shards, folder: Path, settings: CocoSettings | None = None) -> Iterator[int]:
    """Write the images and boxes of a data set, atomically; yield after each sample.

    Raises:
        PlanError: the data set lacks the channel instance, or the visible shares that the limits
            need; or a shard is damaged.
        OutputError: the folder cannot be written.
    """
    settings = settings or CocoSettings()
    layout = "yolo" if settings.is_yolo else "coco"
    if "instance" not in shards.manifest.channels:
        raise PlanError(
            f"{layout}: expected a data set with the channel instance, from which boxes are made"
        )
    check_new_folder(folder)
    splits = {name: _Split() for name in settings.splits or ("",)}
    classes: dict[str, int] = {}
    count = 0
    with atomic_folder(folder) as target:
        (target / IMAGES).mkdir()
        for row in range(len(shards)):
            with shards.naming_shard(row), shards.files(row) as files:
                for image in shards.images(files):
                    split = splits[settings.split_of(int(image.name.partition(".")[0]))]
                    image.rename(target / IMAGES / image.name)
                    boxes = json.loads((files / f"{image.stem}.coco.json").read_text("utf-8"))
                    _check_shares(boxes, settings.limits)
                    _add(split, boxes, count, classes, settings)
                    count += 1
            yield row
        if settings.is_yolo:
            _write_yolo(target, splits, list(classes))
            return
        for name, split in splits.items():
            text = json.dumps(_content(shards, split, classes)) + "\n"
            write_text(target / (f"annotations_{name}.json" if name else ANNOTATIONS), text)


def _check_shares(boxes: dict[str, Any], limits: BoxLimits) -> None:
    if limits.min_visible is not None and not all(
        VISIBLE_SHARE in annotation for annotation in boxes["annotations"]
    ):
        raise PlanError(
            "--min-visible: expected a data set with the visible shares of its objects, which "
            "`omnisim generate` records if the plan has min_visible, which may be 0"
        )


def _add(
    split: _Split,
    boxes: dict[str, Any],
    image_id: int,
    classes: dict[str, int],
    settings: CocoSettings,
) -> None:
    """Add an image and the annotations of its objects within the limits."""
    (image,) = boxes["images"]
    split.images.append(image | {"id": image_id})
    names = {category["id"]: category["name"] for category in boxes["categories"]}
    for annotation in boxes["annotations"]:
        number = classes.setdefault(names[annotation["category_id"]], len(classes) + 1)
        if not settings.limits.keeps(annotation):
            continue
        own: dict[str, Any] = {
            "id": len(split.annotations) + 1,
            "image_id": image_id,
            "category_id": number,
        }
        if settings.with_polygons:
            runs = annotation["segmentation"]
            height, width = runs["size"]
            own["segmentation"] = polygons_of_mask(mask_from_runs(height, width, runs["counts"]))
        split.annotations.append(annotation | own)


def _write_yolo(folder: Path, splits: Mapping[str, _Split], classes: list[str]) -> None:
    """Write the boxes as class, center and size per line, in shares of the image, from class 0."""
    (folder / LABELS).mkdir()
    for name, split in splits.items():
        lines: dict[int, str] = {image["id"]: "" for image in split.images}
        sizes = {image["id"]: (image["width"], image["height"]) for image in split.images}
        for annotation in split.annotations:
            (x, y, w, h), (width, height) = annotation["bbox"], sizes[annotation["image_id"]]
            box = (x + 0.5 * w) / width, (y + 0.5 * h) / height, w / width, h / height
            numbers = " ".join(f"{share:.6f}" for share in box)
            lines[annotation["image_id"]] += f"{annotation['category_id'] - 1} {numbers}\n"
        for image in split.images:
            label = Path(image["file_name"]).with_suffix(".txt").name
            write_text(folder / LABELS / label, lines[image["id"]])
        if name:
            paths = [f"./{IMAGES}/{Path(image['file_name']).name}\n" for image in split.images]
            write_text(folder / f"{name}.txt", "".join(paths))
    named = {name: f"{name}.txt" for name in splits if name}
    places = named or {"train": IMAGES, "val": IMAGES}
    names = [f"  {number}: {json.dumps(name)}" for number, name in enumerate(classes)]
    data = [*(f"{name}: {place}" for name, place in places.items()), "names:", *names]
    write_text(folder / "data.yaml", "\n".join(data) + "\n")
    write_text(folder / "classes.txt", "".join(f"{name}\n" for name in classes))


def _content(shards: Shards, split: _Split, classes: dict[str, int]) -> dict[str, Any]:
    return {
        "info": {"description": shards.manifest.title},
        "licenses": [{"id": 1, "name": shards.manifest.license or "unknown"}],
        "images": split.images,
        "categories": [
            {"id": number, "name": name, "supercategory": ""} for name, number in classes.items()
        ],
        "annotations": split.annotations,
    }


# Samples of a data set as recordings, for writing them in other tools' formats.
#
# These formats hold images of one scene, taken by the same cameras. A data set with several
# scenes or rigs becomes one folder per scene and rig: `soccer/fisheye`.


SAME = 1e-6  # meters and radians: rounding of a camera's pose on its base from two other poses


class _Files:
    """Files of one sample of shards at a time, extracted to a temporary folder."""

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
    with tempfile.TemporaryDirectory(prefix="omnisim-") as name:
        files = _Files(shards, Path(name) / "sample")
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
                    message = without_folder(str(reason))
                    if message == str(reason):
                        raise
                    raise PlanError(f"{shards.folder}: {message}") from None


def _groups(shards: Shards) -> list[_Group]:
    """Samples grouped by scene and rig; groups are in the order of their first samples."""
    groups: dict[tuple[str, str], _Group] = {}
    for row in range(len(shards)):
        content = shards.metadata(row)
        with shards.naming_shard(row):
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
        with shards.naming_shard(row):
            images: dict[str, dict[str, Any]] = dict(content["images"])
            first = first or images
            numbers.append(float(content["number"]))
            poses.append(images[next(iter(first))]["world_from_base"])
            for name, image in first.items():
                other = images[name]
                base_from_world = inverse(check_pose(other["world_from_base"]))
                mount = base_from_world @ np.array(other["world_from_optical"])
                known = mounts.setdefault(name, mount)
                if other["camera"] != image["camera"] or np.abs(mount - known).max() > SAME:
                    raise PlanError(
                        f"{shards.folder}: sample {content['number']}: {name} differs from that of "
                        f"sample {numbers[0]:.0f}: expected cameras that do not vary, as this "
                        "format has one calibration for all images"
                    )
    content = {  # of a manifest that is not in a file
        "format": MANIFEST_FORMAT,
        "scene": {"name": group.scene, "file": group.scene, "up_axis": None, "contents": ""},
        "robot": {"name": group.rig},
        "path": {"name": shards.manifest.title},
        "steps": len(group.rows),
        "sensors": {name: {"type": "omnicamera"} for name in first},
        "channels": list(shards.manifest.channels),
        "is_rig": True,
    }
    run = RunFolder(shards.folder, parse_manifest(content, str(shards.folder)))
    cameras = []
    for name, image in first.items():
        camera = parse_mount(image | {"base_from_optical": mounts[name]}, run.path / name)
        cameras.append(_SampleCamera(run, name, camera, files, group.rows))
    return Recording(run, Trajectory(np.array(numbers), np.array(poses)), None, tuple(cameras))
