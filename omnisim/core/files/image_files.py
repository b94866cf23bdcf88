"""Reading and writing of image files (the only importer of OpenImageIO).

The camera's parameters and pose are stored in the file as one JSON text in ImageDescription, which
every format here supports.
"""

from __future__ import annotations

import ctypes
import json
import os
import threading
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from omnisim.core.arrays import Bytes, Floats32
from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write, check_suffix, check_target
from omnisim.core.files.sources import note_file
from omnisim.core.version import __version__

EIGHT_BIT_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
FLOAT_SUFFIXES = (".exr",)
METADATA_KEY = "ImageDescription"
# In a mirror's image, JPEG artifacts at edges could be mistaken for the camera's: keep them low.
JPEG_QUALITY, _JPEG_SUBSAMPLING = 95, "4:4:4"
_PNG_LEVEL = 4  # half the time of the default 6, for a file 4 % larger
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_NO_DATE = ""  # OpenEXR's writer would add the time of day: equal data must give equal bytes
_MAX_EXACT = 1 << 24  # largest integer up to which float32 is exact
# Longer metadata crashes JPEG's writer, and TIFF's reader does not find it.
_MAX_TEXT, _SHORT_TEXTS = 65_000, (".jpg", ".jpeg", ".tif", ".tiff")
_KINDS = {
    "uint8": oiio.UINT8, "uint16": oiio.UINT16, "float16": oiio.HALF, "float32": oiio.FLOAT
}  # fmt: skip

Attributes = Mapping[str, str | int | float]
Metadata = Mapping[str, Any]  # representable in JSON


def is_float_format(path: Path) -> bool:
    """True for linear float formats, False for 8-bit formats, by the suffix.

    Raises:
        OutputError: omnisim cannot write a format with this suffix.
    """
    suffix = path.suffix.lower()
    if suffix not in EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES:
        known = " ".join(EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES)
        raise OutputError(f"{path}: unknown image format: expected one of {known}, got {suffix!r}")
    return suffix in FLOAT_SUFFIXES


def write_image(
    path: Path,
    pixels: NDArray[Any],
    metadata: Metadata | None = None,
    jpeg_quality: int = JPEG_QUALITY,
) -> None:
    """Write an image (height, width, 3 or 4): uint8 sRGB, or float32 linear for EXR.

    A fourth channel is alpha; JPEG has none and drops it. Equal images give equal bytes.

    Args:
        path: output file, whose suffix sets the format.
        pixels: image.
        metadata: JSON-compatible values to embed, such as camera and pose; None: no metadata.
        jpeg_quality: 1 to 100, on libjpeg's scale; for JPEG only.

    Raises:
        OutputError: the format is unknown, the pixels do not suit it, or the file cannot be
            written; no partial file is left.
    """
    data = image_bytes(path, pixels, metadata, jpeg_quality)
    check_target(path)
    with atomic_write(path) as partial:
        partial.write_bytes(data)


def image_bytes(
    path: Path,
    pixels: NDArray[Any],
    metadata: Metadata | None = None,
    jpeg_quality: int = JPEG_QUALITY,
) -> bytes:
    """Bytes of the file that `write_image` writes to `path`, whose suffix sets the format.

    Raises:
        OutputError: the format is unknown, or the pixels or metadata do not suit it.
    """
    is_float = is_float_format(path)
    kind = "float32" if is_float else "uint8"
    if pixels.dtype != kind:
        raise OutputError(f"{path}: expected {kind} pixels, got {pixels.dtype}")
    given: dict[str, str | int | float] = {
        "oiio:ColorSpace": "lin_rec709_scene" if is_float else "srgb_rec709_scene",
        "DateTime": _NO_DATE,
        "png:compressionLevel": _PNG_LEVEL,
    }
    if path.suffix.lower() in (".jpg", ".jpeg"):
        pixels = pixels[..., :3]
        given |= _jpeg_attributes(jpeg_quality, _JPEG_SUBSAMPLING)
    attributes = _with_metadata(given, metadata)
    size = len(str(attributes.get(METADATA_KEY, "")))
    if size > _MAX_TEXT and path.suffix.lower() in _SHORT_TEXTS:
        raise OutputError(
            f"{path}: expected at most {_MAX_TEXT} bytes of camera metadata, got {size}: write "
            ".png or .exr, which hold them"
        )
    return _encode(path, pixels, attributes)


def png_bytes(pixels: Bytes) -> bytes:
    """Encode an image (height, width, 3 or 4) uint8 sRGB as PNG.

    Raises:
        OutputError: the pixels are of another kind.
    """
    if pixels.dtype != np.uint8 or pixels.ndim != 3:
        raise OutputError(f"PNG: expected (height, width, 3) uint8, got {pixels.shape}")
    color = {"oiio:ColorSpace": "srgb_rec709_scene"}
    return _encode(Path("image.png"), pixels, {**color, "png:compressionLevel": _PNG_LEVEL})


def write_numbers(
    path: Path, numbers: NDArray[np.uint8 | np.uint16], metadata: Metadata | None = None
) -> None:
    """Write integers of 8 or 16 bits that are not colors, (height, width[, n]), as a PNG file.

    Raises:
        OutputError: the suffix is wrong, or the file cannot be written.
    """
    check_suffix(path, ".png")
    check_target(path)
    channels = numbers.reshape(*numbers.shape[:2], -1)
    attributes: dict[str, str | int | float] = {
        "oiio:ColorSpace": "data",  # else the file calls them sRGB
        "png:compressionLevel": _PNG_LEVEL,
    }
    if channels.shape[2] == 4:  # the fourth is not an alpha by which the others were multiplied
        attributes["oiio:UnassociatedAlpha"] = 1
    _write(path, channels, attributes, metadata)


class ExrData(NamedTuple):
    """Contents of an EXR file of data."""

    values: dict[str, Floats32]  # (height, width) float32 arrays by channel name
    metadata: dict[str, Any] | None  # omnisim's metadata; None if the file has none
    # other attributes of the file that are strings or numbers
    attributes: dict[str, str | int | float]


def write_channels(
    path: Path,
    channels: Mapping[str, NDArray[Any]],
    metadata: Metadata | None = None,
    attributes: Attributes | None = None,
) -> None:
    """Write data, not an image, as 32-bit floats to an EXR file with lossless compression.

    Args:
        path: file with the suffix .exr.
        channels: (height, width) arrays by name, such as "Z" or "direction.X". Booleans become 0
            and 1; integers must be exact as floats. Infinities are kept.
        metadata: omnisim's metadata, as in `write_image`.
        attributes: file attributes under the names that other programs use.

    Raises:
        OutputError: the suffix is wrong, there are no channels, arrays differ in shape or hold
            numbers that float32 cannot represent, or the file cannot be written; no partial file
            is left.
    """
    check_suffix(path, ".exr")
    check_target(path)
    if not channels:
        raise OutputError(f"{path}: expected at least one channel")
    shape = next(iter(channels.values())).shape
    floats = []
    for name, values in channels.items():
        where = f"{path}: channel {name}"
        if values.ndim != 2 or values.shape != shape or values.size == 0:
            raise OutputError(f"{where}: expected (height, width), got {values.shape}")
        if values.dtype.kind in "iu" and np.any(np.abs(values.astype(np.float64)) > _MAX_EXACT):
            raise OutputError(f"{where}: expected whole numbers up to {_MAX_EXACT}")
        if values.dtype.kind not in "fiub":
            raise OutputError(f"{where}: expected numbers, got {values.dtype}")
        floats.append(values.astype(np.float32))
    attributes = {"Compression": "zip", "DateTime": _NO_DATE, **(attributes or {})}
    _write(path, np.stack(floats, axis=-1), attributes, metadata, tuple(channels))


def read_channels(path: Path) -> ExrData:
    """Read an EXR file of data; the first row is at the top.

    Raises:
        OutputError: the file is missing or not an EXR.
    """
    spec, pixels = _read(path, oiio.FLOAT)
    with _utf8_header(path):
        attributes = {attribute.name: attribute.value for attribute in spec.extra_attribs}
        names = tuple(spec.channelnames)
    text = attributes.pop(METADATA_KEY, None)
    return ExrData(
        {name: np.ascontiguousarray(pixels[..., at]) for at, name in enumerate(names)},
        _parse_metadata(text),
        {key: value for key, value in attributes.items() if isinstance(value, str | int | float)},
    )


def read_image(path: Path) -> tuple[NDArray[Any], dict[str, Any] | None]:
    """Read an image's stored pixels (height, width, channels), and omnisim's metadata.

    The metadata is None if the image has none from omnisim.

    Raises:
        OutputError: the file is missing or not an image.
    """
    spec, pixels = _read(path)
    with _utf8_header(path):
        return pixels, _parse_metadata(spec.getattribute(METADATA_KEY))


def read_radiance(path: Path) -> Floats32:
    """Read the linear RGB (height, width, 3) of a float image, such as .hdr and .exr.

    Raises:
        OutputError: the file is missing, not an image, or has fewer than three channels.
    """
    spec, pixels = _read(path, oiio.FLOAT)
    with _utf8_header(path):
        names = [name.upper() for name in spec.channelnames]
    places = [names.index(name) for name in "RGB"] if set("RGB") <= set(names) else [0, 1, 2]
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise OutputError(f"{path}: expected an image of red, green and blue")
    return np.ascontiguousarray(pixels[..., places])


def write_radiance(path: Path, pixels: NDArray[np.float16]) -> None:
    """Write linear RGB (height, width, 3) as half floats to an EXR file with lossless compression.

    Raises:
        OutputError: the suffix is wrong, the pixels are of another kind, or the file cannot be
            written.
    """
    check_suffix(path, ".exr")
    if pixels.dtype != np.float16 or pixels.ndim != 3 or pixels.shape[2] != 3:
        raise OutputError(f"{path}: expected (height, width, 3) float16, got {pixels.shape}")
    attributes: Attributes = {
        "Compression": "zip", "DateTime": _NO_DATE, "oiio:ColorSpace": "lin_rec709_scene",
    }  # fmt: skip
    _write(path, pixels, attributes, None)


def through_jpeg(pixels: Bytes, quality: int, subsampling: str) -> Bytes:
    """Encode an image (height, width, 3) sRGB as JPEG, and decode it again.

    Quality is 1 to 100, on libjpeg's scale; subsampling "4:4:4", "4:2:2" or "4:2:0".

    Raises:
        OutputError: the image cannot be encoded.
    """
    data = _encode(Path("camera.jpg"), pixels, _jpeg_attributes(quality, subsampling))
    with _memory_file() as (memory, path):
        os.pwrite(memory, data, 0)
        decoded, _ = read_image(path)
    return decoded


def _jpeg_attributes(quality: int, subsampling: str) -> dict[str, str | int | float]:
    return {"Compression": f"jpeg:{quality}", "jpeg:subsampling": subsampling}


def _write(
    path: Path,
    pixels: NDArray[Any],
    attributes: Attributes,
    metadata: Metadata | None,
    channel_names: tuple[str, ...] = (),
) -> None:
    data = _encode(path, pixels, _with_metadata(attributes, metadata), channel_names)
    with atomic_write(path) as partial:
        partial.write_bytes(data)


def _with_metadata(attributes: Attributes, metadata: Metadata | None) -> Attributes:
    own = {} if metadata is None else {METADATA_KEY: json.dumps(metadata)}
    return {"Software": f"omnisim {__version__}", **attributes, **own}


def _encode(
    path: Path, pixels: NDArray[Any], attributes: Attributes, channel_names: tuple[str, ...] = ()
) -> bytes:
    """Encode an image (height, width, channels) as a file in memory.

    Some of OpenImageIO's writers do not notice a full disk, and one crashes the process. They
    therefore write only to memory, and omnisim writes the bytes to disk.
    """
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, _KINDS[pixels.dtype.name])
    if channel_names:
        spec.channelnames = channel_names
    for key, value in attributes.items():
        spec[key] = value
    with _memory_file() as (memory, target):
        output = oiio.ImageOutput.create(path.suffix[1:].lower())
        if output is None:
            raise OutputError(f"{path}: cannot be encoded: {_one_line(oiio.geterror())}")
        done = output.open(str(target), spec)
        done = done and output.write_image(np.ascontiguousarray(pixels))
        error = output.geterror()
        if not (output.close() and done):
            raise OutputError(f"{path}: cannot be encoded: {_one_line(error or output.geterror())}")
        return os.pread(memory, os.fstat(memory).st_size, 0)


@contextmanager
def _memory_file() -> Iterator[tuple[int, Path]]:
    """Create a file in memory: its descriptor, and a path for libraries that need one."""
    memory = os.memfd_create("omnisim image")
    try:
        yield memory, Path(f"/proc/self/fd/{memory}")
    finally:
        os.close(memory)


def _read(path: Path, kind: oiio.BASETYPE | None = None) -> tuple[oiio.ImageSpec, NDArray[Any]]:
    """Read a file's header and pixels (height, width, channels), as stored or as `kind`."""
    note_file(path)
    _check_png(path)
    with _utf8_header(path), quiet_libraries():  # libpng prints its errors
        source = oiio.ImageInput.open(str(path))
        if source is None:
            reason = _one_line(oiio.geterror()) if path.exists() else "No such file or directory"
            if "OpenImageIO" in reason:  # it advises on its own formats
                reason = "expected an image"
            raise OutputError(f"{path}: cannot be read: {reason}")
        try:
            spec = source.spec()
            pixels = source.read_image(spec.format if kind is None else kind)
            if pixels is None:
                raise OutputError(f"{path}: cannot be read: {_one_line(source.geterror())}")
            return oiio.ImageSpec(spec), pixels
        finally:
            source.close()


@contextmanager
def _utf8_header(path: Path) -> Iterator[None]:
    """Reject a header that is not UTF-8, because OpenImageIO quotes it in messages."""
    try:
        yield
    except UnicodeDecodeError:
        raise OutputError(f"{path}: cannot be read: expected a header in UTF-8") from None


def _check_png(path: Path) -> None:
    """Reject a damaged PNG file: libpng would skip damaged blocks, such as metadata."""
    try:
        data = path.read_bytes() if path.suffix.lower() == ".png" else b""
    except OSError:
        return  # OpenImageIO reports the reason
    if not data.startswith(_PNG_SIGNATURE):
        return
    start, kind = len(_PNG_SIGNATURE), b""
    while kind != b"IEND":  # blocks: length, kind, contents, checksum of kind and contents
        kind = data[start + 4 : start + 8]
        end = start + 8 + int.from_bytes(data[start : start + 4], "big")
        checksum = data[end : end + 4]
        if len(checksum) < 4:
            raise OutputError(f"{path}: cannot be read: the file is cut off")
        if zlib.crc32(memoryview(data)[start + 4 : end]) != int.from_bytes(checksum, "big"):
            raise OutputError(f"{path}: cannot be read: {kind!r} is damaged")
        start = end + 4


def _parse_metadata(text: object) -> dict[str, Any] | None:
    try:
        metadata = json.loads(text) if isinstance(text, str) else None
    except (json.JSONDecodeError, RecursionError):
        return None  # another program's description
    return metadata if isinstance(metadata, dict) else None


def _one_line(error: str) -> str:
    return " ".join(error.split()) or "no reason given"


# Silence of libraries in C that print errors which they also return.
#
# Standard error itself stays: Python's messages, progress bars, other threads and new processes
# write to the descriptor. Only C's stream `stderr`, through which libraries print, is replaced
# meanwhile.


_LINE_BYTES = 256


class _ErrorStream:
    """C's variable `stderr`, which is another stream while any thread wants silence.

    It is left alone without glibc: in other C libraries it is constant.
    """

    def __init__(self) -> None:
        self._library = ctypes.CDLL(None)
        self._is_glibc = hasattr(self._library, "gnu_get_libc_version")
        self._forget()
        # A child has only the thread that forked: those that held the lock are not in it.
        os.register_at_fork(after_in_child=self._restart)

    def _forget(self) -> None:
        self._lock = threading.Lock()
        self._users = 0
        self._kept: int | None = None

    def _restart(self) -> None:
        if self._users:
            self._variable.value = self._kept
        self._forget()

    @contextmanager
    def discarded(self) -> Iterator[None]:
        """Discard what is written to C's `stderr` within the block, in all threads."""
        if not self._is_glibc:
            yield
            return
        with self._lock:
            self._users += 1
            if self._users == 1:
                self._kept = self._variable.value
                self._variable.value = self._sink or self._kept
        try:
            yield
        finally:
            with self._lock:
                self._users -= 1
                if self._users == 0:
                    self._variable.value = self._kept

    @cached_property
    def _variable(self) -> ctypes.c_void_p:
        return ctypes.c_void_p.in_dll(self._library, "stderr")

    @cached_property
    def _sink(self) -> int | None:
        """Address of a stream into memory, which ignores what is more than a line.

        It needs no descriptor, which could be the number of a closed standard error. It is never
        closed, since a thread may be writing to it.
        """
        create = self._library.fmemopen
        create.argtypes = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
        create.restype = ctypes.c_void_p
        return create(None, _LINE_BYTES, b"w")


quiet_libraries = _ErrorStream().discarded
