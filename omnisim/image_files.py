"""Pictures in and out (the only importer of OpenImageIO).

The camera's parameters and pose travel inside, as one JSON text in ImageDescription, which every
format here can hold.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from omnisim.atomic_file import atomic_write, check_target
from omnisim.errors import OutputError
from omnisim.version import __version__

EIGHT_BIT_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
FLOAT_SUFFIXES = (".exr",)
METADATA_KEY = "ImageDescription"
# On a mirror's picture JPEG artefacts at edges would be mistaken for the camera's: keep them low.
JPEG_QUALITY, _JPEG_SUBSAMPLING = 95, "4:4:4"
_PNG_LEVEL = 4  # half the time of the usual 6, for a file 4 % larger
_NO_DATE = ""  # OpenEXR's writer would put the time of day in: equal data are equal bytes
_LARGEST_EXACT = 1 << 24  # whole numbers that a float32 holds


def is_float_format(path: Path) -> bool:
    """Whether the format holds linear floats.

    Raises:
        OutputError: the suffix is of no format that omnisim writes.
    """
    suffix = path.suffix.lower()
    if suffix not in EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES:
        raise OutputError(
            f"{path}: unknown picture format {suffix or '(no suffix)'!r}: want one of "
            + " ".join(EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES)
        )
    return suffix in FLOAT_SUFFIXES


def write_image(
    path: Path,
    pixels: NDArray[Any],
    metadata: dict[str, Any] | None = None,
    jpeg_quality: int = JPEG_QUALITY,
) -> None:
    """Write a picture (height, width, 3 or 4): uint8 sRGB, or float32 linear for EXR.

    A fourth channel is alpha; JPEG, which has none, leaves it out. Equal pictures make equal bytes.

    Raises:
        OutputError: an unknown format, pixels that do not suit it, or a file that cannot be
            written; nothing is left under `path` then.
    """
    is_float = is_float_format(path)
    if pixels.dtype != (np.float32 if is_float else np.uint8):
        kind = "linear float32" if is_float else "uint8"
        raise OutputError(f"{path}: this format takes {kind} pixels, not {pixels.dtype}")
    check_target(path)
    if path.suffix.lower() in (".jpg", ".jpeg"):
        pixels = pixels[..., :3]
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.FLOAT if is_float else oiio.UINT8)
    spec["Software"] = f"omnisim {__version__}"
    spec["oiio:ColorSpace"] = "lin_rec709_scene" if is_float else "srgb_rec709_scene"
    spec["DateTime"] = _NO_DATE
    if metadata is not None:
        spec[METADATA_KEY] = json.dumps(metadata)
    spec["png:compressionLevel"] = _PNG_LEVEL
    if path.suffix.lower() in (".jpg", ".jpeg"):
        spec["Compression"] = f"jpeg:{jpeg_quality}"
        spec["jpeg:subsampling"] = _JPEG_SUBSAMPLING
    data = _encoded(path, spec, np.ascontiguousarray(pixels))
    with atomic_write(path) as partial:
        partial.write_bytes(data)


class Channels(NamedTuple):
    """What an EXR file of data holds.

    Attributes:
        values: (height, width) float32 under each channel's name.
        metadata: omnisim's own; None where the file has none.
        attributes: other attributes of the file that are words or numbers.
    """

    values: dict[str, NDArray[np.float32]]
    metadata: dict[str, Any] | None
    attributes: dict[str, str | int | float]


def write_numbers(
    path: Path, numbers: NDArray[np.uint8 | np.uint16], metadata: dict[str, Any] | None = None
) -> None:
    """Write whole numbers, not colours, (height, width) or (height, width, n) as a PNG file.

    Args:
        path: with the suffix .png.
        numbers: 8 or 16 bits each.
        metadata: omnisim's own, as `write_image` has it.

    Raises:
        OutputError: another suffix, or a file that cannot be written.
    """
    if path.suffix.lower() != ".png":
        raise OutputError(f"{path}: numbers are written as .png")
    check_target(path)
    height, width = numbers.shape[:2]
    kinds = {"uint8": oiio.UINT8, "uint16": oiio.UINT16}
    channels = 1 if numbers.ndim == 2 else numbers.shape[2]
    spec = oiio.ImageSpec(width, height, channels, kinds[numbers.dtype.name])
    spec["Software"] = f"omnisim {__version__}"
    if metadata is not None:
        spec[METADATA_KEY] = json.dumps(metadata)
    spec["png:compressionLevel"] = _PNG_LEVEL
    data = _encoded(path, spec, np.ascontiguousarray(numbers.reshape(height, width, channels)))
    with atomic_write(path) as partial:
        partial.write_bytes(data)


def write_channels(
    path: Path,
    channels: Mapping[str, NDArray[Any]],
    metadata: dict[str, Any] | None = None,
    attributes: Mapping[str, str | int | float] | None = None,
) -> None:
    """Write data, not a picture, as 32-bit floats of an EXR file, losslessly compressed.

    Args:
        path: with the suffix .exr.
        channels: (height, width) arrays under their names, "Z" or "direction.X"; booleans become
            0 and 1, whole numbers have to be exact as floats. Infinities are kept.
        metadata: omnisim's own, as `write_image` has it.
        attributes: what other programs look for under these names.

    Raises:
        OutputError: another suffix, no channels, arrays of different shapes or with numbers that
            a float32 does not hold, or a file that cannot be written; nothing is left under
            `path` then.
    """
    if path.suffix.lower() not in FLOAT_SUFFIXES:
        raise OutputError(f"{path}: data is written as .exr, not as {path.suffix or '(no suffix)'}")
    check_target(path)
    if not channels:
        raise OutputError(f"{path}: want at least one channel")
    shape = next(iter(channels.values())).shape
    floats = []
    for name, values in channels.items():
        if values.ndim != 2 or values.shape != shape or values.size == 0:
            raise OutputError(f"{path}: channel {name}: {values.shape}: want (height, width)")
        if values.dtype.kind in "iu" and np.any(np.abs(values.astype(np.float64)) > _LARGEST_EXACT):
            raise OutputError(f"{path}: channel {name}: want whole numbers up to {_LARGEST_EXACT}")
        if values.dtype.kind not in "fiub":
            raise OutputError(f"{path}: channel {name}: {values.dtype}: want numbers")
        floats.append(values.astype(np.float32))
    spec = oiio.ImageSpec(shape[1], shape[0], len(floats), oiio.FLOAT)
    spec.channelnames = tuple(channels)
    spec["Software"] = f"omnisim {__version__}"
    spec["Compression"] = "zip"
    spec["DateTime"] = _NO_DATE
    for key, value in (attributes or {}).items():
        spec[key] = value
    if metadata is not None:
        spec[METADATA_KEY] = json.dumps(metadata)
    data = _encoded(path, spec, np.stack(floats, axis=-1))
    with atomic_write(path) as partial:
        partial.write_bytes(data)


def read_channels(path: Path) -> Channels:
    """Read an EXR file of data; the first row is at the top.

    Raises:
        OutputError: the file is missing or not one.
    """
    spec, pixels = _stored(path, oiio.FLOAT)
    found = {attribute.name: attribute.value for attribute in spec.extra_attribs}
    names = spec.channelnames
    text = found.pop(METADATA_KEY, None)
    return Channels(
        {name: np.ascontiguousarray(pixels[..., at]) for at, name in enumerate(names)},
        _metadata_of(text),
        {key: value for key, value in found.items() if isinstance(value, str | int | float)},
    )


def _metadata_of(text: Any) -> dict[str, Any] | None:
    try:
        metadata = json.loads(text) if isinstance(text, str) else None
    except (json.JSONDecodeError, RecursionError):
        return None  # somebody else's description
    return metadata if isinstance(metadata, dict) else None


def through_jpeg(pixels: NDArray[np.uint8], quality: int, subsampling: str) -> NDArray[np.uint8]:
    """What a picture (height, width, 3) sRGB becomes in a JPEG file, encoded and decoded again.

    Args:
        pixels: the picture.
        quality: 1 to 100, as libjpeg counts.
        subsampling: "4:4:4", "4:2:2" or "4:2:0".

    Raises:
        OutputError: it cannot be encoded.
    """
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT8)
    spec["Compression"] = f"jpeg:{quality}"
    spec["jpeg:subsampling"] = subsampling
    data = _encoded(Path("camera.jpg"), spec, np.ascontiguousarray(pixels))
    memory = os.memfd_create("omnisim picture")
    try:
        with open(memory, "wb", closefd=False) as file:
            file.write(data)
        decoded, _ = read_image(Path(f"/proc/self/fd/{memory}"))
    finally:
        os.close(memory)
    return decoded


def _encoded(path: Path, spec: oiio.ImageSpec, pixels: NDArray[Any]) -> bytes:
    """The bytes of the file, encoded into memory.

    Some of OpenImageIO's writers do not notice a full disk, and one ends the process. So none of
    them ever sees a disk: they write to memory, and the bytes are written by us.
    """
    memory = os.memfd_create("omnisim picture")
    try:
        output = oiio.ImageOutput.create(path.suffix[1:].lower())
        if output is None:
            raise OutputError(f"{path}: cannot be encoded: {_one_line(oiio.geterror())}")
        done = output.open(f"/proc/self/fd/{memory}", spec) and output.write_image(pixels)
        error = output.geterror()
        if not (output.close() and done):
            raise OutputError(f"{path}: cannot be encoded: {_one_line(error or output.geterror())}")
        with open(memory, "rb", closefd=False) as file:
            file.seek(0)
            return file.read()
    finally:
        os.close(memory)


def _one_line(error: str) -> str:
    return " ".join(error.split()) or "no reason given"


def _stored(path: Path, kind: oiio.BASETYPE | None = None) -> tuple[oiio.ImageSpec, NDArray[Any]]:
    """What a file says of itself, and its pixels (height, width, channels), as stored or as `kind`.

    Raises:
        OutputError: the file is missing or not a picture.
    """
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise OutputError(f"{path}: cannot be read: {_one_line(oiio.geterror())}")
    try:
        spec = source.spec()
        pixels = source.read_image(spec.format if kind is None else kind)
        if pixels is None:
            raise OutputError(f"{path}: cannot be read: {_one_line(source.geterror())}")
        return oiio.ImageSpec(spec), pixels
    finally:
        source.close()


def read_image(path: Path) -> tuple[NDArray[Any], dict[str, Any] | None]:
    """Return a picture's pixels (height, width, channels), as stored, and omnisim's metadata.

    The metadata is None where the picture has none of ours.

    Raises:
        OutputError: the file is missing or not a picture.
    """
    spec, pixels = _stored(path)
    text = spec.getattribute(METADATA_KEY)
    return pixels, _metadata_of(text)
