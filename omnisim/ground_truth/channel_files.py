"""Sidecar files of an 8-bit image: one file per channel in standard formats, and descriptions.

    frame.range.png             16 bits: 0 outside the camera, 65535: no hit; a step is 1 mm, or
                                2, 5, 10 mm … for ranges beyond 65.534 m, as stated in the JSON
    frame.range_through.png     as frame.range.png, with its own scale
    frame.z.exr, frame.position.exr            as in the EXR of all channels
    frame.scene_flow.exr, frame.scene_flow_camera.exr    as in the EXR of all channels
    frame.normals.png, frame.normals_camera.png    16 bits, 32768 + 32767 n; 0 0 0: no hit
    frame.albedo.png            8 bits, sRGB
    frame.roughness.png, frame.metallic.png    16 bits, 1 + 65534 x; 0: no hit
    frame.emissive.exr          as in the EXR of all channels
    frame.semantic.png          8 bits, or 16 if a class ID exceeds 255
    frame.semantic_through.png  as frame.semantic.png
    frame.instance.png          16 bits
    frame.flow.flo, frame.flow.png             formats of Middlebury and KITTI
    frame.occluded.png          8 bits: 0 visible, 1 occluded, 2 outside, 255 no ray
    frame.flow_backward.flo, frame.flow_backward.png, frame.occluded_backward.png    as forward
    frame.valid.png             8 bits: 0 or 255
    frame.range.npy ...         any channel as an array, in the format npy, see `CHANNELS`
    frame.channels.json         units, scales, labels, camera and pose
    frame.coco.json             boxes and masks of the instances, with the channel instance
    frame.boxes_3d.json         oriented 3-D boxes of the instances
    frame.overlay.png           the image with boxes or masks, to look at
"""  # fmt: skip

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OutputError
from omnisim.core.files.image_files import is_float_format, write_image, write_numbers
from omnisim.core.srgb import srgb8_from_linear
from omnisim.ground_truth.channels import CHANNELS, CLASSES, FLOWS, RANGES
from omnisim.ground_truth.coco import VISIBLE_SHARE, BoxLimits, coco_image, write_json
from omnisim.ground_truth.exr import write_exr
from omnisim.ground_truth.flow_files import KITTI_STEPS_PER_PX, write_flo, write_kitti_flow
from omnisim.ground_truth.label_names import Labels
from omnisim.ground_truth.npy import ChannelFormat, write_npy
from omnisim.ground_truth.previews import preview

BOXES_3D, OVERLAY = "boxes_3d.json", "overlay.png"
_SIDECARS = (
    "channels.json",
    "coco.json",
    BOXES_3D,
    OVERLAY,
)  # in addition to the channels' own files
_MAX_ID = 2**16 - 1
FINEST_RANGE_STEPS_PER_M = 1000
_NOTHING_HIT = _MAX_ID
_IN_STEPS = "in steps, at least 1; the scale is this image's own"


def write_sidecars(
    image: Path,
    channels: Mapping[str, NDArray[Any]],
    labels: Labels | None,
    metadata: Mapping[str, Any],
    has_ray: NDArray[np.bool_],
    channel_format: ChannelFormat = ChannelFormat.AUTO,
) -> None:
    """Write the files of the channels next to the image, and a JSON file that describes them.

    Args:
        image: path of the image.
        channels: channels by name.
        labels: labels of the class and instance IDs; None: no labels.
        metadata: metadata of the image.
        has_ray: (height, width) mask, false outside the lens or the mirror.
        channel_format: format of the channel files; layers of an EXR are not written here.

    Raises:
        OutputError: a file cannot be written, or values exceed 16 bits.
    """
    described: dict[str, Any] = {}
    for name, values in channels.items():
        channel = CHANNELS[name]
        described[name] = {"unit": channel.unit, "about": channel.about}
        if channel_format is not ChannelFormat.NPY and not is_float_format(image):
            if name in RANGES:
                files, scale = _write_ranges(image, name, values, has_ray)
            else:
                files, scale = _write(image, name, values, labels, metadata)
            described[name] = {"files": files} | described[name] | scale
        if channel_format is not ChannelFormat.AUTO:
            path = sidecar_path(image, f"{name}.npy")
            write_npy(path, values)
            described[name]["npy"] = {
                "file": path.name,
                "dtype": values.dtype.name,
                "shape": values.shape,
                "about": channel.about,
            }
    content = dict(metadata) | {"channels": described}
    if labels is not None:
        content["labels"] = labels.to_json()
    write_json(sidecar_path(image, "channels.json"), content)


def write_boxes(image: Path, channels: Mapping[str, NDArray[Any]], labels: Labels | None) -> None:
    """Write the instances' boxes next to the image, given labels and an instance channel.

    Raises:
        OutputError: the file cannot be written.
    """
    if labels is not None and "instance" in channels:
        content = coco_image(channels["instance"], labels, image.name)
        write_json(sidecar_path(image, "coco.json"), content)


def limit_boxes(image: Path, limits: BoxLimits, shares: Mapping[int, float]) -> None:
    """Add visible shares to the boxes next to an image, and remove boxes beyond the limits.

    Args:
        image: path of the image.
        limits: limits for the boxes to keep.
        shares: visible shares of the instances by ID; empty: unknown.

    Raises:
        KeyError: the limits require a visible share that is unknown.
        OutputError: the file cannot be written.
    """
    path = sidecar_path(image, "coco.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    for one in content["annotations"]:
        if one["instance_id"] in shares:
            one[VISIBLE_SHARE] = round(shares[one["instance_id"]], 4)
    kept = [one for one in content["annotations"] if limits.keeps(one)]
    numbered = [one | {"id": number} for number, one in enumerate(kept, start=1)]
    write_json(path, content | {"annotations": numbered})


def write_previews(
    image: Path, channels: Mapping[str, NDArray[Any]], labels: Labels | None
) -> list[Path]:
    """Write false-color images of the channels next to the image, and return their paths.

    Raises:
        OutputError: a file cannot be written.
    """
    files = []
    for name, values in channels.items():
        files.append(sidecar_path(image, f"{name}.preview.png"))
        write_image(files[-1], preview(name, values, labels))
    return files


def sidecar_path(image: Path, ending: str) -> Path:
    """Path of a sidecar file: `frame.png` and `range.png` yield `frame.range.png`."""
    return image.with_name(f"{image.stem}.{ending}")


def is_sidecar_name(image: Path, path: Path) -> bool:
    """True if a path is in the image's folder, and named like one of the image's sidecar files."""
    if path.resolve().parent != image.resolve().parent:
        return False
    stem, _, ending = path.name.partition(f"{image.stem}.")
    is_ours = ending in _SIDECARS or ending.partition(".")[0] in CHANNELS
    return not stem and is_ours


def range_steps_per_m(ranges_m: NDArray[Any]) -> float:
    """Finest scale among 1000, 500, 200, 100, 50 … at which all finite ranges fit in 16 bits."""
    farthest_m = float(np.max(ranges_m, where=np.isfinite(ranges_m), initial=0.0))
    decade = 1
    while True:
        for divisor in (1, 2, 5):
            steps_per_m = FINEST_RANGE_STEPS_PER_M / (divisor * decade)
            if np.rint(steps_per_m * farthest_m) < _NOTHING_HIT:
                return steps_per_m
        decade *= 10


def _write_ranges(
    image: Path, name: str, ranges_m: NDArray[Any], has_ray: NDArray[np.bool_]
) -> tuple[list[str], dict[str, Any]]:
    """Write ranges as a PNG; return its file name, and the scale and meaning of its values."""
    steps_per_m = range_steps_per_m(ranges_m)
    hit = np.isfinite(ranges_m)
    steps = np.rint(steps_per_m * np.where(hit, ranges_m, 0.0))
    # 0 means outside the camera, so a hit is at least one step away
    steps = np.where(hit, np.maximum(steps, 1), np.where(has_ray, _NOTHING_HIT, 0))
    path = sidecar_path(image, f"{name}.png")
    described = {
        "about": f"{CHANNELS[name].about.partition(';')[0]}, {_IN_STEPS}",
        "steps_per_m": int(steps_per_m) if steps_per_m.is_integer() else steps_per_m,
        "nothing_hit": _NOTHING_HIT,
        "outside": 0,
    }
    write_numbers(path, steps.astype(np.uint16), {"channel": name, "unit": "m", **described})
    return [path.name], described


def _normal_steps(normals: NDArray[Any]) -> NDArray[np.uint16]:
    steps = np.rint(32767.0 * normals + 32768.0)
    return np.where(np.any(normals != 0, axis=-1, keepdims=True), steps, 0).astype(np.uint16)


def _share_steps(shares: NDArray[Any]) -> NDArray[np.uint16]:
    steps = np.rint(1.0 + (_MAX_ID - 1) * np.clip(shares, 0.0, 1.0))
    return np.where(np.isnan(shares), 0.0, steps).astype(np.uint16)


# Encodings of channels as PNG values, and the scales stated in the description.
_SHARE_SCALE = {"zero": 1, "steps_per_unit": _MAX_ID - 1}
_NORMAL_SCALE = {"zero": 32768, "steps_per_unit": 32767}
_NUMBERS: dict[str, tuple[Callable[[NDArray[Any]], NDArray[Any]], dict[str, int]]] = {
    "normals": (_normal_steps, _NORMAL_SCALE),
    "normals_camera": (_normal_steps, _NORMAL_SCALE),
    "roughness": (_share_steps, _SHARE_SCALE),
    "metallic": (_share_steps, _SHARE_SCALE),
    "valid": (lambda valid: (255 * valid).astype(np.uint8), {"true": 255}),
    "occluded": (lambda occluded: occluded, {}),
    "occluded_backward": (lambda occluded: occluded, {}),
}


def _write(
    image: Path,
    name: str,
    values: NDArray[Any],
    labels: Labels | None,
    metadata: Mapping[str, Any],
) -> tuple[list[str], dict[str, Any]]:
    """Write one channel; return its file names, and the scale of the stored values."""
    path = sidecar_path(image, f"{name}.png")
    scale: dict[str, int] = {}
    if name in _NUMBERS:
        encode, scale = _NUMBERS[name]
        write_numbers(path, encode(values))
    elif name == "albedo":
        write_image(path, srgb8_from_linear(values))
    elif name in FLOWS:
        flo = path.with_suffix(".flo")
        write_flo(flo, values)
        write_kitti_flow(path, values)
        return [flo.name, path.name], {"kitti_steps_per_px": KITTI_STEPS_PER_PX}
    elif values.dtype.kind == "f":
        path = path.with_suffix(".exr")
        write_exr(path, {name: values}, labels, metadata)
    else:
        write_numbers(path, _ids(path, name, values, labels))
    return [path.name], scale


def _ids(
    path: Path, name: str, ids: NDArray[np.integer[Any]], labels: Labels | None
) -> NDArray[np.uint8 | np.uint16]:
    if ids.max(initial=0) > _MAX_ID:
        raise OutputError(f"{path}: {ids.max()} instances: 16 bits hold {_MAX_ID}: expected .exr")
    # by the scene's labels, not by this image's: all images of a scene get the same bit depth
    few = name in CLASSES and labels is not None and labels.classes[-1].id < 256
    return ids.astype(np.uint8 if few else np.uint16)
