"""Frames of videos and ROS bags, spread evenly over the recording.

The frames are in a temporary folder until the process ends; only one at a time is in memory.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import MeasurementError, OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.image_files import read_image
from omnisim.core.files.ros_bag import open_bag

MAX_FRAMES = 100  # of a recording
VIDEO_SUFFIXES = (".mp4", ".mkv", ".mov", ".avi", ".m4v", ".webm")
BAG_SUFFIXES = (".bag", ".mcap", ".db3")
_TOPIC = "#"  # separator between a bag's path and a topic
_RAW_TYPE, _COMPRESSED_TYPE = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_CHANNELS = {"mono8": 1, "rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono16": 1, "rgb16": 3}
_COMPRESSED = {b"\xff\xd8": ".jpg", b"\x89P": ".png"}


def is_recording(source: Path) -> bool:
    """True for a video, and for a ROS bag: a file, or a folder with metadata.yaml."""
    bag, _ = _split(source)
    is_file = bag.suffix.lower() in (*VIDEO_SUFFIXES, *BAG_SUFFIXES) and not bag.is_dir()
    return is_file or (bag / "metadata.yaml").is_file()


def recorded_frames(source: Path) -> list[Path]:
    """Extract up to `MAX_FRAMES` evenly spread frames as files for `read_photo`.

    Args:
        source: video or bag; `BAG#/TOPIC` selects one of several image topics.

    Raises:
        MeasurementError: a missing or damaged recording, no images, several topics without a
            selection, an unknown encoding, or a package that is not installed.
    """
    return list(_extracted(source.absolute(), source))


@lru_cache(maxsize=8)  # a plan's parts share a recording
def _extracted(absolute: Path, source: Path) -> tuple[Path, ...]:
    """Files of the frames of `source`, a path in messages; `absolute` is the key of the cache."""
    folder = Path(tempfile.mkdtemp(prefix="omnisim-frames-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    bag, topic = _split(source)
    if bag.suffix.lower() in VIDEO_SUFFIXES:
        files = _video_files(source, folder)
    else:
        files = _bag_files(bag, topic, folder)
    if not files:
        raise MeasurementError(f"{source}: expected images, got none")
    return tuple(files)


def frame_numbers(source: Path, files: Sequence[Path]) -> list[int]:
    """Numbers of frames: their places in a recording, or in a folder of consecutive images.

    Args:
        source: recording or folder.
        files: its image files.
    """
    if is_recording(source):
        return [int(file.stem.rpartition("-")[2]) for file in files]
    return list(range(len(files)))


def without_topic(source: Path) -> Path:
    """Path of a recording without the suffix `#/TOPIC`, if any."""
    return _split(source)[0]


def _split(source: Path) -> tuple[Path, str]:
    """Recording and topic; "" without one."""
    bag, _, topic = str(source).partition(_TOPIC)
    return Path(bag), topic


def _chosen(count: int) -> set[int]:
    """Indices of at most `MAX_FRAMES` evenly spread frames of `count`."""
    if count <= MAX_FRAMES:
        return set(range(count))
    return set(np.linspace(0, count - 1, MAX_FRAMES).round().astype(int).tolist())


def _video_files(path: Path, folder: Path) -> list[Path]:
    """Write frames of a video to a folder, and return their files."""
    require_extra("video", str(path), MeasurementError)
    import av

    try:
        with av.open(str(path)) as container:
            count = sum(packet.size > 0 for packet in container.demux(video=0))
        chosen, files = _chosen(count), []
        with av.open(str(path)) as container:
            for index, frame in enumerate(container.decode(video=0)):
                if index in chosen:
                    file = folder / f"{path.stem}-{index:06}{LOSSY_FRAME_SUFFIX}"
                    np.save(file, frame.to_ndarray(format="rgb24"))
                    files.append(file)
    except (av.FFmpegError, IndexError) as reason:
        raise MeasurementError(f"{path}: cannot be read as a video: {reason}") from None
    return files


def _bag_files(bag: Path, topic: str, folder: Path) -> list[Path]:
    """Write images of a bag's topic to a folder, and return their files."""
    with open_bag(bag, MeasurementError) as reader:
        images = [one for one in reader.connections if one.msgtype in (_RAW_TYPE, _COMPRESSED_TYPE)]
        names = sorted({image.topic for image in images})
        if not names:
            raise MeasurementError(f"{bag}: expected a topic of images, got none")
        if topic and topic not in names:
            raise MeasurementError(f"{bag}: topic {topic}: expected one of {', '.join(names)}")
        if not topic and len(names) > 1:
            example = f"{bag}{_TOPIC}{names[0]}"
            raise MeasurementError(
                f"{bag}: images of several topics, {', '.join(names)}: give one, such as {example}"
            )
        name = topic or names[0]
        used = [image for image in images if image.topic == name]
        chosen = _chosen(sum(one.msgcount for one in used))
        messages = (
            (index, reader.deserialize(data, connection.msgtype))
            for index, (connection, _, data) in enumerate(reader.messages(used))
            if index in chosen
        )
        return _message_files(bag, messages, folder)


def _message_files(bag: Path, messages: Iterable[tuple[int, Any]], folder: Path) -> list[Path]:
    """Write images of messages to a folder, and return their files."""
    files = []
    for index, message in messages:
        stem = folder / f"{bag.stem}-{index:06}"
        if hasattr(message, "encoding"):
            file = stem.with_name(stem.name + FRAME_SUFFIX)
            np.save(file, _pixels(bag, message))
        else:
            data = message.data.tobytes()
            suffix = _COMPRESSED.get(data[:2])
            if suffix is None:
                raise MeasurementError(
                    f"{bag}: image {index}: expected JPEG or PNG, got {message.format!r}"
                )
            file = stem.with_name(stem.name + suffix)
            file.write_bytes(data)
        files.append(file)
    return files


def _pixels(bag: Path, message: Any) -> NDArray[Any]:
    """Pixels (height, width, channels) of an image message."""
    encoding = message.encoding
    is_mosaic = encoding.startswith("bayer_")
    if encoding not in _CHANNELS and not is_mosaic:
        known = " ".join(_CHANNELS)
        raise MeasurementError(f"{bag}: encoding {encoding!r}: expected {known} or bayer_*")
    channels = 1 if is_mosaic else _CHANNELS[encoding]
    kind = np.dtype(np.uint16 if encoding.endswith("16") else np.uint8)
    kind = kind.newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * channels * kind.itemsize
    if message.step < row or len(message.data) < message.height * message.step:
        raise MeasurementError(f"{bag}: expected {message.height} rows of {row} bytes, got fewer")
    lines = np.asarray(message.data)[: message.height * message.step]
    lines = lines.reshape(message.height, message.step)[:, :row]
    values = np.ascontiguousarray(lines).view(kind).astype(kind.newbyteorder("="))
    pixels = values.reshape(message.height, message.width, channels)
    return pixels[..., [2, 1, 0]] if encoding.startswith("bgr") else pixels


# Readers of a camera's image files, including raw files (the only importer of rawpy).


IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".pgm", ".ppm", ".bmp", ".webp")
RAW_SUFFIXES = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".orf", ".raf", ".rw2", ".pef", ".srw")
FRAME_SUFFIX = ".npy"  # of the frames that `recorded_frames` extracts
LOSSY_FRAME_SUFFIX = ".lossy.npy"
_LOSSY = (".jpg", ".jpeg", ".webp")


def is_lossy(path: Path) -> bool:
    """True if the file's format compresses with loss, such as JPEG or a video."""
    name = path.name.lower()
    return path.suffix.lower() in _LOSSY or name.endswith(LOSSY_FRAME_SUFFIX)


def read_photo(path: Path) -> NDArray[Any]:
    """Read the stored values (height, width, channels) of an image file.

    Raw files are demosaiced to 16-bit linear RGB: the black level becomes 0, the white level 65535.
    Colors stay those of the sensor, without white balance.

    Raises:
        MeasurementError: the file is missing or damaged, or rawpy is not installed.
    """
    if path.suffix.lower() in RAW_SUFFIXES:
        with _open(path) as raw:
            return _demosaiced(path, raw)
    if path.suffix == FRAME_SUFFIX:
        return np.load(path, allow_pickle=False)
    try:
        return read_image(path)[0]
    except OutputError as reason:
        raise MeasurementError(str(reason)) from None


def read_mosaic(path: Path) -> NDArray[Any]:
    """Read the stored values (height, width, channels) of an image; raw files keep their mosaic.

    The mosaic of a raw file has 1 channel.

    Raises:
        MeasurementError: the file is missing or damaged, or rawpy is not installed.
    """
    if path.suffix.lower() not in RAW_SUFFIXES:
        return read_photo(path)
    with _open(path) as raw:
        mosaic: NDArray[Any] = np.array(raw.raw_image_visible)
    return mosaic[..., None] if mosaic.ndim == 2 else mosaic


def _demosaiced(path: Path, raw: Any) -> NDArray[Any]:
    import rawpy

    try:
        rgb: NDArray[Any] = raw.postprocess(
            gamma=(1, 1), no_auto_bright=True, output_bps=16, user_flip=0,
            output_color=rawpy.ColorSpace.raw, user_wb=[1.0, 1.0, 1.0, 1.0],
            adjust_maximum_thr=0.0,  # the file's white level, not the image's maximum, is white
        )  # fmt: skip
    except rawpy.LibRawError as reason:
        raise MeasurementError(f"{path}: cannot be read: {reason}") from None
    return rgb


def _open(path: Path) -> Any:
    require_extra("raw", str(path), MeasurementError)
    import rawpy

    try:
        return rawpy.imread(str(path))
    except (rawpy.LibRawError, OSError) as reason:
        if not path.exists():
            raise MeasurementError(f"{path}: no such file") from None
        text = reason.args[0] if reason.args else reason
        shown = text.decode(errors="replace") if isinstance(text, bytes) else str(text)
        raise MeasurementError(f"{path}: cannot be read: {shown}") from None
