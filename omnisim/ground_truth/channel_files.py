"""Sidecar files of an 8-bit image: one file per channel in standard formats, and descriptions.

A file that cannot be written, or is damaged, raises `OutputError`.

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
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Collection, Mapping
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats32
from omnisim.core.errors import OmnisimError, OutputError
from omnisim.core.files.atomic_file import atomic_write
from omnisim.core.files.image_files import (
    is_float_format,
    read_channels,
    read_image,
    write_channels,
    write_image,
    write_numbers,
)
from omnisim.core.srgb import linear_from_srgb8, srgb8_from_linear
from omnisim.ground_truth.boxes import VISIBLE_SHARE, BoxLimits, coco_image, write_json
from omnisim.ground_truth.channels import CHANNELS, CLASSES, FLOWS, RANGES
from omnisim.ground_truth.label_names import Labels
from omnisim.ground_truth.previews import preview

BOXES_3D, OVERLAY = "boxes_3d.json", "overlay.png"
_SIDECARS = ("channels.json", "coco.json", BOXES_3D, OVERLAY)  # beside the channels' own files
_MAX_ID = 2**16 - 1
FINEST_RANGE_STEPS_PER_M = 1000
_NOTHING_HIT = _MAX_ID
_IN_STEPS = "in steps, at least 1; the scale is this image's own"


class ChannelFormat(StrEnum):
    """File formats of an image's channels."""

    AUTO = "auto"  # EXR: layers; other image formats: PNG, EXR and FLO files
    NPY = "npy"
    BOTH = "both"

    @classmethod
    def parse(cls, text: str | None) -> ChannelFormat:
        """Format by name; None: `AUTO`.

        Raises:
            OutputError: an unknown name.
        """
        try:
            return cls.AUTO if text is None else cls(text.strip().lower())
        except ValueError:
            names = ", ".join(cls)
            raise OutputError(f"channel format: expected one of {names}, got {text!r}") from None


def write_sidecars(
    image: Path,
    channels: Mapping[str, NDArray[Any]],
    labels: Labels | None,
    metadata: Mapping[str, Any],
    has_ray: Bools,
    channel_format: ChannelFormat = ChannelFormat.AUTO,
) -> None:
    """Write the files of the channels next to the image, and a JSON file that describes them.

    `has_ray` (height, width) is false outside the lens or the mirror. Layers of an EXR are not
    written.

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
                "file": path.name, "dtype": values.dtype.name, "shape": values.shape,
                "about": channel.about,
            }  # fmt: skip
    content = dict(metadata) | {"channels": described}
    if labels is not None:
        content["labels"] = labels.to_json()
    write_json(sidecar_path(image, "channels.json"), content)


def write_boxes(image: Path, channels: Mapping[str, NDArray[Any]], labels: Labels | None) -> None:
    """Write the instances' boxes next to the image, given labels and an instance channel."""
    if labels is not None and "instance" in channels:
        content = coco_image(channels["instance"], labels, image.name)
        write_json(sidecar_path(image, "coco.json"), content)


def limit_boxes(image: Path, limits: BoxLimits, shares: Mapping[int, float]) -> None:
    """Add visible shares (by ID; empty: unknown) to the boxes next to an image, and apply limits.

    Raises:
        KeyError: the limits require a visible share that is unknown.
        OutputError: the file cannot be written.
    """
    path = sidecar_path(image, "coco.json")
    content = json.loads(path.read_text(encoding="utf-8"))
    for annotation in content["annotations"]:
        if annotation["instance_id"] in shares:
            annotation[VISIBLE_SHARE] = round(shares[annotation["instance_id"]], 4)
    kept = [annotation for annotation in content["annotations"] if limits.keeps(annotation)]
    numbered = [annotation | {"id": number} for number, annotation in enumerate(kept, start=1)]
    write_json(path, content | {"annotations": numbered})


def write_previews(
    image: Path, channels: Mapping[str, NDArray[Any]], labels: Labels | None
) -> list[Path]:
    """Write false-color images of the channels next to the image, and return their paths."""
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
    image: Path, name: str, ranges_m: NDArray[Any], has_ray: Bools
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
    image: Path, name: str, values: NDArray[Any], labels: Labels | None, metadata: Mapping[str, Any]
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
        if values.max(initial=0) > _MAX_ID:
            message = f"{values.max()} instances: 16 bits hold {_MAX_ID}: expected .exr"
            raise OutputError(f"{path}: {message}")
        # by the scene's labels, not by this image's: all images of a scene get the same bit depth
        few = name in CLASSES and labels is not None and labels.classes[-1].id < 256
        write_numbers(path, values.astype(np.uint8 if few else np.uint16))
    return [path.name], scale


# All channels in one EXR file, together with the image's colors if there are any.


def write_exr(
    path: Path,
    channels: Mapping[str, NDArray[Any]],
    labels: Labels | None,
    metadata: Mapping[str, Any],
    linear: NDArray[Any] | None = None,
) -> None:
    """Write channels under the names of `Channel.layers`, and optional colors as R, G, B, A.

    All layers are 32-bit floats, which are exact for integers up to 2^24. Positions are relative to
    the world's origin, so float32 rounds distant ones: to 0.1 mm at 1 km. The attributes
    `omnisim:<channel>` describe the channels; the label table is in the metadata. Linear colors are
    (height, width, 3 or 4).
    """
    layers: dict[str, NDArray[Any]] = {}
    if linear is not None:
        layers |= {name: linear[..., index] for index, name in enumerate("RGBA"[: linear.shape[2]])}
    attributes = {}
    for name, values in channels.items():
        channel = CHANNELS[name]
        planes = values.reshape(*values.shape[:2], -1)
        layers |= {layer: planes[..., index] for index, layer in enumerate(channel.layers)}
        unit = f"{channel.unit}; " if channel.unit else ""
        attributes[f"omnisim:{name}"] = f"{', '.join(channel.layers)}: {unit}{channel.about}"
    if labels is not None and channels.keys() & {*CLASSES, "instance"}:
        metadata = {**metadata, "labels": labels.to_json()}
    write_channels(path, layers, metadata, attributes)


# Channels as NumPy .npy files.


def write_npy(path: Path, values: NDArray[Any]) -> None:
    """Write an array unchanged, including its dtype."""
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.save(file, values, allow_pickle=False)


def read_npy(path: Path) -> NDArray[Any]:
    """Read a numeric array."""
    try:
        # memory-mapped, so that a damaged header cannot request more memory than the file has
        with warnings.catch_warnings(action="ignore"):  # about headers from Python 2
            values = np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except OSError as reason:
        raise OutputError(f"{path}: cannot be read: {reason.strerror or 'damaged'}") from None
    except (ValueError, TypeError, EOFError, ArithmeticError, SyntaxError, TokenError):
        raise OutputError(f"{path}: expected an array of numbers, as NumPy writes it") from None
    if values.dtype.kind not in "fiub":
        raise OutputError(f"{path}: expected an array of numbers, got {values.dtype}")
    return values


# Optical flow in two common formats: Middlebury's .flo and KITTI's PNG.


_FLO_MAGIC = np.float32(202021.25)  # "PIEH"
_FLO_UNKNOWN, _FLO_LARGEST = np.float32(1e10), 1e9
KITTI_STEPS_PER_PX, _KITTI_ZERO = 64.0, 2**15


def write_flo(path: Path, flow_px: Floats32) -> None:
    """Write flow (height, width, 2) in Middlebury's format, with 1e10 in place of NaN.

    Source: Baker et al., "A database and evaluation methodology for optical flow", flow-code.
    """
    height, width = flow_px.shape[:2]
    known = np.where(np.isnan(flow_px), _FLO_UNKNOWN, flow_px).astype("<f4")
    with atomic_write(path) as partial:
        partial.write_bytes(
            _FLO_MAGIC.astype("<f4").tobytes()
            + np.array([width, height], dtype="<i4").tobytes()
            + known.tobytes()
        )


def read_flo(path: Path) -> Floats32:
    """Read flow (height, width, 2) from Middlebury's format, with NaN for unknown flow."""
    try:
        data = path.read_bytes()
    except OSError as reason:
        raise OutputError(f"{path}: cannot be read: {reason.strerror}") from None
    width, height = np.frombuffer(data[4:12], "<i4").tolist() if len(data) >= 12 else (0, 0)
    is_flo = data[:4] == _FLO_MAGIC.astype("<f4").tobytes() and min(width, height) > 0
    if not is_flo or len(data) != 12 + 8 * width * height:
        raise OutputError(f"{path}: expected optical flow in Middlebury's format")
    flow_px = np.frombuffer(data[12:], "<f4").reshape(height, width, 2).astype(np.float32)
    flow_px[flow_px > _FLO_LARGEST] = np.nan
    return flow_px


def write_kitti_flow(path: Path, flow_px: Floats32) -> None:
    """Write flow (height, width, 2) as 16-bit RGB: 64 u + 2^15, 64 v + 2^15, and 1 if valid.

    Flow that is NaN or beyond ±512 px is invalid: 0, 0, 0. Occluded points are included, as in
    KITTI's flow_occ.

    Source: KITTI, devkit of the flow benchmark 2015, readme.
    """
    known: Bools = np.all(~np.isnan(flow_px), axis=-1)
    steps = np.rint(KITTI_STEPS_PER_PX * np.where(known[..., None], flow_px, 0.0)) + _KITTI_ZERO
    known &= np.all((steps >= 0) & (steps < 2**16), axis=-1)
    pixels = np.zeros((*known.shape, 3), dtype=np.uint16)
    pixels[known, :2] = steps[known]
    pixels[known, 2] = 1
    write_numbers(path, pixels)


# Channels read from the files of an image: EXR layers, arrays and sidecar files.


# Metadata that all files of one image share.
_IDENTITY = ("scene", "camera", "world_from_base", "world_from_optical")


class StoredChannels:
    """Channels next to an image or inside it, as written by `Frame.save` or a drive.

    Arrays and EXR files are exact; PNG files are quantized to the steps stated in their
    description.

    Args:
        image: path of the image.
        metadata: metadata of the image; files of another image are rejected.

    Attributes:
        names: names of the available channels, in the order of `CHANNELS`.

    Raises:
        OutputError: an unreadable file, or a file of another image.
    """

    def __init__(self, image: Path, metadata: Mapping[str, Any]):
        self._image = image
        self._layers: dict[str, Floats32] = {}
        self._described: dict[str, dict[str, Any]] = {}
        self._tables: list[Any] = []
        step = sidecar_path(image, "channels.exr")  # file name in a drive
        for path in (image if is_float_format(image) else step,):
            if path.is_file() and path.suffix.lower() == ".exr":
                stored = read_channels(path)
                _check_identity(path, stored.metadata or {}, metadata)
                self._layers = stored.values
                self._tables.append((stored.metadata or {}).get("labels"))
        description = sidecar_path(image, "channels.json")
        if description.is_file():
            content = _read_json(description)
            _check_identity(description, content, metadata)
            channels = content.get("channels")
            if not isinstance(channels, dict):
                raise OutputError(f"{description}: channels: expected a table of channels")
            self._described = {
                name: described
                for name, described in channels.items()
                if name in CHANNELS
                and isinstance(described, dict)
                # a layer of the image file itself is never older than the image
                and not (is_float_format(image) and CHANNELS[name].layers[0] in self._layers)
            }
            self._tables.append(content.get("labels"))
        self.names = tuple(
            name
            for name, channel in CHANNELS.items()
            if channel.layers[0] in self._layers or name in self._described
        )

    @cached_property
    def labels(self) -> Labels | None:
        """Labels of the class and instance IDs; None: unknown.

        Raises:
            OutputError: a damaged table.
        """
        tables = [table for table in self._tables if table]
        run = self._image.parent.parent
        if not tables and (run / "manifest.json").is_file() and (run / "labels.json").is_file():
            tables.append(_read_json(run / "labels.json"))
        try:
            return Labels.from_json(tables[0]) if tables else None
        except (KeyError, TypeError, ValueError):
            raise OutputError(f"{self._image}: its table of labels is damaged") from None

    def read(self, names: Collection[str]) -> dict[str, NDArray[Any]]:
        """Read channels by name.

        Raises:
            OutputError: a missing channel, naming the available ones, or a damaged file.
        """
        for name in names:
            if name not in self.names:
                available = ", ".join(self.names) or "none"
                raise OutputError(f"{self._image}: no channel {name!r}; it has {available}")
        return {name: self._read(name) for name in names}

    def _read(self, name: str) -> NDArray[Any]:
        described = self._described.get(name, {})
        try:
            if "npy" in described:
                path = self._beside(described["npy"]["file"])
                values = read_npy(path)
            elif CHANNELS[name].layers[0] in self._layers:
                values = _from_layers(name, self._layers)
            else:
                path = self._beside(described["files"][0])
                values = _decode(path, name, described)
        except OmnisimError:
            raise
        except (OSError, ValueError, LookupError, TypeError, ArithmeticError):
            raise OutputError(
                f"{self._image}: channel {name!r}: its file is missing or damaged"
            ) from None
        dtype = np.dtype(CHANNELS[name].dtype)
        if dtype.kind == "u" and not np.all((values >= 0) & (values <= np.iinfo(dtype).max)):
            raise OutputError(f"{self._image}: channel {name!r}: expected {dtype}")
        return values.astype(dtype, copy=False)

    def _beside(self, name: object) -> Path:
        """Path of a file next to the image; raises a ValueError for an invalid file name."""
        if not isinstance(name, str) or not name.isprintable():
            raise ValueError(name)
        return self._image.with_name(name)


def _from_layers(name: str, layers: Mapping[str, Floats32]) -> NDArray[Any]:
    planes = [layers[layer] for layer in CHANNELS[name].layers]
    return planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)


def _decode(path: Path, name: str, described: Mapping[str, Any]) -> NDArray[Any]:
    """Values of a sidecar file, decoded with the scales of its description."""
    if path.suffix == ".exr":
        return _from_layers(name, read_channels(path).values)
    if name in FLOWS:
        return read_flo(path)
    stored = read_image(path)[0]
    if name == "albedo":
        return linear_from_srgb8(stored)
    if name in ("normals", "normals_camera"):
        normals = (stored.astype(np.float64) - described["zero"]) / described["steps_per_unit"]
        return np.where(stored.any(axis=-1, keepdims=True), normals, 0.0)
    numbers = stored[..., 0]
    values: NDArray[Any] = numbers // described.get("true", 1)
    if name in ("roughness", "metallic"):
        shares = (numbers.astype(np.float64) - described["zero"]) / described["steps_per_unit"]
        values = np.where(numbers > 0, shares, np.nan)
    if name in RANGES:
        is_hit = (numbers != described["outside"]) & (numbers != described["nothing_hit"])
        values = np.where(is_hit, numbers / described["steps_per_m"], np.inf)
    return values


def _check_identity(path: Path, stored: Mapping[str, Any], metadata: Mapping[str, Any]) -> None:
    for key in _IDENTITY:
        if key in metadata and stored.get(key) != metadata[key]:
            raise OutputError(
                f"{path}: {key}: differs from the image's: these are channels of another image"
            )


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise OutputError(f"{path}: cannot be read: expected JSON, as omnisim writes it") from None
    if not isinstance(content, dict):
        raise OutputError(f"{path}: expected JSON, as omnisim writes it, got another kind")
    return content
