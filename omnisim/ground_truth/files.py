"""Channels beside a picture of 8 bits: a file each, in the formats that people use.

    frame.range.png             16 bits, millimetres; 0: nothing is hit, 65535: beyond 65.534 m
    frame.z.exr, frame.position.exr            as in the EXR of all channels
    frame.normals.png, frame.normals_camera.png    16 bits, 32768 + 32767 n; 0 0 0: nothing is hit
    frame.albedo.png            8 bits, sRGB
    frame.semantic.png          8 bits, or 16 where a class has a number above 255
    frame.instance.png          16 bits
    frame.flow.flo, frame.flow.png             Middlebury's and KITTI's format
    frame.occluded.png          8 bits: 0 visible, 1 hidden, 2 outside, 255 nothing is seen
    frame.valid.png             8 bits: 0 or 255
    frame.channels.json         units, scales, names and colours of the numbers, camera and pose
    frame.coco.json             boxes of the instances, with the channel instance
"""  # fmt: skip

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import OutputError
from omnisim.ground_truth.channels import CHANNELS
from omnisim.ground_truth.coco import coco_image, write_json
from omnisim.ground_truth.exr import write_exr
from omnisim.ground_truth.flow_files import KITTI_STEPS_PER_PX, write_flo, write_kitti_flow
from omnisim.ground_truth.labels import Labels
from omnisim.ground_truth.previews import preview
from omnisim.image_files import write_image, write_numbers
from omnisim.srgb import srgb8_from_linear

RANGE_STEPS_PER_M = 1000
_LARGEST = 2**16 - 1


def write_beside(
    picture: Path,
    channels: Mapping[str, NDArray[Any]],
    labels: Labels | None,
    metadata: Mapping[str, Any],
) -> None:
    """Write a file a channel beside the picture, and what their numbers mean.

    Raises:
        OutputError: a file cannot be written, or numbers that 16 bits do not hold.
    """
    told: dict[str, Any] = {}
    for name, values in channels.items():
        files, scale = _write(picture, name, values, labels, metadata)
        channel = CHANNELS[name]
        told[name] = {"files": files, "unit": channel.unit, "about": channel.about} | scale
    content = dict(metadata) | {"channels": told}
    if labels is not None:
        content["labels"] = labels.to_json()
    write_json(beside(picture, "channels.json"), content)


def write_boxes(picture: Path, channels: Mapping[str, NDArray[Any]], labels: Labels | None) -> None:
    """Write the instances' boxes beside the picture, where there is the channel instance.

    Raises:
        OutputError: the file cannot be written.
    """
    if labels is not None and "instance" in channels:
        content = coco_image(channels["instance"], labels, picture.name)
        write_json(beside(picture, "coco.json"), content)


def write_previews(
    picture: Path, channels: Mapping[str, NDArray[Any]], labels: Labels | None
) -> list[Path]:
    """Write each channel in colours beside the picture, `frame.range.preview.png`; the files.

    Raises:
        OutputError: a file cannot be written.
    """
    files = []
    for name, values in channels.items():
        files.append(beside(picture, f"{name}.preview.png"))
        write_image(files[-1], preview(name, values, labels))
    return files


def beside(picture: Path, ending: str) -> Path:
    """`frame.png` and `range.png` make `frame.range.png`."""
    return picture.with_name(f"{picture.stem}.{ending}")


def is_name_beside(picture: Path, path: Path) -> bool:
    """Whether the channels of a picture may write a file of this name."""
    if path.resolve().parent != picture.resolve().parent:
        return False
    stem, _, ending = path.name.partition(f"{picture.stem}.")
    is_ours = ending in ("channels.json", "coco.json") or ending.partition(".")[0] in CHANNELS
    return not stem and is_ours


def _write(
    picture: Path,
    name: str,
    values: NDArray[Any],
    labels: Labels | None,
    metadata: Mapping[str, Any],
) -> tuple[list[str], dict[str, Any]]:
    """Write one channel; its files' names, and the scale of their numbers."""
    path = beside(picture, f"{name}.png")
    if name == "range":
        write_numbers(path, _range_steps(values))
        return [path.name], {"steps_per_m": RANGE_STEPS_PER_M}
    if name in ("z", "position"):
        path = path.with_suffix(".exr")
        write_exr(path, {name: values}, labels, metadata)
        return [path.name], {}
    if name in ("normals", "normals_camera"):
        steps = np.rint(32767.0 * values + 32768.0)
        write_numbers(path, np.where(np.any(values != 0, axis=-1, keepdims=True), steps, 0)
                      .astype(np.uint16))  # fmt: skip
        return [path.name], {"zero": 32768, "steps_per_unit": 32767}
    if name == "albedo":
        write_image(path, srgb8_from_linear(values))
        return [path.name], {}
    if name == "flow":
        write_flo(path.with_suffix(".flo"), values)
        write_kitti_flow(path, values)
        return [path.with_suffix(".flo").name, path.name], {
            "kitti_steps_per_px": KITTI_STEPS_PER_PX
        }
    if name == "valid":
        write_numbers(path, (255 * values).astype(np.uint8))
        return [path.name], {"true": 255}
    if name == "occluded":
        write_numbers(path, values)
        return [path.name], {}
    write_numbers(path, _ids(path, name, values, labels))
    return [path.name], {}


def _range_steps(ranges_m: NDArray[np.float32]) -> NDArray[np.uint16]:
    seen = np.isfinite(ranges_m)
    steps = np.rint(RANGE_STEPS_PER_M * np.where(seen, ranges_m, 0.0))
    # 0 stands for nothing: what is hit is at least a step away
    return np.where(seen, np.clip(steps, 1, _LARGEST), 0).astype(np.uint16)


def _ids(
    path: Path, name: str, ids: NDArray[np.integer], labels: Labels | None
) -> NDArray[np.uint8 | np.uint16]:
    if ids.max(initial=0) > _LARGEST:
        raise OutputError(f"{path}: {ids.max()} instances: 16 bits hold {_LARGEST}: want .exr")
    # by what there is, not by what is seen: all pictures of a scene have the same depth
    few = name == "semantic" and labels is not None and labels.classes[-1].id < 256
    return ids.astype(np.uint8 if few else np.uint16)
