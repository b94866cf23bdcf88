"""Channels read from the files of an image: EXR layers, arrays and sidecar files."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats32
from omnisim.core.errors import OmnisimError, OutputError
from omnisim.core.files.image_files import is_float_format, read_channels, read_image
from omnisim.core.srgb import linear_from_srgb8
from omnisim.ground_truth.channel_files import read_flo, read_npy, sidecar_path
from omnisim.ground_truth.channels import CHANNELS, FLOWS, RANGES
from omnisim.ground_truth.label_names import Labels

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
                if name in CHANNELS and not self._is_inside(name) and isinstance(described, dict)
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

    def _is_inside(self, name: str) -> bool:
        """True for a layer of the image file itself, which is never older than the image."""
        return is_float_format(self._image) and CHANNELS[name].layers[0] in self._layers

    def read(self, names: Collection[str]) -> dict[str, NDArray[Any]]:
        """Read channels by name.

        Raises:
            OutputError: a missing channel, naming the available ones, or a damaged file.
        """
        for name in names:
            if name not in self.names:
                available = ", ".join(self.names) or "none"
                raise OutputError(f"{self._image}: channel {name!r}: not there; it has {available}")
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
