"""Boxes and masks of visible instances in COCO format."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.atomic_file import write_text
from omnisim.core.version import __version__
from omnisim.ground_truth.label_names import Labels

_ABOUT = (
    "Boxes and areas cover an instance's visible pixels only. Straight edges are curved in an "
    "omnidirectional image, so boxes fit less tightly than in a perspective one; an instance "
    "across the seam of a 360° image has a box as wide as the image. Box: x, y, width, height in "
    "pixels from the corner of the top left pixel."
)
VISIBLE_SHARE = "visible_share"  # key of an annotation, if the share is known


@dataclass(frozen=True)
class BoxLimits:
    """Limits for annotated objects.

    Attributes:
        min_area_px: minimum number of visible pixels.
        min_visible: minimum visible share, 0 to 1, of the pixels that the object would cover alone;
            None: no limit, and the share may be unknown.
    """

    min_area_px: int = 1
    min_visible: float | None = None

    def keeps(self, annotation: Mapping[str, Any]) -> bool:
        """True if an annotation is within the limits.

        Raises:
            KeyError: the visible share is required but unknown.
        """
        if annotation["area"] < self.min_area_px:
            return False
        return self.min_visible is None or annotation[VISIBLE_SHARE] >= self.min_visible


def coco_image(
    instances: NDArray[np.integer[Any]], labels: Labels, file_name: str, image_id: int = 0
) -> dict[str, Any]:
    """COCO data of one image.

    Args:
        instances: (height, width) channel `instance`.
        labels: labels of the instances.
        file_name: file name of the image.
        image_id: ID of the image.
    """
    height, width = instances.shape
    annotations = []
    for number, counts in _runs(instances).items():
        label = labels.instances[number - 1]
        rows, columns = np.nonzero(_box(instances, number, counts))
        first = counts[0] // height
        x, y = first + int(columns.min()), int(rows.min())
        annotations.append(
            {
                "id": 0,
                "image_id": image_id,
                "category_id": label.class_id,
                "bbox": [x, y, int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1],
                "area": len(rows),
                "iscrowd": 0,
                "segmentation": {"size": [height, width], "counts": counts},
                "instance_id": number,
                "instance_name": label.name,
            }
        )
    return _whole(
        labels, [{"id": image_id, "file_name": file_name, "width": width, "height": height}],
        annotations,
    )  # fmt: skip


def _runs(instances: NDArray[np.integer[Any]]) -> dict[int, list[int]]:
    """Run lengths of each instance's mask, in column-major order, starting with the background."""
    flat = instances.T.ravel()
    ends = np.append(np.flatnonzero(np.diff(flat.astype(np.int64))) + 1, flat.size)
    starts = np.concatenate(([0], ends[:-1]))
    numbers = flat[starts]
    counts_of = {}
    for number in np.unique(numbers[numbers > 0]).tolist():
        runs = numbers == number
        edges = np.stack((starts[runs], ends[runs]), axis=-1).ravel()
        counts = np.diff(np.concatenate(([0], edges))).tolist()
        if edges[-1] < flat.size:
            counts.append(int(flat.size - edges[-1]))
        counts_of[number] = counts
    return counts_of


def _box(instances: NDArray[np.integer[Any]], number: int, counts: list[int]) -> NDArray[np.bool_]:
    """Mask (height, columns) of an instance, cropped to its columns."""
    height = instances.shape[0]
    last = sum(counts[: len(counts) - len(counts) % 2]) - 1
    return instances[:, counts[0] // height : last // height + 1] == number


def _whole(
    labels: Labels, images: list[dict[str, Any]], annotations: list[dict[str, Any]]
) -> dict[str, Any]:
    numbered = [
        annotation | {"id": number} for number, annotation in enumerate(annotations, start=1)
    ]
    return {
        "info": {"description": _ABOUT, "contributor": f"omnisim {__version__}"},
        "images": images,
        "categories": [
            {"id": label.id, "name": label.name, "supercategory": ""} for label in labels.classes
        ],
        "annotations": numbered,
    }


def merged(parts: Sequence[Mapping[str, Any]], labels: Labels) -> dict[str, Any]:
    """COCO data of several images combined; their image IDs must be unique."""
    return _whole(
        labels,
        [image for part in parts for image in part["images"]],
        [annotation for part in parts for annotation in part["annotations"]],
    )


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write content as JSON.

    Raises:
        OutputError: the file cannot be written.
    """
    write_text(path, json.dumps(content) + "\n")


# COCO polygons of masks, exact along pixel edges.


Loop = list[tuple[int, int]]  # corners (x, y)


def mask_from_runs(height: int, width: int, counts: Sequence[int]) -> NDArray[np.bool_]:
    """Mask (height, width) from COCO run lengths, column-major, starting with the background."""
    flat = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return flat.reshape(width, height).T


def polygons_of_mask(mask: NDArray[np.bool_]) -> list[list[float]]:
    """Polygons of a mask, one per region: x, y, x, y … in px from the image's top left corner.

    Pixels that share only a corner are in different regions. A polygon excludes a hole by a line to
    the hole and back.

    Args:
        mask: (height, width) mask.
    """
    from scipy import ndimage  # slow to import, and seldom needed

    regions, count = ndimage.label(mask)
    polygons: list[list[float]] = []
    for region, (rows, columns) in enumerate(ndimage.find_objects(regions), start=1):
        outer, *holes = _loops(regions[rows, columns] == region)
        start = outer[:1] if holes else []
        outer += start
        for hole in holes:
            outer += [*hole, hole[0], *start]
        corner = columns.start, rows.start
        polygons.append([float(value + offset) for point in outer
                         for value, offset in zip(point, corner, strict=True)])  # fmt: skip
    assert len(polygons) == count
    return polygons


def _loops(region: NDArray[np.bool_]) -> list[Loop]:
    """Loops around a region and its holes, outer loop first; the region is on their right."""
    edges = _edges(region)
    loops = []
    while edges:
        start = next(iter(edges))  # in the first remaining row
        point, direction = start, edges[start][0]
        loop: Loop = []
        while True:
            ways = edges[point]
            # where two pixels touch at a corner, turn right to stay on the same pixel
            turned = (-direction[1], direction[0])
            way = turned if turned in ways else ways[0]
            if way != direction or not loop:
                loop.append(point)
            ways.remove(way)
            if not ways:
                del edges[point]
            point, direction = (point[0] + way[0], point[1] + way[1]), way
            if point == start:
                break
        loops.append(loop)
    return loops


def _edges(region: NDArray[np.bool_]) -> dict[tuple[int, int], list[tuple[int, int]]]:
    """Directions of the edges that start at each corner, row by row."""
    padded = np.pad(region, 1)
    inside = padded[1:-1, 1:-1]
    sides = (
        (padded[:-2, 1:-1], (0, 0), (1, 0)),  # top edge: from the left corner to the right
        (padded[1:-1, 2:], (1, 0), (0, 1)),
        (padded[2:, 1:-1], (1, 1), (-1, 0)),
        (padded[1:-1, :-2], (0, 1), (0, -1)),
    )
    directed = []
    for neighbor, (right, down), way in sides:
        rows, columns = np.nonzero(inside & ~neighbor)
        directed += [
            (y + down, x + right, way) for y, x in zip(rows.tolist(), columns.tolist(), strict=True)
        ]
    edges: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for y, x, way in sorted(directed):
        edges.setdefault((x, y), []).append(way)
    return edges
