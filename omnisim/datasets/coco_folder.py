"""COCO and YOLO layouts of a data set: images with the boxes of their objects.

COCO has `annotations.json`, or one such file per split; YOLO a text file per image in `labels/`,
`classes.txt`, `data.yaml`, and a list of images per split.

Classes of the same name have the same ID in all scenes and all splits.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omnisim.core.errors import PlanError
from omnisim.core.files.atomic_file import atomic_folder, check_new_folder, write_text
from omnisim.datasets.generate.samples import Shards
from omnisim.ground_truth.boxes import VISIBLE_SHARE, BoxLimits, mask_from_runs, polygons_of_mask

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
            f"{layout}: expected a data set with the channel instance, whose boxes it has"
        )
    check_new_folder(folder)
    splits = {name: _Split() for name in settings.splits or ("",)}
    classes: dict[str, int] = {}
    count = 0
    with atomic_folder(folder) as target:
        (target / IMAGES).mkdir()
        for row in range(len(shards)):
            with shards.damage_named(row), shards.files(row) as files:
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
        VISIBLE_SHARE in one for one in boxes["annotations"]
    ):
        raise PlanError(
            "--min-visible: expected a data set with the visible shares of its objects, which "
            "`omnisim generate` records where the plan has min_visible: 0 leaves none out"
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
    names = {one["id"]: one["name"] for one in boxes["categories"]}
    for one in boxes["annotations"]:
        number = classes.setdefault(names[one["category_id"]], len(classes) + 1)
        if not settings.limits.keeps(one):
            continue
        own: dict[str, Any] = {
            "id": len(split.annotations) + 1,
            "image_id": image_id,
            "category_id": number,
        }
        if settings.with_polygons:
            (height, width), counts = one["segmentation"]["size"], one["segmentation"]["counts"]
            own["segmentation"] = polygons_of_mask(mask_from_runs(height, width, counts))
        split.annotations.append(one | own)


def _write_yolo(folder: Path, splits: Mapping[str, _Split], classes: list[str]) -> None:
    """Write the boxes as class, center and size per line, in shares of the image, from class 0."""
    (folder / LABELS).mkdir()
    for name, split in splits.items():
        lines: dict[int, str] = {image["id"]: "" for image in split.images}
        sizes = {image["id"]: (image["width"], image["height"]) for image in split.images}
        for one in split.annotations:
            (x, y, w, h), (width, height) = one["bbox"], sizes[one["image_id"]]
            box = (x + 0.5 * w) / width, (y + 0.5 * h) / height, w / width, h / height
            numbers = " ".join(f"{share:.6f}" for share in box)
            lines[one["image_id"]] += f"{one['category_id'] - 1} {numbers}\n"
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
