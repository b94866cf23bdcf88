"""COCO's layout of a data set: `images/` and one `annotations.json` for all of them.

Classes of all scenes have one number for each name.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from omnisim.atomic_file import atomic_folder, check_new_folder, write_text
from omnisim.datasets.samples import Shards
from omnisim.errors import PlanError

IMAGES, ANNOTATIONS = "images", "annotations.json"


def write_coco(shards: Shards, folder: Path) -> Iterator[int]:
    """Write the pictures and boxes of a data set, whole or not at all; yield after each sample.

    Raises:
        PlanError: a data set without the channel instance, or a damaged shard.
        OutputError: the folder cannot be written.
    """
    if "instance" not in shards.manifest.channels:
        raise PlanError("coco: expected a data set with the channel instance, whose boxes it has")
    check_new_folder(folder)
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    classes: dict[str, int] = {}
    with atomic_folder(folder) as target:
        (target / IMAGES).mkdir()
        for row in range(len(shards)):
            with shards.damage_named(row), shards.files(row) as files:
                for picture in shards.pictures(files):
                    picture.rename(target / IMAGES / picture.name)
                    boxes = json.loads((files / f"{picture.stem}.coco.json").read_text("utf-8"))
                    names = {one["id"]: one["name"] for one in boxes["categories"]}
                    for image in boxes["images"]:
                        images.append(image | {"id": len(images)})
                    for one in boxes["annotations"]:
                        name = names[one["category_id"]]
                        number = classes.setdefault(name, len(classes) + 1)
                        own = {"id": len(annotations) + 1, "image_id": len(images) - 1}
                        annotations.append(one | own | {"category_id": number})
            yield row
        content = {
            "info": {"description": shards.manifest.title},
            "licenses": [{"id": 1, "name": shards.manifest.licence or "unknown"}],
            "images": images,
            "categories": [
                {"id": number, "name": name, "supercategory": ""}
                for name, number in classes.items()
            ],
            "annotations": annotations,
        }
        write_text(target / ANNOTATIONS, json.dumps(content) + "\n")
