"""Boxes and masks of instances: in an image, in COCO format, and oriented ones in space."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats
from omnisim.core.files.atomic_file import write_text
from omnisim.core.poses import inverse, quaternion_from_rotation
from omnisim.core.short_repr import point_text, short_repr
from omnisim.core.version import __version__
from omnisim.ground_truth.label_names import InstanceLabel, Labels

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

    Shares are of the pixels that the object would cover if nothing hid it; None: no limit, or
    unknown.
    """

    min_area_px: int = 1  # minimum number of visible pixels
    min_visible: float | None = None  # minimum visible share, 0 to 1

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
    """COCO data of one image, from its channel `instance` (height, width)."""
    height, width = instances.shape
    annotations = []
    for number, counts in _runs(instances).items():
        label = labels.instances[number - 1]
        # the mask, cropped to the columns of the instance
        first = counts[0] // height
        last = sum(counts[: len(counts) - len(counts) % 2]) - 1
        rows, columns = np.nonzero(instances[:, first : last // height + 1] == number)
        x, y = first + int(columns.min()), int(rows.min())
        annotations.append({
            "id": 0, "image_id": image_id, "category_id": label.class_id,
            "bbox": [x, y, int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1],
            "area": len(rows), "iscrowd": 0,
            "segmentation": {"size": [height, width], "counts": counts},
            "instance_id": number, "instance_name": label.name,
        })  # fmt: skip
    image = {"id": image_id, "file_name": file_name, "width": width, "height": height}
    return _whole(labels, [image], annotations)


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


def _whole(
    labels: Labels, images: list[dict[str, Any]], annotations: list[dict[str, Any]]
) -> dict[str, Any]:
    return {
        "info": {"description": _ABOUT, "contributor": f"omnisim {__version__}"},
        "images": images,
        "categories": [
            {"id": label.id, "name": label.name, "supercategory": ""} for label in labels.classes
        ],
        "annotations": [
            annotation | {"id": number} for number, annotation in enumerate(annotations, start=1)
        ],
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


def mask_from_runs(height: int, width: int, counts: Sequence[int]) -> Bools:
    """Mask (height, width) from COCO run lengths, column-major, starting with the background."""
    flat = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return flat.reshape(width, height).T


def polygons_of_mask(mask: Bools) -> list[list[float]]:
    """Polygons of a mask (height, width), one per region: x, y, x, y … in px from the top left.

    Pixels that share only a corner are in different regions. A polygon excludes a hole by a line to
    the hole and back.
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


def _loops(region: Bools) -> list[Loop]:
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


def _edges(region: Bools) -> dict[tuple[int, int], list[tuple[int, int]]]:
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


# Oriented 3-D boxes of instances: around the whole surface, and around its visible points.


_ABOUT_3D = (
    "Oriented boxes of the instances that at least one pixel shows. Their axes are those of the "
    "instance's own frame: of its node, z up where that is not turned; not the tightest ones. "
    "full: of the whole surface, hidden or not; visible: of the points that the pixels' rays hit, "
    "along the same axes. world: x and y on the ground, z up; camera: the optical frame, x right, "
    "y down, z forward. quaternion_xyzw turns the box's axes into those of the frame; size_m is "
    "along the box's axes, edge to edge."
)


@dataclass(frozen=True, eq=False)
class OrientedBox:
    """Oriented bounding box in a reference frame.

    Attributes:
        center_m: (3,) center in the reference frame.
        rotation: (3, 3) frame_from_box; the columns are the box's axes.
        size_m: (3,) edge lengths along the box's axes.
    """

    center_m: Floats
    rotation: Floats
    size_m: Floats

    @classmethod
    def of_points(cls, points_m: NDArray[np.floating[Any]], rotation: Floats) -> OrientedBox:
        """Bounding box of at least one point (n, 3), along the axes of a rotation (3, 3)."""
        along = points_m @ rotation
        low, high = along.min(axis=0), along.max(axis=0)
        return cls(rotation @ (0.5 * (low + high)), rotation, high - low)

    def __repr__(self) -> str:
        size = " × ".join(f"{edge_m:.4g}" for edge_m in self.size_m)
        return short_repr(self, f"{size} m", f"at {point_text(self.center_m, 4)} m")

    def transformed(self, pose: Floats) -> OrientedBox:
        """Box in another frame, given the pose (4, 4) other_from_frame."""
        rotation = pose[:3, :3]
        center_m = rotation @ self.center_m + pose[:3, 3]
        return OrientedBox(center_m, rotation @ self.rotation, self.size_m)

    def within(self, outer: OrientedBox) -> OrientedBox:
        """Intersection with another box that has the same axes."""
        offset_m = (self.center_m - outer.center_m) @ self.rotation
        half_m = 0.5 * outer.size_m
        low = np.clip(offset_m - 0.5 * self.size_m, -half_m, half_m)
        high = np.clip(offset_m + 0.5 * self.size_m, -half_m, half_m)
        center_m = outer.center_m + self.rotation @ (0.5 * (low + high))
        return OrientedBox(center_m, self.rotation, high - low)

    @property
    def corners_m(self) -> Floats:
        """Corners (8, 3); corners i and j share an edge if i ^ j is 1, 2 or 4."""
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        return self.center_m + (signs * self.size_m) @ self.rotation.T


@dataclass(frozen=True, eq=False)
class InstanceBox:
    """Boxes of an instance in an image, world frame.

    Attributes:
        label, pixels: label of the instance, and number of pixels that show it.
        full, visible: boxes of its whole surface, and of the points hit by the pixels' rays, along
            the same axes.
    """

    label: InstanceLabel
    pixels: int
    full: OrientedBox
    visible: OrientedBox

    def __repr__(self) -> str:
        return short_repr(self, repr(self.label.name), repr(self.full))


def visible_boxes(
    positions_m: NDArray[np.floating[Any]],
    instances: NDArray[np.integer[Any]],
    labels: Labels,
    full: Mapping[int, OrientedBox],
) -> tuple[InstanceBox, ...]:
    """Boxes of the instances in an image, in order of ID, given the whole instances' by ID.

    Channels are `position` (height, width, 3) and `instance` (height, width); boxes are in the
    world.
    """
    ids = instances.ravel()
    order = np.argsort(ids, kind="stable")
    present, starts = np.unique(ids[order], return_index=True)
    points_m = positions_m.reshape(-1, 3)
    boxes = []
    for number, rows in zip(present.tolist(), np.split(order, starts[1:]), strict=True):
        if number == 0:
            continue
        # a ray that narrowly misses an edge may count as a hit just outside the box
        visible = OrientedBox.of_points(points_m[rows], full[number].rotation)
        label = labels.instances[number - 1]
        boxes.append(InstanceBox(label, len(rows), full[number], visible.within(full[number])))
    return tuple(boxes)


def boxes_json(
    boxes: Sequence[InstanceBox], labels: Labels, file_name: str, metadata: Mapping[str, Any]
) -> dict[str, Any]:
    """JSON content with the boxes (world frame) of one image in the world and camera frames.

    The metadata have the camera's pose.
    """
    world_from_optical = np.array(metadata["world_from_optical"])
    names = {label.id: label.name for label in labels.classes}
    frames = {"world": np.eye(4), "camera": inverse(world_from_optical)}
    return {
        "info": {"description": _ABOUT_3D, "contributor": f"omnisim {__version__}"},
        "file_name": file_name,
        "world_from_optical": world_from_optical.tolist(),
        "boxes": [
            {"instance_id": box.label.id, "instance_name": box.label.name,
             "category_id": box.label.class_id, "category_name": names[box.label.class_id],
             "pixels": box.pixels, "full": _in_frames(box.full, frames),
             "visible": _in_frames(box.visible, frames)}
            for box in boxes
        ],
    }  # fmt: skip


def _in_frames(box: OrientedBox, frames: Mapping[str, Floats]) -> dict[str, Any]:
    content: dict[str, Any] = {"size_m": box.size_m.tolist()}
    for name, pose in frames.items():
        transformed = box.transformed(pose)
        content[name] = {
            "center_m": transformed.center_m.tolist(),
            "quaternion_xyzw": quaternion_from_rotation(transformed.rotation[None])[0].tolist(),
        }
    return content
