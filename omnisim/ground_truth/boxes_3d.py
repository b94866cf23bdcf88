"""Oriented 3-D boxes of instances: around the whole surface, and around its visible points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import inverse, quaternion_from_rotation
from omnisim.core.short_repr import point_text, short_repr
from omnisim.core.version import __version__
from omnisim.ground_truth.label_names import InstanceLabel, Labels

_ABOUT = (
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

    center_m: NDArray[np.float64]
    rotation: NDArray[np.float64]
    size_m: NDArray[np.float64]

    @classmethod
    def of_points(
        cls, points_m: NDArray[np.floating[Any]], rotation: NDArray[np.float64]
    ) -> OrientedBox:
        """Bounding box of at least one point (n, 3), along the axes of a rotation (3, 3)."""
        along = points_m @ rotation
        low, high = along.min(axis=0), along.max(axis=0)
        return cls(rotation @ (0.5 * (low + high)), rotation, high - low)

    def __repr__(self) -> str:
        size = " × ".join(f"{one:.4g}" for one in self.size_m)
        return short_repr(self, f"{size} m", f"at {point_text(self.center_m, 4)} m")

    def transformed(self, pose: NDArray[np.float64]) -> OrientedBox:
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
    def corners_m(self) -> NDArray[np.float64]:
        """Corners (8, 3); corners i and j share an edge if i ^ j is 1, 2 or 4."""
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        return self.center_m + (signs * self.size_m) @ self.rotation.T


@dataclass(frozen=True, eq=False)
class InstanceBox:
    """Boxes of an instance in an image, world frame.

    Attributes:
        label: label of the instance.
        pixels: number of pixels that show the instance.
        full: box of its whole surface.
        visible: box of the points hit by the pixels' rays, along the same axes.
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
    """Boxes of the instances in an image, in order of ID.

    Args:
        positions_m: (height, width, 3) channel `position`.
        instances: (height, width) channel `instance`.
        labels: labels of the instances.
        full: boxes of the whole instances by ID, world frame.
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
    boxes: Sequence[InstanceBox],
    labels: Labels,
    file_name: str,
    metadata: Mapping[str, Any],
) -> dict[str, Any]:
    """JSON content with the boxes of one image in the world and camera frames.

    Args:
        boxes: boxes in the world frame.
        labels: labels with the class names.
        file_name: file name of the image.
        metadata: metadata of the image, with the camera's pose.
    """
    world_from_optical = np.array(metadata["world_from_optical"])
    names = {label.id: label.name for label in labels.classes}
    frames = {
        "world": np.eye(4),
        "camera": inverse(world_from_optical),
    }
    return {
        "info": {"description": _ABOUT, "contributor": f"omnisim {__version__}"},
        "file_name": file_name,
        "world_from_optical": world_from_optical.tolist(),
        "boxes": [
            {
                "instance_id": box.label.id,
                "instance_name": box.label.name,
                "category_id": box.label.class_id,
                "category_name": names[box.label.class_id],
                "pixels": box.pixels,
                "full": _in_frames(box.full, frames),
                "visible": _in_frames(box.visible, frames),
            }
            for box in boxes
        ],
    }


def _in_frames(box: OrientedBox, frames: Mapping[str, NDArray[np.float64]]) -> dict[str, Any]:
    content: dict[str, Any] = {"size_m": box.size_m.tolist()}
    for name, pose in frames.items():
        transformed = box.transformed(pose)
        content[name] = {
            "center_m": transformed.center_m.tolist(),
            "quaternion_xyzw": quaternion_from_rotation(transformed.rotation[None])[0].tolist(),
        }
    return content
