"""Ground truth in the folder of a run: files of each step, and of the whole run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from omnisim.errors import RunError
from omnisim.frame import Frame
from omnisim.ground_truth import Labels
from omnisim.ground_truth.coco import coco_image, merged, write_json
from omnisim.ground_truth.exr import write_exr
from omnisim.ground_truth.files import write_sidecars
from omnisim.ground_truth.npy import ChannelFormat
from omnisim.simulation.run_folder import (
    BOXES,
    BOXES_SUFFIX,
    CHANNELS_SUFFIX,
    LABELS,
    RunFolder,
    is_written,
)


def write_step(run: RunFolder, camera: str, step: int, frame: Frame) -> None:
    """Write what is missing of a camera's channels at a step.

    Raises:
        OutputError: a file cannot be written.
    """
    picture, files = run.file(camera, step, ".png"), run.manifest.channel_format
    target = run.file(camera, step, CHANNELS_SUFFIX)
    if frame.channels and files is not ChannelFormat.NPY and not is_written(target):
        write_exr(target, frame.channels, None, frame.metadata)
    if frame.channels and files is not ChannelFormat.AUTO:
        has_ray = frame.valid if frame.has_ray is None else frame.has_ray
        write_sidecars(picture, frame.channels, None, frame.metadata, has_ray, ChannelFormat.NPY)
    target = run.file(camera, step, BOXES_SUFFIX)
    instances, labels = frame.channels.get("instance"), frame.labels
    if instances is not None and labels is not None and not is_written(target):
        write_json(target, coco_image(instances, labels, picture.name, step))


def write_labels(run: RunFolder, labels: Labels) -> None:
    """Write the table of class and instance IDs, where the run has them.

    Raises:
        OutputError: it cannot be written.
    """
    if {"semantic", "instance"} & set(run.manifest.channels) and not run.has(LABELS):
        write_json(run.path / LABELS, labels.to_json())


def write_boxes(run: RunFolder, labels: Labels) -> None:
    """Merge the boxes of all steps of each camera into one file, where the run has them.

    Raises:
        RunError: boxes of a step are damaged.
        OutputError: it cannot be written.
    """
    if "instance" not in run.manifest.channels:
        return
    for camera in run.manifest.cameras:
        if not run.has(f"{camera}/{BOXES}"):
            steps = range(run.manifest.steps)
            parts = [_read(run.file(camera, step, BOXES_SUFFIX)) for step in steps]
            write_json(run.path / camera / BOXES, merged(parts, labels))


def _read(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return content
    except (OSError, ValueError):
        raise RunError(f"{path}: cannot be read: remove it, and drive again") from None
